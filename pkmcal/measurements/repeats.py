"""Rows that repeat a measurement: those of one target, at one pose."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import IntArray
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.linear_fit import numbered


def targets(measured: Measurements) -> IntArray:
    """Return the target of each row, (N,), counted from 0: by its index, or by its place.

    Rows of one target that differ in what else was read, a second place or an attachment, have
    numbers of their own.
    """
    subject, place = measured.instrument.subject(len(measured)), measured.target
    if measured.target_index is not None:
        own = np.asarray(measured.target_index, dtype=np.intp)
        if not subject.any():
            return own
    elif place is None or place.ndim == 1:
        return subject
    else:
        own = np.unique(place, axis=0, return_inverse=True)[1].reshape(-1)
    return numbered(own, subject)


def groups(measured: Measurements) -> IntArray:
    """Return the group of pose and target of each row, (N,), counted from 0."""
    keys = np.column_stack([measured.pose_index, targets(measured)])
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
