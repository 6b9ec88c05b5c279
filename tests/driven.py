"""Machines with drive laws that nobody drew: the laws of each drive are drawn at random."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import tomli_w

import pkmcal as pk
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.robot_file_writer import text_of

KINDS = ("quadratic", "spool", "harmonics", "table", "backlash")
BEND = 0.1  # share of its slope by which each kind may change a drive's


def with_laws(
    robot: pk.Robot, rng: np.random.Generator, kinds: tuple[str, ...] = KINDS
) -> pk.Robot:
    """The robot with random laws of these kinds, each drive with some of them."""
    data = content(robot)
    home = robot.inverse(robot.home)
    ways = robot.machine.drives(robot.slots, home[None])[0]
    data_of, done = [table for _, table in _drives(data)], dict[int, int]()
    for d, table in enumerate(data_of):
        drive = robot.model.drives[d]
        reach = 0.7 if drive.angle else 0.4 * robot.machine.struct.size
        if (first := done.get(drive.actuator)) is not None:  # one motor has one law
            if "drive" in data_of[first]:
                table["drive"] = data_of[first]["drive"]
                _state_stroke(table, ways[d], 2.0 * reach * abs(table.get("gain", 1.0)))
                table["gain"] = table.get("gain", 1.0) / table["drive"].get("spool", 1.0)
            continue
        done[drive.actuator] = d
        chosen = [
            kind for kind in kinds if rng.random() < 0.6 and not (drive.angle and kind == "spool")
        ]
        if not chosen:
            continue
        q, gain = home[drive.actuator], table.get("gain", 1.0)
        law = _law(chosen, rng, q, reach, gain)
        if "spool" in law:
            table["gain"] = gain / law["spool"]
            if "quadratic" in law:
                law["quadratic"] /= law["spool"]
        table["drive"] = law
        _state_stroke(table, ways[d], 2.0 * reach * abs(gain))
    return parsed(data)


def content(robot: pk.Robot) -> dict[str, Any]:
    """What the robot's file says, to be changed."""
    return deepcopy(Source(text_of(robot.model).encode(), "driven.toml").data)


def parsed(data: dict[str, Any]) -> pk.Robot:
    """The robot of a file that says so."""
    source = Source(tomli_w.dumps(data).encode(), "driven.toml")
    return pk.Robot(robot_file.parse(source, None))


def _state_stroke(table: dict[str, Any], way: float, room: float) -> None:
    table.setdefault("stroke", [float(way - room), float(way + room)])


def _drives(data: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Limb and table that has the key `drive`, for each drive in their order."""
    if data["limb"][0]["kind"] != "chain":
        return [(limb, limb) for limb in data["limb"]]
    found = {}
    for limb in data["limb"]:
        for joint in limb["joints"]:
            if "actuator" in joint:
                found.setdefault(joint["actuator"], (limb, joint))
    return [found[a] for a in sorted(found)]


def _law(
    chosen: list[str], rng: np.random.Generator, q: float, reach: float, gain: float
) -> dict[str, Any]:
    far = abs(q) + 3.0 * reach
    law: dict[str, Any] = {}
    if "quadratic" in chosen:
        law["quadratic"] = rng.uniform(-1, 1) * BEND * gain / (2.0 * far)
    if "spool" in chosen:
        law["spool"] = rng.uniform(20.0, 90.0)
        law["buildup"] = rng.uniform(-1, 1) * 2.0 * BEND * law["spool"] ** 2 / (abs(gain) * far)
    if "harmonics" in chosen:
        waves = np.array([1.0, rng.uniform(2.0, 3.0)]) * 2.0 * np.pi / (0.3 * reach)
        law["harmonics"] = [
            {
                "k": float(k),
                "cos": a * BEND * abs(gain) / k / 3.0,
                "sin": b * BEND * abs(gain) / k / 3.0,
            }
            for k, (a, b) in zip(waves.tolist(), rng.uniform(-1, 1, (2, 2)).tolist(), strict=True)
        ]
    if "table" in chosen:
        places = q + reach * np.sort(rng.uniform(-1.2, 1.2, 7))
        slopes = rng.uniform(-1, 1, 6) * BEND * gain
        values = np.concatenate([[rng.normal() * 1e-3 * reach], slopes * np.diff(places)]).cumsum()
        law["table"] = np.column_stack([places, values]).tolist()
    if "backlash" in chosen:
        law["backlash"] = 1e-3 * reach * rng.uniform()
    return law
