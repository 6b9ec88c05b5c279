"""Check whether numbers that a fit held would explain its residuals: a score test by clusters.

Rao's test needs no other fit: the residuals are regressed on the part of the held numbers' columns
that the parameters cannot take up. Errors that the equations of a cluster share count by the
sandwich of `clusters`, as Hotelling's T² with Pustejovsky and Tipton's degrees of freedom. An F
test as if they shared none needs sums over the equations alone, and says first which columns are
worth more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.statistics.clusters import Sandwich
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit

_SHARED = 1e-3  # chance by errors that clusters share, from which on a jump is not told
LEFT = 1e-6  # share of a column that must be left beside others, for it to say anything of its own

# Derivatives of the predicted values to held numbers, whitened: equations in their order, and their
# rows (b, d). They are made anew for each pass: all at once may be larger than the design. Numbers
# that cannot be have none.
Columns = Callable[[], Iterator[tuple[slice, FloatArray]]]


def columns_of(matrix: FloatArray) -> Columns:
    """Columns that there are already, (M, d)."""
    return lambda: ((rows, matrix[rows]) for rows in lots(len(matrix)))


@dataclass(frozen=True, eq=False)
class Score:
    """The score of held numbers.

    Attributes
    ----------
    size, deviation : ndarray (d,)
        What the numbers would be off by, parameters found with them, and standard deviations.
    chance : float
        How likely as much would be explained if they were right.
    explained : ndarray (M,)
        What of the residuals they would explain.
    drop : float
        Sum of its squares.
    """

    size: FloatArray
    deviation: FloatArray
    chance: float
    explained: FloatArray
    drop: float


@dataclass(frozen=True, eq=False)
class Beside:
    """Columns as they are beside the parameters of a fit.

    Attributes
    ----------
    fit : LinearFit
        The fit.
    columns : Columns
        The columns.
    by_basis : ndarray (p, d)
        What they have in common with the basis of the fit.
    half : ndarray (d, k)
        Their combinations that the parameters cannot take up, of length 1 beside these.
    along : ndarray (k,)
        What these have in common with the residuals.
    """

    fit: LinearFit
    columns: Columns
    by_basis: FloatArray
    half: FloatArray
    along: FloatArray

    @property
    def drop(self) -> float:
        """Sum of squares that they explain."""
        return float(self.along @ self.along)

    @property
    def chance(self) -> float:
        """Chance of explaining as much if errors were independent; 1 if no numbers are left."""
        k, drop = len(self.along), self.drop
        rest = self.fit.freedom - k
        if not k or rest < 1.0:
            return 1.0
        over = max(self.fit.squares - drop, 0.0) / rest
        return f_tail(min(drop / k / over, 1e300), k, rest) if over > 0.0 else 1.0

    @cached_property
    def own(self) -> FloatArray:
        """The combinations without what the parameters take up, (M, k)."""
        found = np.empty((len(self.fit.residual), self.half.shape[1]))
        taken = self.by_basis @ self.half
        for rows, some in self.columns():
            found[rows] = some @ self.half - self.fit.design[rows] @ taken
        return found

    def score(self) -> Score | None:
        """The test by clusters; None where too little is left."""
        k, fit, along = len(self.along), self.fit, self.along
        if not k or fit.freedom - k < 1:
            return None
        explained = self.own @ along
        sandwich = Sandwich(replace(fit, residual=fit.residual - explained), self.own)
        p = fit.design.shape[1]
        prior = -fit.prior @ self.by_basis @ self.half
        matrix = sandwich.data[p:, p:] + prior.T @ prior
        freedom = sandwich.joint_freedom(np.eye(p + k)[p:]) - k + 1.0
        size, axes = np.linalg.eigh(matrix)
        if freedom < 1.0 or not size[0] > 0:
            return None
        ratio = float(((axes.T @ along) ** 2 / size).sum()) * freedom / (freedom + k - 1.0) / k
        return Score(
            size=self.half @ along,
            deviation=np.sqrt(np.einsum("ij,jk,ik->i", self.half, matrix, self.half)),
            chance=f_tail(min(ratio, 1e300), k, freedom),
            explained=explained,
            drop=self.drop,
        )


def beside(fit: LinearFit, columns: Columns) -> Beside | None:
    """Find what columns are beside a fit; None where there are none, or all of them are 0."""
    sums = [
        (some.T @ some, fit.design[rows].T @ some, some.T @ fit.residual[rows])
        for rows, some in columns()
    ]
    if not sums:
        return None
    square, by_basis, pulls = (sum(parts[1:], parts[0]) for parts in zip(*sums, strict=True))
    return _of_sums(fit, columns, square, by_basis, pulls)


def _of_sums(
    fit: LinearFit, columns: Columns, square: FloatArray, by_basis: FloatArray, pulls: FloatArray
) -> Beside | None:
    """Find `beside` by what columns C have with themselves, with the basis and with residuals."""
    size = np.sqrt(np.diag(square))
    known = size > 0.0
    if not known.any():
        return None
    unit = np.diag(1.0 / np.where(known, size, 1.0))[:, known]
    inner = by_basis @ unit
    values, ways = np.linalg.eigh(unit.T @ square @ unit - inner.T @ inner)
    new = values > LEFT
    half = unit @ (ways[:, new] / np.sqrt(values[new]))
    return Beside(fit, columns, by_basis, half, half.T @ pulls)


@dataclass(frozen=True, eq=False)
class Jump:
    """Numbers that have become others in the course of measuring.

    Attributes
    ----------
    at : int
        The first visit at which they are.
    size : ndarray (d,)
        By how much.
    chance : float
        How likely as much would be explained if they were always the same, times the number of
        visits at which it was looked for; 1 where errors that clusters share may explain it.
    """

    at: int
    size: FloatArray
    chance: float


def jump(fit: LinearFit, columns: FloatArray, visit: IntArray, fewest: int) -> Jump | None:
    """Find from which visit on other numbers explain most; None where nothing can be told.

    Errors count as independent; what is found by them has to stand against those that clusters
    share, too: corners of a tag that are off together look like a jump to many equations.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : ndarray (M, d)
        Derivatives of the predicted values to the numbers, whitened.
    visit : ndarray of int (M,)
        In which visit each equation was read, from 0 in the order of measuring.
    fewest : int
        Visits before and after.

    Examples
    --------
    >>> from pkmcal.statistics.linear_fit import linear_fit
    >>> rows = np.arange(12)
    >>> y = np.where(rows < 7, 0.0, 2.0) + 0.01 * (-1.0) ** rows
    >>> one = np.ones((12, 1))
    >>> fit = linear_fit(one, y - y.mean(), np.zeros((0, 1)), np.eye(1), rows, 0 * rows)
    >>> found = jump(fit, one, rows, 2)
    >>> found.at, round(float(found.size[0]), 2), found.chance < 1e-9
    (7, 2.0, True)
    """
    order = np.argsort(visit, kind="stable")
    visits = int(visit.max(initial=-1)) + 1
    ends = np.searchsorted(visit[order], np.arange(visits + 1))
    parts = [order[a:b] for a, b in pairwise(ends)]
    sums = [
        np.cumsum(np.array([one[rows].T @ other[rows] for rows in parts])[::-1], axis=0)[::-1]
        for one, other in (
            (columns, columns), (fit.design, columns), (columns, fit.residual),
        )
    ]  # fmt: skip
    tried = dict[int, Beside]()
    for at in range(fewest, visits - fewest + 1):
        found = _of_sums(fit, columns_of(columns), *(each[at] for each in sums))
        if found is not None and len(found.along):
            tried[at] = found
    if not tried:
        return None
    at = min(tried, key=lambda each: (tried[each].chance, -tried[each].drop))
    best = tried[at]
    own = columns_of(np.where((visit >= at)[:, None], columns, 0.0))
    stands = _by_clusters(replace(best, columns=own), min(at, visits - at)) < _SHARED
    return Jump(at, best.half @ best.along, min(1.0, len(tried) * best.chance) if stands else 1.0)


def _by_clusters(jump: Beside, fewer: int) -> float:
    """Chance of what a jump explains, by the variance that clusters show, mean over its numbers.

    Their whole covariance, as `Beside.score` has it, is not told by the few visits beside a jump.
    """
    k, fit = len(jump.along), jump.fit
    left = replace(fit, residual=fit.residual - jump.own @ jump.along)
    p = fit.design.shape[1]
    variance = float(np.trace(Sandwich(left, jump.own).data[p:, p:])) / k
    if not variance > 0.0 or fewer < 2:
        return 1.0
    return f_tail(min(jump.drop / k / variance, 1e300), k, k * (fewer - 1))


def score_test(fit: LinearFit, columns: Columns) -> Score | None:
    """Test numbers that were held.

    None where parameters take up all of them, or too little is left.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : Columns
        Of the numbers.

    Examples
    --------
    >>> from pkmcal.statistics.linear_fit import linear_fit
    >>> rows = np.arange(8)
    >>> noise = np.array([1, -1, -1, 1, 1, -1, -1, 1])
    >>> y = 0.5 * rows + 0.01 * noise
    >>> fit = linear_fit(np.ones((8, 1)), y - y.mean(), np.zeros((0, 1)), np.eye(1), rows, 0 * rows)
    >>> found = score_test(fit, columns_of(rows[:, None].astype(float)))
    >>> round(float(found.size[0]), 3), found.chance < 1e-6
    (0.5, True)
    """
    tested = beside(fit, columns)
    return None if tested is None else tested.score()
