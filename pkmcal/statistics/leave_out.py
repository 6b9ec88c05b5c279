"""Misfit of a linear model at each cluster of rows that it was left without.

In closed form: where a fit with the design A, AᵀA + RᵀR = 1, has the residuals r, the one without
the rows k misses (1 - A_k A_kᵀ)⁻¹ r_k there. It is exact for a linear model with a prior R.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.linear_fit import few_rows, grouped, numbered
from pkmcal.statistics.singular_values import svd

_DETERMINED = 1e-9  # share of the largest singular value: below it a combination is not
_ALONE = 1e-9  # what a cluster leaves of itself where it alone decides a combination


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A linear model y = J x with each cluster left out in turn.

    Attributes
    ----------
    missed : ndarray (M,)
        What is missed of each row by the fit without its cluster; NaN where the others do not
        determine what it depends on.
    without : ndarray (K, n)
        x as found without each cluster; along what is not determined it is 0.
    found : ndarray (n,)
        x as found from all rows.
    deviation : float
        Of the whitened residuals of the fit to all rows; NaN where no freedom is left.
    """

    missed: FloatArray
    without: FloatArray
    found: FloatArray
    deviation: float


def leave_out(
    jacobian: FloatArray,
    values: FloatArray,
    prior: FloatArray,
    known: FloatArray,
    cluster: IntArray,
) -> LeftOut:
    """Fit y = J x with each cluster left out.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        Whitened.
    values : ndarray (M,)
        Whitened.
    prior : ndarray (q, n)
        Rows of what is known of x, in units of its deviation.
    known : ndarray (q,)
        What they should be.
    cluster : ndarray of int (M,)
        Which rows are left out together.

    Examples
    --------
    >>> x = np.array([1.0, 2.0, 6.0])
    >>> none = np.zeros((0, 1))
    >>> leave_out(np.ones((3, 1)), x, none, none[:, 0], np.arange(3)).missed
    array([-3. , -1.5,  4.5])
    """
    count, n = jacobian.shape
    key = numbered(cluster)
    _, singular, turned = svd(few_rows(jacobian, prior))
    keep = singular > _DETERMINED * singular.max(initial=0.0)
    back = turned[keep].T / singular[keep]
    design = jacobian @ back
    found = design.T @ values + (prior @ back).T @ known
    left = values - design @ found
    missed, without = np.empty(count), np.empty((int(key.max()) + 1, n))
    for lot in grouped(key):
        for k in np.unique(key[lot]).tolist():
            rows = lot[key[lot] == k]
            axes, size, _ = svd(design[rows])
            alone = 1.0 - size**2 <= _ALONE
            share = np.where(alone, 0.0, size**2 / np.where(alone, 1.0, 1.0 - size**2))
            part = left[rows] + axes @ (share * (axes.T @ left[rows]))
            missed[rows] = np.nan if alone.any() else part
            without[k] = back @ (found - design[rows].T @ part)
    freedom = count - float((design**2).sum())
    deviation = float(np.sqrt(left @ left / freedom)) if freedom >= 1.0 else float("nan")
    return LeftOut(missed, without, back @ found, deviation)
