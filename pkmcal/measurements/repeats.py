"""Which rows repeat another."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import IntArray
from pkmcal.measurements.measurements import Measurements


def targets(measured: Measurements) -> IntArray:
    """Which target each row is of, (N,), counted from 0: by its index, or by its place."""
    if measured.target_index is not None:
        return np.asarray(measured.target_index, dtype=np.intp)
    if (subject := measured.instrument.subject(measured)) is not None:
        return np.unique(subject, return_inverse=True)[1].reshape(-1)
    place = measured.target
    if place is None or place.ndim == 1:
        return np.zeros(len(measured), dtype=np.intp)
    return np.unique(place, axis=0, return_inverse=True)[1].reshape(-1)


def groups(measured: Measurements) -> IntArray:
    """Which pose and target each row measured, (N,), counted from 0."""
    keys = np.column_stack([measured.pose_index, targets(measured)])
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
