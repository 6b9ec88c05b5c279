"""Positions and heights of points of the platform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core import instruments
from pkmcal.files.column_names import is_turned
from pkmcal.files.csv_table import Table
from pkmcal.readings.alignment import Laid, Sighting, frame_of_points, of_heights
from pkmcal.readings.dependences import point
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading
from pkmcal.readings.unknowns import POINT, Dependence

ORIGIN = np.zeros(3)
PLACE_TITLE = "x, y, z"


@dataclass(frozen=True, eq=False)
class Position(Reading):
    """Position of a point of the platform."""

    name = "position"
    components = POINT
    framed = True
    frame_order: ClassVar[int] = 0
    is_place: ClassVar[bool] = True
    point = "platform"

    def predict(self, at: At, target: FloatArray = ORIGIN, **numbers: FloatArray) -> Predicted:
        """Place of the point `target` (N, 3) of the platform, mm."""
        return points(at.pose, target, at.frame, at.origin)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return what points depend on beside the machine: their targets."""
        yield point(data.measured, "target", "target", data.unknown_target)

    def frame(self, seen: Sighting) -> Laid:
        """The frame in which the points are nearest, with unknown targets placed."""
        return frame_of_points(seen)

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """The targets as stated."""
        return {"target": m.targets}

    def found_in(self, table: Table) -> list[str]:
        """Columns x and y where there is no orientation."""
        there = not table.columns.keys().isdisjoint(("x", "y"))
        return [PLACE_TITLE] if there and not is_turned(table.columns) else []


@dataclass(frozen=True, eq=False)
class Height(Position):
    """Height of a point of the platform."""

    name = "height"
    components = (("z", "mm"),)
    frame_order = 2
    is_place = False
    by_firmware = True
    more = "probe 20 points or more"

    def predict(self, at: At, target: FloatArray = ORIGIN, **numbers: FloatArray) -> Predicted:
        """Height of the point `target` (N, 3) of the platform, mm."""
        return some_components(points(at.pose, target, at.frame, at.origin), np.array([[2]]))

    def frame(self, seen: Sighting) -> Laid:
        """The height and lean that agree with the heights best."""
        return of_heights(seen.values, seen.point), {}

    def found_in(self, table: Table) -> list[str]:
        """Return where heights are found in a table: column z alone."""
        alone = "z" in table.columns and table.columns.keys().isdisjoint(("x", "y"))
        return [PLACE_TITLE] if alone and not is_turned(table.columns) else []


def points(
    pose: FloatArray, target: FloatArray, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    """Places of points of the platform, in the base frame or an instrument's."""
    point, by_twist, by_target = instruments.points(pose, target)
    if frame is None:
        return Predicted(point, by_twist, {"target": by_target})
    near, by_frame, by_point = instruments.seen_points(frame, point)
    seen, _, by_near = instruments.seen_points(origin, near)
    by_point = by_near @ by_point
    by = {"target": by_point @ by_target}
    return Predicted(seen, by_point @ by_twist, by, by_frame=by_near @ by_frame)


def some_components(seen: Predicted, chosen: IntArray) -> Predicted:
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
