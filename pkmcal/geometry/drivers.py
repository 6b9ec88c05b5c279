"""Drivers of limbs: how an actuator moves one, one entry each; their formulas are in `derive/`.

All that kinematics, checks, pictures and exports ask of a driver they ask here: none of them names
one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pkmcal.arrays import Unit
from pkmcal.core.library import DRIVERS as OF_THE_CORE
from pkmcal.core.pulleys import BENT

Carries = Literal["", "along", "about"]


@dataclass(frozen=True, eq=False)
class Driver:
    """A way in which an actuator moves a limb.

    Attributes
    ----------
    name : str
        Its name, in the core too where `core` names no other.
    unit : {"mm", "rad"}
        Of the actuator coordinate, and of the offset.
    lengths : mapping of str to str
        Keys of the fixed lengths of the limb, and the slots they are in.
    carries : {"", "along", "about"}
        How it moves the joint that a rod hangs on, the anchor: along the base axis or about it;
        the inverse then has two branches. With "" it changes the length of the limb. One that
        moves its anchor about the axis has the radius as its length beside the rod.
    has_zero, needs_zero : bool
        Whether the direction in which an angle about the base axis is 0 can be stated, or must be.
    points : bool
        Whether the limb runs over several points of the base, with whole numbers of parts.
    swivels : bool
        Whether something turns about the base axis that no actuator moves.
    core : str
        The driver of limbs between two points that stand for it in the core.
    jointed : bool
        Whether the limb is a row of joints, which `robot_file_kind_joints` can list.
    """

    name: str
    unit: Unit = "mm"
    lengths: Mapping[str, str] = field(default_factory=dict)
    carries: Carries = ""
    has_zero: bool = False
    needs_zero: bool = False
    points: bool = False
    swivels: bool = False
    core: str = ""
    jointed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "core", self.core or self.name)
        if self.name not in (*OF_THE_CORE, *BENT) or self.core not in OF_THE_CORE:
            raise ValueError(
                f"{self.name}: the core has no such driver, but {', '.join(OF_THE_CORE)}: "
                "declare it in derive/limbs.py, make regenerate and build"
            )
        if self.turns != any(key != "rod" for key in self.lengths) and not self.swivels:
            raise ValueError(
                f"{self.name}: lengths must name a radius beside the rod where, and only where, "
                'carries is "about"'
            )

    @property
    def bent(self) -> bool:
        """True if the limb is no distance between two points: the core knows others for it."""
        return self.core != self.name

    @property
    def has_base_axis(self) -> bool:
        """True if the limb has an axis on its base side because of its driver."""
        return bool(self.carries) or self.swivels

    @property
    def slides(self) -> bool:
        """True if the anchor is a carriage, along the base axis."""
        return self.carries == "along"

    @property
    def turns(self) -> bool:
        """True if the anchor turns about the base axis, by an angle or by a way on its circle."""
        return self.carries == "about"

    @property
    def arm(self) -> str:
        """Key of the radius at which the anchor turns; "" where it does not."""
        return next((key for key in self.lengths if key != "rod"), "") if self.turns else ""


LENGTH = Driver("length", jointed=True)
SLIDER = Driver("slider", lengths={"rod": "rod"}, carries="along", jointed=True)
CRANK = Driver(
    "crank",
    "rad",
    {"rod": "rod", "crank": "crank"},
    carries="about",
    has_zero=True,
    needs_zero=True,
    jointed=True,
)
PULLEY = Driver(
    "pulley",
    lengths={"radius": "crank"},  # what turns about the base point, as a crank does
    has_zero=True,
    swivels=True,
    core="length",
)
TACKLE = Driver("tackle", points=True, core="length")
