"""Elastic numbers and loads of a robot file: compliances, masses, payload, springs.

Compliances are in mm/N and rad/(N mm), stiffnesses in N/mm and N m/rad, masses in kg, forces in N
and moments in N mm, whatever the file's units; places and angles are in its units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import Unit
from pkmcal.core.library import SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.toml_table import Table, shown
from pkmcal.geometry.elastic import COMPLIANCE, GRAVITY, PER_LENGTH, Elastic, Spring, spring_of
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.robot_file_limbs import Entry, Limbs, Parameters
from pkmcal.geometry.ties import LimbNumber
from pkmcal.geometry.yielding import widened

TOP = ("gravity", "gravity_tilt", "platform", "payload", "compliance", "balancer")
STIFFNESS = {"stiffness": "offset", "rod_stiffness": "rod"}  # keys of a limb, and what yields
MASSES = {"mass": "limb", "anchor_mass": "anchor"}
_PER_MM = 1e-3  # rad/(N m) in rad/(N mm)


class _Yields(NamedTuple):
    """A spring with its compliance, and what that grows by per mm where it does."""

    spring: Spring
    compliance: Entry
    per_length: Entry | None


def read_elastic(
    top: Table, described: Sequence[Table], limbs: Limbs, parameters: Parameters
) -> tuple[Elastic | None, Limbs]:
    """Read the elastic numbers of a file, and the limbs with them behind their own.

    None, and the limbs as they are, where the file says nothing of it.
    """
    yielding = {each.spring.number: each for each in _of_limbs(described, limbs, parameters)}
    for key, each in _of_table(top, limbs, parameters):
        if each.spring.number in yielding:
            top.table("compliance").fail(
                "", f"{each.spring.number} has a compliance already", at=key
            )
        yielding[each.spring.number] = each
    if not yielding:
        _refuse_without(top, described)
        return None, limbs
    _refuse_cables(top, limbs)
    order = {number.name: _place(limbs, number) for number in limbs.numbers}
    springs = sorted(yielding.values(), key=lambda each: order[each.spring.moves[0][0]])
    numbers = _Numbers(parameters)
    for each in springs:
        name = COMPLIANCE + each.spring.number
        numbers.entries[name] = each.compliance
        if each.per_length is not None:
            numbers.entries[name + PER_LENGTH] = each.per_length
    masses = {key: _masses(described, key, numbers) for key in MASSES}
    _read_carried(top, numbers)
    balancers = _read_balancers(top, numbers)
    numbers.tilts(top)
    elastic = Elastic(
        tuple(each.spring for each in springs),
        rods=masses["mass"],
        anchors=masses["anchor_mass"],
        platform="platform" in top,
        payload="payload" in top,
        gravity=_gravity(top),
        balancers=balancers,
    )
    return elastic, _with_numbers(limbs, elastic, numbers.entries)


# what yields ------------------------------------------------------------------------------------


def _of_limbs(
    described: Sequence[Table], limbs: Limbs, parameters: Parameters
) -> Iterator[_Yields]:
    """Springs by the keys of limbs."""
    if any(limb.kind not in KINDS for limb in limbs.limbs):
        for table in described:
            for key in (*STIFFNESS, *MASSES):
                if key in table:
                    table.fail(key, "is of machines without chains: here state [compliance]")
        return
    for i, table in enumerate(described):
        for key, slot in STIFFNESS.items():
            if key in table:
                number = next(each for each in limbs.numbers if each.name == f"{slot}{i + 1}")
                yield _by_stiffness(table, key, Spring(number.name, number.unit), parameters)


def _by_stiffness(table: Table, key: str, spring: Spring, parameters: Parameters) -> _Yields:
    value = table.data[key]
    of, at = table, key
    per_length = None
    if isinstance(value, Mapping):
        of, at = table.table(key), "value"
        of.only(("value", "at", "per_length"), "a stiffness")
        value = of[at]
        spring, per_length = _growing(of, spring, parameters)
    what = "a number of N/mm, or of N m/rad of an angle; what has a name goes into [compliance]"
    stiffness = of.as_number(at, value, "N/mm", what)
    if not stiffness > 0.0:
        of.fail(at, f"must be positive, found {shown(value)}")
    factor = _PER_MM if spring.unit == "rad" else 1.0
    return _Yields(spring, Entry(factor / stiffness), per_length)


def _of_table(top: Table, limbs: Limbs, parameters: Parameters) -> Iterator[tuple[str, _Yields]]:
    """Springs of the table ``[compliance]``, each with the key that names it."""
    if "compliance" not in top:
        return
    table = top.table("compliance")
    units = {number.name: number.unit for number in limbs.numbers}
    tied = dict.fromkeys(name for each in limbs.numbers if each.tie for name in each.tie.drivers)
    of_parameters = {name: parameters.units[name] for name in tied}
    for key, value in table.data.items():
        hits = [name for name in units if fnmatchcase(name, key)]
        hits = hits or [name for name in of_parameters if fnmatchcase(name, key)]
        if not hits:
            known = did_you_mean(key, [*units, *of_parameters])
            table.fail("", f"the limbs have no number {key!r}{known}", at=key)
        for name in hits:
            try:
                spring = spring_of(name, (units | of_parameters)[name], limbs.numbers)
            except ArgumentError as error:
                table.fail("", str(error), at=key)
            unit = spring.units[COMPLIANCE + name]
            of, at, per_length, given = table, key, None, value
            if isinstance(value, Mapping):
                of, at = table.table(key), "value"
                of.only(("value", "at", "per_length"), "a compliance")
                given = of[at]
                spring, per_length = _growing(of, spring, parameters)
            entry = parameters.entry(parameters.term(of, at, given, unit))
            yield key, _Yields(spring, entry, per_length)


def _growing(of: Table, spring: Spring, parameters: Parameters) -> tuple[Spring, Entry | None]:
    """The spring with what its compliance grows by per mm of its drive, where that is stated."""
    if "per_length" not in of:
        if "at" in of:
            of.fail("at", "is where per_length is 0, which is missing")
        return spring, None
    if spring.unit != "mm" or not spring.of_drive:
        of.fail("per_length", f"is of a leg or a screw, and {spring.number} has no way to grow by")
    term = parameters.term(of, "per_length", of["per_length"], "1/N")
    drive = int(spring.number.removeprefix("offset")) - 1
    grown = replace(spring, drive=drive, at=of.number("at", "mm"))
    return grown, parameters.entry(term)


def _place(limbs: Limbs, number: LimbNumber) -> int:
    """Return the place of a number among those of the core."""
    if number.place is not None:
        return number.place
    width = len(SLOTS) if limbs.blank is None else limbs.blank.shape[1]
    return number.limb * width + SLOTS.index(number.slot)


def _refuse_without(top: Table, described: Sequence[Table]) -> None:
    for table, keys in [(top, TOP), *((each, tuple(MASSES)) for each in described)]:
        for key in keys:
            if key in table:
                why = "pulls at a machine in which nothing yields: state stiffness or [compliance]"
                table.fail(key, f'{why}, "offset*" = 0 where compliances are to be identified')


def _refuse_cables(top: Table, limbs: Limbs) -> None:
    if any(limb.kind in KINDS and KINDS[limb.kind].cable for limb in limbs.limbs):
        top.fail("", "cables yield by the stretch of their drive, not by a compliance")


# what pulls -------------------------------------------------------------------------------------


def _masses(described: Sequence[Table], key: str, numbers: _Numbers) -> tuple[int, ...]:
    """Limbs that state a mass under this key."""
    having = tuple(i for i, table in enumerate(described) if key in table)
    for i in having:
        numbers.read(described[i], key, "kg", f"mass.{MASSES[key]}{i + 1}")
    return having


class _Numbers:
    """Numbers of what yields and pulls as they are read, by name.

    Parameters
    ----------
    parameters : Parameters
        Which they may name.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.entries: dict[str, Entry] = {}

    def read(
        self, table: Table, key: str, unit: Unit, name: str, default: float | None = None
    ) -> None:
        """Read a number, not negative unless it has the unit of a place."""
        value = table[key] if default is None else table.data.get(key, default)
        self._put(table, key, unit, name, value)
        if unit in ("kg", "N/mm") and self.entries[name].value < 0.0:
            table.fail(key, f"must not be negative, found {shown(value)}")

    def vector(self, table: Table, key: str, unit: Unit, name: str, needed: bool = False) -> None:
        """Three numbers, by default 0."""
        given: Sequence[Any] = (0.0, 0.0, 0.0)
        if needed or key in table:
            given = table.list_of(key, 3, "three numbers")
        for axis, value in zip("xyz", given, strict=True):
            self._put(table, key, unit, f"{name}.{axis}", value)

    def tilts(self, top: Table) -> None:
        """The two tilts of gravity, by default 0."""
        key = "gravity_tilt"
        given = top.list_of(key, 2, "two angles") if key in top else (0.0, 0.0)
        for k, tilt in enumerate(given, 1):
            self._put(top, key, "rad", f"gravity.tilt{k}", tilt)

    def _put(self, table: Table, key: str, unit: Unit, name: str, value: Any) -> None:
        self.entries[name] = self.parameters.entry(self.parameters.term(table, key, value, unit))


def _read_carried(top: Table, numbers: _Numbers) -> None:
    """The masses of platform and payload, and what else pulls at the tool."""
    if "platform" in top:
        table = top.table("platform")
        table.only(("mass", "centre"))
        numbers.read(table, "mass", "kg", "mass.platform")
        numbers.vector(table, "centre", "mm", "centre.platform")
    if "payload" in top:
        table = top.table("payload")
        table.only(("mass", "centre", "force", "moment"))
        numbers.read(table, "mass", "kg", "payload.mass", 0.0)
        numbers.vector(table, "centre", "mm", "payload.centre")
        numbers.vector(table, "force", "N", "payload.force")
        numbers.vector(table, "moment", "N mm", "payload.moment")


def _read_balancers(top: Table, numbers: _Numbers) -> int:
    if "balancer" not in top:
        return 0
    tables = top.tables("balancer", "a robot with balancers")
    for j, table in enumerate(tables, 1):
        table.only(("base", "platform", "rate", "free"))
        for end in ("base", "platform"):
            numbers.vector(table, end, "mm", f"balancer{j}.{end}", needed=True)
        numbers.read(table, "rate", "N/mm", f"balancer{j}.rate")
        numbers.read(table, "free", "mm", f"balancer{j}.free")
    return len(tables)


def _gravity(top: Table) -> tuple[float, float, float]:
    if "gravity" not in top:
        return GRAVITY
    x, y, z = (
        top.as_number("gravity", each, "1")
        for each in top.list_of("gravity", 3, "three numbers of m/s²")
    )
    return (x, y, z)


# numbers ----------------------------------------------------------------------------------------


def _with_numbers(limbs: Limbs, elastic: Elastic, entries: Mapping[str, Entry]) -> Limbs:
    """The limbs with the numbers of what is elastic, behind those of the first limb's row."""
    before = limbs.blank
    if before is None:
        before = np.zeros((len(limbs.limbs), len(SLOTS)))
        before[:, SLOTS.index("gain")] = 1.0
    units = elastic.units
    ties = {name: entries[name].tie for name in units}
    numbers, blank = widened(limbs.numbers, before, elastic, ties)
    values = {name: entries[name].value for name in units if entries[name].tie is None}
    return Limbs(limbs.limbs, numbers, limbs.values | values, blank)
