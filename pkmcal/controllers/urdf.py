"""A serial arm as URDF: its links in a row, joint errors in the origins.

A URDF is a tree of links. A parallel machine has loops, so it has none; MJCF holds those.
"""

from __future__ import annotations

from os import PathLike
from xml.etree import ElementTree as Xml

from pkmcal.arguments import path as as_path
from pkmcal.arms.arm import SerialArm
from pkmcal.controllers.arm_tree import (
    INERTIA,
    MASS,
    TreeJoint,
    joints,
    require_arm,
    text_of,
    xml_of,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole


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
        A parallel machine: a URDF is a tree. An arm with a joint that follows several others.

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
    arm = require_arm(arm, "a URDF")
    led = [ratio.joint for ratio in arm.followers.ratios]
    if len(set(led)) < len(led):
        several = next(joint for joint in led if led.count(joint) > 1)
        raise ArgumentError(
            f"robot: joint {several} of {arm.name} follows several joints, and <mimic> of a URDF"
            " follows one"
        )
    top = Xml.Element("robot", name=arm.name)
    Xml.SubElement(top, "link", name="base")
    for joint in joints(arm):
        _add(top, joint)
    write_whole(as_path("path", path), xml_of(top))


def _add(top: Xml.Element, joint: TreeJoint) -> None:
    """Add a joint and the link behind it."""
    link = Xml.SubElement(top, "link", name=joint.child)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "mass", value=MASS)
    inertia = dict.fromkeys(("ixx", "iyy", "izz"), INERTIA) | dict.fromkeys(
        ("ixy", "ixz", "iyz"), "0"
    )
    Xml.SubElement(inertial, "inertia", inertia)
    moves = "prismatic" if joint.slides else "continuous"
    kind = "fixed" if joint.axis is None else moves
    element = Xml.SubElement(top, "joint", name=joint.name, type=kind)
    Xml.SubElement(element, "parent", link=joint.parent)
    Xml.SubElement(element, "child", link=joint.child)
    origin = {"xyz": text_of(joint.origin[:3]), "rpy": text_of(joint.origin[3:])}
    Xml.SubElement(element, "origin", origin)
    if joint.axis is not None:
        Xml.SubElement(element, "axis", xyz=text_of(joint.axis))
    if joint.follows is not None:
        leader, by = joint.follows
        Xml.SubElement(element, "mimic", joint=leader, multiplier=repr(by))
    if joint.slides:
        limit = {"lower": "-1000", "upper": "1000", "effort": "0", "velocity": "0"}
        Xml.SubElement(element, "limit", limit)
