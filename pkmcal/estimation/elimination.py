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

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.core.elimination import Fit, PoseEquations
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines

_STEPS = 50  # of finding the best poses
_STRAIGHT = 12  # of these, as if equations were straight; then as they bend
_NEAR = 1e-4  # share of the way on which equations are as large as what is left, to see them bend
_SETTLED = 1e-12  # share of a pose's cost that a further step would gain
_CLOSE = 1e-6  # the same where steps have become too short to gain anything
_TOLD = 1e-6  # share of an equation that is left of it, to tell anything
_ROUNDING = 1e-15  # of the largest number that equations are made of
_RIDGE = 1e-13  # of a normal matrix, for unknowns that no equation has
_TOGETHER = 4096  # poses whose bases are there at once, to bound memory

Whitened = tuple[FloatArray, FloatArray]  # whitened (E,), and their derivative by unknowns (E, u)
System = tuple[FloatArray, FloatArray, FloatArray]  # as `Whitened`, and the reduced equations (M,)
# Poses with equally many equations left: their equations (G, k), which are left (G, k - u), which
# blocks they are (G,), and what is across their unknowns, Q₂ (G, k, k - u)
_Alike = tuple[IntArray, IntArray, IntArray, FloatArray]
# Of G groups of equations: squared residuals, degrees of freedom (the trace of P over each group),
# and (G, G) the squares of P, twice what the residuals inform of the variances
Shares = tuple[FloatArray, FloatArray, FloatArray]
Equate = Callable[[RowStates], Whitened]


class Elimination:
    """The assignment of equations to poses.

    Parameters
    ----------
    pose_of : ndarray of int (E,)
        Of each equation.
    poses : int
        How many there are.
    unknowns : int
        Of each pose.
    size : float
        The largest number that the equations are made of.

    Attributes
    ----------
    components : ndarray of int (U,)
        How many equations are left of each pose that has any left.
    pose_of_block : ndarray of int (U,)
        Which poses these are.
    uninformative : int
        How many poses have none left: whatever was read there, they say nothing.
    """

    def __init__(self, pose_of: IntArray, poses: int, unknowns: int, size: float) -> None:
        self.pose_of, self.poses, self.unknowns = pose_of, poses, unknowns
        self._rounding = _ROUNDING * size
        self._order = np.argsort(pose_of, kind="stable")
        self._count = np.bincount(pose_of, minlength=poses)
        self._all = PoseEquations(self._order, self._count, unknowns)
        self.pose_of_block: IntArray = np.flatnonzero(self._all.left_of)
        self.components: IntArray = self._all.left_of[self.pose_of_block]
        self.uninformative = poses - len(self.pose_of_block)

    def reduced(self, by_unknown: FloatArray, part: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project columns (E, n) onto what the poses' unknowns do not explain, (M, n).

        And how they take it: steps (K, u, n) of the unknowns by each column. `by_unknown` is
        (E, u).
        """
        return self._all.left(by_unknown, part)

    def expanded(self, by_unknown: FloatArray, left: FloatArray) -> FloatArray:
        """Equations (E,) of which so much is left (M,), and nothing for the poses to take."""
        spread = np.empty(len(self.pose_of))
        spread[self._order] = self._all.spread(by_unknown, left[:, None])[:, 0]
        return spread

    def seen_by(
        self, by_unknown: FloatArray, some: BoolArray, left: FloatArray, least: int
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the share of some original equations (E,) in the projected columns (M, n).

        Of poses with `least` equations left or more, which of them (B,), how many numbers each has
        (B,) and these, one after another, (Σ, n): equally uncertain ones.
        """
        places, counts, parts = list[int](), list[int](), [np.empty((0, left.shape[1]))]
        for equations, place, units, rest in self._bases(by_unknown):
            if rest.shape[2] < least:
                continue
            for mine, at, unit, basis in zip(some[equations], place, units, rest, strict=True):
                size, axes = np.linalg.svd(basis[mine], full_matrices=False)[1:]
                told = axes[size > _TOLD]
                places.append(int(unit))
                counts.append(len(told))
                parts.append(told @ left[at])
        return np.array(places, np.intp), np.array(counts, np.intp), np.concatenate(parts)

    def _bases(self, by_unknown: FloatArray) -> Iterator[_Alike]:
        """Alike poses with equations left, lot by lot."""
        first, u = np.cumsum(self._count) - self._count, self.unknowns
        for left in np.unique(self.components).tolist():
            units = np.flatnonzero(self.components == left)
            for lot in lots(len(units), _TOGETHER):
                some = units[lot]
                mine, count = self.pose_of_block[some], len(some)
                equations = self._order[first[mine, None] + np.arange(left + u)]
                poses = PoseEquations(equations.ravel(), np.full(count, left + u), u)
                behind = np.tile(np.eye(left), (count, 1))
                rest = poses.spread(by_unknown, behind).reshape(count, left + u, left)
                place = self._all.place[mine, None] + np.arange(left)
                yield equations, place, some, rest

    def redundancy(
        self, by_unknown: FloatArray, weights: FloatArray, taken: FloatArray
    ) -> FloatArray:
        """Degrees of freedom (E,) of the original equations, as `by_groups` adds them up."""
        found = np.zeros(len(self.pose_of))
        for equations, left, units, rest in self._bases(by_unknown):
            leverage, weight = rest @ taken[left], weights[units, None]
            found[equations] = weight * (rest**2).sum(axis=2) - (leverage**2).sum(axis=2)
        return found

    def by_groups(
        self,
        by_unknown: FloatArray,
        group: IntArray,
        weights: FloatArray,
        residual: FloatArray,
        taken: FloatArray,
    ) -> Shares:
        """The `Shares` of the groups of the original equations, of which each is of one, (E,).

        `residual` (M,) is what is left, `taken` (M, r) derivatives of it whose squares are
        leverages, both weighted; `weights` (U,) are of the poses with equations left. P, which
        takes noise to residuals, is the blocks Q₂Q₂ᵀ less (Q₂ taken)(Q₂ taken)ᵀ.
        """
        count_of = int(group.max()) + 1
        squares, freedom = np.zeros(count_of), np.zeros(count_of)
        information = np.zeros((count_of, count_of))
        outer = np.zeros((count_of, taken.shape[1], taken.shape[1]))
        for equations, left, units, plain in self._bases(by_unknown):
            leverage, mine = plain @ taken[left], residual[left][:, :, None]
            rest = np.sqrt(weights[units])[:, None, None] * plain
            groups = group[equations]
            blocks = rest @ rest.transpose(0, 2, 1)
            blocks_squared = blocks * (blocks - 2.0 * leverage @ leverage.transpose(0, 2, 1))
            free = np.einsum("nii->ni", blocks) - (leverage**2).sum(axis=2)
            squares += _sums(((plain @ mine)[:, :, 0]) ** 2, groups, count_of)
            freedom += _sums(free, groups, count_of)
            pairs = groups[:, :, None] * count_of + groups[:, None, :]
            information += _sums(blocks_squared, pairs, count_of**2).reshape(information.shape)
            for g in range(count_of):
                rows = leverage[groups == g]
                outer[g] += rows.T @ rows
        information += np.einsum("gij,hij->gh", outer, outer)
        return squares, freedom, information

    def parts_of_groups(
        self, by_unknown: FloatArray, group: IntArray, count: int
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Return the share of each of the groups (E,) in the covariance of what is left.

        Of n poses with m equations left: which these are (n, m), and Q₂gᵀ Q₂g, (count, n, m, m).
        """
        for equations, left, _, basis in self._bases(by_unknown):
            groups = group[equations]
            parts = [
                (basis * (groups == g)[:, :, None]).transpose(0, 2, 1) @ basis for g in range(count)
            ]
            yield left, np.stack(parts)

    def best(
        self, machines: Machines, states: RowStates, system: Equate
    ) -> tuple[RowStates, System]:
        """The states of least squares, each pose by itself.

        Levenberg's and Marquardt's steps for all poses at once, each with a damping of its own.
        Where a reading is far off, equations bend by more than Gauss's and Newton's matrix, whose
        steps then are too long or, damped, too short: poses that have not settled by it go on with
        Newton's.

        The search begins at `states`; `system` gives the whitened equations at any. Poses that no
        step improves, though their gradient is not zero, have status 1.
        """
        damping = np.zeros(self.poses)
        moving = np.ones(self.poses, dtype=bool)
        there = system(states)
        fit = self._fit(there, damping)
        for k in range(_STEPS):
            if k >= _STRAIGHT:

                def pulled(by: FloatArray, at: RowStates = states) -> FloatArray:
                    return self._all.normals(*system(machines.moved(at, by)))[1]

                damping[:] *= k > _STRAIGHT
                fit = self._newton(fit, there, damping, moving, pulled)
            moving = fit.gain > 0.0
            if not moving.any():
                break
            trial = machines.moved(states, fit.step)
            beyond = system(trial)
            after = self._fit(beyond, damping)
            worse = moving & ~(after.cost < fit.cost)
            if worse.any():
                states = trial.chosen(~worse, states)
                stay = worse[self.pose_of]
                there = (
                    np.where(stay, there[0], beyond[0]),
                    np.where(stay[:, None], there[1], beyond[1]),
                )
            else:
                states, there, fit = trial, beyond, after
            if worse.any() or damping.any():
                eased = 0.1 * damping * (damping > 1e-5)
                damping = np.where(worse, np.maximum(10.0 * damping, 1e-3), eased)
                fit = self._fit(there, damping)
                if (damping[moving] > 1e8).all():
                    break
        if moving.any() or damping.any():  # short of steps, or they have become too short
            fit = self._fit(there, np.zeros(self.poses), _CLOSE)
        unsolved = (fit.gain != 0.0) & (states.status == 0)
        if unsolved.any():
            status = np.where(unsolved, 1, states.status).astype(np.int32)
            states = replace(states, status=status)
        return states, (*there, fit.left)

    def at(self, there: Whitened) -> System:
        """The equations where poses are not moved."""
        return *there, self._fit(there, np.zeros(self.poses)).left

    def _fit(self, there: Whitened, damping: FloatArray, least: float = _SETTLED) -> Fit:
        return self._all.fit(*there, damping, least, self._rounding)

    def _newton(
        self,
        straight: Fit,
        there: Whitened,
        damping: FloatArray,
        moving: BoolArray,
        pulled: Callable[[FloatArray], FloatArray],
    ) -> Fit:
        """Newton's steps of poses that move, equations bent as `_curved` finds them by `pulled`."""
        matrix, pull, cost = self._all.normals(*there)
        rounded = self._rounding * np.sqrt(np.einsum("kii->k", matrix))
        matrix = _curved(matrix, pull, np.where(moving, cost, 0.0), pulled)
        size = np.einsum("kii->ki", matrix)
        ridge = _RIDGE * size.sum(axis=1) + np.finfo(np.float64).tiny
        unit = np.eye(self.unknowns)
        damped = matrix + unit * (damping[:, None] * size + ridge[:, None])[:, None]
        known = np.isfinite(damped).all(axis=(1, 2)) & np.isfinite(pull).all(axis=1)
        damped[~known] = unit
        step = -np.linalg.solve(damped, pull[:, :, None])
        gain = -(step[:, :, 0] * (2.0 * pull + (matrix @ step)[:, :, 0])).sum(axis=1)
        gain[gain <= _SETTLED * cost + rounded * (rounded + np.sqrt(cost))] = 0.0
        gain[~known] = np.nan
        return straight._replace(step=np.where(gain[:, None] > 0.0, step[:, :, 0], 0.0), gain=gain)


def _sums(numbers: FloatArray, group: IntArray, count: int) -> FloatArray:
    """Sum (count,) of the numbers of each group; both have the same shape."""
    sums: FloatArray = np.bincount(group.ravel(), numbers.ravel(), count).astype(np.float64)
    return sums


def _curved(
    matrix: FloatArray,
    pull: FloatArray,
    cost: FloatArray,
    pulled: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """Second derivatives (K, u, u) of half the squares, of poses with a cost (K,); else JᵀJ.

    By differences of `pull` (K, u), which `pulled` tells at steps (K, u). Directions in which the
    squares are curved downwards count as if they were curved upwards: steps go down.
    """
    size = np.einsum("kii->ki", matrix)
    way = np.zeros_like(size)
    np.divide(cost[:, None], size, out=way, where=size > 0.0)
    way = _NEAR * np.sqrt(way)
    bent = np.empty_like(matrix)
    for i in range(matrix.shape[1]):
        by = np.zeros_like(way)
        by[:, i] = way[:, i]
        bent[:, i] = (pulled(by) - pull) / np.where(way[:, i], way[:, i], 1.0)[:, None]
    mine = (way > 0.0).all(axis=1) & np.isfinite(bent).all(axis=(1, 2))
    curved, axes = np.linalg.eigh(0.5 * (bent + bent.transpose(0, 2, 1))[mine])
    found: FloatArray = matrix.copy()
    found[mine] = (axes * np.abs(curved)[:, None]) @ axes.transpose(0, 2, 1)
    return found
