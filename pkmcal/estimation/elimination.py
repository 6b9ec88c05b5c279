"""Poses are nuisance parameters: what is left of the equations when each has taken its own part.

The equations of a pose, k of them with u unknowns of that pose alone, are rotated by a QR
factorisation of their derivative by the unknowns: u of them determine the pose whatever the
parameters are, the k - u others do not depend on it to first order and are what is left,

    [J_x | J_θ | r] = Q [R T t; 0 J̄ r̄].

With the poses at their best, gradient and Gauss-Newton matrix of the sum of squares by θ are
those of r̄ and J̄ alone, and so are the marginal covariance and the degrees of freedom (G. H. Golub
and V. Pereyra, Separable nonlinear least squares: the variable projection method, Inverse Problems
19 (2003) R1-R26). SciPy has no least squares that does this row by row: with all poses among its
unknowns it takes time with the third power of the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.closures import RowStates
from pkmcal.estimation.session_machines import Machines, SessionClosures

_STEPS = 50  # of finding the best poses
_STRAIGHT = 12  # of these, as if equations were straight; then as they bend
_NEAR = 1e-4  # share of the way on which equations are as large as what is left, to see them bend
_SETTLED = 1e-12  # share of a pose's cost that a further step would gain
_CLOSE = 1e-6  # the same where steps have become too short to gain anything
_ROUNDING = 1e-15  # of a whitened equation, of the largest number it was made of
_RIDGE = 1e-13  # of the normal matrix, for unknowns that no equation has
_TOGETHER = 4096  # poses that are eliminated at once, to bound memory

System = Callable[[RowStates], tuple[FloatArray, FloatArray]]


class _Alike(NamedTuple):
    """Poses with equally many equations: their numbers (G,), and their equations (G, k)."""

    poses: IntArray
    equations: IntArray


class Shares(NamedTuple):
    """What each of G groups of equations has of the residuals.

    Attributes
    ----------
    squares : ndarray (G,)
        Sum of squared residuals, whitened and weighted.
    freedom : ndarray (G,)
        Degrees of freedom: the trace of P over the group.
    information : ndarray (G, G)
        Sum of the squares of P between groups: twice what the residuals inform of the variances.
    """

    squares: FloatArray
    freedom: FloatArray
    information: FloatArray


class Blocks:
    """Which equations belong to which pose.

    Parameters
    ----------
    pose_of : ndarray of int (E,)
        Of each equation.
    poses : int
        How many there are.
    unknowns : int
        Of each pose.

    Attributes
    ----------
    components : ndarray of int (U,)
        How many equations are left of each pose that has any left.
    pose_of_unit : ndarray of int (U,)
        Which poses these are.
    idle : int
        How many poses have none left: whatever was read there, they say nothing.
    """

    def __init__(self, pose_of: IntArray, poses: int, unknowns: int) -> None:
        self.pose_of, self.poses, self.unknowns = pose_of, poses, unknowns
        order = np.argsort(pose_of, kind="stable")
        count = np.bincount(pose_of, minlength=poses)
        first = np.cumsum(count) - count
        self._alike: list[_Alike] = []
        for k in np.unique(count[count > 0]).tolist():
            mine = np.flatnonzero(count == k)
            for start in range(0, len(mine), _TOGETHER):
                some = mine[start : start + _TOGETHER]
                self._alike.append(_Alike(some, order[first[some, None] + np.arange(k)]))
        left = [each for each in self._alike if each.equations.shape[1] > unknowns]
        self._left = left
        self._last: tuple[FloatArray, list[list[FloatArray]]] | None = None
        none = np.empty(0, dtype=np.intp)
        self.pose_of_unit: IntArray = np.concatenate([none, *(each.poses for each in left)])
        self.components: IntArray = np.concatenate([
            none,
            *(np.full(len(e.poses), e.equations.shape[1] - unknowns) for e in left),
        ]).astype(np.intp)  # fmt: skip
        self._equations_left = int(self.components.sum())
        self.idle = poses - len(self.pose_of_unit)

    def left(self, by_unknown: FloatArray, part: FloatArray) -> FloatArray:
        """What is left (M, ...) of equations (E, ...) when the poses have taken theirs.

        `by_unknown` is (E, u).
        """
        width, found = part.shape[1:], np.empty((self._equations_left, *part.shape[1:]))
        first = 0
        for each, mirrors in zip(self._left, self._mirrors_of(by_unknown), strict=True):
            mine = part[each.equations].reshape(*each.equations.shape, -1)
            for mirror in mirrors:
                _reflect(mirror, mine)
            rest = mine[:, self.unknowns :].reshape(-1, *width)
            found[first : first + len(rest)] = rest
            first += len(rest)
        return found

    def _mirrors_of(self, by_unknown: FloatArray) -> list[list[FloatArray]]:
        """Mirrors of each lot of alike poses; of one array they are found once."""
        if self._last is None or self._last[0] is not by_unknown:
            self._last = None
            found = [_mirrors(by_unknown[each.equations]) for each in self._left]
            self._last = by_unknown, found
        return self._last[1]

    def spread(self, by_unknown: FloatArray, left: FloatArray) -> FloatArray:
        """Equations (E,) of which so much is left (M,), and nothing for the poses to take."""
        spread, first = np.zeros(len(self.pose_of)), 0
        for equations, rest in self._bases(by_unknown):
            count, _, most = rest.shape
            mine = left[first : first + count * most].reshape(count, most, 1)
            spread[equations] = (rest @ mine)[:, :, 0]
            first += count * most
        return spread

    def _bases(self, by_unknown: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Equations (G, k) of alike poses and Q₂ (G, k, k - u), across their unknowns."""
        for each, mirrors in zip(self._left, self._mirrors_of(by_unknown), strict=True):
            count, k = each.equations.shape
            rest = np.zeros((count, k, k - self.unknowns))
            rest[:, self.unknowns :] = np.eye(k - self.unknowns)
            for mirror in reversed(mirrors):
                _reflect(mirror, rest)
            yield each.equations, rest

    def redundancy(
        self, by_unknown: FloatArray, weights: FloatArray, taken: FloatArray
    ) -> FloatArray:
        """Degrees of freedom (E,) of the original equations, as `by_groups` adds them up."""
        found = np.zeros(len(self.pose_of))
        unit = first = 0
        for equations, rest in self._bases(by_unknown):
            count, _, left = rest.shape
            last = first + count * left
            leverage = rest @ taken[first:last].reshape(count, left, -1)
            weight = weights[unit : unit + count, None]
            found[equations] = weight * (rest**2).sum(axis=2) - (leverage**2).sum(axis=2)
            unit, first = unit + count, last
        return found

    def by_groups(
        self,
        by_unknown: FloatArray,
        group: IntArray,
        weights: FloatArray,
        residual: FloatArray,
        taken: FloatArray,
    ) -> Shares:
        """Squared residuals and degrees of freedom of each group of the original equations.

        Parameters
        ----------
        by_unknown : ndarray (E, u)
            As for `left`.
        group : ndarray of int (E,)
            Which group each equation is of, counted from 0.
        weights : ndarray (U,)
            Of each pose with equations left.
        residual : ndarray (M,)
            What is left, weighted.
        taken : ndarray (M, r)
            Derivatives of what is left whose squares are leverages, weighted.

        Returns
        -------
        Shares
            With P = blocks of Q₂Q₂ᵀ less (Q₂ taken)(Q₂ taken)ᵀ, what takes noise to residuals.
        """
        count_of = int(group.max()) + 1
        squares, freedom = np.zeros(count_of), np.zeros(count_of)
        information = np.zeros((count_of, count_of))
        outer = np.zeros((count_of, taken.shape[1], taken.shape[1]))
        unit = first = 0
        for equations, rest in self._bases(by_unknown):
            count, _, left = rest.shape
            last = first + count * left
            mine, plain = residual[first:last].reshape(count, left, 1), rest
            leverage = rest @ taken[first:last].reshape(count, left, -1)
            weight = weights[unit : unit + count, None]
            of = group[equations]
            rest = np.sqrt(weight)[:, :, None] * rest
            blocks = rest @ rest.transpose(0, 2, 1)
            blocks_squared = blocks * (blocks - 2.0 * leverage @ leverage.transpose(0, 2, 1))
            free = np.einsum("nii->ni", blocks) - (leverage**2).sum(axis=2)
            np.add.at(squares, of, ((plain @ mine)[:, :, 0]) ** 2)
            np.add.at(freedom, of, free)
            np.add.at(information, (of[:, :, None], of[:, None, :]), blocks_squared)
            for g in range(count_of):
                rows = leverage[of == g]
                outer[g] += rows.T @ rows
            unit, first = unit + count, last
        information += np.einsum("gij,hij->gh", outer, outer)
        return Shares(squares, freedom, information)

    def best(
        self, closures: SessionClosures, machines: Machines, states: RowStates, system: System
    ) -> RowStates:
        """The states of least squares, each pose by itself.

        Levenberg's and Marquardt's steps for all poses at once, each with a damping of its own.
        Where a reading is far off, equations bend by more than Gauss's and Newton's matrix, whose
        steps then are too long or, damped, too short: poses that have not settled by it go on with
        Newton's.

        Parameters
        ----------
        closures : SessionClosures
            What the unknowns are.
        machines : Machines
            With the present numbers.
        states : RowStates
            Where to start.
        system : callable
            Whitened equations (E,) at states, and their derivative by the unknowns (E, u).

        Returns
        -------
        RowStates
            Poses that no step improves, though their gradient is not zero, have status 1.
        """
        damping = np.zeros(self.poses)
        residual, by_unknown = system(states)
        cost = self._sums(residual**2)
        rounded = _ROUNDING * _size(states) * np.sqrt(self._sums((by_unknown**2).sum(axis=1)))
        settled = np.zeros(self.poses, dtype=bool)
        for k in range(_STEPS):
            matrix, pull = self._normal(residual, by_unknown)
            if k >= _STRAIGHT:

                def pulled(by: FloatArray, at: RowStates = states) -> FloatArray:
                    return self._normal(*system(closures.moved(machines, at, by)))[1]

                _bend(matrix, pull, np.where(settled, 0.0, cost), pulled)
            if k == _STRAIGHT:
                damping[:] = 0.0
            step, gain = _steps(matrix, pull, damping)
            floor = rounded * (rounded + np.sqrt(cost))
            settled = (gain <= _SETTLED * cost + floor) | ~np.isfinite(cost)
            if settled.all():
                break
            step[settled] = 0.0
            trial = closures.moved(machines, states, step)
            residual_there, by_unknown_there = system(trial)
            cost_there = self._sums(residual_there**2)
            better = ~settled & (cost_there < cost)
            damping = np.where(better, 0.1 * damping * (damping > 1e-5), damping)
            damping = np.where(better | settled, damping, np.maximum(10.0 * damping, 1e-3))
            states = trial.chosen(better, states)
            moved = better[self.pose_of]
            np.copyto(residual, residual_there, where=moved)
            np.copyto(by_unknown, by_unknown_there, where=moved[:, None])
            np.copyto(cost, cost_there, where=better)
            if not better.any() and damping[~settled].min() > 1e8:
                break
        else:
            damping[:] = 1.0  # the gain is that of states before
        if damping.any():
            _, gain = _steps(*self._normal(residual, by_unknown), np.zeros(self.poses))
        unsolved = ~(gain <= _CLOSE * cost + floor)
        status = np.where(unsolved & (states.status == 0), 1, states.status).astype(np.int32)
        return RowStates(states.pose, states.actuators, status)

    def _sums(self, squares: FloatArray) -> FloatArray:
        sums: FloatArray = np.bincount(self.pose_of, squares, self.poses).astype(np.float64)
        return sums

    def _normal(
        self, residual: FloatArray, by_unknown: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """JᵀJ (K, u, u) and Jᵀr (K, u) of every pose."""
        u = self.unknowns
        matrix, pull = np.zeros((self.poses, u, u)), np.zeros((self.poses, u))
        for poses, equations in self._alike:
            j = by_unknown[equations]
            matrix[poses] = np.einsum("gki,gkj->gij", j, j)
            pull[poses] = np.einsum("gki,gk->gi", j, residual[equations])
        return matrix, pull


def _mirrors(columns: FloatArray) -> list[FloatArray]:
    """Householder's mirrors that take columns (G, k, u) to a triangle, one after another.

    Each is normal to a vector (G, k - j) of length √2 and acts on what is behind the first j. Own
    code, for LAPACK through NumPy forms all of Q, one pose after another: the fit of 100 000 poses
    takes twice as long.
    """
    columns, mirrors = columns.copy(), list[FloatArray]()
    for j in range(columns.shape[2]):
        mirror = columns[:, j:, j].copy()
        mirror[:, 0] += np.copysign(np.sqrt(np.einsum("gk,gk->g", mirror, mirror)), mirror[:, 0])
        square = np.einsum("gk,gk->g", mirror, mirror)
        mirror *= np.sqrt(2.0 / np.where(square == 0.0, 1.0, square))[:, None]
        mirrors.append(mirror)
        _reflect(mirror, columns)
    return mirrors


def _reflect(mirror: FloatArray, parts: FloatArray) -> None:
    """Reflect the last rows of parts (G, k, c) in mirrors (G, k - j), in place."""
    behind = parts[:, parts.shape[1] - mirror.shape[1] :]
    along = np.einsum("gk,gkc->gc", mirror, behind)
    behind -= mirror[:, :, None] * along[:, None, :]


def _bend(
    matrix: FloatArray,
    pull: FloatArray,
    cost: FloatArray,
    pulled: Callable[[FloatArray], FloatArray],
) -> None:
    """Make JᵀJ (K, u, u) the second derivatives of half the squares, of poses with a cost (K,).

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
    mine = np.flatnonzero((way > 0.0).all(axis=1) & np.isfinite(bent).all(axis=(1, 2)))
    curved, axes = np.linalg.eigh(0.5 * (bent + bent.transpose(0, 2, 1))[mine])
    matrix[mine] = (axes * np.abs(curved)[:, None]) @ axes.transpose(0, 2, 1)


def _size(states: RowStates) -> float:
    """The largest number of the poses and actuators."""
    numbers = np.abs(np.concatenate([states.pose, states.actuators], axis=1))
    return float(np.max(numbers, initial=1.0, where=np.isfinite(numbers)))


def _steps(
    matrix: FloatArray, pull: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Damped Gauss-Newton steps (K, u), and what they should take off the squares (K,)."""
    u = matrix.shape[1]
    size = np.einsum("kii->ki", matrix)
    ridge = _RIDGE * size.sum(axis=1, keepdims=True) + np.finfo(float).tiny
    damped = matrix + (damping[:, None] * size + ridge)[:, :, None] * np.eye(u)
    good = np.isfinite(damped).all(axis=(1, 2)) & np.isfinite(pull).all(axis=1)
    if not good.all():
        damped[~good], pull = np.eye(u), np.where(good[:, None], pull, np.nan)
    step = -np.linalg.solve(damped, pull[:, :, None])[:, :, 0]
    bend = np.einsum("kij,kj->ki", matrix, step)
    gain = -np.einsum("ki,ki->k", step, 2.0 * pull + bend)
    if not good.all():
        step[~good] = 0.0
    return step, gain
