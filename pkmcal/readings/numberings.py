"""Boards that look alike when they are turned by 180 degrees, and what pictures of them may show.

Detectors number the corners of such a board from either end, and of a mirrored picture as if it
showed the board from the front: each picture by itself is one of the board as it is stated.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray

_SAME = 1e-6  # of the size of a board, by which two places of its corners are one


def half_turn(corner: FloatArray) -> FloatArray | None:
    """Pose (6,) of the half turn about its normal that puts a board's corners (N, 3) on each other.

    None of a board that has no such middle. A corner may be there several times.
    """
    places = np.unique(corner, axis=0)  # in order of x, then of y: turned, in the other order
    twice = places + places[::-1] * [1.0, 1.0, -1.0]
    if (np.ptp(twice, axis=0) > _SAME * np.ptp(places, axis=0).max()).any():
        return None
    return np.array([*twice[0, :2], 0.0, 0.0, 0.0, np.pi])


def across(points: FloatArray, middle: float) -> FloatArray:
    """Points (N, 2) or (N, 3) with left and right exchanged about a middle."""
    mirrored: FloatArray = points.copy()
    mirrored[:, 0] = 2.0 * middle - mirrored[:, 0]
    return mirrored
