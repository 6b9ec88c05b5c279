"""Columns of a table that single kinds of measurements have; see `KindFields`.

============================  =====================================================================
columns                       meaning
============================  =====================================================================
``to.q1 [mm]`` …              of a ``distance``: between where ``q1`` … and where these lead
``run``                       of a ``distance``: it counts from a zero of this run
``tilt1 [deg], tilt2``        how far x and y of a sensor point up
``angle:limb1.joint2 [deg]``  the angle of a passive joint
``touch``                     the name of the point that is touched; ``touch:line``, ``touch:plane``
                              and ``touch:sphere`` where it is another artefact
``touch.to``                  another artefact to which the distance is known …
``touch.distance [mm]``       … and which it is …
``touch.sigma [mm]``          … and its standard deviation, 1 µm by default
============================  =====================================================================
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, Protocol, cast

import numpy as np

from pkmcal.arrays import FloatArray, TextArray, Unit
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.measurements.actuator_columns import actuators_in, read_second_actuators
from pkmcal.measurements.components import (
    KINDS,
    TOUCHES,
    Artefact,
    Components,
    Kind,
    components,
)
from pkmcal.measurements.kind_fields import GAUGE, TouchDistances

_STATED = ("touch.to", "touch.distance", "touch.sigma")
_JOINT = re.compile(r"angle:(.+)")
_ARTEFACT = re.compile(r"touch(?::(.+))?")


class OfAKind(Protocol):
    """The fields of `Measurements` that are written here."""

    @property
    def kind(self) -> Kind:
        """Which key of `KINDS` they are."""

    @property
    def values(self) -> FloatArray:
        """What was measured, (N, k) or (N,)."""

    @property
    def joint(self) -> str | None:
        """Of an angle, the joint."""

    @property
    def other(self) -> FloatArray | None:
        """Actuators at the second place."""

    @property
    def run(self) -> TextArray | None:
        """The run of each row."""

    @property
    def touched(self) -> TextArray | None:
        """What each row touches."""

    @property
    def artefact(self) -> Artefact | None:
        """What that is."""

    @property
    def touch_distances(self) -> TouchDistances:
        """Known distances."""


def names_of_kinds(table: Table) -> set[str]:
    """Names of columns that are read here."""
    names = {name for name in table.columns if _JOINT.fullmatch(name)}
    names |= {f"to.{name}" for name in actuators_in(table)}
    names |= {"tilt1", "tilt2", "touch", *(f"touch:{name}" for name in TOUCHES), *_STATED}
    names |= {name for name in _offsets() if name in table.columns}
    return names | ({"run"} if "distance" in table.columns else set())


def component_names() -> set[str]:
    """Names of the components of every kind."""
    every = (*(kind.components for kind in KINDS.values()), *TOUCHES.values())
    return {name for parts in every for name, _ in parts}


def _offsets() -> set[str]:
    return {name for parts in TOUCHES.values() for name, _ in parts}


def kinds_in(table: Table) -> dict[str, Kind]:
    """What is measured by columns of one kind alone, by their names."""
    found: dict[str, Kind] = {}
    for name in table.columns:
        if name == "distance":
            second = any(column.startswith("to.") for column in table.columns)
            run = "run" in table.columns
            found[name] = "between" if second else "relative-distance" if run else "distance"
        elif name in ("tilt1", "tilt2"):
            found["tilt1, tilt2"] = "tilt"
        elif _JOINT.fullmatch(name):
            found[name] = "angle"
        elif _ARTEFACT.fullmatch(name):
            found[name] = "touch"
    return found


def components_in(table: Table, kind: Kind) -> Components:
    """Names and units of the numbers of one value."""
    return components(kind, _artefact(table)[1] if kind == "touch" else None)


def value_columns(table: Table, kind: Kind) -> Components:
    """The columns that they are in; of touches none where the machine touched, without reading."""
    if kind == "angle":
        return tuple((name, "rad") for name in table.columns if _JOINT.fullmatch(name))
    of = components_in(table, kind)
    return tuple(pair for pair in of if kind != "touch" or pair[0] in table.columns)


def read_kind_fields(
    table: Table, kind: Kind, units: Sequence[str], robot: Actuated | None
) -> dict[str, Any]:
    """The fields of `Measurements` that this kind alone has."""
    if kind == "between":
        return {"other": read_second_actuators(table, units, robot)}
    if kind == "relative-distance":
        return {"run": np.array(table.texts("run"))}
    if kind == "angle":
        (joint,) = (match[1] for name in table.columns if (match := _JOINT.fullmatch(name)))
        return {"joint": joint}
    if kind == "touch":
        name, artefact = _artefact(table)
        fields = {"touched": np.array(table.texts(name)), "artefact": artefact}
        return fields | {"touch_distances": _known_distances(table, name)}
    return {}


def _artefact(table: Table) -> tuple[str, Artefact]:
    """The column that names what is touched, and what that is."""
    name = next(name for name in table.columns if _ARTEFACT.fullmatch(name))
    found = cast(re.Match[str], _ARTEFACT.fullmatch(name))[1] or "point"
    if found not in TOUCHES:
        raise table.header_error(
            f"column {table.columns[name].name!r}: expected touch, touch:{', touch:'.join(TOUCHES)}"
        )
    return name, cast(Artefact, found)


def _known_distances(table: Table, touch: str) -> TouchDistances:
    if not any(name in table.columns for name in _STATED):
        return ()
    table.require(_STATED[:2])
    touched, to = table.texts(touch), table.columns["touch.to"].cells
    mm = table.numbers("touch.distance", "mm", blank=True)[0]
    sigma = np.full(len(table), np.nan)
    if "touch.sigma" in table.columns:
        sigma = table.numbers("touch.sigma", "mm", blank=True, like="touch.distance")[0]
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for row, other in enumerate(to):
        if not other and np.isnan(mm[row]):
            continue
        if not other or np.isnan(mm[row]):
            empty = "touch.distance" if other else "touch.to"
            raise table.cell_error(empty, row, "found an empty cell beside one with a distance")
        said = float(mm[row]), GAUGE if np.isnan(sigma[row]) else float(sigma[row])
        if found.setdefault((touched[row], other), said) != said:
            raise table.cell_error("touch.distance", row, "found another distance than before")
    return tuple((*pair, *said) for pair, said in found.items())


def columns_read(m: OfAKind) -> Iterator[tuple[str, Unit, FloatArray]]:
    """Name, unit and numbers of each column of what was read; none where the machine touched."""
    if m.touched is not None and not m.values.any() and not np.signbit(m.values).any():
        return
    numbers = m.values.reshape(len(m.values), -1).T
    for (name, unit), column in zip(components(m.kind, m.artefact), numbers, strict=True):
        yield name if m.joint is None else f"angle:{m.joint}", unit, column


def kind_cells(m: OfAKind, units: Sequence[str]) -> Iterator[tuple[str, Sequence[str]]]:
    """Headings and cells of these fields."""
    if m.other is not None:
        for i, unit in enumerate(units):
            yield f"to.q{i + 1} [{unit}]", [repr(float(value)) for value in m.other[:, i]]
    if m.run is not None:
        yield "run", m.run.tolist()
    if m.touched is None:
        return
    yield "touch" if m.artefact == "point" else f"touch:{m.artefact}", m.touched.tolist()
    if m.touch_distances:
        yield from _stated_cells(m.touched, m.touch_distances)


def _stated_cells(
    touched: TextArray, distances: TouchDistances
) -> Iterator[tuple[str, Sequence[str]]]:
    """Known distances, each in a row that touches one of the two."""
    cells = {name: [""] * len(touched) for name in _STATED}
    for one, other, mm, sigma in distances:
        pairs = ((here, there) for here, there in ((one, other), (other, one)))
        row, there = next(
            ((int(row), there) for here, there in pairs for row in np.flatnonzero(touched == here)
             if not cells["touch.to"][row]),
            (-1, ""),
        )  # fmt: skip
        if row < 0:
            raise ValueError(
                f"touch_distances: no row is left that touches {one} or {other}, to state it in"
            )
        for name, cell in zip(_STATED, (there, repr(mm), repr(sigma)), strict=True):
            cells[name][row] = cell
    for name, column in cells.items():
        yield (name if name == "touch.to" else f"{name} [mm]"), column
