"""Elastic numbers of a machine, and its loads: compliances, masses, loads, balancers.

A compliance belongs to a number of the geometry: under a force Q the number is c Q longer. The
values are numbers of the geometry themselves; this module says which there are and where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from pkmcal.arrays import Unit
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.load import is_of_load
from pkmcal.geometry.ties import LimbNumber

GRAVITY = (0.0, 0.0, -9.80665)  # m/s², in the axes of the base
COMPLIANCE, PER_LENGTH = "compliance.", ".per_length"
SOFTEST = 100.0  # mm/N, rad/(N mm): 1 kg moves the number by 1 m
_GROUPS = ("compliance", "mass.", "centre.", "payload.", "gravity.", "balancer")


@dataclass(frozen=True)
class Spring:
    """A number that yields: of a limb, or a parameter that several follow, such as of one screw.

    Attributes
    ----------
    number : str
        Its name, such as ``"offset1"``.
    unit : str
        "mm" or "rad".
    drive : int
        The drive, counted from 0, by whose way the compliance grows; -1 where it is constant.
    at : float
        The way, mm, at which the compliance is the stated one.
    followers : tuple of (str, float)
        Numbers of limbs that follow a parameter, with +1 or -1; none of a number of a limb.
    """

    number: str
    unit: Unit
    drive: int = -1
    at: float = 0.0
    followers: tuple[tuple[str, float], ...] = ()

    @property
    def moves(self) -> tuple[tuple[str, float], ...]:
        """Numbers of limbs that the spring moves, and by how much as it yields by 1."""
        return self.followers or ((self.number, 1.0),)

    @property
    def of_drive(self) -> bool:
        """True if the spring is that of one leg, screw or crank."""
        return self.number.startswith("offset") and not self.followers

    @property
    def units(self) -> dict[str, Unit]:
        """Names and units of its numbers."""
        own: Unit = "rad/(N mm)" if self.unit == "rad" else "mm/N"
        found = {COMPLIANCE + self.number: own}
        return found if self.drive < 0 else found | {COMPLIANCE + self.number + PER_LENGTH: "1/N"}


def spring_of(name: str, unit: Unit, numbers: Sequence[LimbNumber]) -> Spring:
    """The spring of a number of a limb, or of a parameter and the numbers that follow it.

    Raises
    ------
    ValueError
        What is no length and no angle, or a parameter that numbers follow otherwise than alike.
    """
    if unit not in ("mm", "rad"):
        raise ArgumentError(f"{name} is no length and no angle, and does not yield")
    if any(number.name == name for number in numbers):
        return Spring(name, unit)
    ties = [(each.name, each.tie) for each in numbers if each.tie and name in each.tie.drivers]
    if bent := [each for each, tie in ties if tie.rule != "equal"]:
        raise ArgumentError(f"{name} is a radius or an angle of {bent[0]}: name that number")
    return Spring(name, unit, followers=tuple((each, tie.terms[0].factor) for each, tie in ties))


@dataclass(frozen=True)
class Elastic:
    """Elastic numbers, in the order of the core, and the loads.

    Attributes
    ----------
    springs : tuple of Spring
        The numbers that yield.
    rods, anchors : tuple of int
        Limbs, counted from 0, whose rod or leg has a mass, halves of which act at both ends, and
        whose anchor (the carriage, the end of a crank) has one.
    platform : bool
        Whether the platform has a mass, with a centre in the frame of its joints.
    payload : bool
        Whether a payload is stated: mass, centre in the frame of the tool, force and moment.
    gravity : tuple of float
        m/s², in the axes of the base, before its tilts.
    balancers : int
        How many springs hold the platform, each between a point of the base and one of it.
    """

    springs: tuple[Spring, ...]
    rods: tuple[int, ...] = ()
    anchors: tuple[int, ...] = ()
    platform: bool = False
    payload: bool = False
    gravity: tuple[float, float, float] = GRAVITY
    balancers: int = 0

    @property
    def units(self) -> dict[str, Unit]:
        """Names and units of its numbers, in their order."""
        found: dict[str, Unit] = {}
        for spring in self.springs:
            found |= spring.units
        found |= {f"mass.limb{i + 1}": "kg" for i in self.rods}
        found |= {f"mass.anchor{i + 1}": "kg" for i in self.anchors}
        if self.platform:
            found["mass.platform"] = "kg"
            found |= _point("centre.platform", "mm")
        if self.payload:
            found["payload.mass"] = "kg"
            found |= _point("payload.centre", "mm")
            found |= _point("payload.force", "N") | _point("payload.moment", "N mm")
        found |= {"gravity.tilt1": "rad", "gravity.tilt2": "rad"}
        for j in range(1, self.balancers + 1):
            found |= _point(f"balancer{j}.base", "mm") | _point(f"balancer{j}.platform", "mm")
            found |= {f"balancer{j}.rate": "N/mm", f"balancer{j}.free": "mm"}
        return found


def _point(name: str, unit: Unit) -> dict[str, Unit]:
    return {f"{name}.{axis}": unit for axis in "xyz"}


def require_compliance(what: str, value: float, stiffness: str, per_stiffness: float = 1.0) -> None:
    """Refuse a compliance that no machine has, such as a stiffness in its place.

    Parameters
    ----------
    what : str
        As messages say it.
    value : float
        The compliance, mm/N or rad/(N mm).
    stiffness : str
        The unit of the stiffness that it may be.
    per_stiffness : float
        The compliance of a stiffness of 1.
    """
    if value > SOFTEST:
        raise ArgumentError(
            f"{what} is {value:g}, softer than any machine: if that is a stiffness in {stiffness},"
            f" its compliance is {per_stiffness / value:.4g}"
        )


@cache
def is_kinematic(name: str) -> bool:
    """Return whether a number is one of a limb, or ties some; not of loads or compliances."""
    return not is_elastic(name) and not is_of_load(name)


def is_elastic(name: str) -> bool:
    """Return whether a number is a compliance, of limbs or of joints, or of what pulls."""
    return name.startswith(_GROUPS)
