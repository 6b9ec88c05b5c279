"""The key ``drive`` of a limb or a joint: its law, read and written."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from pkmcal.arrays import Unit
from pkmcal.files.toml_table import Table, shown
from pkmcal.geometry.laws import Law, LawNumber
from pkmcal.geometry.model import Model

KEYS = ("quadratic", "spool", "buildup", "harmonics", "table", "smoothness", "backlash", "stretch")
# How a number is read: the table and the key for messages, the value, its unit.
Reader = Callable[[Table, str, object, Unit], Any]


def read_law(
    table: Table, number: int, unit: Unit, read: Reader
) -> tuple[Law | None, list[tuple[LawNumber, Any]]]:
    """The law of a drive in mm or rad, and its numbers with their values as `read` has them.

    `number` is that of the drive, counted from 1. None where the table has no key ``drive``.
    """
    if "drive" not in table:
        return None, []
    drive = table.table("drive")
    drive.only(KEYS, "a drive law")
    if not drive.data:
        table.fail("drive", f"states no law; it may have {', '.join(KEYS)}")
    if "spool" in drive and unit == "rad":
        drive.fail("spool", "takes up a length, and this actuator turns the limb")
    if "stretch" in drive and unit == "rad":
        drive.fail("stretch", "lengthens what is under tension, and this actuator turns the limb")
    if "buildup" in drive and "spool" not in drive:
        drive.fail("buildup", "is that of a spool, whose radius is missing: spool = …")
    waves = drive.tables("harmonics", "the key") if "harmonics" in drive else []
    for wave in waves:
        wave.only(("k", "cos", "sin"), "a harmonic")
    k = tuple(wave.number("k", "1/mm" if unit == "mm" else "1") for wave in waves)
    if any(each <= 0.0 for each in k) or len(set(k)) < len(k):
        drive.fail("harmonics", "must have different k above 0")
    places, corrections = _table(drive, unit) if "table" in drive else (None, [])
    smoothness = drive.number("smoothness", unit) if "smoothness" in drive else None
    if smoothness is not None and (places is None or not smoothness > 0.0):
        drive.fail("smoothness", "is how far a table bends, above 0")
    law = Law(
        quadratic="quadratic" in drive,
        spool="spool" in drive,
        harmonics=k,
        table=places,
        smoothness=smoothness,
        backlash="backlash" in drive,
        stretch="stretch" in drive,
    )
    numbers = []
    for each in law.numbers(number, unit):
        of = waves[each.entry] if each.key in ("cos", "sin") else drive
        value = corrections[each.entry] if each.key == "table" else of.data.get(each.key, 0.0)
        numbers.append((each, read(of, each.key, value, each.unit)))
    return law, numbers


def _table(drive: Table, unit: Unit) -> tuple[tuple[float, ...], list[object]]:
    form = "pairs [reading, correction], two or more with rising readings"
    given = drive["table"]
    if not isinstance(given, list) or len(given) < 2:
        drive.fail("table", f"must be {form}, found {shown(given)}")
    for pair in given:
        if not isinstance(pair, list) or len(pair) != 2:
            drive.fail("table", f"must be {form}, found {shown(pair)}")
    places = tuple(drive.as_number("table", pair[0], unit) for pair in given)
    for one, other in itertools.pairwise(places):
        if not one < other:
            drive.fail("table", f"must be {form}, found {one:g} and then {other:g}")
    return places, [pair[1] for pair in given]


def law_table(law: Law, unit: Unit, written: Callable[[str], Any]) -> dict[str, Any]:
    """The key ``drive`` in mm and rad; `written` has a number by its name, without ``drive1.``."""
    data: dict[str, Any] = {}
    for number in law.numbers("", unit):
        value = written(number.name.removeprefix("drive."))
        if number.key == "cos":
            data.setdefault("harmonics", []).append({"k": law.harmonics[number.entry]})
        if number.key in ("cos", "sin"):
            data["harmonics"][-1][number.key] = value
        elif number.key == "table":
            assert law.table is not None
            data.setdefault("table", []).append([law.table[number.entry], value])
        else:
            data[number.key] = value
    if law.smoothness is not None:
        data["smoothness"] = law.smoothness
    return data


def refuse_turning(model: Model, tables: list[Table]) -> None:
    """Refuse laws whose inverse is not known over the stroke, with the line of their limb."""
    for limb, why in model.doubts():
        tables[min(limb, len(tables) - 1)].fail(
            model.mechanism.key_of_drives, f"limb {limb + 1}: {why}"
        )
