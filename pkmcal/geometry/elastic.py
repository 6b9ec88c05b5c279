"""Elastic numbers of a machine, and its loads: compliances, masses, loads, balancers.

A compliance belongs to a number of the geometry: under a force Q the number is c Q longer. The
values are numbers of the geometry themselves; this module says which there are and where.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from pkmcal.arrays import Unit
from pkmcal.geometry.load import is_of_load

GRAVITY = (0.0, 0.0, -9.80665)  # m/s², in the axes of the base
COMPLIANCE, PER_LENGTH = "compliance.", ".per_length"
_GROUPS = ("compliance", "mass.", "centre.", "payload.", "gravity.", "balancer")


@dataclass(frozen=True)
class Spring:
    """A number of a limb that yields.

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
    """

    number: str
    unit: Unit
    drive: int = -1
    at: float = 0.0

    @property
    def units(self) -> dict[str, Unit]:
        """Names and units of its numbers."""
        own: Unit = "rad/(N mm)" if self.unit == "rad" else "mm/N"
        found = {COMPLIANCE + self.number: own}
        return found if self.drive < 0 else found | {COMPLIANCE + self.number + PER_LENGTH: "1/N"}


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


@cache
def is_kinematic(name: str) -> bool:
    """Return whether a number is one of a limb, or ties some; not of loads or compliances."""
    return not is_elastic(name) and not is_of_load(name)


def is_elastic(name: str) -> bool:
    """Return whether a number is a compliance, of limbs or of joints, or of what pulls."""
    return name.startswith(_GROUPS)
