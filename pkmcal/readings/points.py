"""Positions and heights of points of the platform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core import instruments
from pkmcal.readings.reading import At, Predicted, Reading
from pkmcal.readings.unknowns import POINT, Dependence, point

ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class Position(Reading):
    """Where a point of the platform is."""

    name: str = "position"
    components: Any = POINT
    framed: bool = True
    point: Any = "platform"

    def predict(self, at: At, target: FloatArray = ORIGIN, **_: FloatArray) -> Predicted:
        return points(at.pose, target, at.frame, at.origin)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        yield point(data.measured, "target", "target", data.unknown_target)

    def simulated(self, m: Any, truth: Any) -> dict[str, FloatArray]:
        return {"target": m.targets}


@dataclass(frozen=True)
class Height(Position):
    """How high it is."""

    name: str = "height"
    components: Any = (("z", "mm"),)

    def predict(self, at: At, target: FloatArray = ORIGIN, **_: FloatArray) -> Predicted:
        return some_components(points(at.pose, target, at.frame, at.origin), np.array([[2]]))


def points(
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
