"""Poses of a machine's rows as unknowns: how they move, and what the actuators would read there.

What an estimator asks that gives every measured row a pose of its own. Steps are those of the pose
map in the machine's own frame, m numbers a row, mm and rad.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.chains import ChainMachine
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.machine import Machine
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot


def surplus(robot: Robot) -> int:
    """How many closures a machine has beyond its free coordinates, which its limbs cannot meet.

    None where limbs are chains: their joints give way, and the pose follows from that.
    """
    machine = robot.machine
    return machine.rows - machine.m if robot.model.chains is None else 0


def moved(robot: Robot, pose: FloatArray, step: FloatArray) -> FloatArray:
    """Poses (N, 6) after steps (N, m)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    return robot.frames.outward(_of_limbs(robot).moved(own, np.ascontiguousarray(step))[0])


def step_twists(robot: Robot, pose: FloatArray) -> FloatArray:
    """Twist of the platform by a step at poses (N, 6): (N, 6, m)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    twists = _of_limbs(robot).moved(own, np.zeros((len(own), robot.machine.m)))[1]
    return robot.frames.twists_outward(own, twists)


def readings(robot: Robot, pose: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Closures at poses (N, 6) in units of the actuators that read q (N, n).

    Of each limb the coordinate that it needs at the pose less the one read, mm or rad, then its
    other rows, weighted, in mm: (N, rows); and their derivative by a step (N, rows, m).
    """
    own = np.ascontiguousarray(robot.frames.inward(pose))
    residual, by_step, _ = _of_limbs(robot).readings(robot.slots, own, q)
    return residual, by_step


def readings_by_numbers(
    robot: Robot, pose: FloatArray, q: FloatArray, places: IntArray
) -> FloatArray:
    """Derivative of `readings` by numbers of the geometry at `places` (k,), (N, rows, k)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    chain = robot.geometry.chain[:, places]  # of the limbs' numbers, through their ties
    moving = np.flatnonzero(chain.any(axis=1))
    columns = robot.geometry.slot_index[moving].astype(np.int32)
    by_number = _of_limbs(robot).readings(robot.slots, own, q, columns)[2]
    assert by_number is not None
    by_places: FloatArray = by_number @ chain[moving]
    return by_places


def sphere_actuators(robot: Robot) -> list[int]:
    """Which actuator each row of `readings` is of; -1 for rows beside a limb's own."""
    of_rows: list[int] = []
    for limb in robot.model.limbs:
        beside = KINDS[limb.kind].all_rows(limb.couple > 0)
        of_rows += [limb.actuator] + [-1] * len(beside)
    return of_rows


def _of_limbs(robot: Robot) -> Machine | DrivenMachine:
    assert not isinstance(robot.machine, ChainMachine)  # `surplus` is 0 otherwise
    return robot.machine
