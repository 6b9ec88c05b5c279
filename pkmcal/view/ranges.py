"""Ranges of a page's sliders, places of a machine, and its assembly modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.complete import completed
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import good_poses, reach

BEYOND = 0.15  # of a range: sliders go beyond it, so that one sees what stops there
_SAME = 1e-6  # of the machine's length: a pose that is found again
_DECIMALS = 9  # of a mode's pose, mm and rad: more would be another processor's
_CLOUD = 500  # points, at most
_DRAWS = 2500
_ANGLE, _LENGTH = np.radians(30.0), 0.2  # where the machine says nothing: rad, and of its size


def poses(robot: Robot, size: float, most: float) -> dict[str, tuple[float, float]]:
    """Return the range of each coordinate of the pose alone from home, mm and rad.

    No farther than `most`, mm.
    """
    try:
        found = reach(robot)
    except ArgumentError:  # home is singular or breaks a limit: it can be looked at all the same
        home = dict(zip(POSE, robot.home.tolist(), strict=True))
        by = {name: _ANGLE if name in POSE[3:] else _LENGTH * size for name in robot.moved}
        found = {name: (home[name] - by[name], home[name] + by[name]) for name in robot.moved}
    return {name: _within(robot, name, ends, most) for name, ends in found.items()}


def sliders(
    robot: Robot, ranges: dict[str, tuple[float, float]], most: float
) -> list[tuple[float, float]]:
    """Return the range of each coordinate's slider: beyond what is reached."""
    return [_within(robot, name, beyond(ends), most) for name, ends in ranges.items()]


def farthest(robot: Robot, strokes: list[tuple[float, float] | None]) -> float:
    """Return the largest way from home, mm: where no stroke ends it, to the farthest base joint."""
    units = robot.actuator_units
    if all(stroke or unit == "rad" for stroke, unit in zip(strokes, units, strict=True)):
        return np.inf
    base = robot.model.mechanism.base_points(robot.slots)
    return float(np.linalg.norm(base - robot.own_home[:3], axis=1).max())


def _within(robot: Robot, name: str, ends: Sequence[float], most: float) -> tuple[float, float]:
    low, high = ends
    if name in POSE[3:]:
        return low, high
    home = float(robot.home[POSE.index(name)])
    return max(low, home - most), min(high, home + most)


def beyond(ends: Sequence[float]) -> list[float]:
    """A range with a margin at both ends."""
    more = BEYOND * (ends[1] - ends[0])
    return [ends[0] - more, ends[1] + more]


def actuators(
    robot: Robot,
    strokes: list[tuple[float, float] | None],
    ranges: dict[str, tuple[float, float]],
) -> list[list[float]]:
    """Return the range of each actuator: its stroke, or what the poses ask for."""
    at = robot.inverse(robot.home)
    corners = np.repeat(robot.home[None], 2 * len(ranges), axis=0)
    for k, (name, ends) in enumerate(ranges.items()):
        corners[2 * k : 2 * k + 2, POSE.index(name)] = ends
    q = robot.inverse(completed(robot, corners))
    found = []
    for a, stroke in enumerate(strokes):
        least = _ANGLE if robot.actuator_units[a] == "rad" else 1e-2 * robot.length
        seen = np.append(q[np.isfinite(q[:, a]), a], [at[a] - least, at[a] + least])
        ends = (float(seen.min()), float(seen.max())) if stroke is None else stroke
        found.append(beyond((min(ends[0], float(at[a])), max(ends[1], float(at[a])))))
    return found


def modes(robot: Robot) -> dict[str, Any]:
    """Every pose at the actuator coordinates of home; none where home is not reached."""
    home = completed(robot, robot.home[None])[0]  # of a calibrated machine some coordinates follow
    q = robot.inverse(home if np.isfinite(home).all() else robot.home)
    if not np.isfinite(q).all():
        return {"poses": [], "complete": False}
    found = robot.forward_all(q)
    poses = found.poses
    if not robot.model.closed_form:  # of passive joints that fold over the page knows nothing
        there = robot.forward(np.repeat(q[None], len(poses), axis=0), poses)
        off = np.linalg.norm(there.pose[:, :3] - poses[:, :3], axis=1)
        poses = poses[there.ok & (off < _SAME * robot.length)]
    return {"poses": np.round(poses, _DECIMALS).tolist(), "complete": bool(found.complete)}


def cloud(robot: Robot, ranges: dict[str, tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """Good poses (N, 6), within all limits and not near a singularity, and where to draw them.

    That is their position (N, 3), mm; of machines that only turn, where a point in front of the
    platform goes.
    """
    moved = [name for name in ranges if name in POSE[:3]]
    turned = [name for name in ranges if name in POSE[3:]]
    names = moved or turned
    if len(moved) == 1:  # a line is no cloud: what turns shows more
        names = moved + turned
    random = np.random.default_rng(0)
    drawn = np.repeat(robot.home[None], _DRAWS, axis=0)
    for name in names:
        low, high = beyond(ranges[name])
        drawn[:, POSE.index(name)] = random.uniform(low, high, _DRAWS)
    drawn = completed(robot, drawn)
    kept = drawn[good_poses(robot, drawn)][:_CLOUD]
    if len(moved) > 1:
        return kept, kept[:, :3]
    a, b, c = kept[:, 3:].T  # the third column of Rz(γ) Ry(β) Rx(α): where the platform's z points
    up = np.stack([
        np.cos(a) * np.sin(b) * np.cos(c) + np.sin(a) * np.sin(c),
        np.cos(a) * np.sin(b) * np.sin(c) - np.sin(a) * np.cos(c),
        np.cos(a) * np.cos(b),
    ], axis=1)  # fmt: skip
    shown: FloatArray = kept[:, :3] + robot.length * up
    return kept, shown
