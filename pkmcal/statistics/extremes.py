"""Readings that are equal to the largest or the smallest of all more often than chance allows.

An instrument at its stop, or past the end of its range, shows its last value whatever it measures.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray

LEAST = 2  # poses that have the same extreme reading
_CHANCE = 1e-4  # of as many, were the end as likely as a few other steps
_STEPS = 3.0  # of which one is taken to be the end: readings may crowd there


def tied_extremes(
    values: FloatArray, pose: IntArray, step: float
) -> Iterator[tuple[float, BoolArray]]:
    """Find the ends at which readings are equal.

    Parameters
    ----------
    values : ndarray (N,)
        Readings of one component; NaN where nothing was read.
    pose : ndarray of int (N,)
        At which pose each was read: repeats of one may well be equal.
    step : float
        Of which all are multiples; 0 where there is none.

    Yields
    ------
    value, rows : float, ndarray of bool (N,)
        The largest or smallest reading, and where it was read.

    Examples
    --------
    >>> values = np.array([0.1, 0.8, 0.8, 0.25, 0.8, 0.63, 0.8, 0.02, 0.8])
    >>> [(value, rows.sum().item()) for value, rows in tied_extremes(values, np.arange(9), 0.01)]
    [(0.8, 5)]
    """
    from scipy.special import bdtrc

    read = np.isfinite(values)
    if not read.any():
        return
    low, high = float(values[read].min()), float(values[read].max())
    if low == high:
        return  # touches of one height, say
    bins = (high - low) / step + 1.0 if step else np.inf
    count = len(np.unique(pose[read]))
    for end in (low, high):
        mine = values == end
        tied = len(np.unique(pose[mine]))
        if tied >= LEAST and bdtrc(tied - 1, count, min(_STEPS / bins, 1.0)) < _CHANCE:
            yield end, mine
