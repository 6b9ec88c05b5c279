"""A rotary delta as controllers have it: shoulders on one circle, cranks in radial planes.

Klipper and LinuxCNC both have this model: a shoulder at (r cos θ, r sin θ, height), a crank that
turns in the vertical plane through it and the z axis, and from its elbow a rod to the effector,
whose joints stand on the z axis: only shoulder less effector counts, in radius and in height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import robot_files
from pkmcal.controllers.c_limbs import prepared
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.controllers.linear_delta import Bed
from pkmcal.controllers.loss import COMPARED, Loss, fitted, require_held
from pkmcal.controllers.robot_files import About
from pkmcal.core.library import SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.kinematics.workspace import sample_poses

OVER = "over half of its workspace"
_TOWERS = 3
_LOWEST = 180.0  # deg: a crank that points inward; no firmware states its lower end


@dataclass(frozen=True)
class RotaryDelta:
    """The numbers of a rotary delta.

    Attributes
    ----------
    radius : float
        Distance of each shoulder from the middle, less that of the effector's joints, mm.
    heights : tuple of float
        Of each shoulder over the pose z = 0, less that of the effector's joints, mm.
    angles : tuple of float
        Of each shoulder, deg from x.
    cranks, rods : tuple of float
        Upper and lower arms, mm.
    elbows : tuple of float
        Angle of each crank at q = 0, rad from horizontal and outward, downwards positive.
    gains : tuple of float
        Rad by which a crank goes down for a unit of its actuator.
    """

    radius: float
    heights: tuple[float, ...]
    angles: tuple[float, ...]
    cranks: tuple[float, ...]
    rods: tuple[float, ...]
    elbows: tuple[float, ...]
    gains: tuple[float, ...]

    @property
    def across(self) -> float:
        """Distance from the middle that arms and rods reach level with the shoulders, mm."""
        return min(self.radius + min(self.cranks), min(self.rods) - self.radius)

    @property
    def endstops(self) -> tuple[float, ...]:
        """Height of the pose in the middle with each crank at its end stop, q = 0; mm."""
        found = []
        limbs = zip(self.heights, self.cranks, self.rods, self.elbows, strict=True)
        for height, crank, rod, elbow in limbs:
            across = self.radius + crank * np.cos(elbow)
            down = crank * np.sin(elbow) + np.sqrt(max(rod**2 - across**2, 0.0))
            found.append(float(height - down))
        return tuple(found)


def elbow_at(endstop: float, radius: float, height: float, crank: float, rod: float) -> float:
    """Angle of a crank below the horizontal with the pose in the middle, its knee outward; rad."""
    down = height - endstop
    way = np.hypot(radius, down)
    inner = np.arccos((crank**2 + way**2 - rod**2) / (2.0 * crank * way))
    return float(np.arctan2(down, -radius) - inner)


def of_robot(robot: Robot, project: bool, one_height: bool) -> tuple[RotaryDelta, Loss]:
    """The numbers of a robot, with one height or three, and what they lose.

    Raises
    ------
    ValueError
        No rotary delta; or one that the model cannot hold, unless `project`.
    """
    require_rotary_delta(robot)
    home = float(robot.home[2])
    built = as_built(robot, one_height)
    poses = sample_poses(robot, COMPARED)
    q = robot.inverse(poses)

    def of(x: FloatArray) -> RotaryDelta:
        heights = x[13:] if len(x) > 14 else np.repeat(x[13:], _TOWERS)
        angles, cranks, rods, elbows = map(tuple, x[1:13].reshape(4, _TOWERS).tolist())
        numbers = (float(x[0]), tuple(heights.tolist()), angles, cranks, rods, elbows)
        return RotaryDelta(*numbers, built.gains)

    heights = built.heights[: 1 if one_height else _TOWERS]
    start = [built.radius, *built.angles, *built.cranks, *built.rods, *built.elbows, *heights]
    x, lost = fitted(lambda x: as_robot(of(x), home), np.array(start), q, poses, OVER)
    lacks = (
        f"the firmware has one radius{' and one height' * one_height}, and cranks that turn in"
        " radial planes, this robot has not"
    )
    require_held(robot, lost, project, lacks)
    delta = of(x)
    if min(delta.endstops) <= 0.0:
        raise ArgumentError(
            f"robot: {robot.name}: the end stops would be {min(delta.endstops):.6g} mm over the"
            " bed; the pose must be that of the nozzle over it, and q 0 at the end stops"
        )
    return delta, lost


def require_rotary_delta(robot: Robot) -> None:
    """Refuse what is no rotary delta with three cranks of its own."""
    require_parallel(robot)
    require_plain_limbs(robot, "a firmware")
    if not is_rotary_delta(robot):
        raise ArgumentError(
            f"robot: {robot.name} is no rotary delta of three RUS limbs that only translates, or"
            " has base and tool frames"
        )


def is_rotary_delta(robot: Robot) -> bool:
    """Return whether three cranks of their own move a platform that only translates."""
    limbs = robot.model.limbs
    kinds = [(limb.kind, limb.actuator) for limb in limbs]
    cranks = kinds == [("RUS", i) for i in range(_TOWERS)]
    return robot.model.map == "translation" and cranks and robot.frames.trivial


def as_built(robot: Robot, one_height: bool = True) -> RotaryDelta:
    """Return the cranks as if alike and turned in radial planes: exact where they are."""
    slots = robot.slots
    shoulders = slots[:, 0:3] - slots[:, 3:6]
    heights = shoulders[:, 2]
    radius = np.hypot(shoulders[:, 0], shoulders[:, 1])
    first, second, _, _ = prepared(robot)
    drive = slots[:, SLOTS.index("offset")]
    elbows, gains = [], []
    for i, outward in enumerate(shoulders / radius[:, None]):
        plane = np.array([[outward[0], outward[1], 0.0], [0.0, 0.0, -1.0]])
        zero, turned = plane @ first[i], plane @ second[i]
        sense = float(np.sign(zero[0] * turned[1] - zero[1] * turned[0])) or 1.0
        angle = np.arctan2(zero[1], zero[0]) + sense * drive[i]
        elbows.append(float(np.arctan2(np.sin(angle), np.cos(angle))))
        gains.append(sense * float(slots[i, SLOTS.index("gain")]))
    return RotaryDelta(
        float(radius.mean()),
        tuple((np.full(_TOWERS, heights.mean()) if one_height else heights).tolist()),
        tuple((np.degrees(np.arctan2(shoulders[:, 1], shoulders[:, 0])) % 360.0).tolist()),
        tuple(slots[:, SLOTS.index("crank")].tolist()),
        tuple(slots[:, SLOTS.index("rod")].tolist()),
        tuple(elbows),
        tuple(gains),
    )


def as_robot(delta: RotaryDelta, home: float) -> Robot:
    """The robot with these numbers, as it is in `text_of`."""
    text = text_of(delta, home, About("rotary delta"))
    return robot_files.robot_of(text, "the firmware's numbers")


def text_of(delta: RotaryDelta, home: float, about: About, bed: Bed | None = None) -> str:
    """A robot file with these numbers.

    Parameters
    ----------
    delta : RotaryDelta
        The numbers.
    home : float
        Height of the home pose, mm.
    about : About
        Its name and where it comes from.
    bed : Bed or None
        Where the nozzle stays; cranks stay below their end stops.
    """
    alike = len(set(delta.heights)) == 1
    parameters = {"radius": delta.radius} | ({"height": delta.heights[0]} if alike else {})
    parameters |= {f"angle{i}": angle for i, angle in enumerate(delta.angles, 1)}
    heights = ["height"] if alike else ["base*.z"]
    free = [*heights, "offset1", "offset2", "offset3"]
    box = None if bed is None else _box(delta, bed)
    pose = {"map": "translation", "home": {"z": min(home, box["z"][1]) if box else home}}
    remark = (
        "# The radius stays: heights hardly tell it from the others. So do the angles: the axes\n"
        "# of the cranks would not turn with them.\n"
    )
    limbs = []
    for i in range(_TOWERS):
        angle = np.radians(delta.angles[i])
        base: dict[str, object] = {"radius": "radius", "angle": f"angle{i + 1}", "z": "height"}
        if not alike:
            base["z"] = delta.heights[i]
        limb: dict[str, object] = {"kind": "RUS", "base": base, "platform": [0.0, 0.0, 0.0]}
        limb |= {"axis": _point(-np.sin(angle), np.cos(angle))}
        limb |= {"zero": _point(np.cos(angle), np.sin(angle))}
        limb |= {"crank": delta.cranks[i], "rod": delta.rods[i]}
        limb |= {"offset": float(np.degrees(delta.elbows[i])), "branch": 1}
        limb |= {"gain": delta.gains[i]}
        if bed is not None:
            limb |= {"stroke": [limb["offset"], _LOWEST]}
        limbs.append(limb)
    return robot_files.text_of(about, pose, free, limbs, parameters, remark, box)


def _box(delta: RotaryDelta, bed: Bed) -> dict[str, list[float]] | None:
    """The workspace: where arms and rods reach level with the shoulders, below the end stops."""
    across, high = round(delta.across, 3), round(min(*delta.endstops, bed.highest), 3)
    if across <= 0.0 or high <= max(0.0, bed.lowest):
        return None
    radius = across if bed.radius is None else bed.radius
    ends = [-across, across]
    return {"x": ends, "y": ends, "z": [bed.lowest, high], "radius": [0.0, radius]}


def _point(x: float, y: float) -> list[float]:
    return [float(x), float(y), 0.0]
