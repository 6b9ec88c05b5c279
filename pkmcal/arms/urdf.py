"""Serial arms from URDF files, and joint errors back into their origins."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np

from pkmcal import screw
from pkmcal.arguments import did_you_mean
from pkmcal.arms import urdf_file
from pkmcal.arms.inputs import ArmArguments, JointKind, Source
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.atomic import write_whole
from pkmcal.files.units import METRE

_KINDS: dict[str, JointKind] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


@dataclass(frozen=True)
class Joint:
    """A moving joint of a chain, where all commands are zero.

    A joint that follows another then stands at its offset, by which its child link is turned or
    shifted against its own frame.
    """

    name: str
    kind: JointKind
    parent: FloatArray  # (4, 4) of the parent link in the base, mm
    origin: FloatArray  # (4, 4) of the joint in the base, mm
    axis: FloatArray  # (3,) in the joint's frame
    child: FloatArray  # (4, 4) of the child link in the base, mm
    limits: tuple[float, float]  # mm or rad, without the offset; infinite where there are none
    leader: tuple[str, float] | None  # mm or rad by mm or rad of a joint that it follows


def read(path: str | os.PathLike[str], tip: str | None, base: str | None) -> ArmArguments:
    """Read the chain of moving joints from base to tip; see `SerialArm.from_urdf`."""
    name, joints, home = _chain(path, tip, base)
    number = {joint.name: i for i, joint in enumerate(joints, 1)}
    follows = {
        number[joint.name]: {number[joint.leader[0]]: joint.leader[1]}
        for joint in joints
        if joint.leader is not None
    }
    return {
        "axes": np.array([joint.origin[:3, :3] @ joint.axis for joint in joints]),
        "points": np.array([joint.origin[:3, 3] for joint in joints]),
        "home": home,
        "kinds": tuple(joint.kind for joint in joints),
        "name": name,
        "joint_errors": np.zeros((len(joints), 6)),
        "joint_names": tuple(joint.name for joint in joints),
        "source": Source(str(path), tip, base),
        "laws": None,
        "follows": follows or None,
        "uncertainty": None,
    }


def limits(path: str | os.PathLike[str], tip: str | None, base: str | None) -> FloatArray:
    """Least and largest coordinate of each joint (n, 2), mm and rad; infinite where not stated.

    Of a joint that follows another less its offset, as an arm counts it.
    """
    return np.array([joint.limits for joint in _chain(path, tip, base)[1]])


def write(
    path: str | os.PathLike[str],
    source: str | os.PathLike[str],
    error_motions: FloatArray,
    tip: str | None,
    base: str | None,
) -> None:
    """Write a source again with the motions E (n, 4, 4) by joint errors in its origins.

    Joint i sits at H in the base and its parent link at P: its error makes that E H, so its
    origin in the parent becomes P⁻¹ E H. See `SerialArm.save_urdf`.
    """
    _, joints, _ = _chain(source, tip, base)
    root = urdf_file.tree(source)
    elements = {each.get("name"): each for each in root.findall("joint")}
    for joint, error in zip(joints, error_motions, strict=True):
        pose = screw.to_pose(np.linalg.inv(joint.parent) @ error @ joint.origin)
        element = elements[joint.name]
        origin = element.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(element, "origin")
        origin.set("xyz", _text(pose[:3] / METRE))
        origin.set("rpy", _text(pose[3:]))
    before, behind = urdf_file.comments_around(source)
    text: str = ElementTree.tostring(root, encoding="unicode")
    write_whole(path, f'<?xml version="1.0" encoding="utf-8"?>\n{before}{text}\n{behind}')


def weights(
    path: str | os.PathLike[str], tip: str | None, base: str | None
) -> tuple[FloatArray, FloatArray]:
    """Return the mass on each joint of the chain from base to tip, by the file's ``inertial``.

    Masses (n,), kg, and their centres (n, 3) with all joints at zero, in the base, mm. What joints
    beside the chain carry hangs on the chain's last joint before them; 0 where nothing is stated.
    """
    robot, (_, joints, _) = urdf_file.read(path), _chain(path, tip, base)
    above = {joint.child: joint for joint in robot.joints}
    number = {joint.name: k for k, joint in enumerate(joints)}
    masses, moments = np.zeros(len(joints)), np.zeros((len(joints), 3))
    for link, inertial in robot.inertials.items():
        place, owner = np.array([*inertial.centre, 1.0]), link
        while owner in above and above[owner].name not in number:
            place = above[owner].origin @ place
            owner = above[owner].parent
        if owner not in above:  # before the first joint
            continue
        k = number[above[owner].name]
        masses[k] += inertial.mass
        moments[k] += inertial.mass * (joints[k].child @ place)[:3]
    carried = masses > 0.0
    moments[carried] /= masses[carried, None]
    return masses, moments


def _text(numbers: FloatArray) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _chain(
    path: str | os.PathLike[str], tip: str | None, base: str | None
) -> tuple[str, list[Joint], FloatArray]:
    """The robot's name, its moving joints from base to tip at zero, and the tip, mm."""
    robot = urdf_file.read(path)
    above = {joint.child: joint for joint in robot.joints}
    for argument, link in (("tip", tip), ("base", base)):
        if link is not None and link not in robot.links:
            near = did_you_mean(link, robot.links)
            raise FileError(f"{argument}: {path} has no link {link!r}{near}")
    if tip is None:
        tip = _only_end(path, robot)
    chain: list[urdf_file.Element] = []
    link = tip
    while link != base and link in above:
        if above[link] in chain:
            raise FileError(f"{path}: the joint {above[link].name!r} is above itself")
        chain.insert(0, above[link])
        link = above[link].parent
    if base is not None and link != base:
        raise FileError(f"base: {base!r} is not above {tip!r} in {path}")
    joints, place = [], np.eye(4)
    following = _following(path, chain, robot)
    for joint in chain:
        parent = place
        place = origin = parent @ joint.origin
        if not np.isfinite(place).all():
            raise FileError(f"{path}: joint {joint.name!r}: origin must be finite")
        if joint.type == "fixed":
            continue
        if joint.type not in _KINDS:
            raise FileError(
                f"{path}: joint {joint.name!r} is {joint.type}, which a serial arm has not"
            )
        if not any(joint.axis):
            raise FileError(f"{path}: joint {joint.name!r}: axis must be a direction, found 0 0 0")
        axis, kind = np.array(joint.axis), _KINDS[joint.type]
        leader, offset = following.get(joint.name, (None, 0.0))
        if offset:
            place = origin @ _motion(kind, axis, offset)
        low, high = joint.limits
        ends = (low - offset, high - offset)
        joints.append(Joint(joint.name, kind, parent, origin, axis, place, ends, leader))
    if not joints:
        raise FileError(f"{path}: no moving joint above the link {tip!r}")
    return robot.name, joints, place


def _motion(kind: JointKind, axis: FloatArray, by: float) -> FloatArray:
    """The motion (4, 4) of a joint by mm or rad, in its own frame."""
    way = axis / np.linalg.norm(axis) * by
    none = np.zeros(3)
    turning = kind == "revolute"
    return screw.exp(np.concatenate([way, none] if turning else [none, way]))


def _following(
    path: str | os.PathLike[str], chain: list[urdf_file.Element], robot: urdf_file.File
) -> dict[str, tuple[tuple[str, float], float]]:
    """The joints of a chain that follow: whom and by how much, and their offsets, mm and rad.

    A joint that follows a follower follows whom that one follows.
    """
    by_name = {joint.name: joint for joint in robot.joints}
    moving = {joint.name for joint in chain if joint.type in _KINDS}
    found = {}
    for joint in chain:
        if joint.follows is None or joint.type not in _KINDS:
            continue
        place = f"{path}: joint {joint.name!r}"
        leader, multiplier, offset = joint.follows
        seen = [joint.name]
        while leader in by_name and (further := by_name[leader].follows) is not None:
            if leader in seen:
                raise FileError(f"{place} follows itself (mimic): {' → '.join([*seen, leader])}")
            seen.append(leader)
            offset += multiplier * further.offset
            leader, multiplier = further.joint, multiplier * further.multiplier
        if leader not in moving:
            why = "is not in the file" if leader not in by_name else "does not move the tool here"
            raise FileError(
                f"{place} follows {leader!r} (mimic), which {why}: take a tip and a base with"
                f" {leader!r} between them, or write the joint without its <mimic> and state its"
                " own column in the measurements"
            )
        own, its = _per_unit(joint), _per_unit(by_name[leader])
        found[joint.name] = (leader, multiplier * own / its), offset * own
    return found


def _per_unit(joint: urdf_file.Element) -> float:
    """Mm or rad of a unit of a joint's coordinate."""
    return METRE if _KINDS[joint.type] == "prismatic" else 1.0


def _only_end(path: str | os.PathLike[str], robot: urdf_file.File) -> str:
    parents = {joint.parent for joint in robot.joints}
    ends = [link for link in robot.links if link not in parents]
    if len(ends) != 1:
        named = ", ".join(ends[:12]) + (", …" if len(ends) > 12 else "")
        raise FileError(
            f"tip: name one of the ends of {path}: {named or 'it has none'}; a robot may be given"
            f" as {path}#TIP or {path}#BASE:TIP"
        )
    return ends[0]
