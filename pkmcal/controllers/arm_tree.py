"""A serial arm as a row of links, as URDF and SDF have it: each joint in the link before."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

from pkmcal import screw
from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.controllers.loss import require_plain
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot

MILLIMETRE = 1e-3  # m
MASS, INERTIA = "1", "0.01"  # kg, kg m²: an arm's file has none


class TreeJoint(NamedTuple):
    """A joint of the tree.

    Attributes
    ----------
    name : str
        The arm's name for it, or q1 …; of the tool "tool".
    parent, child : str
        Links.
    origin : ndarray (6,)
        Its pose in the link before, m and rad: x y z, roll pitch yaw.
    axis : ndarray (3,) or None
        None: it is fixed.
    slides : bool
        Whether it is prismatic.
    follows : (str, float) or None
        A joint that it follows, and m or rad by m or rad of that one.
    """

    name: str
    parent: str
    child: str
    origin: FloatArray
    axis: FloatArray | None
    slides: bool
    follows: tuple[str, float] | None = None


def require_arm(arm: object, format: str) -> SerialArm:
    """Refuse what is no serial arm.

    Raises
    ------
    ArgumentError
        A parallel machine: it has loops. An arm whose joints have laws.
    """
    if isinstance(arm, Robot):
        raise ArgumentError(
            f"robot: {arm.name} is a parallel machine; {format} is a tree and holds no loops,"
            " an MJCF does: --as mjcf"
        )
    instance("arm", arm, SerialArm)
    assert isinstance(arm, SerialArm)
    require_plain(arm, format)
    return arm


def joints(arm: SerialArm) -> Iterator[TreeJoint]:
    """The joints from the base to the tool, joint errors in their origins."""
    before = np.eye(4)
    parent = "base"
    names = arm.joint_names or _numbered(arm)
    follows = {
        ratio.joint: (
            names[ratio.leader - 1],
            ratio.by * _metres(arm, ratio.joint) / _metres(arm, ratio.leader),
        )
        for ratio in arm.followers.ratios
    }
    numbers = zip(arm.axes, arm.points, arm.kinds, arm.error_motions(), strict=True)
    for i, (axis, point, kind, error) in enumerate(numbers, 1):
        at = np.eye(4)
        at[:3, 3] = point
        origin = _origin(np.linalg.inv(before) @ error @ at)
        slides, led = kind == "prismatic", follows.get(i)
        yield TreeJoint(names[i - 1], parent, f"link{i}", origin, axis, slides, led)
        parent, before = f"link{i}", at
    tool = _origin(np.linalg.inv(before) @ arm.home)
    yield TreeJoint("tool", parent, "tool", tool, None, False)


def _numbered(arm: SerialArm) -> list[str]:
    """Names of joints: of the k-th that is commanded qk, of one that follows its own number."""
    names = [f"joint{i}" for i in range(1, arm.n_joints + 1)]
    for k, joint in enumerate(arm.followers.driven, 1):
        names[joint] = f"q{k}"
    return names


def _metres(arm: SerialArm, joint: int) -> float:
    """Return what 1 mm or 1 rad of a joint, counted from 1, is in m or rad."""
    return MILLIMETRE if arm.kinds[joint - 1] == "prismatic" else 1.0


def _origin(motion: FloatArray) -> FloatArray:
    pose = screw.to_pose(motion)
    pose[:3] *= MILLIMETRE
    return pose


def text_of(numbers: FloatArray) -> str:
    """Numbers with spaces between them, to the last bit."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)


def xml_of(top: Xml.Element) -> str:
    """The text of a file."""
    Xml.indent(top)
    return Xml.tostring(top, encoding="unicode") + "\n"
