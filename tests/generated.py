"""Machines that nobody drew: random limbs, gains, frames, shared actuators, strokes of any turn.

Homes are level, near γ = 180° or where β is ±90°. Each machine is assembled at home by
construction: joints, directions and drives are drawn, and the lengths follow. What it does is
judged by `twin_rows`, which knows nothing of the core.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import pkmcal as pk

from .driven import content, parsed
from .robots import made
from .twin import rotation

SIZE = 300.0  # mm
ROOM = np.array([0.1 * SIZE] * 3 + [0.2] * 3)  # half widths of the box of poses about home
COORDINATES = ("x", "y", "z", "alpha", "beta", "gamma")
FREE = {
    "six": (0, 1, 2, 3, 4, 5),
    "translation": (0, 1, 2),
    "planar": (0, 1, 5),
    "pairs": (0, 1, 2),
    "redundant": (0, 1, 2, 3, 4, 5),
    "tripod": (2, 3, 4),
    "spherical": (3, 4, 5),
    "xy": (0, 1),
}
KINDS = tuple(FREE)
MAPS = {kind: kind for kind in ("translation", "planar", "spherical", "xy")}  # others: spatial
SQUARE = ("six", "translation", "planar", "spherical", "xy")  # every pose of the map can be taken
CONSTRAINED = ("pairs", "tripod")  # what is not matched is determined by the limbs


def machine(kind: str, rng: np.random.Generator, *, errors: float = 0.0) -> pk.Robot:
    """A machine that is well conditioned at home; `errors` in mm of its points and lengths."""
    while True:
        robot = _drawn(kind, rng)
        there = pk.dexterity(robot, robot.home)
        if there.conditioning > 0.05 and there.transmission > 0.2:
            break
    if errors:
        values = robot.geometry.values.copy()
        lengths = np.array([unit == "mm" for unit in robot.geometry.units])
        values[lengths] += errors * rng.uniform(-1, 1, lengths.sum())
        robot = robot.replace(values)
    return robot


def poses(kind: str, robot: pk.Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random poses about home, in the machine's own frame.

    Of a machine whose home has β = ±90°, half of them are nearer to that by any power of ten.
    """
    at = np.tile(robot.own_home, (count, 1))
    free = list(FREE[kind])
    at[:, free] += ROOM[free] * rng.uniform(-1, 1, (count, len(free)))
    if abs(robot.own_home[4]) == np.pi / 2:
        near = rng.random(count) < 0.5
        off = 10.0 ** -rng.uniform(1, 18, near.sum())
        at[near, 4] = robot.own_home[4] + rng.choice([-1, 1], near.sum()) * off
    return at


def written_in(robot: pk.Robot, turn: np.ndarray, shift: np.ndarray) -> pk.Robot:
    """The same machine described in a frame turned (3, 3) and shifted; its base frame undoes it."""
    data = content(robot)
    for limb in data["limb"]:
        limb["base"] = (turn @ limb["base"] + shift).tolist()
        for axis in {"slider", "axis", "zero", "normal"} & set(limb):
            limb[axis] = (turn @ limb[axis]).tolist()
    own = np.eye(4)
    own[:3, :3], own[:3, 3] = turn, shift
    frames = data.get("frames", {})
    base, home = (
        pk.screw.from_pose([place.get(name, 0.0) for name in COORDINATES])
        for place in (frames.get("base", {}), data["pose"]["home"])
    )

    def stated(motion: np.ndarray) -> dict[str, float]:
        return dict(zip(COORDINATES, pk.screw.to_pose(motion).tolist(), strict=True))

    data["frames"] = frames | {"base": stated(base @ np.linalg.inv(own))}
    data["pose"]["home"] = stated(own @ home)
    return parsed(data)


def references(robot: pk.Robot) -> np.ndarray:
    """q of each actuator that angles are to be nearest to: NaN for lengths, and without strokes."""
    found = np.full(robot.n_actuators, np.nan)
    for i, limb in enumerate(robot.model.limbs, 1):
        if limb.kind == "RUS" and limb.stroke is not None and np.isnan(found[limb.actuator]):
            middle = sum(limb.stroke) / 2
            found[limb.actuator] = middle - robot.geometry[f"offset{i}"]
            found[limb.actuator] /= robot.geometry[f"gain{i}"]
    return found


def _drawn(kind: str, rng: np.random.Generator) -> pk.Robot:
    home = {"z": SIZE * rng.uniform(0.8, 1.4)}
    if kind == "planar":
        home = {"x": rng.uniform(-20, 20), "y": rng.uniform(-20, 20), "gamma": rng.uniform(-3, 3)}
    if kind == "spherical":
        home = {name: rng.uniform(-0.3, 0.3) for name in COORDINATES[3:]}
    if kind == "xy":
        home = {"x": rng.uniform(-20, 20), "y": rng.uniform(-20, 20)}
    turned = rng.random() if kind in ("six", "redundant") else 1.0
    if turned < 0.3:
        home |= {"alpha": rng.uniform(-3, 3), "gamma": rng.uniform(-3, 3)}
        home["beta"] = rng.choice([-1, 1]) * np.pi / 2
    elif turned < 0.6:
        home["gamma"] = np.pi + rng.uniform(-0.2, 0.2)
    sections: dict[str, Any] = {}
    if kind == "tripod":
        limbs = _tripod(rng)
        sections["match"] = ["z", "alpha", "beta"]
    elif kind == "pairs":
        limbs = [each for i in range(3) for each in _pair(i, home, rng)]
        sections["match"] = ["x", "y", "z"]
    else:
        count = {"six": 6, "translation": 3, "planar": 3, "spherical": 3, "xy": 2}
        count["redundant"] = int(rng.integers(7, 10))
        limbs = [_limb(*_joints(kind, i, count[kind], rng), home, kind, rng)
                 for i in range(count[kind])]  # fmt: skip
    if rng.random() < 0.3:
        sections["frames"] = {
            name: dict(zip(COORDINATES, rng.uniform(-1, 1, 6) * [100, 100, 100, 3, 1.4, 3],
                           strict=True))
            for name in ("base", "tool")
        }  # fmt: skip
        if rng.random() < 0.3:
            sections["frames"]["base"]["beta"] = np.pi / 2
    return made(MAPS.get(kind, "spatial"), home, limbs, **sections)


def _joints(
    kind: str, i: int, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Base and platform joint of limb i, the latter from the platform's origin at home."""
    angle = 2 * np.pi * (i + rng.uniform(-0.2, 0.2)) / count
    other = angle + rng.choice([-0.6, 0.6]) * (i % 2 or rng.random()) + rng.uniform(-0.2, 0.2)
    base = SIZE * np.array([np.cos(angle), np.sin(angle), rng.uniform(-0.2, 0.2)])
    platform = 0.5 * SIZE * np.array([np.cos(other), np.sin(other), rng.uniform(-0.2, 0.2)])
    if kind == "spherical":
        base[2] -= SIZE
    if kind in ("planar", "xy"):
        base[2] = platform[2] = 0.0
    return base, platform


def _limb(
    base: np.ndarray,
    platform: np.ndarray,
    home: dict[str, float],
    kind: str,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """A limb of any kind between two joints at home."""
    at = np.array([home.get(name, 0.0) for name in COORDINATES])
    h = at[:3] + platform - base
    limb = {
        "base": base,
        "platform": rotation(at).T @ platform,
        "gain": rng.choice([-1, 1]) * rng.uniform(0.5, 2),
    }
    which = rng.choice(["UPS", "PUS", "RUS", "RUS"])
    if which == "UPS":
        return limb | {"kind": "UPS", "offset": rng.uniform(-100, 100)}
    while True:
        made_of = _slider(h, kind, rng) if which == "PUS" else _crank(h, kind, rng)
        if made_of is not None:
            return limb | made_of


def _direction(kind: str, rng: np.random.Generator) -> np.ndarray:
    found = rng.normal(size=3)
    found[2] *= kind not in ("planar", "xy")
    return found / np.linalg.norm(found)


def _slider(h: np.ndarray, kind: str, rng: np.random.Generator) -> dict[str, Any] | None:
    s, size = _direction(kind, rng), float(np.linalg.norm(h))
    drive = size * rng.uniform(-0.6, 0.6)
    u = h - drive * s
    if abs(u @ s) < 0.4 * np.linalg.norm(u):
        return None
    limb = {"kind": "PUS", "slider": s, "rod": np.linalg.norm(u), "branch": int(np.sign(u @ s))}
    limb["offset"] = rng.uniform(-100, 100)
    if rng.random() < 0.5:
        limb["stroke"] = [drive - size, drive + size]
    return limb


def _crank(h: np.ndarray, kind: str, rng: np.random.Generator) -> dict[str, Any] | None:
    """Half of the cranks are at home near half a turn; half have strokes, of any turn."""
    axis = np.array([0.0, 0.0, 1.0]) if kind in ("planar", "xy") else _direction(kind, rng)
    zero = np.cross(axis, rng.normal(size=3))
    zero /= np.linalg.norm(zero)
    drive = np.pi + rng.uniform(-0.4, 0.4) if rng.random() < 0.5 else rng.uniform(-np.pi, np.pi)
    crank = rng.uniform(0.3, 0.6) * np.linalg.norm(h)
    u = h - crank * (np.cos(drive) * zero + np.sin(drive) * np.cross(axis, zero))
    along = u @ (np.cos(drive) * np.cross(axis, zero) - np.sin(drive) * zero)
    if abs(along) < 0.4 * np.linalg.norm(u):
        return None
    limb = {"kind": "RUS", "axis": axis, "zero": zero, "crank": crank, "rod": np.linalg.norm(u)}
    limb |= {"branch": int(np.sign(along)), "offset": rng.uniform(-4, 4)}
    if rng.random() < 0.5:
        middle = drive + rng.uniform(-0.5, 0.5) + 2 * np.pi * rng.integers(-2, 3)
        half = rng.uniform(1.8, 3.0)
        limb["stroke"] = [middle - half, middle + half]
    return limb


def _pair(i: int, home: dict[str, float], rng: np.random.Generator) -> list[dict[str, Any]]:
    """Two parallel rods on one carriage or crank; the second may count the other way round."""
    angle = 2 * np.pi * i / 3 + rng.uniform(-0.2, 0.2)
    out, side = (
        np.array([np.cos(angle), np.sin(angle), 0]),
        np.array([-np.sin(angle), np.cos(angle), 0]),
    )
    h = np.array([0.0, 0.0, home["z"]]) - 0.6 * SIZE * out
    while True:
        one = _slider(h, "", rng) if rng.random() < 0.3 else _crank(h, "", rng)
        # rods that run across the line between them keep the platform from turning
        if one is not None:
            break
    sign = int(rng.choice([-1, 1]))
    gain, limbs = float(rng.uniform(0.5, 2)), []
    for way, there in ((1, -1), (sign, 1)):
        limb = dict(one) | {"base": 0.8 * SIZE * out + 60 * there * side, "actuator": i + 1}
        limb |= {"platform": 0.2 * SIZE * out + 60 * there * side, "gain": way * gain}
        limb |= {"offset": way * one["offset"], "branch": way * one["branch"]}
        key = "axis" if one["kind"] == "RUS" else "slider"
        limb[key] = way * one[key]
        if "stroke" in one:
            limb["stroke"] = sorted(way * end for end in one["stroke"])
        limbs.append(limb)
    return limbs


def _tripod(rng: np.random.Generator) -> list[dict[str, Any]]:
    """A 3-RPS whose planes meet near the middle."""
    limbs = []
    for i in range(3):
        angle = 2 * np.pi * i / 3 + rng.uniform(-0.1, 0.1)
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        limbs.append({
            "kind": "RPS", "base": SIZE * rng.uniform(0.8, 1.2) * out,
            "platform": SIZE * rng.uniform(0.4, 0.7) * out,
            "normal": [-np.sin(angle), np.cos(angle), 0.0],
            "offset": rng.uniform(-100, 100), "gain": rng.choice([-1, 1]) * rng.uniform(0.5, 2),
        })  # fmt: skip
    return limbs
