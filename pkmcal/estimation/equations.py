"""The equations of a calibration: measured less predicted, whitened, and their Jacobian.

What the estimator works on are `Equations.residual` (M,) and `Equations.by_parameters` (M, n): the
equations that are left when every pose has taken those that determine it (`elimination`). On a
machine whose poses follow exactly from its actuators no pose takes any, and they are the readings
themselves, set by set and row by row.
"""

from __future__ import annotations

import copy
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, rms
from pkmcal.core.library import STATUS
from pkmcal.estimation.derivatives import Derivatives
from pkmcal.estimation.elimination import Blocks, Shares, System
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.first_frames import aligned
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.readings import ROUNDING, of_read
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import (
    Machines,
    SessionClosures,
    closures_of_sessions,
    commanded_closures,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.readings import joint_angles, orientation
from pkmcal.result import failed_rows

_TOGETHER = 16384  # rows whose readings are kept with their derivatives

Near = Evaluation | RowStates | None  # where a search for poses begins


class Lot(NamedTuple):
    """Some of the equations.

    Attributes
    ----------
    units, equations : slice
        Which.
    by_parameters : ndarray (m, n)
        Their derivative.
    """

    units: slice
    equations: slice
    by_parameters: FloatArray


class Equations(Derivatives):
    """The stacked residual equations of all measurements, and their Jacobian.

    Parameters
    ----------
    datasets : sequence of FitData
        The rows to fit; rows with the same actuators are solved once.
    parameters : Parameters
        The parameter vector.
    unread : int
        How many rows were left out because nothing was read there.

    Attributes
    ----------
    closures : SessionClosures
        What the closures say of the poses.
    components : ndarray of int (U,)
        Equations of each unit. A unit is what counts together: a row where poses follow from the
        actuators, else all that was read at one pose, less what determines that pose.
    unit_of_row : ndarray of int (N,)
        Of each row of the sets; -1 where none of its equations is left.
    pose_of_unit : ndarray of int (U,)
        The pose of each unit: rows of one pose have its errors in common.
    idle : int
        How many rows or poses say nothing: unread, or all that was read determines their pose.
    unstated : ndarray of bool (G,)
        Whose deviation is not known, of each group of equations with a noise of its own: the sets,
        then load cells and actuators where they have equations.
    """

    def __init__(
        self, datasets: Sequence[FitData], parameters: Parameters, unread: int = 0
    ) -> None:
        super().__init__(datasets, parameters)
        self.datasets, self._unread = tuple(datasets), unread
        guess = np.tile(parameters.robot.home, (len(self.actuators), 1))
        for i, (measured, place) in enumerate(zip(self.sets, self.pose_of, strict=True)):
            elsewhere = self._framed[i] or self.columns_of(i, "tool") is not None
            if measured.kind in ("pose", "position") and not elsewhere:
                known = np.isfinite(measured.values)
                ever = np.flatnonzero(known.any(axis=0))  # not across a plane, say
                read = np.flatnonzero(known[:, ever].all(axis=1))
                values = measured.values[np.ix_(read, ever)]
                if 5 in ever:  # angles are read together
                    values[:, -3:] = orientation.shortest(values[:, -3:])
                guess[np.ix_(place[read], ever)] = values
        length, *most = parameters.robot.length, np.abs(guess).max(), np.abs(self.actuators).max()
        self._size = float(max(length, *most))
        unknown = np.zeros(len(guess), dtype=np.int32)
        self.guess = RowStates(guess, self.actuators, unknown)
        self._no_sigma = np.array([
            m.sigma is None and bool(np.isfinite(m.values).any()) for m in self.sets
        ])  # fmt: skip
        sigma = self.actuator_sigma
        machines = range(len(self.machine_columns))
        self._own = tuple(np.flatnonzero(self.machine_of_pose == s) for s in machines)
        cells = self.cells
        self._no_cell_sigma = cells is not None and cells.sigma is None
        closures = closures_of_sessions(parameters.robot, self._own, self.actuators, sigma, cells)
        self._slack = np.zeros((len(guess), closures.equations), dtype=bool)
        self._if_taut = self.actuators
        self._take(closures, sigma is None)

    def _take(self, closures: SessionClosures, estimated: bool) -> None:
        """Build the units for these closures; `estimated`: their deviations are not known."""
        self.closures = closures
        self._counts = ~self._slack
        if closures.unread is not None:
            self._counts &= ~closures.unread
        self._counting = None if self._counts.all() else np.flatnonzero(self._counts)
        if closures.unknowns:
            if any(self._effects):
                raise ArgumentError(
                    "expansion: needs poses that follow from the actuators: no actuator_sigma, and"
                    " no surplus actuators; found others"
                )
            for m in self.sets:
                follows = m.joint and joint_angles.follows_pose(self.parameters.robot, m.joint)
                if m.kind in ("between", "angle") and not follows:
                    raise ArgumentError(
                        f"measurements: readings of kind {m.kind!r} need poses that follow from the"
                        " actuators: no actuator_sigma, and no surplus actuators"
                    )
        of_row, pose_of_row = self.count, np.concatenate(self.pose_of)
        if not closures.unknowns:
            self.unstated: BoolArray = self._no_sigma
            self.components: IntArray = of_row[of_row > 0]
            self.pose_of_unit: IntArray = pose_of_row[of_row > 0]
            self.unit_of_row: IntArray = np.where(of_row > 0, np.cumsum(of_row > 0) - 1, -1)
            self._family_of_unit = self.set_of[of_row > 0]
            self.idle = self._unread + int((of_row == 0).sum())
            return
        of_cells = [self._no_cell_sigma] if closures.cells else []
        self.unstated = np.concatenate([self._no_sigma, of_cells, [estimated]]).astype(bool)
        last, count = len(self.unstated) - 1, closures.equations
        self._groups = np.full(count, last)  # of the closures: load cells are one before
        self._groups[count - closures.cells :] -= 1
        poses = len(self.actuators)
        own, closure = np.nonzero(self._counts)
        pose_of_equation = np.concatenate([own, np.repeat(pose_of_row, of_row)])
        self._group_of_equation = np.concatenate([
            self._groups[closure],
            np.repeat(self.set_of, of_row),
        ])  # fmt: skip
        self._blocks = Blocks(pose_of_equation, poses, closures.unknowns, self._size)
        self.components, self.pose_of_unit = self._blocks.components, self._blocks.pose_of_unit
        unit_of_pose = np.full(poses, -1)
        unit_of_pose[self.pose_of_unit] = np.arange(len(self.pose_of_unit))
        self.unit_of_row = unit_of_pose[pose_of_row]
        self._family_of_unit = np.zeros(len(self.components), dtype=np.intp)
        self.idle = self._blocks.idle

    def commanded(self) -> Equations:
        """The same with poses that follow from the actuators as they read."""
        if not self.closures.unknowns:
            return self
        other = copy.copy(self)
        other._slack = self._slack[:, :0]
        other._take(commanded_closures(self._own, self._if_taut), estimated=False)
        return other

    def under(self, tension: FloatArray | None) -> Equations:
        """The same under other tensions (K, n) of what the actuators drive; None: as they are."""
        if tension is None:
            return self
        other = copy.copy(self)
        other.state = self.state._replace(tension=tension)
        return other

    def begin(self, commanded: Equations, start: Evaluation) -> Evaluation:
        """Evaluate where the same with commanded poses has been started."""
        self.parameters = commanded.parameters
        near = start.states
        if self.closures.unknowns:  # closures that contradict each other may still have a best pose
            near = near.at_poses(np.flatnonzero(start.status), self.parameters.robot.home)
        return start if commanded is self else self.at(start.theta, near=near)

    @property
    def sigma_stated(self) -> bool:
        """Whether any noise is stated, of what was read or of the actuators."""
        of_actuators = self.closures.unknowns and not self.unstated[-1]
        of_cells = self.cells is not None and not self._no_cell_sigma
        of_read = [m.sigma is not None and bool(np.isfinite(m.values).any()) for m in self.sets]
        return bool(of_actuators) or of_cells or any(of_read)

    @property
    def family_of_unit(self) -> IntArray:
        """Family of each unit (U,): the set, or one for all where poses mix the groups' noise."""
        return self._family_of_unit

    @property
    def family_of_group(self) -> IntArray:
        """The same of each group (G,)."""
        groups = np.arange(len(self.unstated))
        return np.zeros_like(groups) if self.closures.unknowns else groups

    def at(
        self, theta: FloatArray, noise: FloatArray | None = None, near: Near = None
    ) -> Evaluation:
        """Evaluate at `theta` (n,), every pose where it fits best what was read of it.

        `noise` (G,) multiplies the stated deviations of each group, as in `whitened`. The search for
        the poses begins `near` another evaluation, or states; by default at home and what was read.
        """
        machines = self._machines_at(theta)
        states, begun = self._states_ahead(machines, theta, near), _begun(near, self.guess)
        if self.closures.unknowns:
            factors = np.ones(len(self.unstated)) if noise is None else noise

            def system(states: RowStates) -> tuple[FloatArray, FloatArray]:
                return self._system(machines, states, theta, factors)

            states, there = self._blocks.best(self.closures, machines, states, system)
        seen = self.predicted(states.pose, theta)
        found = Evaluation(
            theta,
            machines,
            states.pose,
            states.actuators,
            states.status,
            tuple(each.values for each in seen),
            self.residuals(seen),
            states.tension,
            begun,
        )
        if len(self.rows) <= _TOGETHER:
            found.kept["seen"] = weakref.ref(self), seen
        if self.closures.unknowns:
            found.kept["system"] = weakref.ref(self), factors, there
        return found

    def squares_ahead(self, theta: FloatArray, noise: FloatArray, near: Near) -> float:
        """Sum of the squared equations at `theta` where poses are looked for, none fitted yet."""
        machines = self._machines_at(theta)
        off, _ = self._system(machines, self._states_ahead(machines, theta, near), theta, noise)
        return float(off @ off)

    def _machines_at(self, theta: FloatArray) -> Machines:
        p = self.parameters
        robots = [p.robot.with_values(p.values_at(theta, own)) for own in self.machine_columns]
        return Machines(tuple(robots), self._own, self.state)

    def _states_ahead(self, machines: Machines, theta: FloatArray, near: Near) -> RowStates:
        """Where to look for the states: as they follow the parameters from where a search is."""
        states = _begun(near, self.guess)
        if not isinstance(near, Evaluation) or "following" not in near.kept:
            return self.closures.settled(machines, states)
        begin, following = near, near.kept["following"]
        step = (following.reshape(-1, len(theta)) @ (theta - begin.theta)).reshape(
            following.shape[:2]
        )
        if not np.isfinite(step).all():
            step[~np.isfinite(step).all(axis=1)] = 0.0
        ahead = self.closures.moved(machines, states, step)
        if ahead.status.any():
            ahead = ahead.chosen(ahead.status == 0, self.closures.settled(machines, states))
        return ahead

    def _system(
        self, machines: Machines, states: RowStates, theta: FloatArray, noise: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Predicted less measured (E,), whitened, and its derivative by the unknowns (E, u)."""
        off, by_unknown = self.closures.residual(machines, states)
        factors = noise[self._groups]
        off /= factors
        by_unknown /= factors[:, None]
        equation, by_unknown = self._counted(off), self._counted(by_unknown)
        if not self.any_read:
            return equation, by_unknown
        twists = self.closures.twists(machines, states)
        predicted = self.predicted(states.pose, theta)
        residuals = self.residuals(predicted)
        by_pose = [
            m.instrument.by_difference(seen.by_twist @ twists[place], residual)
            for m, seen, place, residual in zip(
                self.sets, predicted, self.pose_of, residuals, strict=True
            )
        ]
        return (
            np.concatenate([equation, -self.whitened(residuals, noise)]),
            np.concatenate([by_unknown, self.whitened(by_pose, noise)]),
        )

    def _at(self, evaluation: Evaluation, noise: FloatArray) -> System:
        """The system at an evaluation; the last one is kept, which a step asks for three times."""
        whose, factors, known = evaluation.kept.get("system", (None, None, None))
        if whose is not None and whose() is self:
            if factors is noise or np.array_equal(factors, noise):
                return known
        there = self._system(evaluation.machines, evaluation.states, evaluation.theta, noise)
        found = self._blocks.at(there)
        evaluation.kept["system"] = weakref.ref(self), noise, found
        return found

    def residual(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Measured less predicted (M,), whitened: what is left when poses have taken their part."""
        if not self.closures.unknowns:
            return self.whitened(evaluation.residuals, noise)
        return -self._at(evaluation, noise).left

    def squares(self, residual: FloatArray) -> FloatArray:
        """Squared length of the residuals (M,) of each unit, (U,)."""
        first = np.cumsum(self.components) - self.components
        squares: FloatArray = np.add.reduceat(residual**2, first)
        return squares

    def by_parameters(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is predicted by the parameters; of what is left likewise."""
        found = np.empty((int(self.components.sum()), len(self.parameters)))
        for lot in self.lots(evaluation, noise):
            found[lot.equations] = lot.by_parameters
        return found

    def lots(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[Lot]:
        """The same in lots of whole units, in order; in one where poses have unknowns."""
        units = equations = slice(0, 0)
        for count, by_parameters in self._units(evaluation, noise):
            units = slice(units.stop, units.stop + count)
            equations = slice(equations.stop, equations.stop + len(by_parameters))
            yield Lot(units, equations, by_parameters)

    def _units(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[tuple[int, FloatArray]]:
        if self.closures.unknowns:
            yield len(self.components), self._left(evaluation, noise)
            return
        for lot, parts in self.derivatives(evaluation):
            white = [self.whiten_rows(part, i, rows, noise) for i, rows, part in parts]
            whole = white[0] if len(white) == 1 else np.concatenate(white)
            yield int(np.count_nonzero(self.count[lot])), whole

    def _left(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is left when poses have taken their part."""
        p, by_unknown = self.parameters, self._at(evaluation, noise).by_unknown
        of_closures = self.closures.by_numbers(
            evaluation.machines, evaluation.states, p.places, self.machine_columns, len(p)
        )
        of_closures /= noise[self._groups][:, None]
        by_all = self._counted(of_closures)
        if self.any_read:
            readings = self.whiten(self.jacobian(evaluation), noise)
            by_all = np.concatenate([by_all, readings])
        found, following = self._blocks.left(by_unknown, by_all)
        evaluation.kept["following"] = following
        return found

    @property
    def slack_cells(self) -> list[tuple[int, int]]:
        """Closures that are left out, of slack cables: their poses and numbers."""
        pose, closure = np.nonzero(self._slack)
        return list(zip(pose.tolist(), closure.tolist(), strict=True))

    def _counted(self, part: FloatArray) -> FloatArray:
        """Equations of closures (K, equations, ...) that count, one after another."""
        whole = part.reshape(-1, *part.shape[2:])
        return whole if self._counting is None else whole[self._counting]

    def closure_residuals(
        self, evaluation: Evaluation, noise: FloatArray, weights: FloatArray, taken: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Closures read less needed (K, equations), whitened, and their degrees of freedom.

        None of those that do not count. `weights` are those of `by_groups`, `taken` (M, r) what
        Jacobian and directions give there.
        """
        off, by_unknown, _ = self._at(evaluation, noise)
        own = int(self._counts.sum())
        longer, freedom = np.zeros((2, *self._slack.shape))
        longer[self._counts] = -off[:own]
        freedom[self._counts] = self._blocks.redundancy(by_unknown, weights, taken)[:own]
        if self._slack.any():
            whole, _ = self.closures.residual(evaluation.machines, evaluation.states)
            longer[self._slack] = -whole[self._slack] / noise[-1]
        return longer, freedom

    def without_closures(
        self, cells: Sequence[tuple[int, int]], evaluation: Evaluation
    ) -> Equations:
        """The same without some closures, by pose and number: of cables that are slack.

        Where poses are to follow from the actuators these read what they would at `evaluation`.
        """
        other = copy.copy(self)
        other._slack = np.zeros_like(self._slack)
        other._slack[tuple(np.array(cells, dtype=np.intp).reshape(-1, 2).T)] = True
        needed = self.readings_off(evaluation)
        other._if_taut = self.actuators.copy()
        for pose, cell in zip(*np.nonzero(other._slack), strict=True):
            other._if_taut[pose, self.closures.actuators[cell]] += needed[pose, cell]
        other._take(self.closures, bool(self.unstated[-1]))
        return other

    def redrawn(
        self,
        at: Evaluation,
        noise: FloatArray,
        left: FloatArray,
        prior_centre: FloatArray,
        drawn: FloatArray | None = None,
    ) -> tuple[Equations, Evaluation]:
        """The same with other readings, and evaluated where these have been drawn.

        Parameters
        ----------
        at : Evaluation
            Where the machine is taken to be.
        noise : ndarray (G,)
            See `whitened`.
        left : ndarray (M,)
            What its readings leave there, as `residual`.
        drawn : ndarray (s,), optional
            That of `Parameters`.
        prior_centre : ndarray (n,)
            Another centre of the prior.
        """
        other, errors, unknowns = copy.copy(self), left, self.closures.unknowns
        if unknowns:
            off, by_unknown, _ = self._at(at, noise)
            errors = self._blocks.spread(by_unknown, left)
            change, own = np.zeros(self._slack.shape), int(self._counts.sum())
            change[self._counts] = -(errors + off)[:own]
            change *= noise[self._groups]
            other.closures = self.closures.shifted(change)
            errors = errors[own:]
        residuals = tuple(self.unwhiten(errors, noise[: len(self.sets)]))
        other.sets = tuple(
            replace(m, values=m.instrument.corrected(values, residual).reshape(m.values.shape))
            for m, values, residual in zip(self.sets, at.predicted, residuals, strict=True)
        )
        other.parameters = replace(self.parameters, start=prior_centre, drawn=drawn)
        if unknowns:
            return other, other.at(at.theta, noise, at)
        return other, replace(at, residuals=residuals, kept={})

    def reweighted(self, deviations: Sequence[FloatArray]) -> Equations:
        """The same where the components (k,) of each set have other relative deviations."""
        other = copy.copy(self)
        pairs = zip(self._whiten, deviations, strict=True)
        other._whiten = [white / relative for white, relative in pairs]
        other.deviations = tuple(deviations)
        return other

    def start(
        self,
        near: FloatArray | None = None,
        own: BoolArray | None = None,
        states: RowStates | None = None,
    ) -> Evaluation:
        """Evaluate at the present parameters, unknown frames aligned with the readings.

        Rows that fail from a measured pose are tried from home, those that then miss grossly in
        every assembly mode. `near` (n,) are other parameters to start from, of which only `own`
        (n,) are aligned.
        """
        theta = self.parameters.start.copy() if near is None else near.copy()
        states = self.guess if states is None else states
        evaluation = self.at(theta, near=states)
        if not evaluation.ok:
            home = self.parameters.robot.home
            states = states.at_poses(np.flatnonzero(evaluation.status), home)
            evaluation = self.at(theta, near=states)
        if not evaluation.ok:
            return evaluation
        before = self.parameters
        self.parameters, theta = aligned(self, evaluation, own)
        if self.parameters is before and np.array_equal(theta, evaluation.theta):
            return evaluation
        return self.at(theta, near=states)

    def by_groups(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        weights: FloatArray,
        residual: FloatArray,
        taken: FloatArray,
    ) -> Shares:
        """Squares and degrees of freedom of each group.

        Parameters
        ----------
        evaluation : Evaluation
            The equations there.
        noise : ndarray (G,)
            See `whitened`.
        weights : ndarray (U,)
            Of the units.
        residual : ndarray (M,)
            Whitened and weighted.
        taken : ndarray (M, r)
            Derivatives in directions in which the parameters' covariance is 1, weighted: the
            squares of a row are the leverage of its equation.
        """
        count = len(self.unstated)
        if not self.closures.unknowns:
            group = np.repeat(self._family_of_unit, self.components)
            every = np.repeat(weights, self.components)
            left = every - np.einsum("ij,ij->i", taken, taken)
            freedom = np.bincount(group, left, count).astype(np.float64)
            squares = np.bincount(group, residual**2, count).astype(np.float64)
            return Shares(squares, freedom, np.diag(freedom))
        by_unknown = self._at(evaluation, noise).by_unknown
        group = self._group_of_equation
        return self._blocks.by_groups(by_unknown, group, weights, residual, taken)

    def rounding(self, noise: FloatArray) -> float:
        """Length of the whitened rounding errors of what is predicted."""
        readings = super().rounding(noise) if self.any_read else 0.0
        sigma = self.closures.sigma
        if sigma is None:
            return readings
        size = ROUNDING * float(np.abs(self.actuators).max())
        whitened = size / (noise[self._groups] * sigma)
        return float(np.hypot(readings, np.linalg.norm(whitened)))

    def distances(self, evaluation: Evaluation) -> FloatArray:
        """How far off each measured point is, mm, in the order of the sets."""
        return np.concatenate([
            m.instrument.distance_per_point(of_read(m, r), m, self.parameters.robot.length)
            for m, r in zip(self.sets, evaluation.residuals, strict=True)
        ])  # fmt: skip

    def rms(self, evaluation: Evaluation) -> float:
        """Root mean square of `distances` over the rows that were reached; NaN without any."""
        off = self.distances(evaluation)
        return rms(off[np.isfinite(off)])

    def progress(self, evaluation: Evaluation) -> float:
        """`rms`, or `closure_rms` where nothing but the actuators was read."""
        return self.rms(evaluation) if self.any_read else self.closure_rms(evaluation)

    def closure_rms(self, evaluation: Evaluation, poses: BoolArray | None = None) -> float:
        """How far off the closures are at poses (K,), mm of the actuators; NaN where they hold."""
        off = self.closures_off(evaluation)
        if self._counting is not None or poses is not None or not evaluation.ok:
            some = evaluation.status == 0 if poses is None else poses & (evaluation.status == 0)
            off = off[~self._slack[:, : off.shape[1]] & some[:, None]]
        return rms(off)

    def worst_closures(self, evaluation: Evaluation) -> FloatArray:
        """The largest of them at each pose (K,); NaN where they hold."""
        off = np.abs(self.closures_off(evaluation))
        off[self._slack[:, : off.shape[1]]] = 0.0
        return off.max(axis=1) if off.shape[1] else np.full(len(off), np.nan)

    def readings_off(self, evaluation: Evaluation) -> FloatArray:
        """What actuators would read at the poses less what they read (K, equations)."""
        whose, factors, known = evaluation.kept.get("system", (None, None, None))
        if whose is not None and whose() is self and self._counting is None:
            off = known.off[: self._slack.size].reshape(self._slack.shape)
            off = off * factors[self._groups]
        else:
            off, _ = self.closures.residual(evaluation.machines, evaluation.states)
        needed: FloatArray = off if self.closures.sigma is None else off * self.closures.sigma
        return needed

    def closures_off(self, evaluation: Evaluation) -> FloatArray:
        """The same in mm."""
        lengths = self.closures.lengths(evaluation.machines)
        of_actuators = slice(self.closures.equations - self.closures.cells)
        return (self.readings_off(evaluation) * lengths)[:, of_actuators]

    def cell_rms(self, evaluation: Evaluation) -> float:
        """How far tensions are off what load cells read, N; NaN where they are no unknowns."""
        cells = self.closures.cells
        if not cells:
            return float("nan")
        return rms(self.readings_off(evaluation)[:, -cells:][self._counts[:, -cells:]])

    def status(self, evaluation: Evaluation) -> Int32Array:
        """Of the forward kinematics, for each row."""
        return np.concatenate([evaluation.status[place] for place in self.pose_of])

    def failures(self, evaluation: Evaluation) -> str:
        """Say which rows failed and why; empty where the forward kinematics solved all."""
        return failed_rows(self.status(evaluation), STATUS, self.rows, most=10)


def _begun(near: Near, guess: RowStates) -> RowStates:
    if near is None:
        return guess
    return near.onward if isinstance(near, Evaluation) else near
