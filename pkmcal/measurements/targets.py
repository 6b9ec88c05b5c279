"""Targets: which point each row measured, and where it is on the platform or the base."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arguments import shown, words
from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.exceptions import ArgumentError
from pkmcal.files.column_names import RESERVED
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.field import Field, integers
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import is_name

_AXES = ("x", "y", "z")
_OF_A_TARGET = re.compile(r"(?P<target>.+)\.[xyz]")


class TargetIndex(Field):
    """Index of the target of each row, of several, counted from 0; its columns say its place."""

    def kept(self, given: Any, m: Any) -> Int64Array:
        """Check whole numbers (N,)."""
        _refuse_without_point(m.instrument)
        index = integers(self.name, given, len(m))
        if index.min() < 0:
            raise ArgumentError(f"target_index counts from 0; found {index.min()}")
        return index

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """The target's name and place."""
        return {"target", *(f"target.{axis}" for axis in _AXES)}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> None:
        """Nothing: `read_targets` reads which target each row has together with their places."""

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """The target's name and place; the reading's own points."""
        yield from self.framed(m)
        places = {} if m.target is None else {"target": m.targets}
        for point, rows in (places | m.instrument.points(m)).items():
            for axis, name in enumerate(_AXES):
                yield WrittenColumn(f"{point}.{name}", "mm", rows[:, axis])

    def framed(self, m: Any) -> Iterator[WrittenColumn]:
        """The target's name."""
        if m.target_index is not None:
            yield WrittenColumn("target", "", np.array(m.target_names)[m.target_index])

    def printed(self, m: Any) -> Iterator[WrittenColumn]:
        """The target's name."""
        return self.framed(m)

    def said(self, m: Any) -> str:
        """Say the names of the targets, or the place of the only one."""
        if m.target_names is not None:
            known = "" if m.target is not None else " (places not known)"
            return f"targets {' '.join(m.target_names)}{known}"
        if m.target is not None and m.target.ndim == 1:
            return "target ({:g}, {:g}, {:g}) mm".format(*m.target)
        return ""


def checked_target(target: FloatArray | None, m: Any) -> FloatArray | None:
    """Return one target, one a row, or several that an index chooses from; None without any."""
    index, rows = m.target_index, len(m)
    if target is None:
        if m.instrument.point == "base":
            raise ArgumentError(
                "target: a distance needs the fixed point it is measured to, (x, y, z) in mm in"
                " the base frame"
            )
        return None
    _refuse_without_point(m.instrument)
    if index is not None:
        if target.ndim != 2 or target.shape[1] != 3:
            raise ArgumentError(
                f"target must have shape (k, 3) with target_index; found {target.shape}"
            )
        if index.max() >= len(target):
            raise ArgumentError(
                f"target_index must be below {len(target)}, the number of targets;"
                f" found {index.max()}"
            )
    elif target.shape not in ((3,), (rows, 3)):
        raise ArgumentError(
            f"target must have shape (3,) or ({rows}, 3), or (k, 3) with target_index;"
            f" found {target.shape}"
        )
    return target


def names_of_targets(given: Sequence[str] | None, m: Any) -> tuple[str, ...] | None:
    """Names of the several targets, "1", "2", … unless given; None where there is no index."""
    index, target = m.target_index, m.target
    if index is None:
        if given is not None:
            raise ArgumentError("target_names need target_index, which says where each is measured")
        return None
    count = int(index.max()) + 1 if target is None else len(target)
    if given is None:
        return tuple(str(i + 1) for i in range(count))
    names = words("target_names", given)
    if not all(map(is_name, names)) or len(set(names)) < len(names):
        raise ArgumentError(
            f"target_names must be different names on one line, of at most {LONGEST_NAME}"
            f" characters; found {shown(names)}"
        )
    if len(names) <= index.max() or (target is not None and len(names) != len(target)):
        raise ArgumentError(f"target_names must name {count} targets; found {len(names)}")
    return names


def _refuse_without_point(instrument: Reading) -> None:
    if not instrument.point:
        raise ArgumentError(f"target: {instrument.noun()} are not of a point, and take no target")


def several_targets(table: Table, points: Collection[str]) -> tuple[str, ...]:
    """Names of the targets that have columns of their own, in the order of the columns.

    `points` are those of readings, which are no targets.
    """
    matches = (_OF_A_TARGET.fullmatch(name) for name in table.columns)
    found = dict.fromkeys(match["target"] for match in matches if match)
    return tuple(name for name in found if name.partition(".")[0] not in {*RESERVED, *points})


def read_several(
    table: Table,
    targets: tuple[str, ...],
    actuators: FloatArray,
    fields: dict[str, Any],
    points_known: Collection[str],
) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
    """Read a measurement per row and target that was seen there, row by row."""
    for name in table.columns:
        if name.partition(".")[0] in ("target", *points_known):
            raise table.header_error(f"column {name!r} does not go with '{targets[0]}.x'")
    values = np.empty((len(table), len(targets), 3))
    for t, target in enumerate(targets):
        names = [f"{target}.{axis}" for axis in _AXES]
        table.require(names)
        for axis, name in enumerate(names):
            values[:, t, axis] = table.numbers(name, "mm", blank=True, unseen=True)[0]
    missing = np.isnan(values)
    read = ~missing.all(axis=(0, 1))  # an axis along which nothing was, as across a plane
    part = missing[:, :, read].any(axis=2) & ~missing.all(axis=2)
    if part.any():
        t, row = np.argwhere(part.T)[0].tolist()
        name = f"{targets[t]}.{_AXES[int(np.argmax(missing[row, t] & read))]}"
        raise table.cell_error(name, row, "found an empty cell beside ones with numbers")
    rows, index = np.nonzero(~np.isnan(values).all(axis=2))
    chosen = {name: None if value is None else value[rows] for name, value in fields.items()}
    chosen |= {"target_index": index, "target_names": targets}
    return actuators[rows], values[rows, index], chosen


def read_targets(
    table: Table, instrument: Reading, readings: Sequence[Reading]
) -> tuple[Reading, dict[str, Any]]:
    """The reading with its own points, and the target of each row, by name, by place or both."""
    own = instrument.own_points
    points_known = dict.fromkeys(name for each in readings for name in each.own_points)
    points = {name: _read_point(table, name) for name in ("target", *points_known)}
    found: dict[str, Any] = {name: place for name, place in points.items() if place is not None}
    named = "target" in table.columns
    if not instrument.point and (named or "target" in found):
        raise table.header_error(f"columns of a target do not go with {instrument.noun()}")
    if instrument.point == "base" and "target" not in found:
        raise table.header_error("missing column 'target.x': a distance is measured to a point")
    for name in found:
        if name not in ("target", *own):
            of = next(each for each in readings if name in each.own_points).noun()
            raise table.header_error(
                f"column '{name}.x' goes with {of}, not with {instrument.noun()}"
            )
    fields = _by_name(table, found) if named else {k: _one(place) for k, place in found.items()}
    mine = {name: fields.pop(name) for name in own if name in fields}
    return instrument.with_fields(mine), fields


def _by_name(table: Table, fields: dict[str, Any]) -> dict[str, Any]:
    """Points of targets that rows name, one place for each."""
    names = table.texts("target")
    long = next((row for row, name in enumerate(names) if len(name) > LONGEST_NAME), None)
    if long is not None:
        message = f"a name has at most {LONGEST_NAME} characters, found {len(names[long])}"
        raise table.cell_error("target", long, message)
    places_of: dict[str, int] = {}
    index = np.array([places_of.setdefault(name, len(places_of)) for name in names])
    order = list(places_of)
    first = np.unique(index, return_index=True)[1].tolist()
    for name, places in fields.items():
        moved = (places != places[first][index]).any(axis=1)
        if moved.any():
            row = int(np.argmax(moved))
            line = table.lines[first[index[row]]]
            what = "place" if name == "target" else name
            raise table.cell_error(
                "target", row, f"{names[row]!r} has another {what} here than in line {line}"
            )
    chosen = {name: places[first] for name, places in fields.items()}
    chosen |= {name: _one(place) for name, place in chosen.items() if name != "target"}
    return chosen | {"target_index": index, "target_names": order}


def _read_point(table: Table, name: str) -> FloatArray | None:
    """A point of each row (rows, 3); None where it has no columns."""
    columns = [f"{name}.{axis}" for axis in _AXES]
    if not any(column in table.columns for column in columns):
        return None
    return table.stacked(columns, ["mm"] * 3)


def _one(places: FloatArray) -> FloatArray:
    """Reduce to one point (3,) where all rows have the same, to the last bit: 0.0 is not -0.0."""
    bits = places.view(np.int64)
    one: FloatArray = places[0] if (bits == bits[0]).all() else places
    return one
