"""Whether two groups of equations have different parameters.

The F test of G. C. Chow, Tests of equality between sets of coefficients in two linear regressions,
Econometrica 28 (1960): parameters of its own for one group explain more of the residuals than
chance, where the groups are of two machines. With independent Gaussian errors it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import column_basis
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


def group_test(design: FloatArray, residual: FloatArray, mine: BoolArray) -> Groups | None:
    """Test a group against the others; None where too few equations are left to say.

    Parameters
    ----------
    design : ndarray (M, p)
        By the common parameters.
    residual : ndarray (M,)
        All of equal variance.
    mine : ndarray of bool (M,)
        Which equations are of the group.

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
    freedom = len(residual) - common.shape[1] - k
    if not k or freedom < LEAST:
        return None
    along = basis.T @ left
    explained, whole = float(along @ along), float(left @ left)
    rest = (whole - explained) / freedom
    if not rest > 0.0:
        return None
    ratio = min(explained / k / rest, 1e300)
    return Groups(f_tail(ratio, k, freedom), float(np.sqrt(rest / (whole / (freedom + k)))))
