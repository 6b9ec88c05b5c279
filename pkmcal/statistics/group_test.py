"""Whether two groups of equations have different parameters.

The F test of G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
Econometrica 28 (1960): parameters of its own for one group explain more of the residuals than
chance, where the groups are of two machines. With independent Gaussian errors it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import column_basis, grouped, means, triangle
from pkmcal.statistics.singular_values import svd

LEAST = 5  # degrees of freedom beside both groups' parameters
_NEW = 1e-3  # of a column's length that the common parameters must leave of it


@dataclass(frozen=True)
class Groups:
    """How unlike two groups are.

    Attributes
    ----------
    chance : float
        How likely a difference as large would be if they were alike.
    apart : float
        Standard deviation of the residuals if each group has its own parameters, over that with
        common ones.
    """

    chance: float
    apart: float


@dataclass(frozen=True, eq=False)
class FewEquations:
    """Equations that stand for more: every fit of whole cells has the same sums of squares.

    Attributes
    ----------
    design, residual : ndarray (m, p), (m,)
        At most p + 1 of each cell.
    cell : ndarray of int (m,)
        Of each.
    count : int
        For how many they stand.
    """

    design: FloatArray
    residual: FloatArray
    cell: IntArray
    count: int


def few_equations(
    design: FloatArray, residual: FloatArray, use: IntArray, key: IntArray, cell: IntArray
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
    """
    width = design.shape[1] + 1
    factors: list[FloatArray] = [np.zeros((0, width)) for _ in range(int(cell.max()) + 1)]
    count = 0
    for lot in grouped(key):
        _, first, own = np.unique(key[lot], return_index=True, return_inverse=True)
        rows = use[lot]
        averaged = means(np.column_stack([design[rows], residual[rows]]), own)
        cell_of, count = cell[rows[first]], count + len(first)
        for k in np.unique(cell_of):
            factors[k] = triangle(factors[k], averaged[cell_of == k])
    whole, number = np.concatenate(factors), np.arange(len(factors))
    return FewEquations(whole[:, :-1], whole[:, -1], number.repeat([*map(len, factors)]), count)


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
        For how many equations these stand, if they are `few_equations`. None: for themselves.

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
    left = residual - common @ (common.T @ residual)
    own = common * np.where(mine, 1.0, -1.0)[:, None]
    own -= common @ (common.T @ own)
    basis, sizes, _ = svd(own)
    basis = basis[:, sizes > _NEW]
    k = basis.shape[1]
    freedom = (len(residual) if count is None else count) - common.shape[1] - k
    if not k or freedom < LEAST:
        return None
    along = basis.T @ left
    explained, whole = float(along @ along), float(left @ left)
    rest = (whole - explained) / freedom
    if not rest > 0.0:
        return None
    ratio = min(explained / k / rest, 1e300)
    return Groups(f_tail(ratio, k, freedom), float(np.sqrt(rest / (whole / (freedom + k)))))
