"""Drive laws: which numbers they have, and where in the geometry these are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from pkmcal.arrays import Unit
from pkmcal.core.laws import Drive
from pkmcal.geometry.geometry import Geometry


class LawNumber(NamedTuple):
    """A number of a law: key and entry in a robot file, its public name and its unit."""

    key: str
    entry: int
    name: str
    unit: Unit


@dataclass(frozen=True)
class Law:
    """A law between an actuator's reading and its drive, apart from its numbers.

    Attributes
    ----------
    quadratic, spool, backlash : bool
        Whether it has these.
    harmonics : tuple of float
        Angular frequency k of each, 1 or 1/mm: waves a turn of an angle.
    table : tuple of float or None
        Readings, rising, at which corrections are stated; mm or rad.
    smoothness : float or None
        Standard deviation of what a correction is off the middle of its neighbours, mm or rad;
        None: nothing is known of it.
    stretch : bool
        Whether the drive grows with its tension.
    """

    quadratic: bool = False
    spool: bool = False
    harmonics: tuple[float, ...] = ()
    table: tuple[float, ...] | None = None
    smoothness: float | None = None
    backlash: bool = False
    stretch: bool = False

    def numbers(self, drive: int | Literal[""], unit: Unit) -> tuple[LawNumber, ...]:
        """The numbers of the law of a drive in mm or rad, counted from 1, in the stated order."""
        start = f"drive{drive}."
        found: list[LawNumber] = []

        def add(key: str, unit: Unit, entry: int = 0, name: str = "") -> None:
            found.append(LawNumber(key, entry, start + (name or key), unit))

        if self.quadratic:
            per: Unit = "1/rad" if unit == "rad" else "1/mm2" if self.spool else "1/mm"
            add("quadratic", per)
        if self.spool:
            add("spool", unit)
            add("buildup", unit)
        for j in range(len(self.harmonics)):
            add("cos", unit, j, f"cos{j + 1}")
            add("sin", unit, j, f"sin{j + 1}")
        for j in range(len(self.table or ())):
            add("table", unit, j, f"table{j + 1}")
        if self.backlash:
            add("backlash", unit)
        if self.stretch:
            add("stretch", "1/N")
        return tuple(found)


def gain_unit(law: Law | None, unit: Unit) -> Unit:
    """Unit of the gain of a drive in mm or rad: with a spool it turns that."""
    return "1/mm" if law is not None and law.spool and unit == "mm" else "1"


def drive(
    law: Law | None,
    number: int,
    unit: Unit,
    actuator: int,
    geometry: Geometry,
    stroke: tuple[float, float] | None,
) -> Drive:
    """A drive as the core takes it.

    Parameters
    ----------
    law : Law or None
        None: a gain and an offset alone.
    number : int
        Of the drive, counted from 1.
    unit : str
        Of its way, "mm" or "rad".
    actuator : int
        Counted from 0.
    geometry : Geometry
        With the numbers.
    stroke : tuple of float or None
        Of its way.
    """
    names = {name: i for i, name in enumerate(geometry.names)}

    def place(name: str) -> int:
        return int(geometry.slot_index[names[name]])

    ends = place(f"offset{number}"), place(f"gain{number}")
    if law is None:
        return Drive(actuator, unit == "rad", *ends, stroke=stroke)
    places = {(n.key, n.entry): place(n.name) for n in law.numbers(number, unit)}
    return Drive(
        actuator,
        unit == "rad",
        *ends,
        quadratic=places.get(("quadratic", 0)),
        spool=places.get(("spool", 0)),
        buildup=places.get(("buildup", 0)),
        harmonics=tuple(
            (k, places["cos", j], places["sin", j]) for j, k in enumerate(law.harmonics)
        ),
        table=None if law.table is None else np.array(law.table),
        corrections=tuple(places["table", j] for j in range(len(law.table or ()))),
        backlash=places.get(("backlash", 0)),
        stretch=places.get(("stretch", 0)),
        stroke=stroke,
    )
