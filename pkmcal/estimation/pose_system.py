"""Poses are nuisance parameters: what is left of the equations when each has taken its own part.

The equations of a pose, k of them with u unknowns of that pose alone, are rotated by a QR
factorisation of their derivative by the unknowns: u of them determine the pose whatever the
parameters are, the k - u others do not depend on it to first order and are what is left,

    [J_x | J_θ | r] = Q [R T t; 0 J̄ r̄].

With the poses at their best, gradient and Gauss-Newton matrix of the sum of squares by θ are
those of r̄ and J̄ alone, and so are the marginal covariance and the degrees of freedom (G. H. Golub
and V. Pereyra, Separable nonlinear least squares: the variable projection method, Inverse Problems
19 (2003) R1-R26). SciPy has no least squares that does this row by row: with all poses among its
unknowns it takes time with the third power of the rows. What is done with each pose is done in the
core (`core.elimination`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, chained, lots
from pkmcal.core.elimination import PoseEquations
from pkmcal.estimation import pose_search
from pkmcal.estimation.derivatives import jacobian
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.pose_search import System, Whitened
from pkmcal.estimation.prediction import Prediction
from pkmcal.estimation.row_blocks import PoseBlocks
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines
from pkmcal.estimation.whitening import Whitening

_TOLD = 1e-6  # share of an equation that is left of it, to tell anything
_TOGETHER = 4096  # poses whose bases are there at once, to bound memory

# Poses with equally many equations left: their equations (G, k), which are left (G, k - u), which
# blocks they are (G,), and what is across their unknowns, Q₂ (G, k, k - u)
_Alike = tuple[IntArray, IntArray, IntArray, FloatArray]
# Of G groups of equations: squared residuals, degrees of freedom (the trace of P over each group),
# and (G, G) the squares of P, twice what the residuals inform of the variances
Shares = tuple[FloatArray, FloatArray, FloatArray]


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

        def whitened(states: RowStates) -> Whitened:
            return self.whitened(machines, states, theta, noise)

        blocks = self.blocks
        return pose_search.best(blocks.equations, blocks.size, machines, states, whitened)

    def whitened(
        self, machines: Machines, states: RowStates, theta: FloatArray, noise: FloatArray
    ) -> Whitened:
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
        found = pose_search.unmoved(self.blocks.equations, self.blocks.size, there)
        cache["system"] = self, noise, found
        return found

    # what is left ---------------------------------------------------------------------------------

    def by_parameters(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of what is predicted by the parameters, whitened and reduced."""
        p, blocks = self.prediction.parameters, self.blocks
        columns = self.prediction.table.machine_columns
        of_closures = evaluation.machines.by_numbers(evaluation.states, p.places, columns, len(p))
        of_closures /= noise[blocks.groups][:, None]
        by_all = blocks.counted(of_closures)
        if self.whitening.any_read:
            of_readings = jacobian(self.prediction, evaluation)
            by_all = np.concatenate([by_all, self.whitening.whiten(of_readings, noise)])
        _, by_unknown, _ = self.at(evaluation, noise)
        found, following = blocks.equations.left(by_unknown, by_all)
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
        return blocks.equations.left(by_unknown, whole)[0]

    def redrawn(
        self, at: Evaluation, noise: FloatArray, reduced: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Change of closures, and whitened residuals of readings, with these reduced ones (M,).

        Of these so much is left, and nothing for the poses to take.
        """
        blocks = self.blocks
        off, by_unknown, _ = self.at(at, noise)
        errors = np.empty(len(off))
        errors[blocks.equations.order] = blocks.equations.spread(by_unknown, reduced[:, None])[:, 0]
        change, own = np.zeros(blocks.counts.shape), int(blocks.counts.sum())
        change[blocks.counts] = -(errors + off)[:own]
        change *= noise[blocks.groups]
        return change, errors[own:]

    # shares of the equations in what is left ------------------------------------------------------

    def by_groups(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        weights: FloatArray,
        residual: FloatArray,
        leverage: FloatArray,
    ) -> Shares:
        """The `Shares` of the groups of equations; arguments are those of `Equations.by_groups`.

        P, which takes noise to residuals, is the blocks Q₂Q₂ᵀ less (Q₂ leverage)(Q₂ leverage)ᵀ.
        """
        group = self.blocks.group_of_equation
        count, r = int(group.max()) + 1, leverage.shape[1]
        squares, freedom = np.zeros(count), np.zeros(count)
        information, outer = np.zeros((count, count)), np.zeros((count, r, r))
        for equations, left, units, plain in self._bases(evaluation, noise):
            taken, mine = plain @ leverage[left], residual[left][:, :, None]
            rest = np.sqrt(weights[units])[:, None, None] * plain
            groups = group[equations]
            blocks = rest @ rest.transpose(0, 2, 1)
            blocks_squared = blocks * (blocks - 2.0 * taken @ taken.transpose(0, 2, 1))
            free = np.einsum("nii->ni", blocks) - (taken**2).sum(axis=2)
            squares += _sums(((plain @ mine)[:, :, 0]) ** 2, groups, count)
            freedom += _sums(free, groups, count)
            pairs = groups[:, :, None] * count + groups[:, None, :]
            information += _sums(blocks_squared, pairs, count**2).reshape(information.shape)
            for g in range(count):
                rows = taken[groups == g]
                outer[g] += rows.T @ rows
        information += np.einsum("gij,hij->gh", outer, outer)
        return squares, freedom, information

    def parts_of_groups(
        self, evaluation: Evaluation, noise: FloatArray
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Return the share of each group of equations in the covariance of what is left.

        Of n poses with m equations left: which these are (n, m), and Q₂gᵀ Q₂g, (G, n, m, m).
        """
        group, count = self.blocks.group_of_equation, len(self.blocks.unstated)
        for equations, left, _, basis in self._bases(evaluation, noise):
            groups = group[equations]
            parts = [
                (basis * (groups == g)[:, :, None]).transpose(0, 2, 1) @ basis for g in range(count)
            ]
            yield left, np.stack(parts)

    def closures_alone(
        self, evaluation: Evaluation, noise: FloatArray, left: FloatArray, least: int
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the closures' share of projected columns (M, n).

        Of poses with `least` equations left or more, which of them (B,), how many numbers each has
        (B,) and these, one after another, (Σ, n): equally uncertain ones.
        """
        own = int(self.blocks.counts.sum())
        places, counts, parts = list[int](), list[int](), [np.empty((0, left.shape[1]))]
        for equations, place, units, rest in self._bases(evaluation, noise):
            if rest.shape[2] < least:
                continue
            for mine, at, unit, basis in zip(equations < own, place, units, rest, strict=True):
                size, axes = np.linalg.svd(basis[mine], full_matrices=False)[1:]
                told = axes[size > _TOLD]
                places.append(int(unit))
                counts.append(len(told))
                parts.append(told @ left[at])
        return np.array(places, np.intp), np.array(counts, np.intp), np.concatenate(parts)

    def closure_residuals(
        self, evaluation: Evaluation, noise: FloatArray, weights: FloatArray, leverage: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Closures read less needed (K, e), whitened, and their degrees of freedom.

        None of those that do not count. `weights` and `leverage` are those of `by_groups`, which
        adds these degrees of freedom up.
        """
        blocks = self.blocks
        off, _, _ = self.at(evaluation, noise)
        redundancy, own = np.zeros(len(off)), int(blocks.counts.sum())
        for equations, left, units, rest in self._bases(evaluation, noise):
            taken, weight = rest @ leverage[left], weights[units, None]
            redundancy[equations] = weight * (rest**2).sum(axis=2) - (taken**2).sum(axis=2)
        longer, freedom = np.zeros((2, *blocks.slack.shape))
        longer[blocks.counts] = -off[:own]
        freedom[blocks.counts] = redundancy[:own]
        if blocks.slack.any():
            whole, _ = evaluation.machines.residual(evaluation.states)
            longer[blocks.slack] = -whole[blocks.slack] / noise[-1]
        return longer, freedom

    def _bases(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[_Alike]:
        """Alike poses with equations left, lot by lot."""
        _, by_unknown, _ = self.at(evaluation, noise)
        blocks, every = self.blocks, self.blocks.equations
        for left in np.unique(blocks.components).tolist():
            units, k = np.flatnonzero(blocks.components == left), left + every.unknowns
            for lot in lots(len(units), _TOGETHER):
                some = units[lot]
                mine, count = blocks.pose_of_block[some], len(some)
                equations = every.order[every.first[mine, None] + np.arange(k)]
                poses = PoseEquations(equations.ravel(), np.full(count, k), every.unknowns)
                behind = np.tile(np.eye(left), (count, 1))
                rest = poses.spread(by_unknown, behind).reshape(count, k, left)
                place = every.place[mine, None] + np.arange(left)
                yield equations, place, some, rest

    # closures -------------------------------------------------------------------------------------

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


def _sums(numbers: FloatArray, group: IntArray, count: int) -> FloatArray:
    """Sum (count,) of the numbers of each group; both have the same shape."""
    sums: FloatArray = np.bincount(group.ravel(), numbers.ravel(), count).astype(np.float64)
    return sums
