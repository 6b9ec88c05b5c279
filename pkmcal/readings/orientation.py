"""Orientations as rotations: how two differ, how that changes, and how sure measured ones are.

Two orientations differ by a rotation vector, the axis of the turning from one to the other times
its angle, in the instrument's axes. It is the same whatever triple of angles names them, and
regular at every orientation. α β γ are how orientations are read and written, no more.
SciPy's `Rotation` does the same row by row; the core does it in lanes, and its Jacobians.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import screws
from pkmcal.exceptions import ArgumentError

_NONE = 1e-12  # share of a variance that is none


def rotations(angles: FloatArray) -> FloatArray:
    """R = Rz(γ) Ry(β) Rx(α), (N, 3, 3), of angles (N, 3)."""
    poses = np.zeros((len(angles), 6))
    poses[:, 3:] = angles
    turns: FloatArray = screws.frames(poses)[:, :3, :3]
    return turns


def between(measured: FloatArray, predicted: FloatArray) -> FloatArray:
    """Rotation vectors (N, 3), rad, that turn the predicted angles (N, 3) into the measured."""
    both = rotations(np.concatenate([measured, predicted]))
    turn = both[: len(measured)] @ both[len(measured) :].transpose(0, 2, 1)
    vectors: FloatArray = screws.log(_motions(turn))[:, :3]
    return vectors


def turned(angles: FloatArray, vectors: FloatArray) -> FloatArray:
    """Angles (N, 3) turned by rotation vectors (N, 3); `between` gives these back."""
    found: FloatArray = screws.pose(_motions(screws.turnings(vectors) @ rotations(angles)))[:, 3:]
    return found


def shortest(angles: FloatArray) -> FloatArray:
    """Return the angles (N, 3) of an orientation with β within ±90°."""
    return turned(angles, np.zeros_like(angles))


def by_turning(vectors: FloatArray) -> FloatArray:
    """Return how rotation vectors (N, 3) shrink as the prediction turns, (N, 3, 3): near 0, one."""
    twists = np.zeros((len(vectors), 6))
    twists[:, :3] = -vectors
    rates: FloatArray = screws.exp_jacobian(twists, inverse=True).reshape(-1, 6, 6)[:, :3, :3]
    return rates


def axes_of_angles(angles: FloatArray) -> FloatArray:
    """Axes (N, 3, 3), columns, about which an orientation turns as α, β or γ grow."""
    axes = np.zeros((len(angles), 3, 3))
    axes[:, :, 0] = rotations(angles * [0.0, 1.0, 1.0])[:, :, 0]
    axes[:, :, 1] = rotations(angles * [0.0, 0.0, 1.0])[:, :, 1]
    axes[:, 2, 2] = 1.0
    return axes


def covariance(sigma: FloatArray, angles: FloatArray) -> FloatArray:
    """Covariance (N, k, k) of place and rotation vector, from that of x y z α β γ, or of α β γ.

    Parameters
    ----------
    sigma : ndarray (N, k) or (N, k, k)
        As stated; k is 6, or 3 of orientations alone. Covariances are those of the numbers x y z
        α β γ and are transformed. Three deviations are those of turnings about the three axes at
        right angles that are nearest to the axes of α, β and γ: with equal ones the instrument is
        as sure about every axis. The axes themselves meet at β = ±90°, where deviations of the
        numbers would say that one turning is known exactly.
    angles : ndarray (N, 3)
        As measured.

    Raises
    ------
    ValueError
        Covariances of angles near β = ±90° that leave nothing of a turning's variance.
    """
    axes = axes_of_angles(angles)
    if sigma.ndim == 2:
        left, _, right = np.linalg.svd(axes)
        axes, sigma = left @ right, sigma[:, :, None] ** 2 * np.eye(sigma.shape[1])
    rates = np.tile(np.eye(sigma.shape[1]), (len(angles), 1, 1))
    rates[:, -3:, -3:] = axes
    carried: FloatArray = rates @ sigma @ rates.transpose(0, 2, 1)
    scale = np.sqrt(np.diagonal(sigma, axis1=1, axis2=2))
    scale[:, -3:] = scale[:, -3:].max(axis=1, keepdims=True)
    least = np.linalg.eigvalsh(carried / (scale[:, :, None] * scale[:, None, :]))[:, 0]
    if (least <= _NONE).any():
        row = int(np.argmax(least <= _NONE))
        raise ArgumentError(
            f"sigma: row {row} says, so near to beta = 90 degrees, that a turning is known exactly;"
            " state standard deviations instead of a covariance"
        )
    return carried


def _motions(turns: FloatArray) -> FloatArray:
    motions = np.zeros((len(turns), 4, 4))
    motions[:, :3, :3], motions[:, 3, 3] = turns, 1.0
    return motions.reshape(-1, 16)
