"""The equations of poses with unknowns: closures and readings, and what the poses take of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, chained
from pkmcal.estimation.elimination import Shares, System
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.prediction import Prediction
from pkmcal.estimation.row_blocks import PoseBlocks
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines
from pkmcal.estimation.whitening import Whitening


@dataclass(frozen=True, eq=False)
class PoseSystem:
    """The equations of poses with unknowns; its parts are those of `Equations`.

    The equations (E,) are those of the closures that count, pose by pose, then the readings. Of
    these M are left when the poses have taken their part: the reduced ones.
    """

    prediction: Prediction
    whitening: Whitening
    blocks: PoseBlocks

    def best(
        self, machines: Machines, states: RowStates, theta: FloatArray, noise: FloatArray
    ) -> tuple[RowStates, System]:
        """The states near those given at which every pose fits best, and the equations there."""

        def whitened(states: RowStates) -> tuple[FloatArray, FloatArray]:
            return self.whitened(machines, states, theta, noise)

        return self.blocks.elimination.best(machines, states, whitened)

    def whitened(
        self, machines: Machines, states: RowStates, theta: FloatArray, noise: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Predicted less measured (E,), whitened, and its derivative by the unknowns (E, u)."""
        blocks, table = self.blocks, self.prediction.table
        off, by_unknown = machines.residual(states)
        factors = noise[blocks.groups]
        off /= factors
        by_unknown /= factors[:, None]
        equation, by_unknown = blocks.counted(off), blocks.counted(by_unknown)
        if not self.whitening.any_read:
            return equation, by_unknown
        twists = machines.twists(states)
        predicted = self.prediction.at(states.pose, theta)
        misfits = self.prediction.misfits_of(predicted)
        by_pose = [
            m.instrument.by_difference(chained(each.by_twist, twists, place), misfit)
            for m, each, place, misfit in zip(
                table.sets, predicted, table.pose_of, misfits, strict=True
            )
        ]
        return (
            np.concatenate([equation, -self.whitening.whitened(misfits, noise)]),
            np.concatenate([by_unknown, self.whitening.whitened(by_pose, noise)]),
        )

    def at(self, evaluation: Evaluation, noise: FloatArray) -> System:
        """The equations at an evaluation; its cache keeps the last ones, asked for three times."""
        cache = evaluation.cache
        if "system" in cache:
            owner, factors, known = cache["system"]
            if owner is self and (factors is noise or np.array_equal(factors, noise)):
                return known
        there = self.whitened(evaluation.machines, evaluation.states, evaluation.theta, noise)
        found = self.blocks.elimination.at(there)
        cache["system"] = self, noise, found
        return found

    def by_parameters(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is predicted by the parameters, whitened and reduced."""
        p, blocks = self.prediction.parameters, self.blocks
        columns = self.prediction.table.machine_columns
        of_closures = evaluation.machines.by_numbers(evaluation.states, p.places, columns, len(p))
        of_closures /= noise[blocks.groups][:, None]
        by_all = blocks.counted(of_closures)
        if self.whitening.any_read:
            of_readings = self.prediction.jacobian(evaluation)
            by_all = np.concatenate([by_all, self.whitening.whiten(of_readings, noise)])
        _, by_unknown, _ = self.at(evaluation, noise)
        found, following = blocks.elimination.reduced(by_unknown, by_all)
        evaluation.cache["following"] = self, following
        return found

    def reduced(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        closures: FloatArray | None,
        readings: FloatArray | None = None,
    ) -> FloatArray:
        """Remainder (M, d) of changes of closures (K, e, d) and of readings (R, d), whitened.

        One of them may be None: it does not change. Signs are those of `by_parameters`.
        """
        blocks = self.blocks
        _, by_unknown, _ = self.at(evaluation, noise)
        changes = readings if closures is None else closures
        assert changes is not None
        whole = np.zeros((len(by_unknown), changes.shape[-1]))
        of_closures = int(blocks.counts.sum())
        if closures is not None:
            whole[:of_closures] = blocks.counted(closures / noise[blocks.groups][:, None])
        if readings is not None:
            whole[of_closures:] = readings
        return blocks.elimination.reduced(by_unknown, whole)[0]

    def by_groups(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        weights: FloatArray,
        residual: FloatArray,
        leverage: FloatArray,
    ) -> Shares:
        """Forward to `Equations.by_groups`."""
        (_, by_unknown, _), group = self.at(evaluation, noise), self.blocks.group_of_equation
        return self.blocks.elimination.by_groups(by_unknown, group, weights, residual, leverage)

    def parts_of_groups(
        self, evaluation: Evaluation, noise: FloatArray
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Forward to `Elimination.parts_of_groups`."""
        (_, by_unknown, _), group = self.at(evaluation, noise), self.blocks.group_of_equation
        return self.blocks.elimination.parts_of_groups(by_unknown, group, len(self.blocks.unstated))

    def closures_alone(
        self, evaluation: Evaluation, noise: FloatArray, left: FloatArray, least: int
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the closures' share of projected columns (M, n): see `Elimination.seen_by`."""
        _, by_unknown, _ = self.at(evaluation, noise)
        closures = np.arange(len(by_unknown)) < int(self.blocks.counts.sum())
        return self.blocks.elimination.seen_by(by_unknown, closures, left, least)

    def closure_residuals(
        self, evaluation: Evaluation, noise: FloatArray, weights: FloatArray, leverage: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Closures read less needed (K, e), whitened, and their degrees of freedom.

        None of those that do not count. `weights` and `leverage` are those of `by_groups`.
        """
        blocks = self.blocks
        off, by_unknown, _ = self.at(evaluation, noise)
        own = int(blocks.counts.sum())
        longer, freedom = np.zeros((2, *blocks.slack.shape))
        longer[blocks.counts] = -off[:own]
        redundancy = blocks.elimination.redundancy(by_unknown, weights, leverage)
        freedom[blocks.counts] = redundancy[:own]
        if blocks.slack.any():
            whole, _ = evaluation.machines.residual(evaluation.states)
            longer[blocks.slack] = -whole[blocks.slack] / noise[-1]
        return longer, freedom

    def readings_off(self, evaluation: Evaluation) -> FloatArray:
        """Return readings of actuators and load cells at the poses, less what was read (K, e)."""
        known = evaluation.cache.get("system")
        if known is not None and known[0] is self and self.blocks.counting is None:
            _, factors, (off, _, _) = known
            off = off[: self.blocks.slack.size].reshape(self.blocks.slack.shape)
            off = off * factors[self.blocks.groups]
        else:
            off, _ = evaluation.machines.residual(evaluation.states)
        sigma = evaluation.machines.sigma
        needed: FloatArray = off if sigma is None else off * sigma
        return needed

    def redrawn(
        self, at: Evaluation, noise: FloatArray, reduced: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Change of closures, and whitened residuals of readings, with these reduced ones (M,)."""
        blocks = self.blocks
        off, by_unknown, _ = self.at(at, noise)
        errors = blocks.elimination.expanded(by_unknown, reduced)
        change, own = np.zeros(blocks.counts.shape), int(blocks.counts.sum())
        change[blocks.counts] = -(errors + off)[:own]
        change *= noise[blocks.groups]
        return change, errors[own:]
