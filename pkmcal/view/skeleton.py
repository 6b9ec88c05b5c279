"""A machine as lines in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.instruments import seen_points
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Polylines (k, 3) in mm, in the base frame.

    Attributes
    ----------
    limbs : tuple of ndarray
        From base to platform, joint by joint; of an arm the one chain.
    base, platform : ndarray
        Outlines through the joints, closed; empty for an arm.
    """

    limbs: tuple[FloatArray, ...]
    base: FloatArray
    platform: FloatArray

    @property
    def joints(self) -> FloatArray:
        """Return the joints, in the same order for the same machine."""
        return np.concatenate([*self.limbs, self.platform])


def skeleton(robot: Robot | SerialArm, q: FloatArray, guess: FloatArray) -> Skeleton | None:
    """Return a machine's joints at actuator coordinates (n,); None where it has no pose.

    Parameters
    ----------
    robot : Robot or SerialArm
        The machine.
    q : ndarray (n,)
        mm and rad.
    guess : ndarray (6,)
        Near its pose.
    """
    if isinstance(robot, SerialArm):
        return Skeleton((_chain(robot, q),), np.empty((0, 3)), np.empty((0, 3)))
    solved = robot.forward(q, guess)
    if not solved.ok:
        return None
    own, _ = robot.own_rows(solved.pose)
    lines = [limb[0] for limb in robot.limb_kinematics.lines(robot, own, q[None])]
    return _placed(robot, lines, from_pose(own)[0])


def _placed(robot: Robot, lines: Sequence[FloatArray], platform: FloatArray) -> Skeleton:
    """Limbs and outlines in the robot's base frame, by the motion (4, 4) of the platform."""
    frame = robot.model.base_frame
    outward = np.zeros(6) if frame is None else frame
    base, ends = (np.array([line[k] for line in lines]) for k in (0, -1))
    return Skeleton(
        tuple(_in_frame(outward, line) for line in lines),
        _in_frame(outward, base[_around(base)]),
        _in_frame(outward, ends[_around((ends - platform[:3, 3]) @ platform[:3, :3])]),
    )


def _chain(arm: SerialArm, q: FloatArray) -> FloatArray:
    """Base, a point on every joint's axis, and the tool."""
    at = [np.zeros(3)]
    tool = arm.forward(q)[:3, 3]
    q = arm.joint_coordinates(q)
    if arm.laws is not None:
        q = arm.laws.moved(q[None])[0]
    for i in range(1, arm.n_joints + 1):
        home = np.eye(4)
        home[:3, 3] = arm.points[i - 1]
        part = SerialArm(
            arm.axes[:i],
            arm.points[:i],
            home,
            kinds=arm.kinds[:i],
            joint_errors=arm.joint_errors[:i],
        )
        at.append(part.forward(q[:i])[:3, 3])
    at.append(tool)
    return np.array(at)


def _around(joints: FloatArray) -> IntArray:
    """Order of the joints around their middle, the first once more at the end."""
    x, y = (joints[:, :2] - joints[:, :2].mean(axis=0)).T
    order = np.argsort(np.arctan2(y, x), kind="stable")
    closed: IntArray = np.append(order, order[0])
    return closed


def _in_frame(frame: FloatArray, line: FloatArray) -> FloatArray:
    """Points of the machine's own frame in the robot's base frame."""
    return seen_points(np.ascontiguousarray(frame), np.ascontiguousarray(line))[0]
