"""The kinds of limbs a robot file can name: their drivers, rows, keys and numbers.

A limb is a driver and rows. The driver takes the actuator coordinate to an anchor point and a
length; every limb has the sphere row, and some kinds add rows of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pkmcal.arrays import Unit
from pkmcal.core.library import AXES, DRIVERS, ROWS, SLOTS
from pkmcal.core.pulleys import BENT

Driver = Literal["length", "slider", "crank", "pulley", "tackle"]

POINT_SLOTS = SLOTS[:6]


@dataclass(frozen=True)
class LimbKind:
    """A kind of limb, as a robot file states it.

    Attributes
    ----------
    name : str
        The name of the kind.
    driver : {"length", "slider", "crank", "pulley", "tackle"}
        How the actuator moves the limb; a crank's coordinate is an angle. Of a pulley and a tackle
        the core knows limbs between two points that stand for it (`pkmcal.core.pulleys`).
    what : str
        What the limb is, in a few words.
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
    axes: Mapping[str, str] = field(default_factory=dict)
    rows: tuple[str, ...] = ()
    couple: bool = False
    cable: bool = False

    def __post_init__(self) -> None:
        unknown = {self.driver, *self.axes, *self.rows} - {*DRIVERS, *BENT, *AXES, *ROWS}
        if unknown:
            raise ValueError(f"{self.name}: the core has no {', '.join(sorted(unknown))}")
        for couple in {False, self.couple}:
            used = {axis for row in self.all_rows(couple) for axis in ROWS[row]}
            used |= set() if self.driver in ("length", "tackle") else {"base"}
            if used != set(self.axes_of(couple)):
                raise ValueError(
                    f"{self.name}: its driver and rows have the axes {sorted(used)}, "
                    f"but {sorted(self.axes_of(couple))} have keys"
                )

    @property
    def actuator_unit(self) -> Unit:
        """Unit of the actuator coordinate and of the offset."""
        return "rad" if self.driver == "crank" else "mm"

    @property
    def lengths(self) -> Mapping[str, str]:
        """Keys of the fixed lengths of the limb, and the slots they are in."""
        of_drivers: dict[Driver, dict[str, str]] = {
            "length": {},
            "slider": {"rod": "rod"},
            "crank": {"rod": "rod", "crank": "crank"},
            "pulley": {"radius": "crank"},  # what turns about the base point, as a crank does
            "tackle": {},
        }
        return of_drivers[self.driver]

    @property
    def has_branch(self) -> bool:
        """True if the inverse has two branches to choose from."""
        return self.driver in ("slider", "crank")

    @property
    def has_zero(self) -> bool:
        """True if the direction in which an angle about the base axis is 0 can be stated."""
        return self.driver in ("crank", "pulley")

    @property
    def has_points(self) -> bool:
        """True if the cable runs over several points of the base, with whole numbers of parts."""
        return self.driver == "tackle"

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
            + (("over", "parts") if self.has_points else ())
            + tuple(self.lengths)
            + tuple(axes)
            + tuple(f"{axis}_tilt" for axis in axes)
            + (("zero",) if self.has_zero else ())
            + (("branch",) if self.has_branch else ())
            + (("couple",) if self.couple else ())
            + (("weights",) if self.rows or self.couple else ())
            + ("drive", "stroke", "base_cone", "platform_cone")
            + (() if self.cable else ("stiffness", "mass"))
            + (("rod_stiffness", "anchor_mass") if self.has_branch else ())
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
        for key, slot in self.lengths.items():
            found[slot] = (f"{key}{limb}", "mm")
        for axis, key in self.axes_of(couple).items():
            for i, slot in enumerate(AXES[axis], 1):
                found[slot] = (f"{key}{limb}.tilt{i}", "rad")
        return tuple((slot, *found[slot]) for slot in SLOTS if slot in found)


KINDS: dict[str, LimbKind] = {
    kind.name: kind
    for kind in (
        LimbKind("UPS", "length", "a leg of variable length"),
        LimbKind(
            "UPR",
            "length",
            "a leg of variable length that keeps to a plane of the platform",
            axes={"base": "universal", "platform": "revolute"},
            rows=("platform_plane",),
            couple=True,
        ),
        LimbKind(
            "RPS",
            "length",
            "a leg of variable length that keeps to a plane of the base",
            axes={"base": "normal"},
            rows=("base_plane",),
        ),
        LimbKind("PUS", "slider", "a carriage and a rod", axes={"base": "slider"}),
        LimbKind(
            "PRS",
            "slider",
            "a carriage and a rod that keeps to a plane of the carriage",
            axes={"base": "slider", "hinge": "normal"},
            rows=("hinge_plane",),
        ),
        LimbKind("cable", "length", "a cable or belt from point to point, taut", cable=True),
        LimbKind(
            "pulley",
            "pulley",
            "a cable over a swivelling pulley, taut",
            axes={"base": "swivel"},
            cable=True,
        ),
        LimbKind("tackle", "tackle", "a cable over several points, taut", cable=True),
        LimbKind("RUS", "crank", "a crank and a rod", axes={"base": "axis"}),
    )
}

# Other names of a kind; T is the Hooke (universal) joint.
ALIASES: dict[str, str] = {"TPS": "UPS", "SPS": "UPS", "TPR": "UPR"}
