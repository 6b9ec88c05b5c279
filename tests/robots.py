"""Robots that are made for a test: as short robot files, read as any other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import tomli_w

import pkmcal as pk
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file


def made(
    map: str, home: Mapping[str, float], limbs: Sequence[Mapping[str, Any]], **sections: Any
) -> pk.Robot:
    """A robot of these limbs, in mm and rad; `match` goes to its pose, `frames` by itself."""
    pose = {"map": map, "home": dict(home)}
    if "match" in sections:
        pose["match"] = sections.pop("match")
    content = {
        "name": "made for a test",
        "units": {"length": "mm", "angle": "rad"},
        "pose": pose,
        "limb": [{key: plain(value) for key, value in limb.items()} for limb in limbs],
        **sections,
    }
    text = tomli_w.dumps(content)
    return pk.Robot(robot_file.parse(Source(text.encode(), "made.toml"), "made.toml"))


def plain(value: Any) -> Any:
    """Without NumPy's types, which TOML does not know."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def ring(radius: float, degrees: float, z: float = 0.0) -> np.ndarray:
    """A point of a horizontal circle."""
    angle = np.radians(degrees)
    return np.array([radius * np.cos(angle), radius * np.sin(angle), z])


def hexapod(*changes: Mapping[str, Any], **sections: Any) -> pk.Robot:
    """A 6-UPS; `changes` are keys that its limbs have as well, the first limb's first."""
    base, platform = (20, 100, 140, 220, 260, 340), (42.5, 77.5, 162.5, 197.5, 282.5, 317.5)
    limbs = [
        {"kind": "UPS", "base": ring(325.0, a), "platform": ring(125.0, b, -10.0)}
        for a, b in zip(base, platform, strict=True)
    ]
    for limb, change in zip(limbs, changes, strict=False):
        limb |= change
    return made("spatial", {"z": 800.0}, limbs, **sections)


def linear_delta(
    *changes: Mapping[str, Any], rod: float = 340.0, radius: float = 160.0, **sections: Any
) -> pk.Robot:
    """Three vertical sliders around the middle, with rods that hang down from their carriages."""
    limbs = [
        {"kind": "PUS", "base": ring(radius, angle), "platform": [0.0, 0.0, 0.0]}
        | {"slider": [0.0, 0.0, 1.0], "rod": rod, "branch": -1}
        for angle in (210.0, 330.0, 90.0)
    ]
    for limb, change in zip(limbs, changes, strict=False):
        limb |= change
    return made("translation", {"z": 100.0}, limbs, **sections)


def rotary_delta(*changes: Mapping[str, Any], **sections: Any) -> pk.Robot:
    """Three cranks around the middle whose rods hang down, each in a plane through the z axis."""
    limbs = [
        {"kind": "RUS", "base": ring(160.0, angle), "platform": ring(40.0, angle)}
        | {"axis": ring(1.0, angle + 90.0), "zero": ring(1.0, angle), "branch": 1}
        | {"crank": 200.0, "rod": 500.0}
        for angle in (0.0, 120.0, 240.0)
    ]
    for limb, change in zip(limbs, changes, strict=False):
        limb |= change
    return made("translation", {"z": -450.0}, limbs, **sections)


def griffis_duffy() -> pk.Robot:
    """Corners of one equilateral triangle joined to the middles of another's sides, and back.

    Griffis and Duffy's special 6-6 platform: it moves by itself from every pose (M. Husty and
    A. Karger, "Self-motions of Griffis-Duffy type parallel manipulators", ICRA 2000).
    """
    corners = {size: [ring(size, 90.0 + 120.0 * k) for k in range(3)] for size in (200.0, 100.0)}
    middles = {
        size: [(at[k] + at[(k + 1) % 3]) / 2.0 for k in range(3)] for size, at in corners.items()
    }
    joined = [(corners[200.0][k], middles[100.0][k]) for k in range(3)]
    joined += [(middles[200.0][k], corners[100.0][(k + 1) % 3]) for k in range(3)]
    limbs = [{"kind": "UPS", "base": base, "platform": joint} for base, joint in joined]
    return made("spatial", {"z": 300.0}, limbs)
