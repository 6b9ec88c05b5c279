"""What an instrument would read at given poses, and how that changes with what is not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots, mm_per_unit, wrapped
from pkmcal.core import instruments
from pkmcal.core.poses import compose
from pkmcal.measurements import orientation
from pkmcal.measurements.components import KINDS, Artefact, Kind

_ORIGIN = np.zeros(3)
_NOWHERE = np.zeros(6)
_ZERO = np.zeros(1)
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Predicted:
    """Readings of one kind and their derivatives.

    Attributes
    ----------
    values : ndarray (N, k)
        In mm and rad, as `Measurements` of the kind have them. Derivatives of the three angles of
        orientations are those of the turning in the instrument's axes.
    by_twist : ndarray (N, k, 6)
        Derivative to the twist of the platform: ω, then the velocity of its origin, in base axes.
    by : mapping of str to ndarray (N, k, w)
        Derivative to each argument of `predict` that the kind depends on, by its name.
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base, counted from the origin; None where there is no frame.
    by_other : ndarray (N, k, 6) or None
        Derivative to the twist of the platform at the second place; None where there is none.
    """

    values: FloatArray
    by_twist: FloatArray
    by: Mapping[str, FloatArray] = field(default_factory=dict)
    by_frame: FloatArray | None = None
    by_other: FloatArray | None = None


def predict(
    kind: Kind,
    pose: FloatArray,
    target: FloatArray = _ORIGIN,
    anchor: FloatArray = _ORIGIN,
    frame: FloatArray | None = None,
    origin: FloatArray = _NOWHERE,
    *,
    zero: FloatArray = _ZERO,
    mounting: FloatArray = _ORIGIN,
    tool: FloatArray | None = None,
    tool_origin: FloatArray = _NOWHERE,
    place: FloatArray = _NOWHERE,
    touching: tuple[Artefact | None, IntArray | None] = (None, None),
    other: FloatArray | None = None,
) -> Predicted:
    """Readings at poses.

    Parameters
    ----------
    kind : str
        What is read, a key of `KINDS` but "angle" (see `read_angles`); of a closure nothing.
    pose : ndarray (N, 6)
        Of the platform in the base frame, mm and rad.
    target : ndarray (3,) or (N, 3)
        The measured point in the platform frame, mm.
    anchor : ndarray (3,) or (N, 3)
        The point of the base frame that distances are measured from, mm; of a touched sphere the
        centre.
    frame : ndarray (6,) or None
        Pose of the base in the instrument's frame; None: they are one. Distances have no frame.
    origin : ndarray (6,)
        Where that pose counts from, another one in the instrument's frame.
    zero : ndarray (1,) or (N, 1)
        What is taken off a distance: the zero of a relative one, the radius of a touched sphere.
    mounting : ndarray (3,) or (N, 3)
        α β γ of a sensor on the platform.
    tool : ndarray (N, 6), optional
        Pose of what is measured on the platform, counted from another, `tool_origin` (N, 6).
    place : ndarray (6,) or (N, 6)
        Pose of the touched point, line or plane in the base frame.
    touching : (str, ndarray of int (N,)), optional
        What is touched, and which of its axes a line has, or is normal to a plane.
    other : ndarray (N, 6), optional
        Poses at the second place.
    """
    artefact, along = touching
    match kind, artefact:
        case ("distance" | "relative-distance", _) | ("touch", "sphere"):
            return _distances(pose, target, anchor, zero)
        case "touch", _:
            return _touched(_points(pose, target, None, origin), place, artefact, along)
        case "touch-distance", _:
            return _of_touched(place, anchor)
        case "between", _:
            assert other is not None
            return _between(pose, other, target)
        case "orientation", _:
            return _orientations(pose, mounting, frame, origin)
        case "tilt", _:
            return _tilts(pose, mounting, frame, origin)
        case "pose", _:
            return _poses(pose, tool, tool_origin, frame, origin)
        case "closure", _:
            return Predicted(np.empty((len(pose), 0)), np.empty((len(pose), 0, 6)))
    seen = _points(pose, target, frame, origin)
    return _rows(seen, np.array([[2]])) if kind == "height" else seen


def read_angles(
    angles: FloatArray, by_twist: FloatArray | None = None, zero: FloatArray = _ZERO
) -> Predicted:
    """Readings of a passive joint that is turned by angles (N,): these less a zero, rad.

    A passive joint of a chain is where that closes, for which the pose alone does not say enough:
    without `by_twist` (N, 6) it does not follow the pose. How it follows the machine's numbers is
    not among these derivatives.
    """
    rows = len(angles)
    values = angles[:, None] - np.broadcast_to(zero, (rows, 1))
    moves = np.zeros((rows, 1, 6)) if by_twist is None else by_twist[:, None, :]
    return Predicted(values, moves, {"zero": np.full((rows, 1, 1), -1.0)})


def _points(
    pose: FloatArray, target: FloatArray, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    point, by_twist, by_target = instruments.points(pose, target)
    if frame is None:
        return Predicted(point, by_twist, {"target": by_target})
    near, by_frame, by_point = instruments.seen_points(frame, point)
    seen, _, by_near = instruments.seen_points(origin, near)
    by_point = by_near @ by_point
    by = {"target": by_point @ by_target}
    return Predicted(seen, by_point @ by_twist, by, by_frame=by_near @ by_frame)


def _rows(seen: Predicted, chosen: IntArray) -> Predicted:
    """Some of the components of every row: `chosen` is (N, k) or (1, k)."""

    def of(part: FloatArray) -> FloatArray:
        index = np.broadcast_to(chosen, (len(part), chosen.shape[1]))
        taken: FloatArray = np.take_along_axis(
            part, index.reshape(*index.shape, *(1,) * (part.ndim - 2)), axis=1
        )
        return taken

    return replace(
        seen,
        values=of(seen.values),
        by_twist=of(seen.by_twist),
        by={name: of(part) for name, part in seen.by.items()},
        by_frame=None if seen.by_frame is None else of(seen.by_frame),
    )


def _distances(
    pose: FloatArray, target: FloatArray, anchor: FloatArray, zero: FloatArray
) -> Predicted:
    distance, *derivatives = instruments.distances(pose, target, anchor, zero)
    _no_direction(distance + zero.reshape(-1), derivatives)
    by_twist, by_target, by_anchor = (by[:, None, :] for by in derivatives)
    by_zero = np.full((len(pose), 1, 1), -1.0)
    by = {"target": by_target, "anchor": by_anchor, "zero": by_zero}
    return Predicted(distance[:, None], by_twist, by)


def _between(pose: FloatArray, other: FloatArray, target: FloatArray) -> Predicted:
    distance, *derivatives = instruments.between(pose, other, target)
    _no_direction(distance, derivatives)
    by_twist, by_other, by_target = (by[:, None, :] for by in derivatives)
    return Predicted(distance[:, None], by_twist, {"target": by_target}, by_other=by_other)


def _of_touched(place: FloatArray, anchor: FloatArray) -> Predicted:
    """Between touched points: the first as if a platform stood there."""
    still = np.zeros_like(place)
    still[:, :3] = place[:, :3]
    distance, by_twist, _, by_anchor = instruments.distances(still, _ORIGIN, anchor)
    _no_direction(distance, [by_twist, by_anchor])
    by_place = np.zeros((len(place), 1, 6))
    by_place[:, 0, :3] = by_twist[:, 3:]
    by = {"place": by_place, "anchor": by_anchor[:, None, :]}
    return Predicted(distance[:, None], np.zeros((len(place), 1, 6)), by)


def _no_direction(distance: FloatArray, derivatives: list[FloatArray]) -> None:
    """Derivatives of a distance of 0, which has no direction, are 0."""
    for by in derivatives:
        by[distance == 0] = 0.0


def _touched(
    seen: Predicted, place: FloatArray, artefact: Artefact | None, along: IntArray | None
) -> Predicted:
    inside, by_place, by_point = instruments.touched_points(place, seen.values)
    by = {"target": by_point @ seen.by["target"], "place": by_place}
    found = Predicted(inside, by_point @ seen.by_twist, by)
    if artefact == "point":
        return found
    assert along is not None
    across = along[:, None] + (np.array([[0]]) if artefact == "plane" else np.array([[1, 2]]))
    return _rows(found, across % 3)


def _poses(
    pose: FloatArray,
    tool: FloatArray | None,
    tool_origin: FloatArray,
    frame: FloatArray | None,
    origin: FloatArray,
) -> Predicted:
    """Poses of the platform, or of a tool that is mounted on it."""
    whole = np.zeros_like(pose) if tool is None else compose(tool_origin, tool)
    place = _points(pose, np.ascontiguousarray(whole[:, :3]), frame, origin)
    turned = _orientations(pose, None if tool is None else whole[:, 3:], frame, origin)
    by, by_frame = {}, None
    if tool is not None:  # its six numbers move and turn it in the axes of its origin
        outer = orientation.rotations(tool_origin[:, 3:])
        seen = place.by["target"] @ outer
        by["tool"] = np.zeros((len(pose), 6, 6))
        by["tool"][:, :3, :3] = seen
        by["tool"][:, 3:, 3:] = seen @ orientation.axes_of_angles(tool[:, 3:])
    if place.by_frame is not None and turned.by_frame is not None:
        by_frame = np.concatenate([place.by_frame, turned.by_frame], axis=1)
    return Predicted(
        np.hstack([place.values, turned.values]),
        np.concatenate([place.by_twist, turned.by_twist], axis=1),
        by,
        by_frame=by_frame,
    )


def _orientations(
    pose: FloatArray, mounting: FloatArray | None, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    """Orientations of the platform, or of a sensor that is mounted on it."""
    carried = pose
    if mounting is not None:
        carried = compose(pose, np.hstack([np.zeros_like(mounting), mounting]))
    whole, by_angles = _frame_turning(frame, origin)
    seen = carried if frame is None else compose(compose(origin, frame[None])[0], carried)
    by_twist = np.zeros((len(pose), 3, 6))
    by_twist[:, :, :3] = whole
    by = {}
    if mounting is not None:
        axes = orientation.axes_of_angles(mounting.reshape(-1, 3))
        by["mounting"] = whole @ orientation.rotations(pose[:, 3:]) @ axes
    by_frame = None
    if frame is not None:
        by_frame = np.zeros((len(pose), 3, 6))
        by_frame[:, :, 3:] = by_angles
    return Predicted(seen[:, 3:], by_twist, by, by_frame=by_frame)


def _tilts(
    pose: FloatArray, mounting: FloatArray, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    whole, by_angles = _frame_turning(frame, origin)
    tilt, by_turn, by_mounting, by_up = instruments.tilts(pose, mounting, whole[2])
    by_twist = np.concatenate([by_turn, np.zeros_like(by_turn)], axis=2)
    by_frame = None
    if frame is not None:  # up = Rᵀ z, of R that turns by ω: Rᵀ (z × ω)
        by_frame = np.zeros((len(pose), 2, 6))
        by_frame[:, :, 3:] = by_up @ (whole.T @ np.cross(_UP, by_angles.T).T)
    return Predicted(tilt, by_twist, {"mounting": by_mounting}, by_frame=by_frame)


def _frame_turning(frame: FloatArray | None, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """From the base's axes to the instrument's (3, 3), and turnings there by the frame's angles."""
    if frame is None:
        return np.eye(3), np.zeros((3, 3))
    outer = orientation.rotations(origin[None, 3:])[0]
    inner = orientation.rotations(frame[None, 3:])[0]
    by_angles: FloatArray = outer @ orientation.axes_of_angles(frame[None, 3:])[0]
    return outer @ inner, by_angles


def joined(parts: Sequence[Predicted], rows: Sequence[IntArray]) -> Predicted:
    """Readings of one kind whose rows stand in several parts: in which rows each part's are."""
    if len(parts) == 1:
        return parts[0]
    count = sum(map(len, rows))

    def whole(of_parts: Sequence[FloatArray]) -> FloatArray:
        found = np.empty((count, *of_parts[0].shape[1:]))
        for values, mine in zip(of_parts, rows, strict=True):
            found[mine] = values
        return found

    numbers = {
        name: whole([vars(part)[name] for part in parts])
        for name, values in vars(parts[0]).items()
        if isinstance(values, np.ndarray)
    }
    by = {name: whole([part.by[name] for part in parts]) for name in parts[0].by}
    return Predicted(**numbers, by=by)


def difference(kind: Kind, values: FloatArray, predicted: FloatArray) -> FloatArray:
    """Measured less predicted, (N, k); of orientations the rotation vector between them."""
    residual: FloatArray = values.reshape(predicted.shape) - predicted
    first = KINDS[kind].turning
    if first is not None:
        residual[:, first:] = orientation.between(values[:, first:], predicted[:, first:])
    return wrapped(residual) if kind == "angle" else residual


def corrected(kind: Kind, predicted: FloatArray, residual: FloatArray) -> FloatArray:
    """Values (N, k) that differ from the predicted ones by a residual: inverts `difference`."""
    values: FloatArray = predicted + residual
    first = KINDS[kind].turning
    if first is not None:
        values[:, first:] = orientation.turned(predicted[:, first:], residual[:, first:])
    return values


def by_difference(kind: Kind, derivative: FloatArray, residual: FloatArray) -> FloatArray:
    """How `difference` shrinks, (N, k, n), in the place of a derivative of `Predicted`."""
    first = KINDS[kind].turning
    if first is not None:
        for rows in lots(len(residual)):
            by_turning = orientation.by_turning(residual[rows, first:])
            derivative[rows, first:] = by_turning @ derivative[rows, first:]
    return derivative


def distance_per_point(residual: FloatArray, units: Sequence[str], length: float) -> FloatArray:
    """How far off each measured point is, mm (N,); of poses their position.

    Where angles alone were read, their arc at a characteristic length, mm.
    """
    if "mm" in units:
        residual = residual[:, np.array(units) == "mm"]
    elif units:
        residual = residual * mm_per_unit(units, length)
    off: FloatArray = np.linalg.norm(residual, axis=1)
    return off
