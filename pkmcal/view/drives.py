"""Machines with drive laws for the page: the machine within, which takes ways, and the laws."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import AnyMachine
from pkmcal.core.driven import DrivenMachine
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.loaded import LoadedMachine
from pkmcal.kinematics.robot import Robot

Stroke = tuple[float, float] | None


def within(robot: Robot) -> tuple[AnyMachine, FloatArray]:
    """The machine whose actuators are the drives themselves, and its geometry."""
    machine = robot.machine
    if not isinstance(machine, DrivenMachine | LoadedMachine):
        return machine, robot.slots
    inner, slots, _ = machine.bare(robot.slots, np.zeros((1, robot.n_actuators)))
    return inner, slots


def ways(robot: Robot, q: FloatArray) -> FloatArray:
    """Return drives at readings (N, n), (N, drives); readings where there is no law."""
    machine = robot.machine
    return machine.drives(robot.slots, q) if isinstance(machine, DrivenMachine) else q


def laws(robot: Robot) -> list[dict[str, Any]] | None:
    """Return each drive's actuator and its law's numbers, as ``laws.js`` takes them."""
    machine = robot.machine
    if not isinstance(machine, DrivenMachine):
        return None
    if machine.tension is not None:
        raise ArgumentError(f"robot: {robot.name} is under tension, which the page cannot draw")
    numbers = robot.slots.ravel().tolist()
    approach = np.zeros(robot.n_actuators) if machine.approach is None else machine.approach
    found = []
    for drive in machine.laws.drives:
        loose = 0.0 if drive.backlash is None else numbers[drive.backlash]
        table = None
        if drive.table is not None:
            pairs = zip(drive.table.tolist(), drive.corrections, strict=True)
            table = [[at, numbers[place]] for at, place in pairs]
        found.append(
            {
                "actuator": drive.actuator,
                "offset": numbers[drive.offset] - 0.5 * float(approach[drive.actuator]) * loose,
                "gain": numbers[drive.gain],
                "quadratic": 0.0 if drive.quadratic is None else numbers[drive.quadratic],
                "spool": 1.0 if drive.spool is None else numbers[drive.spool],
                "buildup": 0.0 if drive.buildup is None else numbers[drive.buildup],
                "harmonics": [[k, numbers[a], numbers[b]] for k, a, b in drive.harmonics],
                "table": table,
            }
        )
    return found


def strokes(robot: Robot) -> list[Stroke]:
    """Return what strokes of all an actuator's drives leave of its reading."""
    machine = robot.machine
    assert isinstance(machine, DrivenMachine)
    drives = machine.laws.drives
    ends = np.array([drive.stroke or (np.nan, np.nan) for drive in drives]).T
    read = np.sort(machine.laws.readings(robot.slots, np.ascontiguousarray(ends)), axis=0)
    found: list[Stroke] = [None] * robot.n_actuators
    for drive, (low, high) in zip(drives, read.T.tolist(), strict=True):
        if np.isfinite(low + high):
            before = found[drive.actuator] or (-np.inf, np.inf)
            found[drive.actuator] = (max(low, before[0]), min(high, before[1]))
    return found
