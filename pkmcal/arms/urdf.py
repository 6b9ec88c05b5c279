"""Serial arms from URDF files, and joint errors back into their origins."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal import arguments, screw
from pkmcal.arguments import did_you_mean
from pkmcal.arms.inputs import ArmArguments, JointKind
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.atomic import write_whole

_METRE = 1000.0  # mm
_KINDS: dict[str, JointKind] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


@dataclass(frozen=True)
class Joint:
    """A moving joint of a chain: its name, its kind, and at zero its parent link and itself."""

    name: str
    kind: JointKind
    parent: FloatArray  # (4, 4) of the parent link in the base, mm
    origin: FloatArray  # (4, 4) of the joint in the base, mm
    axis: FloatArray  # (3,) in the joint's frame


def read(path: str | os.PathLike[str], tip: str | None, base: str | None) -> ArmArguments:
    """Read the chain of moving joints from base to tip; see `SerialArm.from_urdf`."""
    name, joints, home = _chain(path, tip, base)
    return {
        "axes": np.array([joint.origin[:3, :3] @ joint.axis for joint in joints]),
        "points": np.array([joint.origin[:3, 3] for joint in joints]),
        "home": home,
        "kinds": tuple(joint.kind for joint in joints),
        "name": name,
        "joint_errors": np.zeros((len(joints), 6)),
    }


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
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    tree = ElementTree.parse(source, parser)
    elements = {each.get("name"): each for each in tree.getroot().findall("joint")}
    for joint, error in zip(joints, error_motions, strict=True):
        pose = screw.to_pose(np.linalg.inv(joint.parent) @ error @ joint.origin)
        element = elements[joint.name]
        origin = element.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(element, "origin")
        origin.set("xyz", _text(pose[:3] / _METRE))
        origin.set("rpy", _text(pose[3:]))
    text: str = ElementTree.tostring(tree.getroot(), encoding="unicode", xml_declaration=True)
    write_whole(path, text + "\n")


def _text(numbers: FloatArray) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _chain(
    path: str | os.PathLike[str], tip: str | None, base: str | None
) -> tuple[str, list[Joint], FloatArray]:
    """The robot's name, its moving joints from base to tip at zero, and the tip, mm."""
    robot = _parsed(path)
    _check_once(path, (joint.name for joint in robot.joints), "several joints are named {!r}")
    _check_once(
        path, (joint.child for joint in robot.joints), "{!r} is the child of several joints"
    )
    above = {joint.child: joint for joint in robot.joints}
    links = [link.name for link in robot.links]
    for argument, link in (("tip", tip), ("base", base)):
        if link is not None and link not in links:
            raise FileError(f"{argument}: {path} has no link {link!r}{did_you_mean(link, links)}")
    if tip is None:
        tip = _only_end(path, links, robot.joints)
    chain: list[Any] = []
    link = tip
    while link != base and link in above:
        if above[link] in chain:
            raise FileError(f"{path}: the joint {above[link].name!r} is above itself")
        chain.insert(0, above[link])
        link = above[link].parent
    if base is not None and link != base:
        raise FileError(f"base: {base!r} is not above {tip!r} in {path}")
    joints, place = [], np.eye(4)
    for joint in chain:
        parent = place
        place = parent @ _origin(joint)
        if not np.isfinite(place).all():
            raise FileError(f"{path}: joint {joint.name!r}: origin must be finite")
        if joint.type == "fixed":
            continue
        if joint.type not in _KINDS or joint.mimic is not None:
            what = "mimic" if joint.mimic is not None else joint.type
            raise FileError(f"{path}: joint {joint.name!r} is {what}, which a serial arm has not")
        axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            found = " ".join(f"{number:g}" for number in axis)
            raise FileError(
                f"{path}: joint {joint.name!r}: axis must be a direction, found {found}"
            )
        joints.append(Joint(joint.name, _KINDS[joint.type], parent, place, axis))
    if not joints:
        raise FileError(f"{path}: no moving joint above the link {tip!r}")
    return robot.name, joints, place


def _check_once(path: str | os.PathLike[str], names: Iterable[str], fault: str) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise FileError(f"{path}: {fault.format(twice[0])}")


def _parsed(path: str | os.PathLike[str]) -> Any:
    try:
        import yourdfpy
    except ImportError:
        raise ImportError("URDF files need yourdfpy: pip install 'pkmcal[urdf]'") from None
    if not arguments.path("path", path).is_file():
        raise FileNotFoundError(f"{path}: no such file")
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise FileError(f"{path}: not valid XML: {error}") from None
    if root.tag != "robot":
        raise FileError(f"{path}: not a URDF file: it begins with <{root.tag}>, not <robot>")
    try:
        return yourdfpy.URDF.load(
            str(path),
            build_scene_graph=False,
            load_meshes=False,
            build_collision_scene_graph=False,
            load_collision_meshes=False,
        ).robot
    except (KeyError, AttributeError, ValueError, TypeError) as error:
        raise FileError(f"{path}: not a URDF file: {error!r}") from None


def _only_end(path: str | os.PathLike[str], links: Iterable[str], joints: Iterable[Any]) -> str:
    parents = {joint.parent for joint in joints}
    ends = [link for link in links if link not in parents]
    if len(ends) != 1:
        raise FileError(f"tip: name one of the ends of {path}: {', '.join(ends) or 'it has none'}")
    return ends[0]


def _origin(joint: Any) -> FloatArray:
    place = np.eye(4)
    if joint.origin is not None:
        place[:] = joint.origin
    place[:3, 3] *= _METRE
    return place
