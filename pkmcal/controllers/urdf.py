"""A serial arm as URDF: its links in a row, joint errors in the origins.

A URDF is a tree of links. A parallel machine has loops, so it has none; MJCF holds those.
"""

from __future__ import annotations

from os import PathLike
from xml.etree import ElementTree as Xml

import numpy as np

from pkmcal import screw
from pkmcal.arguments import instance
from pkmcal.arguments import path as as_path
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot

_METRE = 1e-3


def urdf(arm: SerialArm, path: str | PathLike[str]) -> None:
    """Write a serial arm, its joint errors included, as a URDF file.

    Links are ``base``, ``link1`` and so on and ``tool``; joints have the arm's names, or ``q1`` and
    so on; metres and radians. Masses are 1 kg, inertias 0.01 kg m² and sliding limits ±1 km
    throughout: an arm's file has none. An arm that was read from a URDF is better written by
    ``save_urdf``, which keeps all else of its source.

    Parameters
    ----------
    arm : SerialArm
        The arm.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.

    Raises
    ------
    ValueError
        A parallel machine: a URDF is a tree.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import tempfile
    >>> arm = pk.load("3r")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pk.export.urdf(arm, f"{folder}/arm.urdf")
    ...     again = pk.SerialArm.from_urdf(f"{folder}/arm.urdf")
    >>> bool(abs(again.forward([0.1, 0.2, 0.3]) - arm.forward([0.1, 0.2, 0.3])).max() < 1e-9)
    True
    """
    if isinstance(arm, Robot):
        raise ArgumentError(
            f"robot: {arm.name} is a parallel machine; a URDF is a tree and holds no loops,"
            " an MJCF does: --as mjcf"
        )
    instance("arm", arm, SerialArm)
    write_whole(as_path("path", path), text_of(arm))


def text_of(arm: SerialArm) -> str:
    """The URDF text."""
    top = Xml.Element("robot", name=arm.name)
    Xml.SubElement(top, "link", name="base")
    before = np.eye(4)
    links = ["base"]
    names = arm.joint_names or [f"q{i}" for i, _ in enumerate(arm.kinds, 1)]
    numbers = zip(arm.axes, arm.points, arm.kinds, arm.error_motions(), strict=True)
    for i, (axis, point, kind, error) in enumerate(numbers, 1):
        at = np.eye(4)
        at[:3, 3] = point
        sliding = kind == "prismatic"
        joint = _joint(
            top,
            links[-1],
            f"link{i}",
            names[i - 1],
            "prismatic" if sliding else "continuous",
        )
        _origin(joint, np.linalg.inv(before) @ error @ at)
        Xml.SubElement(joint, "axis", xyz=_text(axis))
        if sliding:
            limit = {"lower": "-1000", "upper": "1000", "effort": "0", "velocity": "0"}
            Xml.SubElement(joint, "limit", limit)
        links.append(f"link{i}")
        before = at
    _origin(_joint(top, links[-1], "tool", "tool", "fixed"), np.linalg.inv(before) @ arm.home)
    Xml.indent(top)
    return Xml.tostring(top, encoding="unicode") + "\n"


def _joint(top: Xml.Element, parent: str, child: str, name: str, kind: str) -> Xml.Element:
    link = Xml.SubElement(top, "link", name=child)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "mass", value="1")
    inertia = dict.fromkeys(("ixx", "iyy", "izz"), "0.01") | dict.fromkeys(
        ("ixy", "ixz", "iyz"), "0"
    )
    Xml.SubElement(inertial, "inertia", inertia)
    joint = Xml.SubElement(top, "joint", name=name, type=kind)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    return joint


def _origin(joint: Xml.Element, motion: FloatArray) -> None:
    pose = screw.to_pose(motion)
    Xml.SubElement(joint, "origin", xyz=_text(pose[:3] * _METRE), rpy=_text(pose[3:]))


def _text(numbers: FloatArray) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)
