"""Touches: a point of the platform is on an artefact whose place is not known."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import shown, word
from pkmcal.arrays import FloatArray, IntArray, TextArray, as_rows
from pkmcal.core import instruments
from pkmcal.core.poses import NOWHERE
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings import rows
from pkmcal.readings.components import Components
from pkmcal.readings.dependences import always, point
from pkmcal.readings.distances import DISTANCE, ZERO, distances, no_direction
from pkmcal.readings.known_distances import (
    STATED_DISTANCES,
    TouchDistances,
    checked_distances,
    distances_read,
    stated_columns,
)
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.points import ORIGIN, points, some_components
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading, Sets, StatedBeside
from pkmcal.readings.unknowns import PLACE, POINT, Dependence, Found, Start

Artefact = Literal["point", "line", "plane", "sphere"]

# How far a touching point is off the artefact, in its axes.
TOUCHES: dict[Artefact, Components] = {
    "point": (("off1", "mm"), ("off2", "mm"), ("off3", "mm")),
    "line": (("off1", "mm"), ("off2", "mm")),
    "plane": (("off1", "mm"),),
    "sphere": (("off1", "mm"),),
}
_EVERY = (0, 1, 2)
_COLUMN = re.compile(r"touch(?::(.+))?")


@dataclass(frozen=True, eq=False)
class Touch(Reading):
    """A point of the platform touches a point, a line, a plane or a sphere of unknown place.

    A value is how far off it the point is, which is 0 where the machine touched without reading.

    Attributes
    ----------
    touched : (N,) sequence of str
        Name of what each row touches, the same where it touches the same.
    artefact : {"point", "line", "plane", "sphere"}
        What is touched; a point is a socket, a cone, a hole.
    distances : mapping of (str, str) to float or (float, float)
        Known distances between touched points, or centres of spheres, mm, or each with its
        standard deviation, which is 1 µm by default: ``{("A", "B"): 50.0}``.
    places : mapping of str to array
        Of a simulated machine: where that is in the base frame, of a point or sphere (3,) or (4,)
        with the radius, of a line or plane a pose (6,), whose z it is along or normal to.
    """

    touched: Sequence[str] | TextArray | None = None
    artefact: Artefact = "point"
    distances: Mapping[tuple[str, str], Any] | TouchDistances = ()
    places: Mapping[str, ArrayLike] | None = None

    name = "touch"
    shrinks = True
    by_contact = True
    point = "platform"
    nouns = ("touch", "touches")
    starts_by_pose = True
    planned = False
    per_row = ("touched",)
    truth = ("places",)
    stated = ("artefact", "distances")

    def __post_init__(self) -> None:
        word("artefact", self.artefact, TOUCHES)
        object.__setattr__(self, "components", TOUCHES[self.artefact])

    def predict(
        self,
        at: At,
        target: FloatArray = ORIGIN,
        anchor: FloatArray = ORIGIN,
        zero: FloatArray = ZERO,
        place: FloatArray = NOWHERE,
        **numbers: FloatArray,
    ) -> Predicted:
        """Return how far `target` (N, 3) is off the artefact, in its axes, mm.

        A sphere has its centre `anchor` (N, 3) and radius `zero` (N, 1), any other artefact a pose
        `place` (N, 6).
        """
        if self.artefact == "sphere":
            return distances(at.pose, target, anchor, zero)
        seen = points(at.pose, target, None, at.origin)
        return _touched(seen, place, self.artefact, at.axis)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """The target, and where the artefacts are."""
        yield point(data.measured, "target", "target", data.unknown_target)
        names = self._names.tolist()
        if self.artefact == "sphere":
            yield always("anchor", "touch", POINT, names, data.starts)
            yield always("zero", "touch radius", (("radius", "mm"),), names, data.starts)
        else:
            yield always("place", "touch", PLACE, names, data.starts)

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """The artefacts nearest to the points that the nominal machine has reached."""
        _touches([(data.measured, pose) for data, pose in sets], found)

    def axis(self, data: InFit) -> IntArray:
        """The axis of its own from which each row's line or plane counts."""
        return np.array([data.starts["touch", name].axis for name in self._names.tolist()])

    def stated_beside(self, sets: Sequence[Measured]) -> StatedBeside | None:
        """The known distances between what is touched, as readings of their own."""
        known = [each for m in sets for each in m.instrument.distances]
        if not known:
            return None
        places = []
        for one, other, _, _ in known:
            first = {
                name: (i, int(row))
                for name in (one, other)
                for i, m in enumerate(sets)
                for row in np.flatnonzero(m.instrument.touched == name)[:1]
            }
            for name in (one, other):
                if name not in first:
                    raise ArgumentError(f"touch_distances: no row touches {name!r}")
            places.append(first[one])
        return StatedBeside(
            TouchDistance(tuple(known)),
            [mm for _, _, mm, _ in known],
            [sigma for *_, sigma in known],
            places,
        )

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """Targets and artefacts as stated."""
        wide = {"point": 3, "sphere": 4}.get(self.artefact, 6)
        places = {
            name: as_rows(f"places[{name!r}]", place, wide)[0][0]
            for name, place in (self.places or {}).items()
        }
        missing = [name for name in np.unique(self._names).tolist() if name not in places]
        if missing:
            raise ArgumentError(f"places: where {missing[0]!r} is has to be given")
        rows = np.array([places[name] for name in self._names.tolist()])
        found = {"target": m.targets}
        if wide == 4:
            return found | {"anchor": rows[:, :3], "zero": rows[:, 3:]}
        return found | {"place": np.hstack([rows, np.zeros((len(rows), 6 - wide))])}

    @property
    def _names(self) -> TextArray:
        return np.asarray(self.touched)

    def of_rows(
        self, values: Any, actuators: FloatArray, targets: int | None
    ) -> tuple[Touch, ArrayLike | None]:
        """Check the names, one a row; the values may be these names."""
        rows_, argument, touched = len(actuators), "touched", self.touched
        if touched is None:
            if isinstance(values, str) and rows_ == 1:
                values = [values]
            argument, touched, values = "values", _names_touched(values), None
        named = rows.names(argument, touched, rows_)
        if values is None:
            wide = len(self.components)
            values = np.zeros((rows_, wide) if wide > 1 else rows_)
        known = checked_distances(self.distances, self.artefact)
        return self.with_fields({"touched": named, "distances": known}), values

    def title(self, m: Measured) -> str:
        """Return a title that counts touches and artefacts."""
        count = len(np.unique(self._names))
        return f"{super().title(m)} of {count} {self.artefact}{'' if count == 1 else 's'}"

    def found_in(self, table: Table) -> list[str]:
        """A column ``touch``, or ``touch:ARTEFACT``."""
        return [name for name in table.columns if _COLUMN.fullmatch(name)]

    def names(self, table: Table) -> set[str]:
        """Touches, known distances and, where they are there, readings of how far off."""
        off = {name for parts in TOUCHES.values() for name, _ in parts}
        named = {"touch", *(f"touch:{name}" for name in TOUCHES), *STATED_DISTANCES}
        return named | (off & table.columns.keys())

    def read(self, table: Table, units: Sequence[str]) -> Touch:
        """Read the touched artefacts, and known distances."""
        name = self.found_in(table)[0]
        artefact = name.partition(":")[2] or "point"
        if artefact not in TOUCHES:
            raise table.header_error(
                f"column {table.columns[name].name!r}: expected touch, touch:"
                f"{', touch:'.join(TOUCHES)}"
            )
        known = distances_read(table, name)
        return Touch(np.array(table.texts(name)), artefact, known)

    def columns_read(self, table: Table) -> Components:
        """Return the components' columns that are there: none where the machine touched alone."""
        return tuple(pair for pair in self.components if pair[0] in table.columns)

    def value_columns(self, values: FloatArray) -> Iterator[WrittenColumn]:
        """The components; none where the machine touched without reading."""
        if values.any() or np.signbit(values).any():
            yield from super().value_columns(values)

    def columns(self, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write what each row touches."""
        of = "" if self.artefact == "point" else f":{self.artefact}"
        yield WrittenColumn(f"touch{of}", "", self._names)

    def columns_in_file(self, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Known distances beside."""
        yield from self.columns(units)
        if self.distances:
            yield from stated_columns(self._names, cast(TouchDistances, self.distances))


@dataclass(frozen=True, eq=False)
class TouchDistance(Reading):
    """A known distance between two touched points; no pose has to do with it.

    `identify` makes these of `Touch.distances`.
    """

    distances: TouchDistances = ()

    name = "touch-distance"
    argument = "touch_distances"
    stated = ("distances",)
    planned = False
    components = DISTANCE

    def predict(
        self,
        at: At,
        place: FloatArray = NOWHERE,
        anchor: FloatArray = ORIGIN,
        **numbers: FloatArray,
    ) -> Predicted:
        """Distance of the origin of `place` (N, 6) from `anchor` (N, 3), mm."""
        return _of_touched(place, anchor)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return the artefacts as dependences."""
        one, other = zip(*((one, other) for one, other, _, _ in self.distances), strict=True)
        yield always("place", "touch", PLACE, one, data.starts)
        yield always("anchor", "touch", POINT, other, data.starts)

    def found_in(self, table: Table) -> list[str]:
        """Nothing, for files state known distances beside touches."""
        return []

    def names(self, table: Table) -> set[str]:
        """Return no names of columns: they are read elsewhere."""
        return set()


def _names_touched(values: Any) -> Sequence[str] | TextArray:
    named = np.asarray(values) if isinstance(values, list | tuple | np.ndarray) else None
    if named is None or named.ndim != 1 or named.dtype.kind != "U":
        raise ArgumentTypeError(
            "values of kind 'touch' must name what each row touches, one str a row; found"
            f" {shown(values)}"
        )
    return named


def _touched(
    seen: Predicted, place: FloatArray, artefact: Artefact, axis: IntArray | None
) -> Predicted:
    inside, by_place, by_point = instruments.touched_points(place, seen.values)
    by = {"target": by_point @ seen.by["target"], "place": by_place}
    found = Predicted(inside, by_point @ seen.by_twist, by)
    if artefact == "point":
        return found
    assert axis is not None
    across = axis[:, None] + (np.array([[0]]) if artefact == "plane" else np.array([[1, 2]]))
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


def _touches(sets: Sequence[tuple[Any, FloatArray]], found: Found) -> None:
    points: dict[str, list[FloatArray]] = {}
    kinds: dict[str, Artefact] = {}
    for m, pose in sets:
        touched, artefact = m.instrument.touched, m.instrument.artefact
        target = np.zeros(3) if m.target is None else m.targets
        here = instruments.points(pose, target)[0]
        for name in np.unique(touched).tolist():
            if kinds.setdefault(name, artefact) != artefact:
                raise ArgumentError(f"values: {name!r} is a {kinds[name]} and a {artefact}")
            points.setdefault(name, []).append(here[touched == name])
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
