"""Noise of a least-squares fit beside that of a robust one: rows that carry the fit.

The robust fit is that of the linear model at the solution, reweighted by the Cauchy loss; it costs
no evaluation of the machine.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots

_LIMIT = 2.385  # of the Cauchy loss: 95 % as efficient as least squares for Gaussian noise
_ROUNDS, _SETTLED = 60, 1e-4
_LEAST_FREEDOM = 5  # below, some rows are always met
_DRAWS = 100
_RIDGE = 1e-12  # of a normal matrix that is 1 where all rows have full weight
_ENOUGH = 100.0  # rows' worth of spare equations from which chance no longer moves a ratio much
MET = 1e-6  # share of a scale or largest residual below which an equation is met exactly


def median_ratio(squares: FloatArray, components: IntArray) -> float:
    """Variance that squared lengths of rows show by their median: 1 if they are chi squared."""
    return float(np.median(squares / _medians(components)))


def _medians(components: IntArray) -> FloatArray:
    """Medians of chi squared variables with so many degrees of freedom."""
    from scipy.special import gammaincinv

    medians: FloatArray = 2 * gammaincinv(np.arange(int(components.max()) + 1) / 2, 0.5)
    return medians[components]


def robust_ratio(design: FloatArray, residual: FloatArray, components: IntArray) -> float:
    """Noise of the least-squares fit over that of the robust one; NaN with few equations.

    Parameters
    ----------
    design : ndarray (M, p)
        Orthonormal columns; see `LinearFit`.
    residual : ndarray (M,)
        Of the least-squares fit.
    components : ndarray of int (N,)
        Equations of each row.
    """
    m, p = design.shape
    if m - p < _LEAST_FREEDOM:
        return float("nan")
    first = np.cumsum(components) - components
    factor, medians = m / (m - p), _medians(components)
    left = residual
    scale = first_scale = np.inf
    for _ in range(_ROUNDS):
        squares = np.add.reduceat(left**2, first)
        revised = np.sqrt(np.median(squares / medians) * factor)
        if np.isinf(first_scale):
            first_scale = revised
        if not revised > MET * first_scale or abs(revised / scale - 1.0) < _SETTLED:
            break
        scale = revised
        weights = np.repeat(1.0 / (1.0 + squares / (scale * _LIMIT) ** 2 / components), components)
        # the ridge is for directions that rows without weight alone determined
        normal, pull = _RIDGE * np.eye(p), np.zeros(p)
        for rows in lots(m):
            weighted = design[rows] * weights[rows, None]
            normal += weighted.T @ design[rows]
            pull += weighted.T @ residual[rows]
        left = residual - design @ np.linalg.solve(normal, pull)
    return float(np.sqrt(residual @ residual / (m - p)) / scale)


def ratio_by_chance(design: FloatArray, components: IntArray) -> float:
    """The largest `robust_ratio` of 100 draws of equal independent errors, which no row carries.

    The median of few rows says little, and a robust fit meets some of them exactly: how far chance
    goes depends on the design. 1 where spare equations are many.
    """
    m, p = design.shape
    if (m - p) ** 2 / m > _ENOUGH:
        return 1.0
    rng = np.random.default_rng(0)
    errors = rng.normal(size=(_DRAWS, m))
    left = errors - (errors @ design) @ design.T
    return float(np.nanmax([robust_ratio(design, each, components) for each in left]))
