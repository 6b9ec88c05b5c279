"""The equations of a calibration: measured less predicted, whitened, and their Jacobian.

What the estimator works on are `Equations.residual` (M,) and `Equations.by_parameters` (M, n): the
reduced equations, of which every pose has taken those that determine it (`pose_system`). On a
machine whose poses follow exactly from its actuators no pose takes any, and they are the readings
themselves, set by set and row by row.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array
from pkmcal.core.library import STATUS
from pkmcal.estimation.compression import compressed
from pkmcal.estimation.derivatives import derivatives, jacobian
from pkmcal.estimation.evaluation import Cache, Evaluation
from pkmcal.estimation.first_frames import aligned
from pkmcal.estimation.first_unknowns import fitted_together
from pkmcal.estimation.fit_data import FitData, refuse_free_poses
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_system import PoseSystem, Shares
from pkmcal.estimation.pose_table import PoseTable
from pkmcal.estimation.prediction import Prediction
from pkmcal.estimation.row_blocks import PoseBlocks, RowBlocks, pose_blocks, row_blocks
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines, machines_of
from pkmcal.estimation.whitening import Whitening
from pkmcal.result import failed_rows

_TOGETHER = 16384  # rows whose readings are kept with their derivatives

Near = Evaluation | RowStates | None  # where a search for poses begins
Batch = tuple[slice, slice, FloatArray]  # blocks, their equations, and their derivative (m, n)


@dataclass(frozen=True, eq=False)
class Equations:
    """The stacked residual equations of all measurements, and their Jacobian.

    They do not change: what is computed at some parameters is an `Evaluation`, and equations with
    other parts are other equations.

    Attributes
    ----------
    missing : int
        How many rows were left out because nothing was read there.
    prediction : Prediction
        What the instruments should read.
    whitening : Whitening
        The noise of what they read.
    machines : Machines
        The machines at their present numbers, and what their closures say of the poses.
    blocks : RowBlocks
        Which equations count together.
    without_slack : ndarray (K, n)
        What the actuators would read if no cable were slack.
    whole : Equations or None
        Those that these are compressed of.
    """

    missing: int
    prediction: Prediction
    whitening: Whitening
    machines: Machines
    blocks: RowBlocks
    without_slack: FloatArray
    whole: Equations | None = None

    @classmethod
    def of(cls, datasets: Sequence[FitData], parameters: Parameters, missing: int = 0) -> Equations:
        """The equations of rows; rows with the same actuators are solved once."""
        prediction = Prediction.of(datasets, parameters)
        table, robot = prediction.table, parameters.robot
        machines = machines_of(robot, table)
        whitening = Whitening.of(table.sets, robot.length)
        blocks = row_blocks(table, whitening.unstated(table.sets), missing)
        equations = cls(missing, prediction, whitening, machines, blocks, table.actuators)
        if not machines.unknowns:
            return equations
        refuse_free_poses(datasets, robot)
        whitening = whitening.by_family(table.sets)
        cells = table.cells
        of_cells = [cells is not None and cells.sigma is None] if machines.cells else []
        others = [*of_cells, table.actuator_sigma is None]
        unstated = np.append(whitening.unstated(table.sets), others)
        slack = np.zeros((len(table.actuators), machines.equations), dtype=bool)
        equations = replace(equations, whitening=whitening)
        return equations._with_slack(slack, unstated)

    @property
    def parameters(self) -> Parameters:
        """The parameter vector."""
        return self.prediction.parameters

    @property
    def table(self) -> PoseTable:
        """The rows and their poses."""
        return self.prediction.table

    @cached_property
    def arcs(self) -> tuple[FloatArray, ...]:
        """Factors that turn the residuals of the components (k,) of each set into mm."""
        return tuple(m.instrument.arcs(m, self.parameters.robot.length) for m in self.table.sets)

    @cached_property
    def mm(self) -> tuple[FloatArray, ...]:
        """One unit of each component of each row of each set in mm, (N, k)."""
        length = self.parameters.robot.length
        return tuple(
            np.broadcast_to(m.instrument.mm(m, length), (len(m), len(m.components)))
            for m in self.table.sets
        )

    @property
    def size(self) -> float:
        """The largest number that the equations are made of, mm."""
        largest = np.abs(self.prediction.guess.pose).max(), np.abs(self.table.actuators).max()
        return float(max(self.parameters.robot.length, *largest))

    @property
    def sigma_stated(self) -> bool:
        """True if any noise is stated, of what was read or of the actuators."""
        cells = self.table.cells
        of_actuators = isinstance(self.blocks, PoseBlocks) and not self.blocks.unstated[-1]
        of_cells = cells is not None and cells.sigma is not None
        of_read = [
            m.sigma is not None and bool(np.isfinite(m.values).any()) for m in self.table.sets
        ]
        return bool(of_actuators) or of_cells or any(of_read)

    @property
    def slack_cells(self) -> list[tuple[int, int]]:
        """Closures that are left out, of slack cables: their poses and numbers."""
        if not isinstance(self.blocks, PoseBlocks):
            return []
        return [(int(pose), int(closure)) for pose, closure in np.argwhere(self.blocks.slack)]

    @cached_property
    def system(self) -> PoseSystem | None:
        """The elimination of the poses' unknowns; None where poses have none."""
        if not isinstance(self.blocks, PoseBlocks):
            return None
        return PoseSystem(self.prediction, self.whitening, self.blocks)

    @cached_property
    def compressed(self) -> Equations | None:
        """Fewer equations with these sums of squares; None where none are fewer.

        What they have at an evaluation is what these have but for rounding: squares, derivatives
        by the parameters and their products, degrees of freedom. Of rows by themselves they say
        nothing.
        """
        found = None if self.whole is not None else compressed(self.prediction, self.whitening)
        if found is None:
            return None
        prediction, whitening, beyond_rows = found
        table, unstated = prediction.table, self.blocks.unstated
        if isinstance(self.blocks, PoseBlocks):
            slack, of_readings = self.blocks.slack, whitening.of_equations(whitening.groups)
            blocks: RowBlocks = pose_blocks(
                table, self.machines, slack, unstated, of_readings, self.size
            )
            if not np.array_equal(blocks.pose_of_block, self.blocks.pose_of_block):
                return None
        else:
            blocks = row_blocks(table, unstated, self.missing)
        beyond = np.zeros((len(blocks.components), len(unstated)), dtype=np.intp)
        counts = blocks.block_of_row >= 0
        group = np.array([own[0] if len(own) else 0 for own in whitening.groups])
        place = blocks.block_of_row[counts], group[table.set_of[counts]]
        np.add.at(beyond, place, beyond_rows[counts])
        return replace(
            self,
            prediction=prediction,
            whitening=whitening,
            blocks=replace(blocks, beyond=beyond),
            whole=self,
        )

    @property
    def fewest(self) -> Equations:
        """These equations compressed, if they can be."""
        return self.compressed or self

    # other equations ------------------------------------------------------------------------------

    def with_exact_actuators(self) -> Equations:
        """The equations of poses that follow from the actuators as they read."""
        if not self.machines.unknowns:
            return self
        whitening = self.whitening.by_set()
        return replace(
            self,
            whitening=whitening,
            machines=self.machines.with_exact_actuators(self.without_slack),
            blocks=row_blocks(self.table, whitening.unstated(self.table.sets), self.missing),
        )

    def with_parameters(self, parameters: Parameters) -> Equations:
        """The equations by parameters that count from elsewhere, or with another prior."""
        if parameters is self.parameters:
            return self
        return replace(self, prediction=replace(self.prediction, parameters=parameters))

    def with_more(self, datasets: Sequence[FitData], parameters: Parameters) -> Equations:
        """The equations of the same rows by further parameters, weighted as these are."""
        table = self.table.with_parameters(datasets, parameters)
        if table is not None:
            return replace(self, prediction=Prediction.of(datasets, parameters, table), whole=None)
        equations = Equations.of(datasets, parameters).reweighted(self.whitening.deviations)
        return replace(equations, blocks=self.blocks)  # slack cables count in neither

    def with_tension(self, tension: FloatArray | None) -> Equations:
        """The equations under tensions (K, n) of what the actuators drive; None: as they are."""
        if tension is None:
            return self
        state = self.machines.state._replace(tension=tension)
        return replace(self, machines=replace(self.machines, state=state))

    def without_closures(
        self, cells: Sequence[tuple[int, int]], evaluation: Evaluation
    ) -> Equations:
        """The equations without some closures, by pose and number: of cables that are slack.

        Where poses are to follow from the actuators these read what they would at `evaluation`.
        """
        assert self.system is not None
        needed = self.system.readings_off(evaluation)
        slack = np.zeros(needed.shape, dtype=bool)
        slack[tuple(np.array(cells, dtype=np.intp).reshape(-1, 2).T)] = True
        without_slack = self.table.actuators.copy()
        for pose, cell in zip(*np.nonzero(slack), strict=True):
            without_slack[pose, self.machines.actuators[cell]] += needed[pose, cell]
        without = replace(self, without_slack=without_slack)
        return without._with_slack(slack, self.blocks.unstated)

    def _with_slack(self, slack: BoolArray, unstated: BoolArray) -> Equations:
        """Equations of poses with unknowns, without closures of slack cables (K, e)."""
        of_readings = self.whitening.of_equations(self.whitening.groups)
        blocks = pose_blocks(self.table, self.machines, slack, unstated, of_readings, self.size)
        return replace(self, blocks=blocks)

    def reweighted(self, deviations: Sequence[FloatArray]) -> Equations:
        """Give the components (k,) of each set other relative deviations."""
        return replace(self, whitening=self.whitening.reweighted(deviations))

    # evaluations ----------------------------------------------------------------------------------

    def at(
        self, theta: FloatArray, noise: FloatArray | None = None, near: Near = None
    ) -> Evaluation:
        """Evaluate at `theta` (n,), every pose where it fits best what was read of it.

        `noise` (G,) multiplies the stated deviations of each group, as in `Whitening`. The search
        for the poses begins `near` another evaluation, or states; by default at home and what was
        read.
        """
        machines, cache = self._machines(theta), Cache()
        states = self._states_ahead(machines, theta, near)
        if self.system is not None:
            factors = np.ones(len(self.blocks.unstated)) if noise is None else noise
            states, system = self.system.best(machines, states, theta, factors)
            cache["system"] = self.system, factors, system
        if len(self.table.rows) <= _TOGETHER:
            predicted = self.prediction.at(states.pose, theta)
            cache["predicted"] = self.prediction, predicted
            residuals = self.prediction.residuals(predicted)
        else:
            _, residuals = self.prediction.seen(states.pose, theta)
        begun = self._begun(near)
        return Evaluation(theta, self.parameters, machines, states, residuals, begun, cache)

    def kept(self, evaluation: Evaluation) -> Evaluation:
        """An evaluation by other equations of the same rows, as by these."""
        cache = Cache()
        if len(self.table.rows) <= _TOGETHER:
            predicted = self.prediction.at(evaluation.pose, evaluation.theta)
            cache["predicted"] = self.prediction, predicted
        return replace(evaluation, cache=cache)

    def start(
        self,
        near: FloatArray | None = None,
        own: BoolArray | None = None,
        states: RowStates | None = None,
    ) -> Evaluation:
        """Evaluate at the present parameters, unknown frames aligned with the readings.

        The parameters of the evaluation count from there; those of these equations stay as they
        are. Rows that fail from a measured pose are tried from home. `near` (n,) are other
        parameters to start from, of which only `own` (n,) are aligned.
        """
        unlaid, theta = self.parameters.unlaid(self.parameters.start if near is None else near, own)
        if unlaid is not self.parameters:
            return self.with_parameters(unlaid).start(theta, own, states)
        theta = theta.copy()
        states = self.prediction.guess if states is None else states
        evaluation = self.at(theta, near=states)
        if not evaluation.ok:
            home = self.parameters.robot.home
            states = states.at_poses(np.flatnonzero(evaluation.status), home)
            evaluation = self.at(theta, near=states)
        if not evaluation.ok:
            return evaluation
        parameters, theta = aligned(self.prediction, evaluation, own)
        if parameters is self.parameters and np.array_equal(theta, evaluation.theta):
            return evaluation
        return self.with_parameters(parameters).at(theta, near=states)

    def of_machine_alone(self, start: Evaluation, own: BoolArray | None = None) -> Evaluation:
        """Evaluate with all that readings depend on where it fits the machine of `start` best.

        What they then miss is the machine's. `own` (n,) are the parameters that may be changed.
        """
        if not start.ok:
            return start
        theta = fitted_together(self.prediction, start, self.mm, own)
        return start if theta is start.theta else self.at(theta, near=start)

    def begin(self, start: Evaluation) -> tuple[Equations, Evaluation]:
        """The equations by the parameters of a start with exact actuators, evaluated there."""
        equations = self.with_parameters(start.parameters)
        if not self.machines.unknowns:
            return equations, start
        # closures that contradict each other may still have a best pose
        lost = np.flatnonzero(start.status)
        near = start.states.at_poses(lost, self.parameters.robot.home)
        return equations, equations.fewest.at(start.theta, near=near)

    def squares_ahead(self, theta: FloatArray, noise: FloatArray, near: Near) -> float:
        """Sum of the squared equations where poses with unknowns are looked for, none fitted."""
        machines = self._machines(theta)
        assert self.system is not None
        states = self._states_ahead(machines, theta, near)
        off, _ = self.system.whitened(machines, states, theta, noise)
        return float(off @ off)

    def _machines(self, theta: FloatArray) -> Machines:
        p = self.parameters
        columns = self.table.machine_columns
        robots = [p.robot.with_values(p.values_at(theta, own)) for own in columns]
        return replace(self.machines, robots=tuple(robots))

    def _begun(self, near: Near) -> RowStates:
        if near is None:
            return self.prediction.guess
        return near.onward if isinstance(near, Evaluation) else near

    def _states_ahead(self, machines: Machines, theta: FloatArray, near: Near) -> RowStates:
        """Predict the states from the search's present place along the parameters."""
        states = self._begun(near)
        known = near.cache.get("following") if isinstance(near, Evaluation) else None
        if known is None or known[0] is not self.system or not isinstance(near, Evaluation):
            return machines.settled(states)
        _, following = known
        step = (following.reshape(-1, len(theta)) @ (theta - near.theta)).reshape(
            following.shape[:2]
        )
        step[~np.isfinite(step).all(axis=1)] = 0.0
        ahead = machines.moved(states, step)
        if ahead.status.any():
            ahead = ahead.chosen(ahead.status == 0, machines.settled(states))
        return ahead

    # at an evaluation -----------------------------------------------------------------------------

    def residual(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Measured less predicted (M,), whitened and reduced."""
        if self.system is not None:
            return -self.system.at(evaluation, noise)[2]
        return self.whitening.whitened(self.prediction.misfits(evaluation), noise)

    def by_parameters(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is predicted by the parameters, whitened and reduced."""
        found = np.empty((int(self.blocks.components.sum()), len(self.parameters)))
        for _, equations, by_parameters in self.batches(evaluation, noise):
            found[equations] = by_parameters
        return found

    def batches(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[Batch]:
        """`by_parameters` in batches of whole blocks; in one where poses have unknowns."""
        if self.system is not None:
            found = self.system.by_parameters(evaluation, noise)
            yield slice(0, len(self.blocks.components)), slice(0, len(found)), found
            return
        blocks = equations = slice(0, 0)
        for batch, parts in derivatives(self.prediction, evaluation):
            white = [self.whitening.whiten_rows(part, i, rows, noise) for i, rows, part in parts]
            whole = white[0] if len(white) == 1 else np.concatenate(white)
            read = int(np.count_nonzero(self.table.count[batch]))
            blocks = slice(blocks.stop, blocks.stop + read)
            equations = slice(equations.stop, equations.stop + len(whole))
            yield blocks, equations, whole

    def jacobian(self, evaluation: Evaluation) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n)."""
        return jacobian(self.prediction, evaluation)

    def by_groups(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        weights: FloatArray,
        residual: FloatArray,
        leverage: FloatArray,
    ) -> Shares:
        """Squares, degrees of freedom and information of each group.

        `residual` (M,) is whitened and weighted. `leverage` (M, r) are derivatives in directions in
        which the parameters' covariance is 1, weighted: the squares of a row are the leverage of
        its equation. `weights` are those of the blocks (B,).
        """
        if self.system is not None:
            squares, freedom, information = self.system.by_groups(
                evaluation, noise, weights, residual, leverage
            )
        else:
            count = len(self.blocks.unstated)
            group = np.repeat(self.blocks.family_of_block, self.blocks.components)
            every = np.repeat(weights, self.blocks.components)
            free = every - np.einsum("ij,ij->i", leverage, leverage)
            freedom = np.bincount(group, free, count).astype(np.float64)
            squares = np.bincount(group, residual**2, count).astype(np.float64)
            information = np.diag(freedom)
        if (beyond := self.blocks.beyond) is not None:
            freedom = freedom + weights @ beyond
            information = information + np.diag(weights**2 @ beyond)
        return squares, freedom, information

    def unreached(self, evaluation: Evaluation) -> tuple[int, ...]:
        """Numbers of the rows at whose poses nothing was found."""
        return tuple(self.table.rows[self._status_of_rows(evaluation) != 0].tolist())

    def failures(self, evaluation: Evaluation) -> str:
        """Say which rows failed and why; empty where the forward kinematics solved all."""
        return failed_rows(self._status_of_rows(evaluation), STATUS, self.table.rows, most=10)

    def _status_of_rows(self, evaluation: Evaluation) -> Int32Array:
        status: Int32Array = np.concatenate([evaluation.status[at] for at in self.table.pose_of])
        return status
