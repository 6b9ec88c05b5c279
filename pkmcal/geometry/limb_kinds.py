"""The kinds of limbs a robot file can name: their drivers, rows, keys and numbers.

A limb is a driver and rows. The driver takes the actuator coordinate to an anchor point and a
length; every limb has the sphere row, and some kinds add rows of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pkmcal.arrays import Unit
from pkmcal.core.library import SLOTS

Driver = Literal["length", "slider", "crank"]

POINT_SLOTS = SLOTS[:6]
TILT_SLOTS = ("tilt1", "tilt2")
PLATFORM_TILT_SLOTS = ("platform_tilt1", "platform_tilt2")


@dataclass(frozen=True)
class LimbKind:
    """What a robot file says about one kind of limb.

    Attributes
    ----------
    name : str
        The name of the kind.
    driver : {"length", "slider", "crank"}
        How the actuator moves the limb; a crank's coordinate is an angle.
    base_axis : str or None
        Key of its axis in base axes; its tilts are the slots ``tilt1`` and ``tilt2``.
    platform_axis : str or None
        Key of its axis in platform axes; tilts in ``platform_tilt1`` and ``platform_tilt2``.
    rows : tuple of str
        The closures beside the sphere row.
    couple : bool
        Whether a stated length `couple` adds a row and makes `base_axis` part of the limb.
        Otherwise every limb of the kind has its `base_axis`.
    """

    name: str
    driver: Driver
    base_axis: str | None = None
    platform_axis: str | None = None
    rows: tuple[str, ...] = ()
    couple: bool = False

    @property
    def actuator_unit(self) -> Unit:
        """Unit of the actuator coordinate and of the offset."""
        return "rad" if self.driver == "crank" else "mm"

    @property
    def lengths(self) -> tuple[str, ...]:
        """Fixed lengths of the limb, keys and slots of the same name."""
        return {"length": (), "slider": ("rod",), "crank": ("rod", "crank")}[self.driver]

    @property
    def has_branch(self) -> bool:
        """Whether the inverse has two branches to choose from."""
        return self.driver != "length"

    def has_base_axis(self, couple: bool) -> bool:
        """Whether a limb with or without a couple length has the base axis."""
        return self.base_axis is not None and (couple or not self.couple)

    def all_rows(self, couple: bool) -> tuple[str, ...]:
        """The rows beside the sphere row of a limb with or without a couple length."""
        return self.rows + (("couple",) if couple else ())

    def keys(self) -> tuple[str, ...]:
        """Every key a ``[[limb]]`` table of this kind may have."""
        axes = [axis for axis in (self.base_axis, self.platform_axis) if axis is not None]
        return (
            ("kind", "base", "platform", "offset", "gain", "actuator")
            + self.lengths
            + tuple(axes)
            + tuple(f"{axis}_tilt" for axis in axes)
            + (("zero",) if self.driver == "crank" else ())
            + (("branch",) if self.has_branch else ())
            + (("couple",) if self.couple else ())
            + (("weights",) if self.rows or self.couple else ())
            + ("stroke", "base_cone", "platform_cone")
        )

    def numbers(self, limb: int | Literal[""], couple: bool) -> tuple[tuple[str, str, Unit], ...]:
        """Slot, public name and unit of each number of limb `limb`, in the order of `SLOTS`.

        Limbs count from 1; ``limb=""`` gives the names that stand for all limbs (``rod``).
        """
        found: dict[str, tuple[str, Unit]] = {
            slot: (slot.replace(".", f"{limb}."), "mm") for slot in POINT_SLOTS
        }
        found["offset"] = (f"offset{limb}", self.actuator_unit)
        found["gain"] = (f"gain{limb}", "1")
        for slot in self.lengths:
            found[slot] = (f"{slot}{limb}", "mm")
        if self.has_base_axis(couple):
            for i, slot in enumerate(TILT_SLOTS, 1):
                found[slot] = (f"{self.base_axis}{limb}.tilt{i}", "rad")
        if self.platform_axis is not None:
            for i, slot in enumerate(PLATFORM_TILT_SLOTS, 1):
                found[slot] = (f"{self.platform_axis}{limb}.tilt{i}", "rad")
        return tuple((slot, *found[slot]) for slot in SLOTS if slot in found)


KINDS: dict[str, LimbKind] = {
    kind.name: kind
    for kind in (
        LimbKind("UPS", "length"),
        LimbKind(
            "UPR",
            "length",
            base_axis="universal",
            platform_axis="revolute",
            rows=("platform_plane",),
            couple=True,
        ),
        LimbKind("RPS", "length", base_axis="normal", rows=("base_plane",)),
        LimbKind("PUS", "slider", base_axis="slider"),
        LimbKind("RUS", "crank", base_axis="axis"),
    )
}

# Other names of a kind; T is the Hooke (universal) joint.
ALIASES: dict[str, str] = {"TPS": "UPS", "SPS": "UPS", "TPR": "UPR"}
