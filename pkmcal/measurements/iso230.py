"""Accuracy of positioning along each axis, after ISO 230-2:2014.

The standard moves one axis at a time to targets on a line, five times from either side. Here the
targets are the poses that were measured, the runs their repeats, and nothing is known of the side
they were approached from: the scores are unidirectional.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError

_WIDE = 2.0  # standard deviations that the standard adds to the mean on either side


@dataclass(frozen=True)
class AxisPerformance:
    """Scores of one axis, in the unit of its deviations.

    Attributes
    ----------
    systematic : float
        E, from the least to the largest mean deviation of a target.
    accuracy : float
        A, the same with two standard deviations on either side; NaN without repeats.
    repeatability : float
        R, four standard deviations, the largest of all targets; NaN without repeats.
    targets : int
        How many there are; of them `repeated` were measured more than once.
    repeated : int
        Those that count for A and R.
    """

    systematic: float
    accuracy: float
    repeatability: float
    targets: int
    repeated: int


def axis_performance(deviation: ArrayLike, target: ArrayLike) -> AxisPerformance:
    """Score deviations along one axis.

    Parameters
    ----------
    deviation : array_like (N,)
        Where it was less where it should have been.
    target : array_like of int (N,)
        Rows with the same number are runs to one target.

    Raises
    ------
    ValueError
        Wrong shapes, or no rows.

    Notes
    -----
    ISO 230-2:2014, 3: x̄_i and s_i of the runs to target i; E = max x̄_i - min x̄_i, R = max 4 s_i,
    A = max(x̄_i + 2 s_i) - min(x̄_i - 2 s_i).

    Examples
    --------
    >>> found = axis_performance([1.0, 3.0, 0.0, 0.0], [0, 0, 1, 1])
    >>> found.systematic, round(found.repeatability, 3), round(found.accuracy, 3)
    (2.0, 5.657, 5.657)
    """
    values, number = np.asarray(deviation, dtype=np.float64), np.asarray(target)
    if values.ndim != 1 or not len(values) or number.shape != values.shape:
        raise ArgumentError(
            f"deviation and target must be (N,); found {values.shape} and {number.shape}"
        )
    _, group, runs = np.unique(number, return_inverse=True, return_counts=True)
    mean: FloatArray = np.bincount(group, values) / runs
    squares = np.bincount(group, (values - mean[group]) ** 2)
    several = runs > 1
    spread = np.sqrt(squares[several] / (runs[several] - 1))
    accuracy = repeatability = float("nan")
    if several.any():
        repeatability = float(2.0 * _WIDE * spread.max())
        ends = mean[several] + _WIDE * spread, mean[several] - _WIDE * spread
        accuracy = float(max(ends[0].max(), mean.max()) - min(ends[1].min(), mean.min()))
    return AxisPerformance(
        float(np.ptp(mean)), accuracy, repeatability, len(runs), int(several.sum())
    )
