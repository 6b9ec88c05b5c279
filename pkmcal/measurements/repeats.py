"""Which rows repeat another."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import IntArray
from pkmcal.measurements.measurements import Measurements


def groups(measured: Measurements) -> IntArray:
    """Which pose and target each row measured, (N,), counted from 0."""
    target = measured.target_index
    of = np.zeros(len(measured), dtype=np.intp) if target is None else target
    return np.unique(np.column_stack([measured.pose_index, of]), axis=0, return_inverse=True)[
        1
    ].reshape(-1)
