"""What an instrument would read at given poses, and how that changes with what is not known.

The derivatives come without finite differences: an angle of a pose turns everything that it
carries about its own axis, at the rate axis × arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_UNIT = np.eye(3)


@dataclass(frozen=True)
class Predicted:
    """Readings of one kind and their derivatives.

    Attributes
    ----------
    values : ndarray (N, k)
        In mm and rad, as `Measurements` of the kind have them.
    by_pose : ndarray (N, k, 6)
        Derivative to x y z alpha beta gamma of the platform.
    by_target : ndarray (N, k, 3) or None
        Derivative to the target (a point of the platform, for distances one of the base).
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base in the instrument's frame; None where there is none.
    """

    values: FloatArray
    by_pose: FloatArray
    by_target: FloatArray | None = None
    by_frame: FloatArray | None = None


def predict(
    kind: str, pose: FloatArray, target: FloatArray | None, frame: FloatArray | None = None
) -> Predicted:
    """Readings at poses.

    Parameters
    ----------
    kind : {"pose", "position", "height", "distance"}
        What is read.
    pose : ndarray (N, 6)
        Of the platform in the base frame, mm and rad.
    target : ndarray (N, 3) or None
        The measured point in the platform frame, mm; None is the platform's origin, without a
        derivative. For distances the fixed point of the base frame.
    frame : ndarray (6,) or None
        Pose of the base in the instrument's frame; None: they are one. Distances have no frame.
    """
    if kind == "distance":
        return _distances(pose, np.zeros((1, 3)) if target is None else target)
    if kind == "pose":
        return _poses(pose, frame)
    seen = _points(pose, target, frame)
    return seen if kind == "position" else _heights(seen)


def rotation_and_axes(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """R = Rz(γ)Ry(β)Rx(α) of angles (N, 3), and the axis of each angle, one per row: (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    matrix = Rotation.from_euler("xyz", angles).as_matrix()
    axes = np.empty_like(matrix)
    axes[:, 0] = matrix[:, :, 0]
    axes[:, 1] = Rotation.from_euler("z", angles[:, 2:]).apply(_UNIT[1])
    axes[:, 2] = _UNIT[2]
    return matrix, axes


def _points(pose: FloatArray, target: FloatArray | None, frame: FloatArray | None) -> Predicted:
    point = pose[:, :3]
    by_pose = np.zeros((len(pose), 3, 6))
    by_pose[:, :, :3] = _UNIT
    by_target = None
    if target is not None:
        by_target, axes = rotation_and_axes(pose[:, 3:])
        arm = _applied(by_target, target)
        point = point + arm
        by_pose[:, :, 3:] = _carried(axes, arm)
    if frame is None:
        return Predicted(point, by_pose, by_target)
    turn, axes = rotation_and_axes(frame[None, 3:])
    arm = point @ turn[0].T
    by_frame = np.zeros((len(pose), 3, 6))
    by_frame[:, :, :3] = _UNIT
    by_frame[:, :, 3:] = _carried(axes, arm)
    seen = None if by_target is None else turn @ by_target
    return Predicted(frame[:3] + arm, turn @ by_pose, seen, by_frame)


def _heights(seen: Predicted) -> Predicted:
    parts = (seen.values, seen.by_pose, seen.by_target, seen.by_frame)
    values, by_pose, by_target, by_frame = (None if p is None else p[:, 2:3] for p in parts)
    assert values is not None and by_pose is not None
    return Predicted(values, by_pose, by_target, by_frame)


def _distances(pose: FloatArray, fixed: FloatArray) -> Predicted:
    away = pose[:, :3] - fixed
    values = np.linalg.norm(away, axis=1, keepdims=True)
    direction = np.divide(away, values, out=np.zeros_like(away), where=values > 0)[:, None, :]
    by_pose = np.concatenate([direction, np.zeros_like(direction)], axis=-1)
    return Predicted(values, by_pose, by_target=-direction)


def _poses(pose: FloatArray, frame: FloatArray | None) -> Predicted:
    if frame is None:
        return Predicted(pose, np.broadcast_to(np.eye(6), (len(pose), 6, 6)))
    from scipy.spatial.transform import Rotation

    point = _points(pose, None, frame)
    assert point.by_frame is not None
    outer = Rotation.from_euler("xyz", frame[3:])
    angles = (outer * Rotation.from_euler("xyz", pose[:, 3:])).as_euler("xyz")
    # a small turn is the sum of the angles' rates about their axes, seen from either side
    _, seen_axes = rotation_and_axes(angles)
    _, axes = rotation_and_axes(pose[:, 3:])
    _, frame_axes = rotation_and_axes(frame[None, 3:])
    rates = np.linalg.inv(seen_axes.transpose(0, 2, 1))
    by_pose = np.zeros((len(pose), 6, 6))
    by_pose[:, :3] = point.by_pose
    by_pose[:, 3:, 3:] = rates @ (outer.as_matrix() @ axes.transpose(0, 2, 1))
    by_frame = np.zeros((len(pose), 6, 6))
    by_frame[:, :3] = point.by_frame
    by_frame[:, 3:, 3:] = rates @ frame_axes.transpose(0, 2, 1)
    return Predicted(np.concatenate([point.values, angles], axis=1), by_pose, None, by_frame)


def _applied(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    product: FloatArray = (matrix @ np.broadcast_to(vector, (len(matrix), 3))[:, :, None])[:, :, 0]
    return product


def _carried(axes: FloatArray, arm: FloatArray) -> FloatArray:
    """Velocity of the end of `arm` (N, 3) for each of the axes (N or 1, 3, 3): (N, 3, 3)."""
    velocity: FloatArray = np.cross(axes, arm[:, None, :]).transpose(0, 2, 1)
    return velocity


def difference(kind: str, values: FloatArray, predicted: FloatArray) -> FloatArray:
    """Measured less predicted, (N, k); angles the short way round."""
    residual: FloatArray = values.reshape(predicted.shape) - predicted
    if kind == "pose":
        residual[:, 3:] = np.remainder(residual[:, 3:] + np.pi, 2 * np.pi) - np.pi
    return residual


def distance_per_point(residual: FloatArray) -> FloatArray:
    """How far off each measured point is, mm (N,); of poses their position."""
    off: FloatArray = np.linalg.norm(residual[:, :3], axis=1)
    return off
