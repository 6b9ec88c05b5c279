"""Tails and quantiles, from `scipy.special`: `scipy.stats` takes longer to import than a fit.

Degrees of freedom need not be whole and may be infinite.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray

_QUANTILES = (np.arange(512) + 0.5) / 512.0
FEW = 10.0  # degrees of freedom below which a scatter, and tests by it, say too little
MANY = 1e9  # degrees of freedom, beyond which a distribution is its limit


def t_factor(freedom: FloatArray) -> FloatArray:
    """Half width of the 95 % interval in standard deviations, (n,); inf without freedom.

    Examples
    --------
    >>> t_factor(np.array([0.0, 1.0, 10.0, np.inf])).round(2)
    array([  inf, 12.71,  2.23,  1.96])
    """
    from scipy.special import stdtrit

    known = freedom > 0
    usable = np.where(known, np.minimum(freedom, MANY), 1.0)
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

    return float(2.0 * stdtr(min(freedom, MANY), -abs(value)))


def f_tail(ratio: float, first: float, second: float) -> float:
    """Chance of a larger ratio of mean squares; NaN without freedom."""
    from scipy.special import fdtrc

    if not (first > 0 and second > 0 and np.isfinite(ratio)):
        return float("nan")
    return float(fdtrc(min(first, MANY), min(second, MANY), ratio))


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
    return float(fdtri(min(first, MANY), min(second, MANY), 1.0 - chance))


def skew_f_tail(ratio: float, first: float, second: float, skewness: float) -> float:
    """`f_tail` where the first mean square is more skew than of a chi-square variable.

    It is that variable with `skewness` degrees of freedom, shifted and scaled to the variance of
    one with `first`. Not less than `f_tail`.

    Examples
    --------
    >>> round(skew_f_tail(2.5, 12.0, 50.0, 12.0), 4), round(f_tail(2.5, 12.0, 50.0), 4)
    (0.0118, 0.0118)
    >>> round(skew_f_tail(2.5, 12.0, 50.0, 2.0), 4)
    0.0178
    """
    from scipy.special import gammaincc, gammaincinv

    plain = f_tail(ratio, first, second)
    if not (np.isfinite(plain) and 0.0 < skewness < first):
        return plain
    noise = np.ones(1)
    if second < MANY:
        noise = 2.0 * gammaincinv(second / 2.0, _QUANTILES) / second
    least = skewness + np.sqrt(skewness * first) * (ratio * noise - 1.0)
    return max(plain, float(gammaincc(skewness / 2.0, np.maximum(least, 0.0) / 2.0).mean()))


def chi2_tail(squares: float, freedom: float) -> float:
    """Chance of a larger sum of squares; NaN without freedom."""
    from scipy.special import gammaincc

    return float(gammaincc(freedom / 2.0, squares / 2.0)) if freedom > 0 else float("nan")


def chi2_limit(chance: float, freedom: float) -> float:
    """Sum of squares that is exceeded with this chance.

    Examples
    --------
    >>> round(chi2_limit(0.05, 2.0), 2)
    5.99
    """
    from scipy.special import chdtri

    return float(chdtri(freedom, chance))
