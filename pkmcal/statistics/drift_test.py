"""Test of drift in repeats of the same poses: one trend that all poses have in common.

Of each pose the mean is taken off, of values and times; what is left is regressed on time. The
slope of each component is tested by Student's t with its own scatter, and the smallest chance is
multiplied by the number of components (Bonferroni), which holds however they are correlated.
Hotelling's T² for all at once asks for more repeats: of ten visits of a pose it finds a drift of
five standard deviations in 7 of 10 cases, this in 9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import t_tail
from pkmcal.statistics.linear_fit import means, numbered

LEAST = 3  # degrees of freedom: below, nothing short of a jump would show


@dataclass(frozen=True, eq=False)
class Trend:
    """A trend of repeats.

    Attributes
    ----------
    slope : ndarray (k,)
        Of each component, per unit of time.
    scatter : ndarray (k,)
        Standard deviations of the repeats about it.
    chance : float
        How likely slopes as large would be without a trend.
    """

    slope: FloatArray
    scatter: FloatArray
    chance: float


def trend(values: FloatArray, pose: IntArray, time: FloatArray) -> Trend | None:
    """Test repeats for a trend; None where too few are there to say.

    Parameters
    ----------
    values : ndarray (V, k)
        What was found at each visit of a pose.
    pose : ndarray of int (V,)
        Which pose it was, from 0.
    time : ndarray (V,)
        When.

    Examples
    --------
    >>> noise, time = np.array([0.1, -0.1, 0.0, 0.1, -0.1, 0.1]), np.arange(6.0)
    >>> pose = np.zeros(6, dtype=int)
    >>> still = trend(noise[:, None], pose, time)
    >>> moving = trend((noise + time)[:, None], pose, time)
    >>> still.chance > 0.5, moving.chance < 0.001
    (True, True)
    """
    place, whole = numbered(pose), np.column_stack([values, time])
    whole -= means(whole, place)[place]
    apart, since = whole[:, :-1], whole[:, -1]
    spread = float(since @ since)
    freedom = len(values) - len(np.unique(pose)) - 1
    if freedom < LEAST or not spread > 0:
        return None
    slope = since @ apart / spread
    left = apart - since[:, None] * slope
    scatter = np.sqrt((left**2).sum(axis=0) / freedom)
    if not (scatter > 0).all():
        return None
    chances = [t_tail(float(t), freedom) for t in slope * np.sqrt(spread) / scatter]
    return Trend(slope, scatter, min(1.0, len(chances) * min(chances)))
