"""Check whether two groups of equations have different parameters.

The F test of G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
Econometrica 28 (1960): parameters of its own for one group explain more of the residuals than
chance, where the groups are of two machines. With independent Gaussian errors it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import column_basis, grouped, means, orthonormal, triangle
from pkmcal.statistics.singular_values import svd

LEAST = 5  # degrees of freedom beside both groups' parameters
_LEAST_NOISE = 10  # degrees of freedom from which equations show a noise of their own
_SOME = 1e-9  # of a column's length that is more than rounding
_ONE_SIDED = 0.3  # of a column's length, below which one of the groups says little of it
_NEW = 1e-3  # of a column's length that the common parameters must leave of it


@dataclass(frozen=True)
class Groups:
    """Two groups' difference.

    Attributes
    ----------
    chance : float
        How likely a difference as large would be if they were alike.
    apart : float
        Standard deviation of the residuals if each group has its own parameters, over that with
        common ones.
    ratio : float
        Squares of what the parameters of the groups differ by, over what noise lets expect.
    """

    chance: float
    apart: float
    ratio: float


@dataclass(frozen=True, eq=False)
class FewEquations:
    """Equations that stand for more: every fit of whole cells has the same sums of squares.

    Attributes
    ----------
    design, residual : ndarray (m, p), (m,)
        At most p + 1 of each cell.
    cell : ndarray of int (m,)
        Of each.
    counts : ndarray of int (cells,)
        For how many they stand, of each cell.
    reach : ndarray (n, p)
        Numbers of a machine by parameters, in units of what they may differ by at most.
    """

    design: FloatArray
    residual: FloatArray
    cell: IntArray
    counts: IntArray
    reach: FloatArray

    def tested(self, mine: BoolArray) -> Groups | None:
        """Test a group against the others, each by the noise that it has beside own parameters.

        Weights that were found with common parameters may hide a group of another machine: what
        these miss of it is then its noise. The test is that of S. Johansen, The Welch-James
        approximation to the distribution of the residual sum of squares in a weighted linear
        regression, Biometrika 67 (1980). Where a group is too small to show its noise, both have
        one, and the test is `group_test`. Directions that `within_reach` leaves out are not tested.

        Parameters
        ----------
        mine : ndarray of bool (m,)
            Which of these equations are of the group, by whole cells.
        """
        if not mine.any() or mine.all():
            return None
        reached = within_reach(self.design, self.residual, mine, self.reach)
        noise, freedoms = np.ones(len(mine)), []
        for group in (mine, ~mine):
            basis, values = column_basis(reached[group]), self.residual[group]
            left = values - basis @ (basis.T @ values)
            squares = float(left @ left)
            freedom = int(self.counts[np.unique(self.cell[group])].sum()) - basis.shape[1]
            if freedom < _LEAST_NOISE or not squares > 0.0:
                return group_test(reached, self.residual, mine, int(self.counts.sum()))
            noise[group] = np.sqrt(squares / freedom)
            freedoms.append(freedom)
        design, residual = reached / noise[:, None], self.residual / noise
        plain = group_test(design, residual, mine, int(self.counts.sum()))
        return None if plain is None else _by_own_noise(design, residual, mine, freedoms, plain)


def _by_own_noise(
    design: FloatArray, residual: FloatArray, mine: BoolArray, freedoms: list[int], plain: Groups
) -> Groups:
    """The test of equations in units of a noise that was found with so many degrees of freedom."""
    common = column_basis(design)
    share, ways = np.linalg.eigh(common[mine].T @ common[mine])
    told = 4.0 * share * (1.0 - share) > _NEW**2  # what both groups say something of
    share, ways = np.clip(share[told], 0.0, 1.0), (common @ ways)[:, told]
    along = (ways[mine].T @ residual[mine]) / np.sqrt(share * (1.0 - share))
    along -= np.sqrt(share / (1.0 - share)) * (ways.T @ residual)
    k, spread = len(share), 0.0
    for other, freedom in zip((1.0 - share, share), freedoms, strict=True):
        spread += float((other**2).sum() + other.sum() ** 2) / (2.0 * freedom)
    ratio = float(along @ along) / (k + 2.0 * spread - 6.0 * spread / (k + 2.0))
    chance = f_tail(min(ratio, 1e300), k, k * (k + 2.0) / (3.0 * spread))
    return replace(plain, chance=chance, ratio=ratio)


def few_equations(
    design: FloatArray,
    residual: FloatArray,
    use: IntArray,
    key: IntArray,
    cell: IntArray,
    reach: FloatArray,
) -> FewEquations:
    """Average the equations that have the same key, and reduce each cell to its triangular factor.

    Parameters
    ----------
    design, residual : ndarray (M, p), (M,)
        All of equal variance.
    use : ndarray of int (u,)
        Which of them are used.
    key : ndarray of int (u,)
        Of each of these; those of one key are of one cell.
    cell : ndarray of int (M,)
        By number, from 0.
    reach : ndarray (n, p)
        See `FewEquations`.
    """
    nothing, factors = np.zeros((0, design.shape[1] + 1)), dict[int, FloatArray]()
    counts = np.zeros(int(cell.max()) + 1, dtype=np.intp)
    for lot in grouped(key):
        _, first, own = np.unique(key[lot], return_index=True, return_inverse=True)
        rows = use[lot]
        averaged = means(np.column_stack([design[rows], residual[rows]]), own)
        cell_of = cell[rows[first]]
        counts += np.bincount(cell_of, minlength=len(counts))
        for k in np.unique(cell_of).tolist():
            factors[k] = triangle(factors.get(k, nothing), averaged[cell_of == k])
    cells = sorted(factors)
    whole = np.concatenate([nothing, *(factors[k] for k in cells)])
    of_cell = np.array(cells, dtype=np.intp).repeat([len(factors[k]) for k in cells])
    return FewEquations(whole[:, :-1], whole[:, -1], of_cell, counts, reach)


def within_reach(
    design: FloatArray, residual: FloatArray, mine: BoolArray, reach: FloatArray
) -> FloatArray:
    """The design (M, k) without directions in which groups would differ more than machines do.

    Where a direction changes the equations of a group by no more than their residuals, as touches
    of one place change by the size of the machine, the group does not determine it: numbers of its
    own then take its noise, whatever it is, with a machine that is shrunk to nothing.

    Parameters
    ----------
    design, residual, mine
        As of `group_test`.
    reach : ndarray (n, p)
        As of `FewEquations`.

    Examples
    --------
    >>> design, far = np.array([[1.0, 0], [1, 0], [0, 1e3], [0, 1]]), np.diag([0.1, 0.1])
    >>> mine = np.array([True, False, False, True])
    >>> within_reach(design, np.array([1.0, -1, -0.1, 100]), mine, far).shape
    (4, 1)
    """
    turn = orthonormal(design)
    common = design @ turn
    _, along, sizes, ways = _own(common, residual, mine)
    told = sizes > _SOME
    apart = 2.0 * (along[told] / sizes[told]) * (reach @ turn @ ways[told].T)
    near = (np.linalg.norm(apart, axis=0) <= 1.0) | (sizes[told] > _ONE_SIDED)
    return design if near.all() else common @ np.vstack([ways[told][near], ways[~told]]).T


def group_test(
    design: FloatArray, residual: FloatArray, mine: BoolArray, count: int | None = None
) -> Groups | None:
    """Test a group against the others; None where too few equations are left to say.

    Parameters
    ----------
    design : ndarray (M, p)
        By the common parameters.
    residual : ndarray (M,)
        All of equal variance.
    mine : ndarray of bool (M,)
        Which equations are of the group.
    count : int, optional
        For how many equations these stand. None: for themselves.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> one, noise, turns = np.ones((30, 1)), rng.normal(size=30), np.arange(30) % 2 == 0
    >>> group_test(one, noise, turns).chance > 0.05
    True
    >>> group_test(one, noise + 5.0 * turns, turns).chance < 1e-6
    True
    """
    if not mine.any() or mine.all():
        return None
    common = column_basis(design)
    left, along, sizes, _ = _own(common, residual, mine)
    along = along[sizes > _NEW]
    k = len(along)
    freedom = (len(residual) if count is None else count) - common.shape[1] - k
    if not k or freedom < LEAST:
        return None
    explained, whole = float(along @ along), float(left @ left)
    rest = (whole - explained) / freedom
    if not rest > 0.0:
        return None
    ratio = min(explained / k / rest, 1e300)
    apart = float(np.sqrt(rest / (whole / (freedom + k))))
    return Groups(f_tail(ratio, k, freedom), apart, ratio)


def _own(common: FloatArray, residual: FloatArray, mine: BoolArray) -> tuple[FloatArray, ...]:
    """Explain a group by its own numbers beside the basis `common` (M, k).

    Returns
    -------
    left : ndarray (M,)
        Residuals that common numbers leave.
    along : ndarray (k,)
        These along an orthonormal basis of what is explained.
    sizes, ways : ndarray (k,), (k, k)
        Of the columns that it is the basis of, and their combinations in rows.
    """
    left = residual - common @ (common.T @ residual)
    own = common * np.where(mine, 1.0, -1.0)[:, None]
    basis, sizes, ways = svd(own - common @ (common.T @ own))
    return left, basis.T @ left, sizes, ways
