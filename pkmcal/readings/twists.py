"""Twists by motions and by the numbers of poses: the chain of frames behind a reading."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import screws
from pkmcal.readings import orientation


def adjoint(motion: FloatArray) -> FloatArray:
    """Return adjoints of motions (N, 4, 4), (N, 6, 6)."""
    flat = np.ascontiguousarray(motion).reshape(-1, 16)
    matrices: FloatArray = screws.adjoint(flat).reshape(-1, 6, 6)
    return matrices


def inverse(pose: FloatArray) -> FloatArray:
    """Inverse poses (N, 6); NaN of NaN."""
    found = np.full_like(pose, np.nan)
    known = np.isfinite(pose).all(axis=1)
    motion = np.linalg.inv(screws.frames(pose[known]))
    found[known] = screws.pose(np.ascontiguousarray(motion).reshape(-1, 16))
    return found


def at_base(pose: FloatArray) -> FloatArray:
    """Twists at the base's origin (N, 6, 6) by those at the platform's, which is at (N, 6)."""
    found = np.tile(np.eye(6), (len(pose), 1, 1))
    found[:, 3:, :3] = _crossed(pose[:, :3])
    return found


def twists_of_numbers(pose: FloatArray) -> FloatArray:
    """Twists (N, 6, 6) about the origin by the numbers x y z α β γ of poses (N, 6)."""
    found = np.zeros((len(pose), 6, 6))
    axes = orientation.axes_of_angles(pose[:, 3:])
    found[:, :3, 3:] = axes
    found[:, 3:, :3] = np.eye(3)
    found[:, 3:, 3:] = _crossed(pose[:, :3]) @ axes
    return found


def _crossed(place: FloatArray) -> FloatArray:
    """Matrices (N, 3, 3) of cross products with places (N, 3)."""
    found = np.zeros((len(place), 3, 3))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        found[:, j, k], found[:, k, j] = -place[:, i], place[:, i]
    return found
