"""The equations of a calibration: measured less predicted, whitened, and their Jacobian.

What the estimator works on are `Equations.residual` (M,) and `Equations.by_parameters` (M, n): the
equations that are left when every pose has taken those that determine it (`elimination`). On a
machine whose poses follow exactly from its actuators no pose takes any, and they are the readings
themselves, set by set and row by row.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, mm_per_unit, rms
from pkmcal.calibration.alignment import PointPairs, of_heights, of_points, of_poses
from pkmcal.calibration.closures import Closures, Commanded, RowStates, closures_of
from pkmcal.calibration.elimination import Blocks, Shares
from pkmcal.calibration.parameters import POINTS, FitData, Parameters
from pkmcal.core import instruments
from pkmcal.core.library import STATUS
from pkmcal.measurements import orientation
from pkmcal.measurements.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import (
    Predicted,
    by_difference,
    difference,
    distance_per_point,
    predict,
)
from pkmcal.result import failed_rows

_ROUNDING = 2e-15  # of the largest value: what is left of a solved pose


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations evaluated at one parameter vector.

    Attributes
    ----------
    theta : ndarray (n,)
        The parameters, mm and rad.
    robot : Calibratable
        With their geometry.
    pose : ndarray (K, 6)
        Where the machine is at each distinct row of actuators; NaN where it cannot be.
    actuators : ndarray (K, n)
        Where the actuators are there; what they read unless their noise is stated.
    status : ndarray of int (K,)
        Of the forward kinematics.
    predicted : tuple of Predicted
        Of each set of measurements.
    residuals : tuple of ndarray (N, k)
        Measured less predicted of each set, mm and rad.
    """

    theta: FloatArray
    robot: Calibratable
    pose: FloatArray
    actuators: FloatArray
    status: Int32Array
    predicted: tuple[Predicted, ...]
    residuals: tuple[FloatArray, ...]

    @property
    def ok(self) -> bool:
        """Whether the forward kinematics solved every row."""
        return not self.status.any()

    @property
    def states(self) -> RowStates:
        """Where the machine is at each distinct row of actuators."""
        return RowStates(self.pose, self.actuators, self.status)


class Equations:
    """The stacked residual equations of all measurements, and their Jacobian.

    Parameters
    ----------
    datasets : sequence of FitData
        The rows to fit; rows with the same actuators are solved once.
    parameters : Parameters
        The parameter vector.

    Attributes
    ----------
    closures : Closures
        What the closures say of the poses.
    components : ndarray of int (U,)
        Equations of each unit. A unit is what counts together: a row where poses follow from the
        actuators, else all that was read at one pose, less what determines that pose.
    unit_of_row : ndarray of int (N,)
        Of each row of the sets; -1 where none of its equations is left.
    pose_of_unit : ndarray of int (U,)
        The pose of each unit: rows of one pose have its errors in common.
    unstated : ndarray of bool (G,)
        Whose deviation is not known, of each group of equations with a noise of its own: the sets,
        then the actuators where they have equations.
    """

    def __init__(self, datasets: Sequence[FitData], parameters: Parameters) -> None:
        self.datasets = tuple(datasets)
        self.sets = tuple(data.measured for data in datasets)
        self.rows = np.concatenate([data.rows for data in datasets])
        self.parameters = parameters
        self._framed = [data.framed for data in datasets]
        self._columns = [  # of the points that are sought, by what `predict` calls them
            {
                name: parameters.columns_of(role, data.measured)
                for name, role in POINTS[data.measured.kind].items()
                if role in data.sought
            }
            for data in datasets
        ]
        self._known = [
            {
                name: m.attachments if role == "attachment" else m.targets
                for name, role in POINTS[m.kind].items()
                if name not in columns
            }
            for m, columns in zip(self.sets, self._columns, strict=True)
        ]
        # several targets or repeats at the same actuators are one pose
        actuators = np.concatenate([m.actuators for m in self.sets])
        noises = [m.actuator_sigma for m in self.sets]
        stated = [sigma for sigma in noises if sigma is not None]
        key = np.hstack([actuators, np.concatenate(stated)]) if stated else actuators
        distinct, inverse = np.unique(key, axis=0, return_inverse=True)
        n = actuators.shape[1]
        self.actuators = np.ascontiguousarray(distinct[:, :n])
        edges = np.cumsum([0, *map(len, self.sets)])
        self.pose_of = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
        guess = np.tile(parameters.robot.home, (len(self.actuators), 1))
        for measured, framed, place in zip(self.sets, self._framed, self.pose_of, strict=True):
            if measured.kind in ("pose", "position") and not framed:
                read = np.isfinite(measured.values).all(axis=1)
                guess[place[read], :3] = measured.values[read, :3]
                if measured.kind == "pose":
                    guess[place[read], 3:] = orientation.shortest(measured.values[read, 3:])
        unknown = np.zeros(len(guess), dtype=np.int32)
        self._states = RowStates(guess, self.actuators, unknown)
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self._present = np.concatenate([np.isfinite(m.values).reshape(-1) for m in self.sets])
        self._whole = bool(self._present.all())
        self.set_of = np.repeat(np.arange(len(self.sets)), np.diff(edges))
        self._no_sigma = np.array([m.sigma is None for m in self.sets])
        sigma = np.ascontiguousarray(distinct[:, n:]) if stated else None
        self._take(closures_of(parameters.robot, self.actuators, sigma), sigma is None)

    def _take(self, closures: Closures, estimated: bool) -> None:
        """Build the units for these closures; `estimated`: their deviations are not known."""
        self.closures = closures
        of_row = np.concatenate([
            np.isfinite(m.values).reshape(len(m), -1).sum(axis=1) for m in self.sets
        ])  # fmt: skip
        pose_of_row = np.concatenate(self.pose_of)
        if not closures.unknowns:
            self.unstated: BoolArray = self._no_sigma
            self.components: IntArray = of_row[of_row > 0]
            self.pose_of_unit: IntArray = pose_of_row[of_row > 0]
            self.unit_of_row: IntArray = np.where(of_row > 0, np.cumsum(of_row > 0) - 1, -1)
            self._family_of_unit = self.set_of[of_row > 0]
            self.idle = int((of_row == 0).sum())
            return
        self.unstated = np.append(self._no_sigma, estimated)
        poses = len(self.actuators)
        own = np.repeat(np.arange(poses), closures.equations)
        pose_of_equation = np.concatenate([own, np.repeat(pose_of_row, of_row)])
        self._group_of_equation = np.concatenate([
            np.full(len(own), len(self.sets)),
            np.repeat(self.set_of, of_row),
        ])  # fmt: skip
        self._blocks = Blocks(pose_of_equation, poses, closures.unknowns)
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
        other._take(Commanded(self.actuators), estimated=False)
        return other

    def begin(self, commanded: Equations, start: Evaluation) -> Evaluation:
        """Evaluate where the same with commanded poses has been started."""
        self.parameters, self._states = commanded.parameters, start.states
        return start if commanded is self else self.at(start.theta)

    @property
    def family_of_unit(self) -> IntArray:
        """Family of each unit (U,): the set, or one for all where poses mix the groups' noise."""
        return self._family_of_unit

    @property
    def family_of_group(self) -> IntArray:
        """The same of each group (G,)."""
        groups = np.arange(len(self.unstated))
        return np.zeros_like(groups) if self.closures.unknowns else groups

    def at(self, theta: FloatArray, noise: FloatArray | None = None) -> Evaluation:
        """Evaluate at `theta` (n,), every pose where it fits best what was read of it.

        `noise` (G,) multiplies the stated deviations of each group, as in `whitened`.
        """
        robot = self.parameters.robot.with_values(self.parameters.values_at(theta))
        states = self.closures.settled(robot, self._states)
        if self.closures.unknowns:
            factors = np.ones(len(self.unstated)) if noise is None else noise

            def system(states: RowStates) -> tuple[FloatArray, FloatArray]:
                return self._system(robot, states, theta, factors)

            states = self._blocks.best(self.closures, robot, states, system)
        predicted = self._predicted(states.pose, theta)
        residuals = self._residuals(predicted)
        return Evaluation(
            theta, robot, states.pose, states.actuators, states.status, predicted, residuals
        )

    def _system(
        self, robot: Calibratable, states: RowStates, theta: FloatArray, noise: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Predicted less measured (E,), whitened, and its derivative by the unknowns (E, u)."""
        off, by_unknown = self.closures.residual(robot, states)
        twists = self.closures.twists(robot, states)
        predicted = self._predicted(states.pose, theta)
        residuals = self._residuals(predicted)
        by_pose = [
            by_difference(m.kind, seen.by_twist @ twists[place], residual)
            for m, seen, place, residual in zip(
                self.sets, predicted, self.pose_of, residuals, strict=True
            )
        ]
        u, factor = self.closures.unknowns, noise[-1]
        return (
            np.concatenate([off.reshape(-1) / factor, -self.whitened(residuals, noise)]),
            np.concatenate([by_unknown.reshape(-1, u) / factor, self.whitened(by_pose, noise)]),
        )

    def residual(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Measured less predicted (M,), whitened: what is left when poses have taken their part."""
        if not self.closures.unknowns:
            return self.whitened(evaluation.residuals, noise)
        off, by_unknown = self._system(
            evaluation.robot, evaluation.states, evaluation.theta, noise
        )
        return -self._blocks.left(by_unknown, off)

    def by_parameters(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is predicted by the parameters; of what is left likewise."""
        readings = self.whitened(self.jacobian(evaluation), noise)
        if not self.closures.unknowns:
            return readings
        p, robot, states = self.parameters, evaluation.robot, evaluation.states
        of_closures, _ = self.closures.by_numbers(robot, states, p.places)
        by_all = np.zeros((of_closures.shape[0] * of_closures.shape[1], len(p)))
        by_all[:, : len(p.places)] = of_closures.reshape(len(by_all), -1) / noise[-1]
        _, by_unknown = self._system(robot, states, evaluation.theta, noise)
        return self._blocks.left(by_unknown, np.concatenate([by_all, readings]))

    def _predicted(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Readings of each set at poses (K, 6)."""
        frame = self.parameters.frame_at(theta)
        return tuple(
            predict(
                measured.kind,
                pose[self.pose_of[i]],
                frame=frame if self._framed[i] else None,
                origin=self.parameters.origin,
                **self._known[i],
                **{name: theta[columns] for name, columns in self._columns[i].items()},
            )
            for i, measured in enumerate(self.sets)
        )

    def _residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Measured less predicted of each set."""
        return tuple(
            difference(measured.kind, measured.values, seen.values)
            for measured, seen in zip(self.sets, predicted, strict=True)
        )

    def misfit(self, pose: FloatArray, theta: FloatArray) -> FloatArray:
        """How far off the worst reading at each pose (K, 6) is, mm (K,); inf without a pose.

        Angles count as their arc. NaN where nothing was read.
        """
        worst = np.full(len(pose), np.nan)
        residuals = self._residuals(self._predicted(pose, theta))
        for measured, place, residual in zip(self.sets, self.pose_of, residuals, strict=True):
            arcs = mm_per_unit(measured.units, self.parameters.robot.length)
            known = np.where(np.isfinite(measured.values.reshape(residual.shape)), residual, 0.0)
            off = np.linalg.norm(known * arcs, axis=1)
            off = np.where(np.isfinite(off), off, np.inf)
            read = np.isfinite(measured.values.reshape(residual.shape)).any(axis=1)
            np.fmax.at(worst, place[read], off[read])
        return worst

    def start_from(self, rows: IntArray, poses: FloatArray) -> None:
        """Start the forward kinematics of some distinct rows of actuators from poses (s, 6)."""
        guess = self._states.pose.copy()
        guess[rows] = poses
        self._states = replace(self._states, pose=guess)

    def with_readings(self, values: Sequence[FloatArray], prior_centre: FloatArray) -> Equations:
        """The same with other measured values (N, k) of each set, and another centre (n,)."""
        other = copy.copy(self)
        other.sets = tuple(
            replace(measured, values=given.reshape(measured.values.shape))
            for measured, given in zip(self.sets, values, strict=True)
        )
        other.parameters = replace(self.parameters, start=prior_centre)
        return other

    def start(self) -> Evaluation:
        """Evaluate at the present parameters, an unknown frame aligned with the readings.

        Rows that fail from a measured pose are tried from home, those that then miss grossly in
        every assembly mode.
        """
        theta = self.parameters.start.copy()
        evaluation = self.at(theta)
        if not evaluation.ok:
            self.start_from(np.flatnonzero(evaluation.status), self.parameters.robot.home)
            evaluation = self.at(theta)
        if self.parameters.frame is None or not evaluation.ok:
            return evaluation
        frame, theta = self._aligned(evaluation)
        self.parameters, theta = self.parameters.aligned(theta, frame)
        return self.at(theta)

    def _aligned(self, evaluation: Evaluation) -> tuple[FloatArray, FloatArray]:
        """The frame (6,) nearest to the readings, and parameters with unknown targets shifted."""
        theta = evaluation.theta.copy()
        framed = {
            kind: [i for i, m in enumerate(self.sets) if self._framed[i] and m.kind == kind]
            for kind in ("position", "pose", "height")
        }
        if not framed["position"]:
            kind = "pose" if framed["pose"] else "height"
            values = np.concatenate([self.sets[i].values for i in framed[kind]])
            if kind == "pose":
                poses = np.concatenate([evaluation.pose[self.pose_of[i]] for i in framed[kind]])
                return of_poses(values, poses), theta
            points = np.concatenate([self._points(evaluation, i)[0] for i in framed[kind]])
            return of_heights(values, points), theta
        columns = np.concatenate([
            self._columns[i]["target"][:, 0]
            if "target" in self._columns[i]
            else np.full(len(self.sets[i]), -1)
            for i in framed["position"]
        ])  # fmt: skip
        sought, target = np.unique(columns, return_inverse=True)
        target = target.reshape(-1) - int(sought[0] < 0)
        parts = [self._points(evaluation, i) for i in framed["position"]]
        seen = PointPairs(
            values=np.concatenate([self.sets[i].values for i in framed["position"]]),
            point=np.concatenate([places for places, _ in parts]),
            turn=np.concatenate([turn for _, turn in parts]),
            target=target,
        )
        frame, shifts = of_points(seen)
        for first, shift in zip(sought[sought >= 0], shifts, strict=True):
            mine = slice(first, first + 3)
            moved = theta[mine] + shift
            theta[mine] = np.clip(moved, self.parameters.lower[mine], self.parameters.upper[mine])
        return frame, theta

    def _points(self, evaluation: Evaluation, i: int) -> tuple[FloatArray, FloatArray]:
        """Where the targets of set `i` are in the base frame (N, 3), and how they are turned."""
        sought = self._columns[i].get("target")
        target = self._known[i]["target"] if sought is None else evaluation.theta[sought]
        places, _, turn = instruments.points(evaluation.pose[self.pose_of[i]], target)
        return places, turn

    def warm_start(self, evaluation: Evaluation) -> None:
        """Start the forward kinematics of later calls of `at` from its poses."""
        self._states = evaluation.states.chosen(evaluation.status == 0, self._states)

    def jacobian(self, evaluation: Evaluation) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n).

        With the opposite sign that of the residuals.
        """
        p = self.parameters
        _, by_geometry = self.closures.by_numbers(evaluation.robot, evaluation.states, p.places)
        parts = []
        for i, seen in enumerate(evaluation.predicted):
            rows, k = seen.values.shape
            part = np.zeros((rows, k, len(p)))
            part[:, :, : len(p.places)] = seen.by_twist @ by_geometry[self.pose_of[i]]
            if seen.by_frame is not None and p.frame is not None:
                part[:, :, p.frame : p.frame + 6] = seen.by_frame
            for name, columns in self._columns[i].items():
                by_point = seen.by_target if name == "target" else seen.by_anchor
                assert by_point is not None
                np.put_along_axis(part, np.repeat(columns[:, None, :], k, axis=1), by_point, axis=2)
            parts.append(by_difference(self.sets[i].kind, part, evaluation.residuals[i]))
        return parts

    def whitened(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """Parts (N, k, ...) of all sets in units of their standard deviation, stacked: (M, ...).

        `noise` (G,) multiplies what `Measurements.sigma` says. What was not read is left out.
        """
        stacked = []
        for part, white, factor in zip(parts, self._whiten, noise[: len(parts)], strict=True):
            if not self._whole:
                part = np.nan_to_num(part, nan=0.0)
            if white.ndim == 3:
                scaled = np.einsum("nij,nj...->ni...", white, part)
            else:
                scaled = white.reshape(*white.shape, *(1,) * (part.ndim - 2)) * part
            stacked.append((scaled / factor).reshape(-1, *part.shape[2:]))
        whole = np.concatenate(stacked)
        return whole if self._whole else whole[self._present]

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
            Weighted Jacobian in directions in which the parameters' covariance is 1: the squares
            of a row are the leverage of its equation.
        """
        count = len(self.unstated)
        if not self.closures.unknowns:
            group = np.repeat(self._family_of_unit, self.components)
            every = np.repeat(weights, self.components)
            freedom = np.bincount(group, every - (taken**2).sum(axis=1), count)
            squares = np.bincount(group, residual**2, count)
            return Shares(squares, freedom, np.diag(freedom))
        _, by_unknown = self._system(
            evaluation.robot, evaluation.states, evaluation.theta, noise
        )
        group = self._group_of_equation
        return self._blocks.given_back(by_unknown, group, weights, residual, taken)

    def rounding(self, noise: FloatArray) -> float:
        """Length of the whitened rounding errors of what is predicted."""
        parts = [_rounded(m, self.parameters.robot.length) for m in self.sets]
        readings = float(np.linalg.norm(self.whitened(parts, noise)))
        sigma = self.closures.sigma
        if sigma is None:
            return readings
        size = _ROUNDING * float(np.abs(self.actuators).max())
        return float(np.hypot(readings, size / noise[-1] * np.linalg.norm(1.0 / sigma)))

    def unwhiten(self, whitened: FloatArray, noise: FloatArray) -> list[FloatArray]:
        """Invert `whitened` for vectors (M,): parts (N, k) of all sets, mm and rad."""
        parts, rest = [], whitened
        for measured, white, factor in zip(self.sets, self._whiten, noise, strict=True):
            mine, rest = np.split(rest, [len(measured) * white.shape[1]])
            part = factor * mine.reshape(len(measured), -1)
            if white.ndim == 3:
                parts.append(np.linalg.solve(white, part[:, :, None])[:, :, 0])
            else:
                parts.append(part / white)
        return parts

    def white(self, i: int) -> FloatArray:
        """Matrices (N, k, k) that make the noise of set `i` one, as its sigma says."""
        white = self._whiten[i]
        return white if white.ndim == 3 else white[:, :, None] * np.eye(white.shape[1])

    def distances(self, evaluation: Evaluation) -> FloatArray:
        """How far off each measured point is, mm, in the order of the sets."""
        return np.concatenate([
            distance_per_point(_of_read(m, r))
            for m, r in zip(self.sets, evaluation.residuals, strict=True)
        ])  # fmt: skip

    def rms(self, evaluation: Evaluation) -> float:
        """Root mean square of `distances` over the rows that were reached; NaN without any."""
        off = self.distances(evaluation)
        return rms(off[np.isfinite(off)])

    def closure_rms(self, evaluation: Evaluation) -> float:
        """How far off the closures are at the poses, mm of the actuators; NaN where they hold."""
        sigma = self.closures.sigma
        if sigma is None:
            return float("nan")
        robot, sure = evaluation.robot, evaluation.status == 0
        off = self.closures.residual(robot, evaluation.states)[0] * sigma
        return rms((off * self.closures.lengths(robot))[sure])

    def status(self, evaluation: Evaluation) -> Int32Array:
        """Of the forward kinematics, for each row."""
        return np.concatenate([evaluation.status[place] for place in self.pose_of])

    def failures(self, evaluation: Evaluation) -> str:
        """Say which rows failed and why; empty where the forward kinematics solved all."""
        return failed_rows(self.status(evaluation), STATUS, self.rows, most=10)


def _rounded(measured: Measurements, length: float) -> FloatArray:
    """Rounding errors (N, k) of what is predicted, mm and rad."""
    values = measured.values.reshape(len(measured), -1)
    lengths = np.array([unit == "mm" for unit in measured.units])
    size = np.max(np.nan_to_num(np.abs(values[:, lengths])), initial=0.0) + length
    return np.broadcast_to(_ROUNDING * size / mm_per_unit(measured.units, length), values.shape)


def _of_read(measured: Measurements, residual: FloatArray) -> FloatArray:
    """Residuals (N, k) of what was read, 0 beside it; NaN in rows where nothing was."""
    read = np.isfinite(measured.values.reshape(residual.shape))
    if not residual.shape[1]:
        return np.full((len(residual), 1), np.nan)
    if read.all():
        return residual
    known = np.where(read, residual, 0.0)
    known[~read.any(axis=1)] = np.nan
    return known


def _whitening(measured: Measurements, length: float) -> FloatArray:
    """Factors (N, k) or matrices (N, k, k) that make the noise one; 1 mm where it is not known."""
    sigma = measured.sigma
    if sigma is None:
        return np.tile(mm_per_unit(measured.units, length), (len(measured), 1))
    if measured.kind == "pose" and not _same_turnings(sigma):
        sigma = orientation.covariance(sigma, np.nan_to_num(measured.values[:, 3:]))
    if sigma.ndim == 2:
        return 1.0 / sigma
    missing = np.isnan(measured.values)
    if missing.any():  # what was read has its marginal covariance
        apart = missing[:, :, None] | missing[:, None, :]
        sigma = np.where(apart, np.eye(sigma.shape[1]), sigma)
    return np.linalg.inv(np.linalg.cholesky(sigma))


def _same_turnings(sigma: FloatArray) -> bool:
    """Whether standard deviations (N, 6) are the same about every axis."""
    return sigma.ndim == 2 and bool((sigma[:, 4:] == sigma[:, 3:4]).all())
