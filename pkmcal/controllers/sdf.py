"""A serial arm as SDFormat: its links in a row from the world, joint errors in the joints' poses.

As a URDF it is a tree of links here: what makes a loop of links is no joint of the format, but left
to each simulator. MJCF holds loops.
"""

from __future__ import annotations

from os import PathLike
from xml.etree import ElementTree as Xml

import numpy as np

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

_VERSION = "1.7"  # the first with poses relative to joints


def sdf(arm: SerialArm, path: str | PathLike[str]) -> None:
    """Write a serial arm, its joint errors included, as an SDF model.

    Links are ``base``, which is fixed to the world, ``link1`` and so on and ``tool``; joints have
    the arm's names, or ``q1`` and so on, with ``_joint`` behind where a link is called so; metres
    and radians, SDFormat 1.7. Masses are 1 kg and inertias 0.01 kg m² throughout, and no joint has
    a limit: an arm's file has none.

    Parameters
    ----------
    arm : SerialArm
        The arm.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.

    Raises
    ------
    ValueError
        A parallel machine: it has loops. An arm with joints that follow others.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pk.export.sdf(pk.load("3r"), f"{folder}/arm.sdf")
    ...     pathlib.Path(folder, "arm.sdf").read_text().count('type="revolute"')
    3
    """
    arm = require_arm(arm, "an SDF model")
    if arm.followers:
        raise ArgumentError(
            f"robot: joint {arm.followers.ratios[0].joint} of {arm.name} follows others, which"
            f" SDFormat {_VERSION} does not hold; a URDF does: --as urdf"
        )
    top = Xml.Element("sdf", version=_VERSION)
    model = Xml.SubElement(top, "model", name=arm.name.replace("::", " "))
    _link(model, "base", "__model__")
    tree = list(joints(arm))
    links = {"base", *(joint.child for joint in tree)}
    fixed = TreeJoint("base", "world", "base", np.zeros(6), None, False)
    for joint in (fixed, *tree):
        name = f"{joint.name}_joint" if joint.name in links else joint.name
        if joint is not fixed:
            _link(model, joint.child, name)
        _joint(model, joint, name)
    write_whole(as_path("path", path), xml_of(top))


def _link(model: Xml.Element, name: str, relative_to: str) -> None:
    link = Xml.SubElement(model, "link", name=name)
    Xml.SubElement(link, "pose", relative_to=relative_to).text = text_of(np.zeros(6))
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "mass").text = MASS
    inertia = Xml.SubElement(inertial, "inertia")
    for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        Xml.SubElement(inertia, name).text = INERTIA if name[1] == name[2] else "0"


def _joint(model: Xml.Element, joint: TreeJoint, name: str) -> None:
    moves = "prismatic" if joint.slides else "revolute"
    kind = "fixed" if joint.axis is None else moves
    element = Xml.SubElement(model, "joint", name=name, type=kind)
    where = joint.child if joint.parent == "world" else joint.parent
    Xml.SubElement(element, "pose", relative_to=where).text = text_of(joint.origin)
    Xml.SubElement(element, "parent").text = joint.parent
    Xml.SubElement(element, "child").text = joint.child
    if joint.axis is not None:
        axis = Xml.SubElement(element, "axis")
        Xml.SubElement(axis, "xyz").text = text_of(joint.axis)
