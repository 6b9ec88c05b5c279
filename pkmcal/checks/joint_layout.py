"""The layout of a machine's joints: circles, order, common traits of limbs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pkmcal import screw
from pkmcal.arrays import BoolArray, FloatArray, wrapped
from pkmcal.core.library import SLOTS
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot

_POINT = 0.01  # of the largest length: joints no further from each other are meant to be in one
_TILTED = 0.5  # rad: a plane is so far from another by intention
_FLAT = 0.2  # of the longer side: points no wider than this are rather on a line
ALIKE = 0.03  # of the base's radius: by less, errors of manufacture make limbs differ


@dataclass(frozen=True, eq=False)
class Joints:
    """Base or platform joints, seen along z.

    Attributes
    ----------
    side : str
        "base" or "platform".
    points : ndarray (limbs, 3)
        mm.
    """

    side: str
    points: FloatArray

    @property
    def radii(self) -> FloatArray:
        """Distance from the z axis, mm."""
        return np.asarray(np.hypot(self.points[:, 0], self.points[:, 1]))

    @property
    def angles(self) -> FloatArray:
        """Polar angles about the z axis, rad."""
        return np.arctan2(self.points[:, 1], self.points[:, 0])

    def senses(self, room: float) -> frozenset[int]:
        """Ways the joints follow each other in one turn: +1 counter-clockwise, -1 clockwise.

        Joints that lie `room` mm apart, or less, may follow each other either way.
        """
        steps = np.roll(self.angles, -1) - self.angles
        same = np.minimum(room / np.maximum(self.radii, room), 1.0)
        found = set()
        for way in (1, -1):
            forward = np.mod(way * steps + same, 2 * np.pi) - same
            if abs(float(forward.sum()) - 2 * np.pi) < 1e-3:
                found.add(way)
        return frozenset(found)

    def circle(self, room: float) -> tuple[FloatArray, float, BoolArray] | None:
        """The circle that most joints lie on: centre (2,), radius, and which lie on it.

        About the z axis where more than half lie on one; otherwise through any three joints, if
        all but two of the joints, and four at least, lie on it. None where there is no such circle.
        """
        on, radius = majority(self.radii, room)
        count = len(self.points)
        if 2 * on.sum() > count and radius > room:
            return np.zeros(2), radius, on
        best: tuple[FloatArray, float, BoolArray] | None = None
        for three in combinations(range(count), 3) if count >= 5 else ():
            corners = self.points[list(three), :2]
            system = np.column_stack([2 * corners, np.ones(3)])
            if abs(np.linalg.det(system)) < 1e-9 * max(1.0, float(np.abs(system).max())) ** 2:
                continue
            x, y, rest = np.linalg.solve(system, (corners**2).sum(axis=1))
            centre = np.array([x, y])
            radius = float(np.sqrt(rest + x * x + y * y))
            on = np.abs(np.linalg.norm(self.points[:, :2] - centre, axis=1) - radius) <= room
            if on.sum() >= max(4, count - 2) and (best is None or on.sum() > best[2].sum()):
                best = centre, radius, on
        return best


def joints(robot: Robot) -> tuple[Joints, Joints]:
    """Base and platform joints of a machine."""
    slots = robot.geometry.slots
    return Joints("base", slots[:, 0:3]), Joints("platform", slots[:, 3:6])


def along_axis(robot: Robot) -> tuple[Joints, Joints]:
    """Base and platform joints of a machine at home, seen along the axis they lie around.

    That is z, unless the base joints lie in a plane that is clearly tilted against it, as those of
    a machine do whose frame follows something else. (Three joints always do: they count if they
    are equally far from their middle.)
    """
    base, platform = joints(robot)
    middle = base.points.mean(axis=0)
    spread, plane = np.linalg.svd(base.points - middle)[1:]  # the last row is across the plane
    upright = abs(plane[2, 2]) >= np.cos(_TILTED)
    room, count = ALIKE * size(robot), len(base.points)
    if upright or count < 3 or spread[1] < max(_FLAT * spread[0], room):
        return base, platform
    turn = plane * np.array([[1.0], [1.0], [np.linalg.det(plane)]])
    turned = Joints("base", (base.points - middle) @ turn.T)
    flat = spread[2] <= _FLAT * spread[1] if count > 3 else np.ptp(turned.radii) <= 2 * room
    if not flat:
        return base, platform
    at_home = platform.points @ screw.from_pose(robot.own_home)[:3, :3].T
    return turned, Joints("platform", at_home @ turn.T)


def slider_ways(robot: Robot) -> FloatArray:
    """Direction of each slider as stated (limbs, 3), unit; 0 for other limbs."""
    return np.array([
        limb.frames["base"][:, 2] if KINDS[limb.kind].driver == "slider" else np.zeros(3)
        for limb in robot.model.limbs
    ])  # fmt: skip


def on_rails(robot: Robot) -> bool:
    """Return whether the carriages of all limbs run on parallel rails side by side, three at least.

    Such a machine has no axis that its limbs lie around (Triaglide, Hexaglide).
    """
    ways, points = slider_ways(robot), joints(robot)[0].points
    if not ways.any(axis=1).all() or np.abs(np.cross(ways, ways[0])).max() > ALIKE:
        return False
    across = points - np.outer(points @ ways[0], ways[0])
    spread, along = np.linalg.svd(across - across.mean(axis=0))[1:]
    places = np.sort(across @ along[0])
    rails = 1 + int((np.diff(places) > ALIKE * size(robot)).sum())
    return bool(spread[1] <= ALIKE * spread[0] and rails >= 3)


def size(robot: Robot) -> float:
    """Root mean square distance of the base joints from their middle, mm, or `Robot.length`.

    Of a machine whose joints all meet in one point, the largest rod or crank.
    """
    base = joints(robot)[0].points
    wide = float(np.sqrt(((base - base.mean(axis=0)) ** 2).sum(axis=1).mean()))
    slots = robot.geometry.slots
    arm = float(slots[:, [SLOTS.index("rod"), SLOTS.index("crank")]].max())
    found = max(wide, robot.length)
    return arm if found <= _POINT * arm else found


def majority(values: FloatArray, room: float) -> tuple[BoolArray, float]:
    """The largest group of values within `room` of one of them, and its median."""
    near = np.abs(values[:, None] - values) <= room
    best = int(near.sum(axis=1).argmax())
    return near[best], float(np.median(values[near[best]]))


@dataclass(frozen=True, eq=False)
class Trait:
    """One number of each limb that alike limbs have in common.

    Attributes
    ----------
    name, unit : str
        What it is, and "mm", "deg" or "1".
    values : ndarray (limbs,)
        In that unit; NaN for a limb that has none.
    scale : float
        mm that one unit counts as.
    """

    name: str
    unit: str
    values: FloatArray
    scale: float

    def odd(self, room: float) -> tuple[list[int], float]:
        """Limbs (from 0) that are unlike the others by more than `room` mm, and what others have.

        Where more than half are alike: those that are like no other, and the value of the many.
        Where limbs come in alike groups: two that are like no other, or one of six, and NaN.
        Otherwise none.
        """
        place = np.flatnonzero(np.isfinite(self.values))
        if len(place) < 3:
            return [], np.nan
        values = self.values[place] * self.scale
        near = np.abs(values[:, None] - values) <= room
        alone = near.sum(axis=1) == 1
        many, usual = majority(values, room)
        limbs = place[alone].tolist()
        if 2 * many.sum() > len(values):
            return limbs, usual / self.scale
        count = len(values)
        odd_ones = len(limbs) == 2 <= count - 2 or (
            len(limbs) == 1 and count >= 6 and not count % 2
        )
        return (limbs if odd_ones else []), np.nan


def traits(robot: Robot) -> list[Trait]:
    """Return the common traits of limbs that are alike."""
    base, platform = along_axis(robot)
    mm = size(robot)
    degree = mm * np.pi / 180
    limbs = robot.model.limbs
    rails = on_rails(robot)
    between = np.degrees(np.abs(wrapped(base.angles - platform.angles)))
    near = np.minimum(base.radii, platform.radii) <= ALIKE * mm
    found = [
        Trait("base radius", "mm", np.full(len(limbs), np.nan) if rails else base.radii, 1.0),
        Trait("platform radius", "mm", platform.radii, 1.0),
        Trait("angle between base and platform joint", "deg",
              np.where(near | rails, np.nan, between), degree),
        Trait("height of the base joint", "mm", base.points[:, 2], 1.0),
        Trait("height of the platform joint", "mm", platform.points[:, 2], 1.0),
    ]  # fmt: skip
    drive = robot.feasible(robot.home).drive
    ends = np.array([limb.stroke or (np.nan, np.nan) for limb in limbs])
    slot = dict(zip(SLOTS, robot.geometry.slots.T[: len(SLOTS)], strict=True))
    for driver in dict.fromkeys(KINDS[limb.kind].driver for limb in limbs):
        mine = [KINDS[limb.kind].driver == driver for limb in limbs]
        fixed = KINDS[limbs[mine.index(True)].kind].lengths
        rods = [Trait(key, "mm", slot[name], 1.0) for key, name in fixed.items()]
        unit, shown, scale = ("deg", 180 / np.pi, degree) if driver == "crank" else ("mm", 1.0, 1.0)
        # from one side or the other a rail's carriage drives, and stands elsewhere
        at_home = np.full(len(limbs), np.nan) if rails else drive * shown
        own = (
            *rods,
            Trait(f"{driver} at home", unit, at_home, scale),
            Trait("offset", unit, slot["offset"] * shown, scale),
            Trait("gain", "1", slot["gain"], mm),
            Trait("lower end of the stroke", unit, ends[:, 0] * shown, scale),
            Trait("upper end of the stroke", unit, ends[:, 1] * shown, scale),
        )
        found += [replace(trait, values=np.where(mine, trait.values, np.nan)) for trait in own]
    return found
