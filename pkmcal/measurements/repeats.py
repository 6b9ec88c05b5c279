"""Which rows repeat another."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import IntArray
from pkmcal.measurements.measurements import Measurements


def groups(measured: Measurements) -> IntArray:
    """Which pose and target each row measured, (N,), counted from 0."""
    of = measured.target_index
    if of is None:
        target = measured.target
        places = np.zeros((len(measured), 1)) if target is None or target.ndim == 1 else target
        of = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)
    return np.unique(np.column_stack([measured.pose_index, of]), axis=0, return_inverse=True)[
        1
    ].reshape(-1)
