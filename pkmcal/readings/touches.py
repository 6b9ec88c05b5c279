"""Touches: a point of the platform is on an artefact whose place is not known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, as_rows
from pkmcal.core import instruments
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.distances import DISTANCE, ZERO, distances, no_direction
from pkmcal.readings.points import ORIGIN, points, some_components
from pkmcal.readings.reading import NOWHERE, At, Components, Predicted, Reading
from pkmcal.readings.unknowns import PLACE, POINT, Dependence, Found, Start, always, point

Artefact = Literal["point", "line", "plane", "sphere"]

# How far a touching point is off the artefact, in its axes.
TOUCHES: dict[Artefact, Components] = {
    "point": (("off1", "mm"), ("off2", "mm"), ("off3", "mm")),
    "line": (("off1", "mm"), ("off2", "mm")),
    "plane": (("off1", "mm"),),
    "sphere": (("off1", "mm"),),
}
_EVERY = (0, 1, 2)


@dataclass(frozen=True)
class Touch(Reading):
    """A point of the platform touches a point, a line, a plane or a sphere."""

    name: str = "touch"
    point: Any = "platform"
    nouns: Any = ("touch", "touches")
    starts_by_pose = True

    def predict(
        self,
        at: At,
        target: FloatArray = ORIGIN,
        anchor: FloatArray = ORIGIN,
        zero: FloatArray = ZERO,
        place: FloatArray = NOWHERE,
        **_: FloatArray,
    ) -> Predicted:
        if at.artefact == "sphere":
            return distances(at.pose, target, anchor, zero)
        return _touched(points(at.pose, target, None, at.origin), place, at.artefact, at.along)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        m = data.measured
        yield point(m, "target", "target", data.unknown_target)
        names = m.touched.tolist()
        if m.artefact == "sphere":
            yield always("anchor", "touch", POINT, names, data.starts)
            yield always("zero", "touch radius", (("radius", "mm"),), names, data.starts)
        else:
            yield always("place", "touch", PLACE, names, data.starts)

    def starts(self, machine: Any, sets: Sequence[tuple[Any, FloatArray]], found: Found) -> None:
        _touches([(data.measured, pose) for data, pose in sets], found)

    def simulated(self, m: Any, truth: Any) -> dict[str, FloatArray]:
        wide = {"point": 3, "sphere": 4}.get(m.artefact or "", 6)
        places = {
            name: as_rows(f"touched[{name!r}]", place, wide)[0][0]
            for name, place in (truth["touched"] or {}).items()
        }
        missing = [name for name in np.unique(m.touched).tolist() if name not in places]
        if missing:
            raise ArgumentError(f"touched: where {missing[0]!r} is has to be given")
        rows = np.array([places[name] for name in m.touched.tolist()])
        found = {"target": m.targets}
        if wide == 4:
            return found | {"anchor": rows[:, :3], "zero": rows[:, 3:]}
        return found | {"place": np.hstack([rows, np.zeros((len(rows), 6 - wide))])}


@dataclass(frozen=True)
class TouchDistance(Reading):
    """Between two touched points; no pose has to do with it."""

    name: str = "touch-distance"
    components: Components = DISTANCE

    def predict(
        self, at: At, place: FloatArray = NOWHERE, anchor: FloatArray = ORIGIN, **_: FloatArray
    ) -> Predicted:
        return _of_touched(place, anchor)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        pairs = ((one, other) for one, other, _, _ in data.measured.touch_distances)
        one, other = zip(*pairs, strict=True)
        yield always("place", "touch", PLACE, one, data.starts)
        yield always("anchor", "touch", POINT, other, data.starts)


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
    return some_components(found, across % 3)


def _of_touched(place: FloatArray, anchor: FloatArray) -> Predicted:
    """Between touched points: the first as if a platform stood there."""
    still = np.zeros_like(place)
    still[:, :3] = place[:, :3]
    distance, by_twist, _, by_anchor = instruments.distances(still, ORIGIN, anchor)
    no_direction(distance, [by_twist, by_anchor])
    by_place = np.zeros((len(place), 1, 6))
    by_place[:, 0, :3] = by_twist[:, 3:]
    by = {"place": by_place, "anchor": by_anchor[:, None, :]}
    return Predicted(distance[:, None], np.zeros((len(place), 1, 6)), by)


def _touches(sets: Sequence[tuple[Measurements, FloatArray]], found: Found) -> None:
    points: dict[str, list[FloatArray]] = {}
    kinds: dict[str, Artefact] = {}
    for m, pose in sets:
        assert m.touched is not None and m.artefact is not None
        target = np.zeros(3) if m.target is None else m.targets
        here = instruments.points(pose, target)[0]
        for name in np.unique(m.touched).tolist():
            if kinds.setdefault(name, m.artefact) != m.artefact:
                raise ArgumentError(f"values: {name!r} is a {kinds[name]} and a {m.artefact}")
            points.setdefault(name, []).append(here[m.touched == name])
    for name, parts in points.items():
        reached = np.concatenate(parts)
        reached = reached[np.isfinite(reached).all(axis=1)]
        if kinds[name] == "sphere":
            centre, radius = _sphere(reached)
            found["touch", name] = Start(_EVERY, centre)
            found["touch radius", name] = Start((0,), np.array([radius]))
        else:
            found["touch", name] = _ARTEFACTS[kinds[name]](reached)


def _point(points: FloatArray) -> Start:
    return Start(_EVERY, points.mean(axis=0) if len(points) else np.zeros(3))


def _plane(points: FloatArray) -> Start:
    middle, axes = _spread(points)
    k, slots, turnings = _direction(axes[2])
    place = middle @ axes[2] / axes[2, k]
    return Start((k, *slots), np.array([place, *turnings]), k)


def _line(points: FloatArray) -> Start:
    middle, axes = _spread(points)
    k, slots, turnings = _direction(axes[0])
    pierced = middle - axes[0] * (middle[k] / axes[0, k])  # where it passes through x, y or z = 0
    across = [i for i in range(3) if i != k]
    return Start((*across, *slots), np.array([*pierced[across], *turnings]), k)


_ARTEFACTS: Mapping[Artefact, Callable[[FloatArray], Start]] = {
    "point": _point,
    "plane": _plane,
    "line": _line,
}


def _spread(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle of points, and their principal axes as rows."""
    if len(points) < 2:
        return (points.mean(axis=0) if len(points) else np.zeros(3)), np.eye(3)
    middle = points.mean(axis=0)
    return middle, np.linalg.svd(points - middle, full_matrices=True)[2]


def _direction(d: FloatArray) -> tuple[int, tuple[int, ...], tuple[float, float]]:
    """The base's axis nearest to a direction, and the two turnings that take it there."""
    k = int(np.argmax(np.abs(d)))
    x, y, z = d * np.sign(d[k])
    if k == 0:  # Rz(γ) Ry(β) x
        return k, (4, 5), (float(np.arctan2(-z, np.hypot(x, y))), float(np.arctan2(y, x)))
    if k == 1:  # Rz(γ) Rx(α) y
        return k, (3, 5), (float(np.arctan2(z, np.hypot(x, y))), float(np.arctan2(-x, y)))
    # Ry(β) Rx(α) z
    return k, (3, 4), (float(np.arctan2(-y, np.hypot(x, z))), float(np.arctan2(x, z)))


def _sphere(points: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius of the sphere nearest to points, by its linear equation."""
    if len(points) < 4:
        return (points.mean(axis=0) if len(points) else np.zeros(3)), 1.0
    middle = points.mean(axis=0)
    near = points - middle
    lever = np.hstack([2.0 * near, np.ones((len(near), 1))])
    solved = np.linalg.lstsq(lever, (near**2).sum(axis=1), rcond=None)[0]
    return middle + solved[:3], float(np.sqrt(max(solved[3] + solved[:3] @ solved[:3], 1e-6)))
