"""A straight way from one pose to another, as the poses at which limits are looked at."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray

_STEP = 5.0  # mm between these poses
_LEAST, _MOST = 8, 4000  # steps; a way of more than that is far outside of any machine


def straight_way(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return poses (m, 6) of a straight way behind `start` (6,), the last of them `end` (6,)."""
    steps = int(np.clip(np.abs(end - start)[:3].max() / _STEP, _LEAST, _MOST))
    way: FloatArray = start + np.linspace(0.0, 1.0, steps + 1)[1:, None] * (end - start)
    return way
