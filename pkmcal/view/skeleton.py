"""A machine as lines in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.instruments import seen_points
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot


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
    if robot.model.chains is not None:
        chains = [points[0] for points in robot.chain_points(own, q[None])]
        starts, tips = (np.array([chain[k] for chain in chains]) for k in (0, -1))
        return _placed(robot, chains, starts, tips)
    slots = robot.slots
    _, towards, _ = robot.limb_machine.limbs(slots, own)
    base, platform = np.ascontiguousarray(slots[:, :3]), np.ascontiguousarray(slots[:, 3:6])
    ends = seen_points(own[0], platform)[0]
    lines = []
    for i, limb in enumerate(robot.model.limbs):
        kind = KINDS[limb.kind]
        line = [base[i], ends[i]]
        if kind.has_branch:  # the joint that the slider or crank carries
            rod = robot.geometry[f"rod{i + 1}"]
            line.insert(1, ends[i] - rod * towards[0, i])
        lines.append(np.array(line))
    return _placed(robot, lines, base, ends, _around(platform))


def _placed(
    robot: Robot,
    lines: Sequence[FloatArray],
    base: FloatArray,
    ends: FloatArray,
    order: IntArray | None = None,
) -> Skeleton:
    """Limbs and outlines in the robot's base frame; the platform's in the order given."""
    frame = robot.model.base_frame
    outward = np.zeros(6) if frame is None else frame
    return Skeleton(
        tuple(_in_frame(outward, line) for line in lines),
        _in_frame(outward, base[_around(base)]),
        _in_frame(outward, ends[_around(ends) if order is None else order]),
    )


def _chain(arm: SerialArm, q: FloatArray) -> FloatArray:
    """Base, a point on every joint's axis, and the tool."""
    at = [np.zeros(3)]
    if arm.laws is not None:
        q, arm = arm.laws.moved(q[None])[0], arm.rigid
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
    at.append(arm.forward(q)[:3, 3])
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
