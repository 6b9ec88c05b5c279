"""The links and joints of a URDF file, each checked.

Read here, and not by a URDF library: of a joint six elements matter, and the one at hand goes on
with what is left where its XML parser gives up, so that a file was cut short without a word.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import NamedTuple

import numpy as np

from pkmcal import screw
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files import reading
from pkmcal.files.units import METRE

_MOST_NESTED = 100
_XACRO = "{http://www.ros.org/wiki/xacro}"


class Mimic(NamedTuple):
    """A joint that another one follows: it stands at multiplier × that joint + offset, m or rad."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Element:
    """A joint as the file states it: origin (4, 4) in its parent link, mm; axis in its frame.

    Its limits are in mm or rad, infinite where it states none. `follows` is what it mimics.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: FloatArray
    axis: tuple[float, float, float]
    follows: Mimic | None
    limits: tuple[float, float]


@dataclass(frozen=True)
class Inertial:
    """Mass of a link, kg, and its centre in the link's frame, mm."""

    mass: float
    centre: tuple[float, float, float]


@dataclass(frozen=True)
class File:
    """The robot's name, its links, and its joints; what links weigh that say so."""

    name: str
    links: tuple[str, ...]
    joints: tuple[Element, ...]
    inertials: Mapping[str, Inertial]


def read(path: str | PathLike[str]) -> File:
    """Read a URDF file.

    Raises
    ------
    ValueError
        No XML, a document type or xacro in it, no robot; links and joints that do not make trees.
    OSError
        The file cannot be read.
    """
    root = tree(path)
    links = tuple(_attribute(path, link, "name") for link in root.findall("link"))
    joints = tuple(_joint(path, joint) for joint in root.findall("joint"))
    _once(path, links, "several links are named {!r}")
    _once(path, (joint.name for joint in joints), "several joints are named {!r}")
    _once(path, (joint.child for joint in joints), "{!r} is the child of several joints")
    known = set(links)
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                raise FileError(
                    f"{path}: joint {joint.name!r}: there is no link {link!r}, its {role}"
                )
        if joint.parent == joint.child:
            raise FileError(f"{path}: joint {joint.name!r} joins {joint.child!r} with itself")
    return File(_attribute(path, root, "name"), links, joints, dict(_inertials(path, root)))


def tree(path: str | PathLike[str]) -> ElementTree.Element:
    """The root element of the file, with its comments."""
    content = reading.content(path, reading.MOST_URDF)
    parser = ElementTree.XMLParser(target=_Builder(f"{path}"))
    try:
        parser.feed(content)
        root: ElementTree.Element = parser.close()
    except FileError:
        raise
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # syntax, an encoding
        raise FileError(f"{path}: not valid XML: {error}") from None
    if root.tag != "robot":
        raise FileError(f"{path}: not a URDF file: it begins with <{root.tag}>, not <robot>")
    return root


def comments_around(path: str | PathLike[str]) -> tuple[str, str]:
    """Return the comments before and behind the root element, which a tree does not keep."""
    around = _Around()
    parser = ElementTree.XMLParser(target=around)
    parser.feed(reading.content(path, reading.MOST_URDF))
    parser.close()
    return around.said[0], around.said[1]


class _Around:
    """Keeps the comments outside the root element."""

    def __init__(self) -> None:
        self.said = ["", ""]
        self._depth, self._begun = 0, False

    def start(self, tag: str, attrs: dict[str, str]) -> None:
        self._depth, self._begun = self._depth + 1, True

    def end(self, tag: str) -> None:
        self._depth -= 1

    def comment(self, text: str) -> None:
        if not self._depth:
            self.said[self._begun] += f"<!--{text}-->\n"


class _Builder(ElementTree.TreeBuilder):
    """Builds the tree, and refuses what a URDF file has not."""

    def __init__(self, place: str) -> None:
        super().__init__(insert_comments=True)
        self._place, self._depth = place, 0

    def doctype(self, name: str, *ids: str | None) -> None:
        raise FileError(f"{self._place}: a document type, which may hold anything, is not taken")

    def start(self, tag: str, attributes: dict[str, str]) -> ElementTree.Element:
        self._depth += 1
        if self._depth > _MOST_NESTED:
            raise FileError(f"{self._place}: elements nested deeper than {_MOST_NESTED}")
        if tag.startswith(_XACRO):
            name = tag.removeprefix(_XACRO)
            raise FileError(f"{self._place}: <xacro:{name}>: give the file that xacro makes of it")
        return super().start(tag, attributes)

    def end(self, tag: str) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)


def _joint(path: str | PathLike[str], joint: ElementTree.Element) -> Element:
    name = _attribute(path, joint, "name")
    kind = _attribute(path, joint, "type")
    place = f"{path}: joint {name!r}"
    ends = []
    for role in ("parent", "child"):
        found = _only(place, joint, role)
        if found is None:
            raise FileError(f"{place} has no <{role}>")
        ends.append(_attribute(place, found, "link"))
    origin = _only(place, joint, "origin")
    pose = (*_three(place, origin, "xyz"), *_three(place, origin, "rpy"))
    home = screw.from_pose([*(METRE * number for number in pose[:3]), *pose[3:]])
    axis = _three(place, _only(place, joint, "axis"), "xyz", default=(1.0, 0.0, 0.0))
    follows = _mimic(place, _only(place, joint, "mimic"))
    limits = _limits(place, joint, kind)
    return Element(name, kind, ends[0], ends[1], np.asarray(home), axis, follows, limits)


def _mimic(place: str, stated: ElementTree.Element | None) -> Mimic | None:
    if stated is None:
        return None
    try:
        multiplier, offset = float(stated.get("multiplier", "1")), float(stated.get("offset", "0"))
    except ValueError:
        multiplier = offset = math.nan
    if not (math.isfinite(multiplier) and math.isfinite(offset)):
        raise FileError(f"{place}: <mimic> multiplier and offset must be finite numbers")
    return Mimic(_attribute(place, stated, "joint"), multiplier, offset)


def _inertials(
    path: str | PathLike[str], root: ElementTree.Element
) -> Iterator[tuple[str, Inertial]]:
    for link in root.findall("link"):
        place = f"{path}: link {link.get('name')!r}"
        inertial = _only(place, link, "inertial")
        if inertial is None:
            continue
        mass = _only(place, inertial, "mass")
        try:
            value = float("nan" if mass is None else mass.get("value", "nan"))
        except ValueError:
            value = math.nan
        if not 0.0 <= value < math.inf:
            raise FileError(f"{place}: <inertial> must have a mass of 0 or more")
        x, y, z = _three(place, _only(place, inertial, "origin"), "xyz")
        yield str(link.get("name")), Inertial(value, (METRE * x, METRE * y, METRE * z))


def _limits(place: str, joint: ElementTree.Element, kind: str) -> tuple[float, float]:
    """The ends of a joint; both are 0 where they are left out, as URDF has it, which is none."""
    if kind not in ("revolute", "prismatic"):
        return -math.inf, math.inf
    stated = _only(place, joint, "limit")
    if stated is None or (stated.get("lower") is None and stated.get("upper") is None):
        return -math.inf, math.inf
    try:
        low, high = (float(stated.get(end, "0")) for end in ("lower", "upper"))
    except ValueError:
        raise FileError(f"{place}: <limit> lower and upper must be numbers") from None
    if not low <= high:
        raise FileError(f"{place}: <limit> from {low:g} to {high:g}")
    per_unit = METRE if kind == "prismatic" else 1.0
    return low * per_unit, high * per_unit


def _attribute(place: object, element: ElementTree.Element, name: str) -> str:
    value = element.get(name)
    if not value:
        raise FileError(f"{place}: <{element.tag}> has no {name}")
    if len(value) > reading.LONGEST_NAME:
        raise FileError(f"{place}: {name} of <{element.tag}> has {len(value)} characters")
    return value


def _only(place: str, joint: ElementTree.Element, tag: str) -> ElementTree.Element | None:
    found = joint.findall(tag)
    if len(found) > 1:
        raise FileError(f"{place} has {len(found)} elements <{tag}>")
    return found[0] if found else None


def _three(
    place: str,
    element: ElementTree.Element | None,
    name: str,
    default: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[float, float, float]:
    """Three finite numbers of an attribute; the default where it is not there."""
    if element is None or (text := element.get(name)) is None:
        return default
    try:
        x, y, z = map(float, text.split())
    except ValueError:
        x = y = z = math.nan
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise FileError(f"{place}: {name} must be three finite numbers, found {text!r:.60}")
    return x, y, z


def _once(path: str | PathLike[str], names: Iterable[str], fault: str) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise FileError(f"{path}: {fault.format(twice[0])}")
