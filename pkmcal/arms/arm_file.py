"""Files of serial arms: from TOML to the arguments of a `SerialArm`, and back to the last bit."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal import arguments, screw
from pkmcal.arms import joint_law_file
from pkmcal.arms.arm_geometry import arm_geometry
from pkmcal.arms.followers import Followers, Follows
from pkmcal.arms.inputs import KINDS, ArmArguments, kinds_of
from pkmcal.arrays import FloatArray, Unit
from pkmcal.core.library import COORDINATE_UNITS, POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table, shown
from pkmcal.geometry import robot_file
from pkmcal.geometry.chain_joints import ERRORS
from pkmcal.geometry.robot_file_writer import lines
from pkmcal.geometry.stated_uncertainty import read_uncertainty

TOP = ("name", "units", "gravity", "tool", "uncertainty", "joint")
_UNITS: dict[str, Unit] = {"revolute": "rad", "prismatic": "mm"}
HEADER = "# A serial arm for pkmcal, at zero: lengths in mm, angles in rad.\n"


def is_arm(data: Mapping[str, Any]) -> bool:
    """Return whether the content of a file is that of an arm: it has joints in place of limbs."""
    return "joint" in data and "limb" not in data


def parse(source: Source) -> ArmArguments:
    """Read an arm's file.

    Raises
    ------
    ValueError
        A mistake in the file: one line with the file, its line, the table, the key and what was
        found.
    """
    top = Table(source.data, source)
    top.only(TOP, "a serial arm")
    top.units = robot_file.read_units(top)
    tool = top.table("tool")
    tool.only(("home",))
    joints = top.tables("joint", "an arm")
    for joint in joints:
        joint.only(("name", "kind", "axis", "point", "error", "follows", *joint_law_file.KEYS))
    kinds = kinds_of(
        [joint.choice("kind", KINDS, "kind of joint") for joint in joints], len(joints)
    )
    axes = np.array([joint.vector("axis") for joint in joints])
    points = np.array([_point(joint) for joint in joints])
    errors = np.array([_error(joint) for joint in joints])
    follows = _follows(joints, kinds)
    laws = joint_law_file.read(top, joints, axes, points, kinds)
    stated = top.table("uncertainty") if "uncertainty" in top else Table({}, source)
    return {
        "axes": axes,
        "points": points,
        "home": _home(tool),
        "kinds": kinds,
        "name": top.text("name"),
        "joint_errors": errors,
        "joint_names": _names(joints),
        "source": None,
        "laws": laws,
        "follows": follows,
        "uncertainty": read_uncertainty(stated, arm_geometry(errors, laws)).table(),
    }


def write(arm: ArmArguments, path: str | os.PathLike[str], comment: str = "") -> None:
    """Write an arm's file in mm and rad, `comment` at its head; it is complete or untouched.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    """
    head: dict[str, Any] = {"name": arm["name"], "units": {"length": "mm", "angle": "rad"}}
    laws, follows = arm["laws"], arm["follows"] or {}
    if laws is not None:
        head["gravity"] = list(laws.pulls.gravity)
    blocks = [HEADER, lines(head), "[tool]\n" + lines({"home": arm["home"][:3].tolist()})]
    if arm["uncertainty"]:
        blocks.append("[uncertainty]\n" + lines(arm["uncertainty"]))
    for i, kind in enumerate(arm["kinds"]):
        joint: dict[str, Any] = {}
        if arm["joint_names"] is not None:
            joint["name"] = arm["joint_names"][i]
        joint |= {"kind": kind, "axis": arm["axes"][i].tolist()}
        joint["point"] = arm["points"][i].tolist()
        if leaders := follows.get(i + 1):
            joint["follows"] = [{"joint": k, "by": by} for k, by in leaders.items()]
        error = dict(zip(ERRORS, arm["joint_errors"][i].tolist(), strict=True))
        if any(error.values()):
            joint["error"] = error
        if laws is not None:
            joint |= joint_law_file.keys(laws, i)
        blocks.append("[[joint]]\n" + lines(joint))
    write_whole(path, arguments.comment(comment) + "\n".join(blocks))


def _names(joints: Sequence[Table]) -> tuple[str, ...] | None:
    """Names of the joints: of all, each another one, or of none."""
    if not any("name" in joint for joint in joints):
        return None
    names: list[str] = []
    for joint in joints:
        name = joint.text("name")
        if name in names:
            joint.fail("name", f"{name!r} is another joint's name")
        names.append(name)
    return tuple(names)


def _point(joint: Table) -> list[float]:
    found = joint.list_of("point", 3, "three coordinates")
    return [joint.as_number("point", each, "mm") for each in found]


def _follows(joints: Sequence[Table], kinds: Sequence[str]) -> Follows | None:
    """The joints that each joint without an actuator follows, in mm and rad; None of none."""
    found: dict[int, dict[int, float]] = {}
    for i, joint in enumerate(joints):
        for leader in joint.tables("follows", "the key") if "follows" in joint else []:
            leader.only(("joint", "by"), "a joint that another one follows")
            number = leader.integer("joint")
            if not 1 <= number <= len(joints):
                leader.fail("joint", f"must be another one, 1 to {len(joints)}")
            own, its = (_UNITS[kinds[k]] for k in (i, number - 1))
            by = leader.as_number("by", leader["by"], own) / leader.units.factor(its)
            leaders = found.setdefault(i + 1, {})
            if number in leaders:
                leader.fail("joint", f"joint {number} is stated twice")
            leaders[number] = by
        if i + 1 in found:
            try:
                Followers(found, len(joints))
            except ArgumentError as error:
                joint.fail("follows", str(error).partition(": ")[2])
    return found or None


def _error(joint: Table) -> list[float]:
    """The joint's six errors; those left out are 0."""
    if "error" not in joint:
        return [0.0] * len(ERRORS)
    error = joint.table("error")
    error.only(ERRORS)
    units: tuple[Unit, ...] = ("mm", "mm", "mm", "rad", "rad", "rad")
    return [error.number(name, unit, 0.0) for name, unit in zip(ERRORS, units, strict=True)]


def _home(tool: Table) -> FloatArray:
    """The tool at zero: a pose by name, or three rows of four numbers."""
    value = tool["home"]
    if isinstance(value, Mapping):
        pose = tool.table("home")
        pose.only(POSE)
        return np.array([pose.number(name, COORDINATE_UNITS[name], 0.0) for name in POSE])
    rows = tool.list_of("home", 3, "a pose, or three rows of four numbers")
    if not all(isinstance(row, list) and len(row) == 4 for row in rows):
        tool.fail("home", f"must be a pose, or three rows of four numbers, found {shown(value)}")
    matrix = np.eye(4)
    for i, row in enumerate(rows):
        for j, each in enumerate(row):
            matrix[i, j] = tool.as_number("home", each, "mm" if j == 3 else "1")
    try:
        screw.as_motions("home", matrix)
    except ValueError as error:
        tool.fail("home", str(error).partition(" ")[2])
    return matrix
