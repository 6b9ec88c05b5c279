"""Jumps of speed along a move: at the nodes of tables in drive laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.driven import DrivenMachine
from pkmcal.kinematics.robot import Robot
from pkmcal.moves.peaks import STEPS

HALVINGS = 50  # of a step, to the time at which something changes: to rounding
_STRAIGHT = 1e-12  # of the steepest piece: a node that bends a table by less is none
_LISTED = 3  # of the jumps of a move, in print


@dataclass(frozen=True)
class Jump:
    """A node of a drive's table that a move passes.

    Attributes
    ----------
    time : float
        s.
    actuator : int
        Which, counted from 1.
    node : float
        Its coordinate there, mm or rad.
    """

    time: float
    actuator: int
    node: float


def jumps(
    robot: Robot, actuators: Callable[[FloatArray], FloatArray], duration: float
) -> tuple[Jump, ...]:
    """Nodes of tables that a move passes, in order of time.

    Parameters
    ----------
    robot : Robot
        The machine.
    actuators : callable
        Times (N,) to coordinates (N, n).
    duration : float
        s; 2001 times of it are looked at.
    """
    nodes = _nodes(robot)
    if not nodes:
        return ()
    times = np.linspace(0.0, duration, STEPS + 1)
    q = actuators(times)
    found = []
    for actuator, node in nodes:
        above = q[:, actuator] > node
        known = np.isfinite(q[:, actuator])
        for k in np.flatnonzero((above[1:] != above[:-1]) & known[1:] & known[:-1]).tolist():
            found.append((times[k], times[k + 1], actuator, node, above[k]))
    if not found:
        return ()
    low, high, at, places, before = (np.array(each) for each in zip(*found, strict=True))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (actuators(middle)[np.arange(len(at)), at] > places) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    passed = zip(high.tolist(), at.tolist(), places.tolist(), strict=True)
    return tuple(Jump(time, actuator + 1, place) for time, actuator, place in sorted(passed))


def said(found: Sequence[Jump]) -> str:
    """Say that speeds jump, in one sentence."""
    first = ", ".join(f"q{jump.actuator} at {jump.time:.4f} s" for jump in found[:_LISTED])
    more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    return (
        f"speeds jump where drives pass nodes of their tables ({first}{more}): accelerations, and"
        " their limits, are those between"
    )


def _nodes(robot: Robot) -> list[tuple[int, float]]:
    """Actuator and coordinate of each node at which a table bends."""
    machine = robot.machine
    if not isinstance(machine, DrivenMachine):
        return []
    found = set()
    for drive, law in zip(machine.laws.drives, machine.laws.numbers_of(robot.slots), strict=True):
        if len(law.points) < 2:
            continue
        places, values = np.array(law.points).T
        slopes = np.concatenate([[0.0], np.diff(values) / np.diff(places), [0.0]])
        bends = np.abs(np.diff(slopes)) > _STRAIGHT * np.abs(slopes).max()
        found |= {(drive.actuator, place) for place in places[bends].tolist()}
    return sorted(found)
