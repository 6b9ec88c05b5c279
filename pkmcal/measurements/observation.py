"""What an instrument would read at given poses, and how that changes with what is not known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core import instruments
from pkmcal.core.poses import compose
from pkmcal.measurements import orientation
from pkmcal.measurements.components import Kind

_ORIGIN = np.zeros(3)
_NOWHERE = np.zeros(6)


@dataclass(frozen=True)
class Predicted:
    """Readings of one kind and their derivatives.

    Attributes
    ----------
    values : ndarray (N, k)
        In mm and rad, as `Measurements` of the kind have them. Derivatives of the three angles of
        poses are those of the turning in the instrument's axes.
    by_twist : ndarray (N, k, 6)
        Derivative to the twist of the platform: ω, then the velocity of its origin, in base axes.
    by_target : ndarray (N, k, 3) or None
        Derivative to the measured point of the platform; None for poses.
    by_anchor : ndarray (N, k, 3) or None
        Derivative to the fixed point of the base; distances alone have one.
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base, counted from the origin; None where there is no frame.
    """

    values: FloatArray
    by_twist: FloatArray
    by_target: FloatArray | None = None
    by_anchor: FloatArray | None = None
    by_frame: FloatArray | None = None


def predict(
    kind: Kind,
    pose: FloatArray,
    target: FloatArray = _ORIGIN,
    anchor: FloatArray = _ORIGIN,
    frame: FloatArray | None = None,
    origin: FloatArray = _NOWHERE,
) -> Predicted:
    """Readings at poses.

    Parameters
    ----------
    kind : {"pose", "position", "height", "distance", "closure"}
        What is read; of a closure nothing.
    pose : ndarray (N, 6)
        Of the platform in the base frame, mm and rad.
    target : ndarray (3,) or (N, 3)
        The measured point in the platform frame, mm.
    anchor : ndarray (3,) or (N, 3)
        The point of the base frame that distances are measured from, mm.
    frame : ndarray (6,) or None
        Pose of the base in the instrument's frame; None: they are one. Distances have no frame.
    origin : ndarray (6,)
        Where that pose counts from, another one in the instrument's frame.
    """
    if kind == "distance":
        return _distances(pose, target, anchor)
    if kind == "pose":
        return _poses(pose, frame, origin)
    if kind == "closure":
        return Predicted(np.empty((len(pose), 0)), np.empty((len(pose), 0, 6)))
    seen = _points(pose, target, frame, origin)
    return _heights(seen) if kind == "height" else seen


def _points(
    pose: FloatArray, target: FloatArray, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    point, by_twist, by_target = instruments.points(pose, target)
    if frame is None:
        return Predicted(point, by_twist, by_target)
    near, by_frame, by_point = instruments.seen_points(frame, point)
    seen, _, by_near = instruments.seen_points(origin, near)
    by_point = by_near @ by_point
    return Predicted(seen, by_point @ by_twist, by_point @ by_target, by_frame=by_near @ by_frame)


def _heights(seen: Predicted) -> Predicted:
    rows = {name: part[:, 2:3] for name, part in vars(seen).items() if part is not None}
    return replace(seen, **rows)


def _distances(pose: FloatArray, target: FloatArray, anchor: FloatArray) -> Predicted:
    distance, *derivatives = instruments.distances(pose, target, anchor)
    for by in derivatives:
        by[distance == 0] = 0.0  # no direction there
    return Predicted(distance[:, None], *(by[:, None, :] for by in derivatives))


def _poses(pose: FloatArray, frame: FloatArray | None, origin: FloatArray) -> Predicted:
    place = _points(pose, _ORIGIN, frame, origin)
    turn = place.by_twist[:, :, 3:]  # of the base, as the instrument has it
    by_twist = np.concatenate(
        [place.by_twist, np.concatenate([turn, np.zeros_like(turn)], axis=2)], axis=1
    )
    if frame is None or place.by_frame is None:
        return Predicted(pose, by_twist)
    inner, outer = frame[None, 3:], origin[None, 3:]
    by_angles = orientation.rotations(outer) @ orientation.axes_of_angles(inner)
    by_frame = np.zeros((len(pose), 6, 6))
    by_frame[:, :3], by_frame[:, 3:, 3:] = place.by_frame, by_angles
    return Predicted(compose(compose(origin, frame[None])[0], pose), by_twist, by_frame=by_frame)


def joined(parts: Sequence[Predicted], rows: Sequence[IntArray]) -> Predicted:
    """Readings of one kind whose rows stand in several parts: in which rows each part's are."""
    if len(parts) == 1:
        return parts[0]
    whole: dict[str, FloatArray] = {}
    for part, mine in zip(parts, rows, strict=True):
        for name, values in vars(part).items():
            if values is not None:
                count = sum(map(len, rows))
                whole.setdefault(name, np.empty((count, *values.shape[1:])))[mine] = values
    return Predicted(**whole)


def difference(kind: Kind, values: FloatArray, predicted: FloatArray) -> FloatArray:
    """Measured less predicted, (N, k); of orientations the rotation vector between them."""
    residual: FloatArray = values.reshape(predicted.shape) - predicted
    if kind == "pose":
        residual[:, 3:] = orientation.between(values[:, 3:], predicted[:, 3:])
    return residual


def corrected(kind: Kind, predicted: FloatArray, residual: FloatArray) -> FloatArray:
    """Values (N, k) that differ from the predicted ones by a residual: inverts `difference`."""
    values: FloatArray = predicted + residual
    if kind == "pose":
        values[:, 3:] = orientation.turned(predicted[:, 3:], residual[:, 3:])
    return values


def by_difference(kind: Kind, derivative: FloatArray, residual: FloatArray) -> FloatArray:
    """How `difference` shrinks, (N, k, n), from a derivative of `Predicted`."""
    if kind == "pose":
        turning = orientation.by_turning(residual[:, 3:]) @ derivative[:, 3:]
        return np.concatenate([derivative[:, :3], turning], axis=1)
    return derivative


def distance_per_point(residual: FloatArray) -> FloatArray:
    """How far off each measured point is, mm (N,); of poses their position."""
    off: FloatArray = np.linalg.norm(residual[:, :3], axis=1)
    return off
