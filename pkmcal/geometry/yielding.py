"""Numbers of what yields beside those of the limbs, and models that are made to yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arguments import number
from pkmcal.arrays import FloatArray
from pkmcal.core.library import SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.carried import CARRIED, Load
from pkmcal.geometry.elastic import (
    COMPLIANCE,
    Elastic,
    Spring,
    is_elastic,
    require_compliance,
    spring_of,
)
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.model import Model
from pkmcal.geometry.ties import LimbNumber, Tie


def widened(
    numbers: Sequence[LimbNumber],
    blank: FloatArray,
    elastic: Elastic,
    ties: Mapping[str, Tie | None],
) -> tuple[list[LimbNumber], FloatArray]:
    """Numbers of limbs with those of what yields behind the first row of the core's, `blank`.

    These and the core's numbers, where there are none yet; `ties` says which follow parameters.
    """
    rows, width = blank.shape
    units = elastic.units
    wide = width + len(units)
    made = []
    for each in numbers:
        place = each.place
        if place is None:
            place = each.limb * width + SLOTS.index(each.slot)
        row, column = divmod(place, width)
        made.append(replace(each, place=row * wide + column))
    for j, (name, unit) in enumerate(units.items()):
        made.append(LimbNumber(name, unit, -1, name, ties.get(name), width + j))
    return made, np.hstack([blank, np.zeros((rows, len(units)))])


def yielding(
    model: Model, compliance: Mapping[str, float], ways: Sequence[float] | None = None
) -> Model:
    """The model with numbers that yield, mm/N and rad/(N mm), by name or wildcard.

    Where `ways` are given, of each drive in mm, compliances grow along them by numbers that are 0
    there.

    Raises
    ------
    ValueError, TypeError
        A name that matches no number of a limb, a ratio, or a compliance below 0; with `ways` one
        of no leg or screw.
    """
    wanted: dict[str, float] = {}
    for pattern, value in compliance.items():
        what = f"compliance of {pattern}"
        number(what, value, least=0.0)
        wanted |= dict.fromkeys(elastic_numbers(model, pattern), float(value))
        require_compliance(what, value, "N/mm or N mm/rad")
    if ways is not None:
        return _with_springs(model, wanted, ways)
    known = {name: value for name, value in wanted.items() if COMPLIANCE + name in model.geometry}
    if known:
        changed = {COMPLIANCE + name: value for name, value in known.items()}
        model = model.with_geometry(model.geometry.replace(changed))
    fresh = {name: value for name, value in wanted.items() if name not in known}
    return _with_springs(model, fresh) if fresh else model


def elastic_numbers(model: Model, pattern: str) -> list[str]:
    """Numbers of limbs that match a name or wildcard, each a length or an angle.

    Parameters that limbs follow where no number of a limb does.
    """
    rigid = model.rigid.geometry
    units = dict(zip(rigid.names, rigid.units, strict=True))
    matching = rigid.match(pattern, "compliance")
    own = {each.name for each in rigid.numbers}
    hits = [name for name in matching if name in own] or matching
    wrong = [name for name in hits if units[name] not in ("mm", "rad")]
    if wrong or not hits:
        what = wrong[0] if wrong else pattern
        raise ArgumentError(f"compliance: {what} is no length and no angle of a limb")
    return hits


def carrying(model: Model, load: Load) -> Model:
    """The model of a machine that yields with this payload, which its file may state.

    Raises
    ------
    ValueError
        A load of several rows, or parameters that drive numbers of the stated payload.
    """
    assert model.elastic is not None
    values = load.rows(())
    numbers = {f"payload.{name}": float(each) for name, each in zip(CARRIED, values, strict=True)}
    if not model.elastic.payload:
        model = _with(model, replace(model.elastic, payload=True), {})
    return model.with_geometry(model.geometry.replace(numbers))


def _with_springs(
    model: Model, fresh: Mapping[str, float], ways: Sequence[float] | None = None
) -> Model:
    rigid, before = model.rigid.geometry, model.elastic or Elastic(())
    place = dict(zip(rigid.names, rigid.slot_index.tolist(), strict=False))
    units = dict(zip(rigid.names, rigid.units, strict=True))
    of_number = {spring.number: spring for spring in before.springs}
    for name in fresh:
        spring = spring_of(name, units[name], rigid.numbers)
        of_number[name] = spring if ways is None else _growing(spring, ways)
    springs = sorted(of_number.values(), key=lambda spring: place[spring.moves[0][0]])
    compliance = {COMPLIANCE + name: value for name, value in fresh.items()}
    return _with(model, replace(before, springs=tuple(springs)), compliance)


def _growing(spring: Spring, ways: Sequence[float]) -> Spring:
    """The spring with a compliance that grows from where its drive is at one of these ways."""
    name = spring.number
    if spring.unit != "mm" or not spring.of_drive:
        raise ArgumentError(f"per_length: of a leg or a screw, and {name} has no way to grow by")
    drive = int(name.removeprefix("offset")) - 1
    return replace(spring, drive=drive, at=float(ways[drive]))


def _with(model: Model, elastic: Elastic, fresh: Mapping[str, float]) -> Model:
    """The model with more numbers of what yields and pulls, 0 unless `fresh` states them."""
    rigid, old = model.rigid.geometry, model.geometry
    ties = {each.name: each.tie for each in old.numbers if is_elastic(each.name)}
    numbers, blank = widened(rigid.numbers, rigid.blank, elastic, ties)
    values = dict.fromkeys(elastic.units, 0.0) | dict(old.items())
    values |= fresh
    old_units = dict(zip(old.names, old.units, strict=True))
    parameters = {name: old_units[name] for name in old.parameters}
    geometry = Geometry(numbers, parameters, values, blank)
    return replace(model, geometry=geometry, elastic=elastic)
