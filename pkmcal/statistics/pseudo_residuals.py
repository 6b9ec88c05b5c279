"""Pseudo-residuals: what a robust fit has in place of residuals in formulas of least squares.

With ψ(r) = w r of a row of k whitened residuals, and its mean slope δ, the robust estimate is to
first order the least-squares estimate of data whose residuals are r* = K ψ/δ; K corrects the slope
for the parameters (P. J. Huber, Robust Statistics, Wiley 1981; J. O. Street, R. J. Carroll and D.
Ruppert, A note on computing robust regression estimates via iteratively reweighted least squares,
The American Statistician 42 (1988)). The design stays unweighted.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, IntArray


def pseudo_residuals(
    residual: FloatArray,
    components: IntArray,
    weights: FloatArray,
    decline: FloatArray,
    parameters: int,
) -> tuple[FloatArray, float, float]:
    """Compute residuals that robust standard errors are made of, one loss and scale for all.

    Parameters
    ----------
    residual : ndarray (M,)
        Whitened, row by row.
    components : ndarray of int (N,)
        Equations of each row.
    weights, decline : ndarray (N,)
        w of each row and s ∂w/∂s, s the length of its residual.
    parameters : int
        How many were fitted.

    Returns
    -------
    residual : ndarray (M,)
        r*, whitened.
    slope, correction : float
        δ and K; 1 where no row is down-weighted.
    """
    slopes = weights + decline / components
    slope = float(np.average(slopes, weights=components))
    spread = float(np.average((slopes - slope) ** 2, weights=components))
    correction = 1.0 + parameters / len(residual) * spread / slope**2
    factor = np.repeat(correction * weights / slope, components)
    return factor * residual, slope, correction
