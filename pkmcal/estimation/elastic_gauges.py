"""Gauges of elastic numbers: their change with motions that no reading may notice."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.geometry.elastic import COMPLIANCE, is_elastic
from pkmcal.kinematics.loaded import LoadedMachine
from pkmcal.kinematics.robot import Robot

MOTIONS = 14  # that readings may not notice: six of the base, the scale, six, forces
_LENGTHS = ("centre.", "balancer", "payload.centre.", "payload.moment.")
_STEP = 1e-6  # rad of a tilt: of central differences


def elastic_motions(robot: Robot, platform: int, scale: int, forces: int) -> dict[int, FloatArray]:
    """Changes (14,) of each number of what yields and pulls, by its place in the geometry.

    By motions of the base, the common scale, motions of the platform from the column `platform`,
    and the scale of all forces.
    """
    geometry, found = robot.geometry, {}
    middle = robot.slots[:, 3:6].mean(axis=0)
    tilts = _tilts_by_turns(robot)
    for number, place in zip(geometry.numbers, geometry.slot_index.tolist(), strict=True):
        if not is_elastic(number.name):
            continue
        name, value = number.name, geometry[number.name]
        change = np.zeros(MOTIONS)
        change[scale], change[forces] = _scales(name, number.unit, value)
        stem, _, axis = name.rpartition(".")
        if stem.endswith(".platform"):
            change[platform : platform + 6] = _point(robot, stem, middle)["xyz".index(axis)]
        elif stem.startswith("balancer") and stem.endswith(".base"):
            change[:6] = _point(robot, stem, robot.slots[:, 0:3].mean(axis=0))["xyz".index(axis)]
        elif stem == "gravity":
            change[3:6] = tilts[int(axis[-1]) - 1]
        found[place] = change
    return found


def _scales(name: str, unit: str, value: float) -> tuple[float, float]:
    """Return the power of a number in the scale of all lengths, and in that of all forces."""
    if name.startswith(COMPLIANCE):
        grows = {"mm/N": value, "rad/(N mm)": -value}  # a number of mm/N per mm stays
        return grows.get(unit, 0.0), -value
    if unit == "N/mm":
        return -value, value
    by_length = value if name.startswith(_LENGTHS) and unit in ("mm", "N mm") else 0.0
    return by_length, value if unit in ("kg", "N", "N mm") else 0.0


def _point(robot: Robot, stem: str, middle: FloatArray) -> FloatArray:
    """Return the motion of a point (3, 6) with its body: shifts, then turns about the middle."""
    place = np.array([robot.geometry[f"{stem}.{axis}"] for axis in "xyz"])
    return np.hstack([np.eye(3), np.cross(np.eye(3), place - middle).T])


def _tilts_by_turns(robot: Robot) -> FloatArray:
    """Return gravity's tilts (2, 3) by turns of the base about its own axes."""
    machine = robot.machine
    assert isinstance(machine, LoadedMachine)
    numbers = machine.numbers(robot.slots)
    slopes = []
    for k in (1, 2):
        ends = []
        for sign in (1.0, -1.0):
            tilted = numbers.copy()
            tilted[machine.pulls.place(f"gravity.tilt{k}")] += sign * _STEP
            ends.append(machine.pulls.gravity(tilted))
        slopes.append((ends[0] - ends[1]) / (2.0 * _STEP))
    turned = np.cross(np.eye(3), machine.pulls.gravity(numbers)).T
    if not np.any(slopes):
        return np.zeros((2, 3))
    return np.asarray(np.linalg.lstsq(np.array(slopes).T, turned, rcond=None)[0])
