"""What one measured value of each kind consists of: its components and their units."""

from __future__ import annotations

from typing import Literal

from pkmcal.arrays import Unit

Kind = Literal["pose", "position", "height", "distance", "closure"]

_LENGTHS: tuple[tuple[str, Unit], ...] = (("x", "mm"), ("y", "mm"), ("z", "mm"))
_ANGLES: tuple[tuple[str, Unit], ...] = (("alpha", "rad"), ("beta", "rad"), ("gamma", "rad"))

COMPONENTS: dict[Kind, tuple[tuple[str, Unit], ...]] = {
    "pose": _LENGTHS + _ANGLES,
    "position": _LENGTHS,
    "height": (("z", "mm"),),
    "distance": (("distance", "mm"),),
    "closure": (),  # the actuators alone
}
