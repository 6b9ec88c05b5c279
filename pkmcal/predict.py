"""What an instrument would read at given poses, and how that changes with what is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal import core, core_serial

FloatArray = NDArray[np.float64]

_ORIGIN = np.zeros(3)
_NOWHERE = np.zeros(6)


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
        Derivative to the measured point of the platform; None for poses.
    by_anchor : ndarray (N, k, 3) or None
        Derivative to the fixed point of the base; distances alone have one.
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base in the instrument's frame; None where there is none.
    target : ndarray (3,) or (N, 3) or None
        The measured point of the platform; None for poses.
    """

    values: FloatArray
    by_pose: FloatArray
    by_target: FloatArray | None = None
    by_anchor: FloatArray | None = None
    by_frame: FloatArray | None = None
    target: FloatArray | None = None

    def by_twist(self, pose: FloatArray) -> FloatArray:
        """Derivative to the velocity of the platform's origin and its turning, in base axes.

        Unlike `by_pose` it is regular at every orientation, but for measured poses.

        Parameters
        ----------
        pose : ndarray (N, 6)
            Of the platform, as in `predict`.

        Returns
        -------
        ndarray (N, k, 6)
            mm per mm, then per rad.
        """
        by_place, by_angles = np.split(self.by_pose, 2, axis=2)
        if self.target is None:
            return np.concatenate([by_place, by_angles @ core_serial.angle_rates(pose)], axis=2)
        lever = core.points(pose, self.target)[0] - pose[:, :3]
        by_turn = np.cross(lever[:, None, :], by_place)  # u · (ω × r) = (r × u) · ω
        return np.concatenate([by_place, by_turn], axis=2)


def predict(
    kind: str,
    pose: FloatArray,
    target: FloatArray = _ORIGIN,
    anchor: FloatArray = _ORIGIN,
    frame: FloatArray | None = None,
) -> Predicted:
    """Readings at poses.

    Parameters
    ----------
    kind : {"pose", "position", "height", "distance"}
        What is read.
    pose : ndarray (N, 6)
        Of the platform in the base frame, mm and rad.
    target : ndarray (3,) or (N, 3)
        The measured point in the platform frame, mm.
    anchor : ndarray (3,) or (N, 3)
        The point of the base frame that distances are measured from, mm.
    frame : ndarray (6,) or None
        Pose of the base in the instrument's frame; None: they are one. Distances have no frame.
    """
    if kind == "distance":
        return _distances(pose, target, anchor)
    if kind == "pose":
        return _poses(pose, frame)
    seen = _points(pose, target, frame)
    return _heights(seen) if kind == "height" else seen


def _points(pose: FloatArray, target: FloatArray, frame: FloatArray | None) -> Predicted:
    point, by_pose, by_target = core.points(pose, target)
    if frame is None:
        return Predicted(point, by_pose, by_target, target=target)
    seen, by_frame, turn = core.points(frame, point)
    return Predicted(seen, turn @ by_pose, turn @ by_target, by_frame=by_frame, target=target)


def _heights(seen: Predicted) -> Predicted:
    def last(part: FloatArray | None) -> FloatArray | None:
        return None if part is None else part[:, 2:3]

    values, by_pose = seen.values[:, 2:3], seen.by_pose[:, 2:3]
    return Predicted(
        values, by_pose, last(seen.by_target), None, last(seen.by_frame), target=seen.target
    )


def _distances(pose: FloatArray, target: FloatArray, anchor: FloatArray) -> Predicted:
    distance, *derivatives = core.distances(pose, target, anchor)
    for by in derivatives:
        by[distance == 0] = 0.0  # no direction there
    by_pose, by_target, by_anchor = (by[:, None, :] for by in derivatives)
    return Predicted(distance[:, None], by_pose, by_target, by_anchor, target=target)


def _poses(pose: FloatArray, frame: FloatArray | None) -> Predicted:
    if frame is None:
        return Predicted(pose, np.broadcast_to(np.eye(6), (len(pose), 6, 6)))
    seen = core.compose(frame, pose)
    by_pose = core.compose_rates(frame, pose, _NOWHERE, seen)
    by_frame = core.compose_rates(_NOWHERE, np.tile(frame, (len(pose), 1)), pose, seen)
    return Predicted(seen, by_pose, by_frame=by_frame)


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
