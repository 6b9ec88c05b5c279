"""Whether numbers that a fit held would explain what it leaves: a score test by clusters.

Rao's test needs no other fit: what is left is regressed on the part of the held numbers' columns
that the parameters cannot take up. Errors that the equations of a cluster share count by the
sandwich of `clusters`, as Hotelling's T² with Pustejovsky and Tipton's degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.statistics.clusters import Sandwich
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit

_SAME = 1e-6  # share of a column that must be left beside the parameters


@dataclass(frozen=True, eq=False)
class Score:
    """What held numbers would explain.

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


def score_test(fit: LinearFit, columns: FloatArray) -> Score | None:
    """Test numbers that were held.

    None where parameters take up all of them, or too little is left.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : ndarray (M, d)
        Derivative of the predicted values to the held numbers, whitened.

    Examples
    --------
    >>> from pkmcal.statistics.linear_fit import linear_fit
    >>> rows = np.arange(8)
    >>> noise = np.array([1, -1, -1, 1, 1, -1, -1, 1])
    >>> y = 0.5 * rows + 0.01 * noise
    >>> fit = linear_fit(np.ones((8, 1)), y - y.mean(), np.zeros((0, 1)), np.eye(1), rows, 0 * rows)
    >>> found = score_test(fit, rows[:, None].astype(float))
    >>> round(float(found.size[0]), 3), found.chance < 1e-6
    (0.5, True)
    """
    p = fit.design.shape[1]
    by_basis = fit.design.T @ columns
    values, ways = np.linalg.eigh(columns.T @ columns - by_basis.T @ by_basis)
    new = values > _SAME * float((columns**2).sum(axis=0).max())
    half = ways[:, new] / np.sqrt(values[new])
    k = half.shape[1]
    if not k or fit.freedom - k < 1:
        return None
    own = (columns - fit.design @ by_basis) @ half
    along = half.T @ (columns.T @ fit.residual)
    explained = own @ along
    wider = LinearFit(
        design=np.hstack([fit.design, own]),
        residual=fit.residual - explained,
        prior=np.hstack([fit.prior, -fit.prior @ by_basis @ half]),
        back=np.eye(p + k),
        cluster=fit.cluster,
        component=fit.component,
    )
    contrasts = np.eye(p + k)[p:]
    sandwich = Sandwich(wider)
    matrix = (sandwich.data + wider.prior.T @ wider.prior)[p:, p:]
    freedom = sandwich.joint_freedom(contrasts) - k + 1.0
    size, axes = np.linalg.eigh(matrix)
    if freedom < 1.0 or not size[0] > 0:
        return None
    ratio = float(((axes.T @ along) ** 2 / size).sum()) * freedom / (freedom + k - 1.0) / k
    return Score(
        size=half @ along,
        deviation=np.sqrt(np.einsum("ij,jk,ik->i", half, matrix, half)),
        chance=f_tail(min(ratio, 1e300), k, freedom),
        explained=explained,
        drop=float(along @ along),
    )
