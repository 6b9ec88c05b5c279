"""Joints of chains, as a robot file lists them, and the axes that they stand for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray, Unit, furthest_axis
from pkmcal.geometry.laws import Law

ERRORS = ("dx", "dy", "dz", "dphi", "dtheta", "dpsi")  # of a joint, also of a serial arm: mm, rad
BY_MAP: dict[str, tuple[str, ...]] = {  # what can be wrong in a group
    "spatial": ERRORS,
    "planar": ("dx", "dy", "dpsi"),
    "spherical": ("dphi", "dtheta", "dpsi"),
}
PARTS = ("", "b", "c")
_ELSEWHERE = 1e-3  # mm: joints further from each other have a rod between them
JointKind = Literal["R", "P", "U", "S", "C"]
KINDS: dict[str, str] = {
    "R": "revolute", "P": "prismatic", "U": "universal", "S": "spherical", "C": "cylindrical",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint as the file lists it, the machine at home; mm and rad.

    Attributes
    ----------
    kind : {"R", "P", "U", "S", "C"}
        What it is.
    at : ndarray (3,)
        Its point, in the base frame.
    axes : tuple of ndarray (3,)
        Unit vectors: of R, P and C one, of U two, of S three, or none of a ball.
    actuator : int or None
        Which actuator moves it, counted from 0.
    share : str or None
        What limbs call it that have it in common.
    home_value : float
        What its actuator reads at home.
    stroke : tuple of float or None
        Limits of what it turns or slides: of an actuated joint the drive, else from home.
    cone : float or None
        How far U and S bend, rad: from home, or from `cone_axis`.
    cone_axis : ndarray (3,) or None
        The middle of the cone, at home: of the last joint it goes with the platform, of others
        with the body before the joint.
    soft : float
        Compliance beside that of other joints.
    law : Law or None
        Of an actuated joint, what lies between the reading and the drive.
    """

    kind: JointKind
    at: FloatArray
    axes: tuple[FloatArray, ...]
    actuator: int | None = None
    share: str | None = None
    home_value: float = 0.0
    stroke: tuple[float, float] | None = None
    cone: float | None = None
    cone_axis: FloatArray | None = None
    soft: float = 1.0
    law: Law | None = None

    @property
    def ball(self) -> bool:
        """True if the joint is an S without stated axes."""
        return self.kind == "S" and not self.axes

    @property
    def parts(self) -> int:
        """Number of axes."""
        return {"R": 1, "P": 1, "U": 2, "C": 2, "S": 3}[self.kind]

    @property
    def unit(self) -> Unit:
        """Unit of the joint's coordinate."""
        return "mm" if self.kind == "P" else "rad"


@dataclass(frozen=True, eq=False)
class Part:
    """One axis of a joint, once where limbs share it."""

    name: str
    slides: bool
    axis: FloatArray
    joint: Joint
    limb: int
    errors: tuple[str, ...]


def across(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to a unit vector, and to each other."""
    one = np.cross(direction, np.eye(3)[furthest_axis(direction)])
    one /= np.linalg.norm(one)
    return one, np.cross(direction, one)


def towards(limb: tuple[Joint, ...], k: int) -> FloatArray | None:
    """Unit vector from joint k to the next that is elsewhere, or from the last that was."""
    at = limb[k].at
    for other, sign in [(j, 1.0) for j in limb[k + 1 :]] + [(j, -1.0) for j in limb[:k][::-1]]:
        way = sign * (other.at - at)
        length = float(np.linalg.norm(way))
        if length > 1e-9 * (1.0 + float(np.abs(at).max())):
            return way / length
    return None


def axes_along_rods(limb: tuple[Joint, ...], within: float) -> Iterator[tuple[int, str]]:
    """Each axis of a U that lies along a rod beside it: the place of the U, and which axis it is.

    Parameters
    ----------
    limb : tuple of Joint
        A limb from its base to the platform.
    within : float
        Sine of the angle to the rod below which an axis lies along it.
    """
    for k, joint in enumerate(limb):
        if joint.kind != "U":
            continue
        rods = [_rod(joint, limb[k + 1 :]), _rod(joint, limb[:k][::-1])]
        for axis, ordinal in zip(joint.axes, ("first", "second"), strict=True):
            if any(r is not None and np.linalg.norm(np.cross(axis, r)) < within for r in rods):
                yield k, ordinal


def _rod(joint: Joint, others: tuple[Joint, ...]) -> FloatArray | None:
    """The direction (3,) to the first of other joints that is elsewhere and no slide."""
    for other in others:
        way = other.at - joint.at
        if other.kind != "P" and np.linalg.norm(way) > _ELSEWHERE:
            return np.asarray(way / np.linalg.norm(way))
    return None


def error_unit(name: str) -> Unit:
    """Unit of a joint error, from its name: the displacements are in mm."""
    return "mm" if name.rpartition(".")[2] in ERRORS[:3] else "rad"


def ball_axes(limb: tuple[Joint, ...], k: int) -> tuple[FloatArray, ...]:
    """Return axes of a ball before the last joint: along the limb and across, far from its lock."""
    way = towards(limb, k)
    along = np.array([0.0, 0.0, 1.0]) if way is None else way
    return (along, *across(along))


def frame_of(axis: FloatArray) -> FloatArray:
    """Axes (columns) of which the third is this one."""
    one, other = across(axis)
    return np.column_stack([one, other, axis])
