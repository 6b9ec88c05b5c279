"""Modules that LinuxCNC ships, and the `setp` lines with which one of them is this robot.

genhexkins holds every 6-UPS: its joints are the lengths of the legs. lineardeltakins has one radius
and one arm for towers at 90°, 210° and 330°, rotarydeltakins one of each number for shoulders at
270°, 30° and 150° in the plane z = 0; both have joints from zeros that homing sets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pkmcal.arrays import TIED, FloatArray, first_largest
from pkmcal.controllers import linear_delta, rotary_delta
from pkmcal.controllers.linear_delta import FirmwareDelta
from pkmcal.controllers.loss import COMPARED, Loss, fitted
from pkmcal.controllers.rotary_delta import OVER, RotaryDelta
from pkmcal.core.poses import invert
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import sample_poses

_LEGS = 6
_LINEAR = (90.0, 210.0, 330.0)  # of joints 0, 1 and 2
_ROTARY = (270.0, 30.0, 150.0)
_NO_LOSS = Loss(0.0, 0.0, OVER)


class Module(NamedTuple):
    """A module, the lines for it, and how far off it is with them."""

    name: str
    lines: str
    loss: Loss


def of_robot(robot: Robot) -> Module | None:
    """The module of this kind of machine."""
    limbs = robot.model.limbs
    if [limb.actuator for limb in limbs] != list(range(len(limbs))):
        return None
    kinds = {limb.kind for limb in limbs}
    legs = kinds == {"UPS"} and not any(limb.couple for limb in limbs)
    if robot.model.map == "spatial" and legs and len(limbs) == _LEGS:
        return _hexapod(robot)
    if linear_delta.is_delta(robot):
        return _linear(robot)
    return _rotary(robot) if rotary_delta.is_rotary_delta(robot) else None


def _hexapod(robot: Robot) -> Module:
    base = _moved(robot.slots[:, 0:3], robot.model.base_frame, back=False)
    platform = _moved(robot.slots[:, 3:6], robot.model.tool_frame, back=True)
    values = {}
    for name, points in (("base", base), ("platform", platform)):
        for i, point in enumerate(points):
            for axis, value in zip("xyz", point, strict=True):
                values[f"{name}.{i}.{axis}"] = value
    head = "Joints are the lengths of the legs: gain * q + offset of the robot."
    return Module("genhexkins", _lines("genhexkins", values, head), _NO_LOSS)


def _moved(points: FloatArray, frame: FloatArray | None, back: bool) -> FloatArray:
    """Points of the machine in the frame that the user has."""
    if frame is None:
        return points
    pose = invert(np.ascontiguousarray(frame, dtype=np.float64)) if back else frame
    turned: FloatArray = points @ Rotation.from_euler("xyz", pose[3:]).as_matrix().T + pose[:3]
    return turned


def _linear(robot: Robot) -> Module:
    built = linear_delta.as_built(robot)
    order = _order(built.angles, _LINEAR)
    gains = linear_delta.gains(robot)

    def model(x: FloatArray) -> Robot:
        angles = [0.0] * 3
        for joint, limb in enumerate(order):
            angles[limb] = _LINEAR[joint]
        arms, carriages = (float(x[1]),) * 3, tuple(x[2:].tolist())
        return linear_delta.as_robot(
            FirmwareDelta(float(x[0]), tuple(angles), arms, carriages), gains
        )

    start = np.array([built.radius, float(np.mean(built.arms)), *built.carriages])
    x, lost = _fitted(model, start, robot)
    head = _joints(order, "heights of the carriages over the effector's joints at z = 0, mm")
    values = {"R": x[0], "L": x[1]}
    return Module("lineardeltakins", _lines("lineardeltakins", values, head), lost)


def _rotary(robot: Robot) -> Module:
    built = rotary_delta.as_built(robot)
    order = _order(built.angles, _ROTARY)
    foot = float(np.hypot(robot.slots[:, 3], robot.slots[:, 4]).mean())
    home = float(robot.home[2])

    def model(x: FloatArray) -> Robot:
        angles = [0.0] * 3
        for joint, limb in enumerate(order):
            angles[limb] = _ROTARY[joint]
        radius, crank, rod, *elbows = x.tolist()
        numbers = (radius, (0.0,) * 3, tuple(angles), (crank,) * 3, (rod,) * 3, tuple(elbows))
        return rotary_delta.as_robot(RotaryDelta(*numbers, built.gains), home)

    cranks, rods = float(np.mean(built.cranks)), float(np.mean(built.rods))
    x, lost = _fitted(model, np.array([built.radius, cranks, rods, *built.elbows]), robot)
    head = _joints(order, "angles of the cranks below the horizontal, deg")
    values = {"platformradius": x[0] + foot, "thighlength": x[1], "shinlength": x[2]}
    values["footradius"] = foot
    return Module("rotarydeltakins", _lines("rotarydeltakins", values, head), lost)


def _fitted(
    model: Callable[[FloatArray], Robot], start: FloatArray, robot: Robot
) -> tuple[FloatArray, Loss]:
    poses = sample_poses(robot, COMPARED)
    return fitted(model, start, robot.inverse(poses), poses, OVER)


def _order(angles: tuple[float, ...], joints: tuple[float, ...]) -> list[int]:
    """The limb of each joint, by the angles at which they stand."""
    order: list[int] = []
    for joint in joints:
        off = np.abs((np.array(angles) - joint + 180.0) % 360.0 - 180.0)
        off[order] = np.inf
        order.append(first_largest(-off, TIED))
    return order


def _joints(order: list[int], what: str) -> str:
    return f"Joints 0, 1, 2 are limbs {', '.join(str(limb + 1) for limb in order)}: {what}."


def _lines(module: str, values: dict[str, float], head: str) -> str:
    lines = [f"setp {module}.{name} {float(value)!r}" for name, value in values.items()]
    return f"# {head}\n" + "\n".join(lines) + "\n"
