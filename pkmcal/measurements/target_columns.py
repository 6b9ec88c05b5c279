"""Columns of targets: several in one row, or the one that a row measured."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.column_names import RESERVED
from pkmcal.files.csv_table import Table
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.components import KINDS, Kind, noun

_AXES = ("x", "y", "z")
_OF_A_TARGET = re.compile(r"(?P<target>.+)\.[xyz]")


def several_targets(table: Table) -> tuple[str, ...]:
    """Names of the targets that have columns of their own, in the order of the columns."""
    matches = (_OF_A_TARGET.fullmatch(name) for name in table.columns)
    found = dict.fromkeys(match["target"] for match in matches if match)
    taken = {b.partition(".")[0] for each in KINDS.values() for b in each.besides}
    return tuple(name for name in found if name.partition(".")[0] not in {*RESERVED, *taken})


def read_several(
    table: Table, targets: tuple[str, ...], actuators: FloatArray, fields: dict[str, Any]
) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
    """One measurement per row and target that was seen there, row by row."""
    for name in table.columns:
        if name.partition(".")[0] in ("target", "attachment"):
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


def read_targets(table: Table, kind: Kind) -> dict[str, Any]:
    """The target of each row, by name, by place or both."""
    points = {name: _read_point(table, name) for name in ("target", "attachment")}
    fields: dict[str, Any] = {name: place for name, place in points.items() if place is not None}
    named = "target" in table.columns
    point = KINDS[kind].point
    if not point and (named or "target" in fields):
        raise table.header_error(f"columns of a target do not go with {noun(kind)}")
    if point == "base" and "target" not in fields:
        raise table.header_error("missing column 'target.x': a distance is measured to a point")
    if point != "base" and "attachment" in fields:
        raise table.header_error(
            f"column 'attachment.x' goes with distances, not with {noun(kind)}"
        )
    if not named:
        return {name: _one(place) for name, place in fields.items()}
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
    if "attachment" in chosen:
        chosen["attachment"] = _one(chosen["attachment"])
    return chosen | {"target_index": index, "target_names": order}


def _read_point(table: Table, name: str) -> FloatArray | None:
    """A point of each row (rows, 3); None where it has no columns."""
    columns = [f"{name}.{axis}" for axis in _AXES]
    if not any(column in table.columns for column in columns):
        return None
    return table.stacked(columns, ["mm"] * 3)


def _one(places: FloatArray) -> FloatArray:
    """One point (3,) where all rows have the same, to the last bit: 0.0 is not -0.0."""
    bits = places.view(np.int64)
    one: FloatArray = places[0] if (bits == bits[0]).all() else places
    return one
