"""Tails and quantiles, from `scipy.special`: `scipy.stats` takes longer to import than a fit.

Degrees of freedom need not be whole and may be infinite.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray

_MANY = 1e9  # degrees of freedom, beyond which a distribution is its limit


def t_factor(freedom: FloatArray) -> FloatArray:
    """Half width of the 95 % interval in standard deviations, (n,); inf without freedom.

    Examples
    --------
    >>> t_factor(np.array([0.0, 1.0, 10.0, np.inf])).round(2)
    array([  inf, 12.71,  2.23,  1.96])
    """
    from scipy.special import stdtrit

    known = freedom > 0
    usable = np.where(known, np.minimum(freedom, _MANY), 1.0)
    factor: FloatArray = np.where(known, stdtrit(usable, 0.975), np.inf)
    return factor


def deviation_interval(freedom: float) -> tuple[float, float]:
    """Return 95 % bounds of a true deviation, in multiples of the estimated one.

    Examples
    --------
    >>> low, high = deviation_interval(1.0)
    >>> round(low, 2), round(high, 1)
    (0.45, 31.9)
    """
    from scipy.special import chdtri

    return tuple(float(np.sqrt(freedom / chdtri(freedom, p))) for p in (0.025, 0.975))  # type: ignore[return-value]


def t_tail(value: float, freedom: float) -> float:
    """Chance of a t variable further from zero on either side."""
    from scipy.special import stdtr

    return float(2.0 * stdtr(min(freedom, _MANY), -abs(value)))


def f_tail(ratio: float, first: float, second: float) -> float:
    """Chance of a larger ratio of mean squares; NaN without freedom."""
    from scipy.special import fdtrc

    if not (first > 0 and second > 0 and np.isfinite(ratio)):
        return float("nan")
    return float(fdtrc(min(first, _MANY), min(second, _MANY), ratio))


def f_limit(chance: float, first: float, second: float) -> float:
    """Ratio of mean squares that is exceeded with this chance; NaN without freedom.

    Examples
    --------
    >>> round(f_limit(0.05, 2.0, 10.0), 2)
    4.1
    """
    from scipy.special import fdtri

    if not (first > 0 and second > 0):
        return float("nan")
    return float(fdtri(min(first, _MANY), min(second, _MANY), 1.0 - chance))


def chi2_tail(squares: float, freedom: float) -> float:
    """Chance of a larger sum of squares; NaN without freedom."""
    from scipy.special import gammaincc

    return float(gammaincc(freedom / 2.0, squares / 2.0)) if freedom > 0 else float("nan")
