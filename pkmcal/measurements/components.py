"""What one measured value of each kind consists of, and on what it depends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pkmcal.arrays import Unit

Kind = Literal[
    "pose", "position", "height", "distance", "closure",
    "between", "relative-distance", "orientation", "tilt", "angle", "touch", "touch-distance",
]  # fmt: skip
Artefact = Literal["point", "line", "plane", "sphere"]
Components = tuple[tuple[str, Unit], ...]

_LENGTHS: Components = (("x", "mm"), ("y", "mm"), ("z", "mm"))
_ANGLES: Components = (("alpha", "rad"), ("beta", "rad"), ("gamma", "rad"))
_DISTANCE: Components = (("distance", "mm"),)


@dataclass(frozen=True)
class KindOfReading:
    """What a kind of measurement is made of.

    Attributes
    ----------
    components : tuple of (str, str)
        Name and unit of each number of a value.
    turning : int or None
        The first of three components that are an orientation and differ by a rotation vector.
    framed : bool
        Whether the readings are in the frame of an instrument.
    point : str
        Whose place `Measurements.target` is: of the "platform", of the "base", or "" of neither.
    nouns : (str, str) or None
        What one and several are called, where not as the kind and with an s.
    """

    components: Components
    turning: int | None = None
    framed: bool = False
    point: Literal["platform", "base", ""] = ""
    nouns: tuple[str, str] | None = None


KINDS: dict[Kind, KindOfReading] = {
    "pose": KindOfReading(_LENGTHS + _ANGLES, turning=3, framed=True),
    "position": KindOfReading(_LENGTHS, framed=True, point="platform"),
    "height": KindOfReading((("z", "mm"),), framed=True, point="platform"),
    "distance": KindOfReading(_DISTANCE, point="base"),
    "closure": KindOfReading(()),  # the actuators alone
    "between": KindOfReading(
        _DISTANCE,
        point="platform",
        nouns=("distance between two places", "distances between two places"),
    ),
    "relative-distance": KindOfReading(
        _DISTANCE, point="base", nouns=("relative distance", "relative distances")
    ),
    "orientation": KindOfReading(_ANGLES, turning=0, framed=True),
    "tilt": KindOfReading((("tilt1", "rad"), ("tilt2", "rad")), framed=True),
    "angle": KindOfReading((("angle", "rad"),)),
    "touch": KindOfReading(  # components by artefact, see below
        (), point="platform", nouns=("touch", "touches")
    ),
    "touch-distance": KindOfReading(_DISTANCE),  # between two touched points; no pose has to do
}

# How far a touching point is off the artefact, in its axes.
TOUCHES: dict[Artefact, Components] = {
    "point": (("off1", "mm"), ("off2", "mm"), ("off3", "mm")),
    "line": (("off1", "mm"), ("off2", "mm")),
    "plane": (("off1", "mm"),),
    "sphere": (("off1", "mm"),),
}


def components(kind: Kind, artefact: Artefact | None = None) -> Components:
    """Names and units of the numbers of one value."""
    return KINDS[kind].components if artefact is None else TOUCHES[artefact]


def noun(kind: Kind, count: int = 2) -> str:
    """What one, or several, are called."""
    one, several = KINDS[kind].nouns or (kind, f"{kind}s")
    return one if count == 1 else several
