"""The kinds of limbs a robot file can name: their drivers, rows, keys and numbers.

A limb is a driver and rows. The driver takes the actuator coordinate to an anchor point and a
length; every limb has the sphere row, and some kinds add rows of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pkmcal.arrays import Unit
from pkmcal.core.library import AXES, ROWS, SLOTS
from pkmcal.geometry.drivers import CRANK, LENGTH, PULLEY, SLIDER, TACKLE, Driver

POINT_SLOTS = SLOTS[:6]


@dataclass(frozen=True)
class LimbKind:
    """A kind of limb, as a robot file states it.

    Attributes
    ----------
    name : str
        The name of the kind.
    driver : Driver
        How the actuator moves the limb.
    what, many : str
        What the limb is, in a few words, and what several of them are.
    axes : mapping of str to str
        Key of each axis of the core (`pkmcal.core.AXES`) that the limb has; its tilts have the key
        with ``_tilt`` behind it.
    rows : tuple of str
        The closures beside the sphere row.
    cable : bool
        Whether it pulls and cannot push.
    couple : bool
        Whether a stated length `couple` adds a row and makes the base axis part of the limb.
        Otherwise every limb of the kind has all its axes.
    """

    name: str
    driver: Driver
    what: str
    many: str
    axes: Mapping[str, str] = field(default_factory=dict)
    rows: tuple[str, ...] = ()
    couple: bool = False
    cable: bool = False

    def __post_init__(self) -> None:
        unknown = {*self.axes, *self.rows} - {*AXES, *ROWS}
        if unknown:
            raise ValueError(f"{self.name}: the core has no {', '.join(sorted(unknown))}")
        for couple in {False, self.couple}:
            used = {axis for row in self.all_rows(couple) for axis in ROWS[row]}
            used |= {"base"} if self.driver.has_base_axis else set()
            if used != set(self.axes_of(couple)):
                raise ValueError(
                    f"{self.name}: its driver and rows have the axes {sorted(used)}, "
                    f"but {sorted(self.axes_of(couple))} have keys"
                )

    @property
    def actuator_unit(self) -> Unit:
        """Unit of the actuator coordinate and of the offset."""
        return self.driver.unit

    def axes_of(self, couple: bool) -> dict[str, str]:
        """The axes of a limb with or without a couple length, in the order of the core."""
        missing = "base" if self.couple and not couple else None
        return {axis: self.axes[axis] for axis in AXES if axis in self.axes and axis != missing}

    def all_rows(self, couple: bool) -> tuple[str, ...]:
        """The rows beside the sphere row of a limb with or without a couple length."""
        return self.rows + (("couple",) if couple else ())

    def keys(self) -> tuple[str, ...]:
        """Every key a ``[[limb]]`` table of this kind may have."""
        axes = self.axes.values()
        return (
            ("kind", "base", "platform", "offset", "gain", "actuator")
            + (("over", "parts") if self.driver.points else ())
            + tuple(self.driver.lengths)
            + tuple(axes)
            + tuple(f"{axis}_tilt" for axis in axes)
            + (("zero",) if self.driver.has_zero else ())
            + (("branch",) if self.driver.carries else ())
            + (("couple",) if self.couple else ())
            + (("weights",) if self.rows or self.couple else ())
            + ("drive", "stroke", "base_cone", "platform_cone")
            + (() if self.cable else ("stiffness", "mass"))
            + (("rod_stiffness", "anchor_mass") if self.driver.carries else ())
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
        for key, slot in self.driver.lengths.items():
            found[slot] = (f"{key}{limb}", "mm")
        for axis, key in self.axes_of(couple).items():
            for i, slot in enumerate(AXES[axis], 1):
                found[slot] = (f"{key}{limb}.tilt{i}", "rad")
        return tuple((slot, *found[slot]) for slot in SLOTS if slot in found)


KINDS: dict[str, LimbKind] = {
    kind.name: kind
    for kind in (
        LimbKind("UPS", LENGTH, "a leg of variable length", "legs of variable length"),
        LimbKind(
            "UPR",
            LENGTH,
            "a leg of variable length that keeps to a plane of the platform",
            "legs of variable length that keep to a plane of the platform",
            axes={"base": "universal", "platform": "revolute"},
            rows=("platform_plane",),
            couple=True,
        ),
        LimbKind(
            "RPS",
            LENGTH,
            "a leg of variable length that keeps to a plane of the base",
            "legs of variable length that keep to a plane of the base",
            axes={"base": "normal"},
            rows=("base_plane",),
        ),
        LimbKind(
            "PUS",
            SLIDER,
            "a carriage and a rod",
            "carriages, each with a rod",
            axes={"base": "slider"},
        ),
        LimbKind(
            "PRS",
            SLIDER,
            "a carriage and a rod that keeps to a plane of the carriage",
            "carriages, each with a rod that keeps to a plane of the carriage",
            axes={"base": "slider", "hinge": "normal"},
            rows=("hinge_plane",),
        ),
        LimbKind(
            "cable",
            LENGTH,
            "a cable or belt from point to point, taut",
            "cables or belts from point to point, taut",
            cable=True,
        ),
        LimbKind(
            "pulley",
            PULLEY,
            "a cable over a swivelling pulley, taut",
            "cables over swivelling pulleys, taut",
            axes={"base": "swivel"},
            cable=True,
        ),
        LimbKind(
            "tackle",
            TACKLE,
            "a cable over several points, taut",
            "cables over several points, taut",
            cable=True,
        ),
        LimbKind(
            "RUS", CRANK, "a crank and a rod", "cranks, each with a rod", axes={"base": "axis"}
        ),
    )
}

# Other names of a kind; T is the Hooke (universal) joint.
ALIASES: dict[str, str] = {"TPS": "UPS", "SPS": "UPS", "TPR": "UPR"}

# What each key of a ``[[limb]]`` table states, as `pkmcal new` explains it; {kinds}: the kinds.
KEYS = {
    "kind": "{kinds}",
    "actuator": "number of the q that drives it, if not its own: several limbs may name one",
    "base": "its joint on the base: [x, y, z], or {{ radius = …, angle = …, z = … }}",
    "platform": "its joint on the platform, in the platform's frame",
    "slider": "direction of the carriage's travel, of any length",
    "normal": "of the plane that the limb stays in",
    "revolute": "axis of its joint on the platform, in the platform's frame",
    "universal": "first axis of its joint on the base, with couple",
    "couple": "a length: makes its second constraint count too",
    "weights": "of its constraints beside the length",
    "over": "further points from which parts of the cable run to the platform: [[x, y, z], …]",
    "parts": "how many parts run from base, and from each point under over",
    "swivel": "axis of the pulley, along which the cable runs onto it, at base",
    "radius": "of the pulley's groove",
    "axis": "of the crank, at base",
    "zero": "where the crank points at 0, or the pulley's swivel",
    "crank": "length of the crank",
    "rod": "length from carriage or crank to the platform joint",
    "offset, gain": "the drive is at gain · q + offset; 0 and 1 if left out",
    "branch": "which of the two places that a rod can lead to: 1 or -1",
    "stiffness, rod_stiffness": "N/mm of the leg or the screw, N m/rad of the crank; of the rod",
    "mass, anchor_mass": "kg: of leg or rod, half of it at each end; of the carriage",
    "drive": "law of a drive with a shape: quadratic, spool, harmonics, table, backlash",
    "stroke": "least and most of gain · q + offset",
    "base_cone": "{{ axis = …, angle = … }}: how far its joint on the base swings",
    "platform_cone": "{{ axis = …, angle = … }}: how far its joint on the platform swings",
}
