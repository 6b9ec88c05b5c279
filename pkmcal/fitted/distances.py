"""Distances of measured from predicted points, in short: rms, median and 95 % quantile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, rms


@dataclass(frozen=True)
class Distances:
    """Distances of the points that were reached, mm; NaN without any.

    Attributes
    ----------
    rms, median, quantile95 : float
        Of all.
    rms_without_outliers : float
        Of those that are no outliers.
    """

    rms: float = float("nan")
    median: float = float("nan")
    quantile95: float = float("nan")
    rms_without_outliers: float = float("nan")


NO_DISTANCES = Distances()


def distances(off: FloatArray, outliers: BoolArray) -> Distances:
    """Summarise distances (N,); `outliers` (N,) says which are.

    Examples
    --------
    >>> found = distances(np.array([1.0, 1.0, 7.0]), np.array([False, False, True]))
    >>> found.median, found.rms_without_outliers, round(found.quantile95, 6)
    (1.0, 1.0, 6.4)
    """
    reached = np.isfinite(off)
    if not reached.any():
        return NO_DISTANCES
    median, high = np.quantile(off[reached], [0.5, 0.95]).tolist()
    return Distances(rms_reached(off), median, high, rms(off[reached & ~outliers]))


def rms_reached(off: FloatArray) -> float:
    """Root mean square of the distances (N,) of points that were reached; NaN without any."""
    return rms(off[np.isfinite(off)])
