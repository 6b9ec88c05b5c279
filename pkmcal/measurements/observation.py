"""What an instrument would read at given poses, and how that changes with what is not known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots, wrapped
from pkmcal.measurements.components import KINDS, Artefact, Kind
from pkmcal.readings import orientation
from pkmcal.readings.distances import ZERO
from pkmcal.readings.points import ORIGIN
from pkmcal.readings.reading import NOWHERE, At, Predicted


def predict(
    kind: Kind,
    pose: FloatArray,
    target: FloatArray = ORIGIN,
    anchor: FloatArray = ORIGIN,
    frame: FloatArray | None = None,
    origin: FloatArray = NOWHERE,
    *,
    zero: FloatArray = ZERO,
    mounting: FloatArray = ORIGIN,
    tool: FloatArray | None = None,
    tool_origin: FloatArray = NOWHERE,
    place: FloatArray = NOWHERE,
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
    at = At(pose, other, frame, origin, along, artefact)
    numbers = {
        "target": target, "anchor": anchor, "zero": zero, "mounting": mounting, "tool": tool,
        "tool_origin": tool_origin, "place": place,
    }  # fmt: skip
    return KINDS[kind].predict(at, **{k: v for k, v in numbers.items() if v is not None})


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


def distance_per_point(residual: FloatArray, measured: Any, length: float) -> FloatArray:
    """How far off each measured point is, mm (N,); of poses their position.

    Where angles alone were read, their arc at a characteristic length, mm.
    """
    units = measured.units
    if "mm" in units:
        residual = residual[:, np.array(units) == "mm"]
    elif units:
        residual = residual * measured.instrument.mm(measured, length)
    off: FloatArray = np.linalg.norm(residual, axis=1)
    return off
