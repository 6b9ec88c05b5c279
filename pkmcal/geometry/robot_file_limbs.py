"""The ``[[limb]]`` tables and ``[parameters]`` of a robot file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, Unit, furthest_axis
from pkmcal.core.library import AXES, SLOTS
from pkmcal.files.toml_table import Table, shown, unit_vector
from pkmcal.geometry.laws import Law, LawNumber, gain_unit
from pkmcal.geometry.limb_kinds import ALIASES, KINDS, LimbKind
from pkmcal.geometry.limbs import Cone, Limb
from pkmcal.geometry.robot_file_laws import read_law
from pkmcal.geometry.ties import LimbNumber, Term, Tie

PARAMETER_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
CHAIN_HELP = "chain of joints (docs/machines.md)"
RIGHT_ANGLE = 1e-3  # how far a zero direction may be from a right angle to its axis, rad
UNIT_WORDS: dict[Unit, str] = {
    "mm": "a length",
    "rad": "an angle",
    "1": "a ratio",
    "1/mm": "per length",
    "1/rad": "per angle",
    "1/mm2": "per square of length",
    "1/N": "per force",
    "N": "a force",
    "N mm": "a moment",
    "N/mm": "a stiffness",
    "mm/N": "a compliance",
    "rad/(N mm)": "a compliance of an angle",
    "kg": "a mass",
}


class Entry(NamedTuple):
    """A limb number as the file gives it: its value, and its tie where it has one."""

    value: float
    tie: Tie | None = None


class Parameters:
    """The named parameters: their values, and the unit that their use gives them."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.units: dict[str, Unit] = {}
        self.constants: set[str] = set()
        self._used_at: dict[str, str] = {}
        for name in table.data:
            if not PARAMETER_NAME.fullmatch(name):
                what = f"{name!r} is no name: letters, digits and _, no digit first"
                table.fail("", what, at=name)
            table.as_number(name, table.data[name], "1")

    def term(self, table: Table, key: str, value: object, unit: Unit) -> Term:
        """Read a number, or the name of a parameter with or without a minus."""
        text = value if isinstance(value, str) else ""
        sign, name = (-1.0, text[1:]) if text.startswith("-") else (1.0, text)
        if not PARAMETER_NAME.fullmatch(name):
            what = "a number or the name of a parameter"
            return Term(table.as_number(key, value, unit, what))
        if name not in self.table:
            known = did_you_mean(name, self.table.data)
            table.fail(key, f"[parameters] defines no {name!r}{known}")
        before = self.units.setdefault(name, unit)
        first = self._used_at.setdefault(name, table.name(key))
        if before != unit:
            table.fail(
                key, f"{name} is {UNIT_WORDS[unit]} here and {UNIT_WORDS[before]} in {first}"
            )
        return Term(sign, name)

    def constant(self, table: Table, key: str, value: object, unit: Unit) -> float:
        """Read a number, or a name for its value alone: it is no number of the geometry."""
        term = self.term(table, key, value, unit)
        if term.name is not None:
            self.constants.add(term.name)
        return self.value(term)

    def value(self, term: Term) -> float:
        """The value of a term in mm or rad."""
        return term.factor if term.name is None else term.factor * self[term.name]

    def entry(self, term: Term) -> Entry:
        """The limb number that is this term."""
        tie = None if term.name is None else Tie("equal", (term,))
        return Entry(self.value(term), tie)

    def __getitem__(self, name: str) -> float:
        return self.table.as_number(name, self.table[name], self.units[name])

    def finish(self, limb_names: Sequence[str]) -> dict[str, float]:
        """Refuse unused names and names of limb numbers; return the values in mm and rad."""
        for name in self.table.data:
            if name in limb_names:
                self.table.fail(name, "this is already the name of a limb's own number")
            if name not in self.units:
                self.table.fail(name, "no limb uses this parameter")
        return {name: self[name] for name in self.table.data if name not in self.constants}

    def ordered_units(self) -> dict[str, Unit]:
        """Units in the order of the file."""
        own = (name for name in self.table.data if name not in self.constants)
        return {name: self.units[name] for name in own}


class Limbs(NamedTuple):
    """All limbs, their numbers, and the values of those that are not tied."""

    limbs: tuple[Limb, ...]
    numbers: list[LimbNumber]
    values: dict[str, float]
    blank: FloatArray | None


def read_limbs(tables: Sequence[Table], parameters: Parameters) -> Limbs:
    """Read every ``[[limb]]`` table."""
    read = [read_limb(table, i, parameters) for i, table in enumerate(tables)]
    limbs = [limb for limb, _, _ in read]
    own = len(SLOTS) + 3 * max(len(limb.parts[1:]) for limb in limbs)
    width = own + max(len(of_law) for _, _, of_law in read)
    numbers: list[LimbNumber] = []
    values: dict[str, float] = {}
    for i, (limb, entries, of_law) in enumerate(read):
        kind, law = KINDS[limb.kind], limb.law
        for slot, name, unit in kind.numbers(i + 1, limb.couple > 0.0):
            unit = gain_unit(law, kind.actuator_unit) if slot == "gain" else unit
            numbers.append(LimbNumber(name, unit, i, slot, entries[slot].tie))
            values[name] = entries[slot].value
        for j, (slot, name) in enumerate(over_points(i + 1, limb.parts)):
            place = i * width + len(SLOTS) + j
            numbers.append(LimbNumber(name, "mm", i, slot, entries[slot].tie, place))
            values[name] = entries[slot].value
        for j, (number, entry) in enumerate(of_law):
            slot, place = f"drive.{number.name.partition('.')[2]}", i * width + own + j
            numbers.append(LimbNumber(number.name, number.unit, i, slot, entry.tie, place))
            values[number.name] = entry.value
    _check_actuators(tables, limbs)
    blank = None
    if width > len(SLOTS):
        blank = np.zeros((len(limbs), width))
        blank[:, SLOTS.index("gain")] = 1.0
    free = {number.name for number in numbers if number.tie is None}
    return Limbs(tuple(limbs), numbers, {n: v for n, v in values.items() if n in free}, blank)


def over_points(number: int, parts: Sequence[int]) -> list[tuple[str, str]]:
    """Slot and name of each number of the points of limb `number` behind its base point."""
    points = range(1, len(parts))
    return [(f"over{j}.{axis}", f"over{number}.{j}.{axis}") for j in points for axis in "xyz"]


def read_limb(
    table: Table, i: int, parameters: Parameters
) -> tuple[Limb, dict[str, Entry], list[tuple[LawNumber, Entry]]]:
    """Read one ``[[limb]]`` table, limb `i` counted from 0; its numbers by slot, and its law's."""
    name = table.text("kind")
    if name not in (known := (*KINDS, *ALIASES)):
        near = did_you_mean(name, known)
        table.fail("kind", f"{name!r} is no kind of limb{near}; any other limb is a {CHAIN_HELP}")
    kind = KINDS[ALIASES.get(name, name)]
    table.only(kind.keys(), f"a {name} limb")
    couple = _positive(table, "couple", table.number("couple", "mm")) if "couple" in table else 0.0

    def entry(of: Table, key: str, value: object, unit: Unit) -> Entry:
        return parameters.entry(parameters.term(of, key, value, unit))

    law, of_law = read_law(table, i + 1, kind.actuator_unit, entry)
    entries = _read_numbers(table, kind, couple > 0.0, parameters, law)

    axes = kind.axes_of(couple > 0.0)
    for axis in kind.axes.keys() - axes.keys():
        for key in (kind.axes[axis], f"{kind.axes[axis]}_tilt"):
            if key in table:
                table.fail(key, "only a limb with a couple length has this")
    zero = "zero" if kind.driver.needs_zero or (kind.driver.has_zero and "zero" in table) else None
    frames = {
        axis: _frame(table, key, zero if axis == "base" else None) for axis, key in axes.items()
    }

    branch = table.integer("branch") if kind.driver.carries else 0
    if kind.driver.carries and branch not in (1, -1):
        table.fail("branch", f"must be 1 or -1, found {branch}")
    actuator = table.integer("actuator", i + 1)
    if actuator < 1:
        table.fail("actuator", f"actuators count from 1, found {actuator}")
    limb = Limb(
        kind=kind.name,
        actuator=actuator - 1,
        branch=branch,
        frames=frames,
        couple=couple,
        weights=_weights(table, kind.all_rows(couple > 0.0)),
        stroke=_stroke(table, kind.actuator_unit),
        base_cone=_cone(table, "base_cone"),
        platform_cone=_cone(table, "platform_cone"),
        law=law,
        parts=_parts(table) if kind.driver.points else (),
    )
    for array in frames.values():
        array.flags.writeable = False
    return limb, entries, of_law


def _read_numbers(
    table: Table, kind: LimbKind, couple: bool, parameters: Parameters, law: Law | None
) -> dict[str, Entry]:
    def entry(key: str, value: object, unit: Unit) -> Entry:
        return parameters.entry(parameters.term(table, key, value, unit))

    entries: dict[str, Entry] = {}
    for point in ("base", "platform"):
        for coordinate, found in zip("xyz", _point(table, point, parameters), strict=True):
            entries[f"{point}.{coordinate}"] = found
    if kind.driver.points:
        for j, place in enumerate(_over(table), 1):
            for axis, value in zip("xyz", place, strict=True):
                entries[f"over{j}.{axis}"] = entry("over", value, "mm")
    entries["offset"] = entry("offset", table.data.get("offset", 0.0), kind.actuator_unit)
    of_gain = gain_unit(law, kind.actuator_unit)
    entries["gain"] = entry("gain", table.data.get("gain", 1.0), of_gain)
    if entries["gain"].value == 0.0:
        table.fail("gain", "must not be 0: the actuator would not move the limb")
    for key, slot in kind.driver.lengths.items():
        entries[slot] = entry(key, table[key], "mm")
        _positive(table, key, entries[slot].value)
    for axis, name in kind.axes_of(couple).items():
        key = f"{name}_tilt"
        tilts = table.list_of(key, 2, "two angles") if key in table else (0.0, 0.0)
        for slot, tilt in zip(AXES[axis], tilts, strict=True):
            entries[slot] = entry(key, tilt, "rad")
    return entries


def _point(table: Table, key: str, parameters: Parameters) -> tuple[Entry, Entry, Entry]:
    """Read a joint's centre: ``[x, y, z]`` or ``{ radius, angle, z }``."""
    value = table[key]
    if isinstance(value, list) and len(value) == 3:
        x, y, z = (parameters.term(table, key, each, "mm") for each in value)
        return parameters.entry(x), parameters.entry(y), parameters.entry(z)
    if not isinstance(value, Mapping):
        form = "[x, y, z] or { radius = ..., angle = ..., z = ... }"
        table.fail(key, f"a point is {form}, found {shown(value)}")
    polar = table.table(key)
    polar.only(("radius", "angle", "z"), "a polar point")
    radius = parameters.term(polar, "radius", polar["radius"], "mm")
    angle = parameters.term(polar, "angle", polar["angle"], "rad")
    height = parameters.term(polar, "z", polar["z"], "mm")
    ties = (Tie("cos", (radius, angle)), Tie("sin", (radius, angle)))
    values = {term.name: parameters[term.name] for term in (radius, angle) if term.name}
    tied = radius.name is not None or angle.name is not None
    x_entry, y_entry = (Entry(tie.value(values), tie if tied else None) for tie in ties)
    return x_entry, y_entry, parameters.entry(height)


def _over(table: Table) -> list[list[object]]:
    """The points of a cable behind its base point, as the file has them."""
    found = table["over"]
    good = isinstance(found, list) and bool(found)
    if not good or not all(isinstance(point, list) and len(point) == 3 for point in found):
        table.fail("over", f"must be points [[x, y, z], …], one or more, found {shown(found)}")
    points: list[list[object]] = found
    return points


def _parts(table: Table) -> tuple[int, ...]:
    """Return numbers of cable parts from the base point, and from each point behind it."""
    count = 1 + len(_over(table))
    what = "whole numbers, of base and of each point under over"
    found = table.list_of("parts", count, what) if "parts" in table else [1] * count
    if any(isinstance(each, bool) or not isinstance(each, int) or each < 1 for each in found):
        table.fail("parts", f"must be {what}, 1 or more, found {shown(list(found))}")
    return tuple(int(each) for each in found)


def _positive(table: Table, key: str, value: float) -> float:
    if not value > 0.0:
        table.fail(key, f"must be positive, found {shown(table[key])}")
    return value


def _frame(table: Table, key: str, zero: str | None = None) -> FloatArray:
    """Right-handed orthonormal axes (columns) whose third is the direction under `key`.

    The first is the direction under `zero`; without one it is the coordinate axis that is
    furthest from the third (`furthest_axis`), made orthogonal to it. Axes that are orthonormal
    keep their bits.
    """
    e3 = table.vector(key)
    if zero is not None:
        given = table.vector(zero)
        if abs(_dot(given, e3)) > RIGHT_ANGLE:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, _dot(given, e3)))))
            table.fail(zero, f"must be at a right angle to {key}, found {angle:.4g} degrees")
    else:
        k = furthest_axis(np.array(e3))
        given = (float(k == 0), float(k == 1), float(k == 2))
    along = _dot(given, e3)
    if abs(along) > 1e-15:
        x, y, z = (g - along * e for g, e in zip(given, e3, strict=True))
        given = unit_vector(x, y, z)
    e1 = given
    e2 = (
        e3[1] * e1[2] - e3[2] * e1[1],
        e3[2] * e1[0] - e3[0] * e1[2],
        e3[0] * e1[1] - e3[1] * e1[0],
    )
    return np.ascontiguousarray(np.array([e1, e2, e3]).T)


def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _weights(table: Table, rows: Sequence[str]) -> tuple[float, ...]:
    if "weights" not in table:
        return (1.0,) * len(rows)
    what = f"one number for each row beside the sphere ({', '.join(rows) or 'none here'})"
    found = table.list_of("weights", len(rows), what)
    weights = tuple(table.as_number("weights", each, "1") for each in found)
    if any(weight <= 0.0 for weight in weights):
        table.fail("weights", f"must be positive, found {shown(list(found))}")
    return weights


def _stroke(table: Table, unit: Unit) -> tuple[float, float] | None:
    if "stroke" not in table:
        return None
    found = table.list_of("stroke", 2, "two numbers, the shortest and the longest")
    low, high = (table.as_number("stroke", each, unit) for each in found)
    if not low < high:
        table.fail("stroke", f"must rise, found {shown(list(found))}")
    return low, high


def _cone(table: Table, key: str) -> Cone | None:
    if key not in table:
        return None
    cone = table.table(key)
    cone.only(("axis", "angle"))
    axis = np.array(cone.vector("axis"))
    axis.flags.writeable = False
    angle = cone.number("angle", "rad")
    if not 0.0 < angle <= math.pi:
        cone.fail("angle", f"must be above 0 and at most half a turn, found {cone['angle']!r}")
    return Cone(axis, angle)


def _check_actuators(tables: Sequence[Table], limbs: Sequence[Limb]) -> None:
    used: dict[int, Any] = {}
    for i, limb in enumerate(limbs):
        unit = KINDS[limb.kind].actuator_unit
        j, before = used.setdefault(limb.actuator, (i, unit))
        if before != unit:
            tables[i].fail(
                "actuator",
                f"actuator {limb.actuator + 1} moves by {UNIT_WORDS[unit]} here "
                f"and by {UNIT_WORDS[before]} in [[limb]] {j + 1}",
            )
    for number in range(max(used) + 1):
        if number not in used:
            most = max(range(len(limbs)), key=lambda i: limbs[i].actuator)
            tables[most].fail(
                "actuator", f"found {max(used) + 1}, but no limb has actuator {number + 1}"
            )
