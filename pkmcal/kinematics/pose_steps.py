"""Poses of a machine's rows as unknowns: how they move, and what the actuators would read there.

What an estimator asks that gives every measured row a pose of its own. Steps are those of the pose
map in the machine's own frame, m numbers a row, mm and rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, Unit, mm_per_unit
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.library import COORDINATE_UNITS
from pkmcal.kinematics.calibratable import Calibratable, as_parallel
from pkmcal.kinematics.robot import Robot

_DEPENDENT = 1e-2  # of unit rows: what errors of the geometry make of rows that depend


@dataclass(frozen=True, eq=False)
class RowRoles:
    """Roles of the rows of `readings` for a machine whose actuators are read.

    Attributes
    ----------
    read : ndarray (s, rows)
        Combinations that an error of reading moves: of each actuator the mean over its limbs, then
        passive rows that give way.
    actuator : tuple of int, s
        Whose error it is; -1 of passive rows.
    held : ndarray (h, rows)
        Combinations that hold whatever the actuators read: passive rows, and how limbs that share
        an actuator differ. Independent of one another.
    surplus : int
        How many actuators there are beyond the ways in which the platform can move.
    """

    read: FloatArray
    actuator: tuple[int, ...]
    held: FloatArray
    surplus: int


def surplus(machine: Calibratable) -> int:
    """Return the number of actuators beyond the platform's degrees of freedom.

    What they read can contradict itself. Closures beyond the free coordinates alone do not make it:
    of an over-constrained machine they are those of passive joints, which give way, and the pose
    follows from that. None where chains share passive joints or carry a tail, and none of arms.
    """
    robot = as_parallel(machine)
    if robot is None or robot.machine.rows <= robot.machine.m:
        return 0
    return row_roles(robot).surplus if robot.model.mechanism.apart else 0


def row_roles(robot: Robot) -> RowRoles:
    """Tell rows that are read from rows that hold.

    Passive rows hold, but for those that the file weighs by another number than 1, and for all of
    them where they depend on one another: joints with errors can then not meet them all at once.
    """
    unit = np.eye(robot.machine.rows)
    of_rows = np.array(sphere_actuators(robot))
    of_actuators = [unit[of_rows == a] for a in range(robot.n_actuators)]
    differ = [row - mine[0] for mine in of_actuators for row in mine[1:]]
    beside = unit[of_rows < 0]
    passive = np.concatenate([np.reshape(differ, (-1, len(unit))), beside])
    home = robot.home[None]
    slopes = readings(robot, home, robot.inverse(home))[1][0]
    along = passive @ slopes / mm_per_unit(step_units(robot), robot.length)
    weighted = [weight != 1.0 for limb in robot.model.limbs for weight in limb.weights]
    if robot.model.closed_form:
        along /= np.linalg.norm(along, axis=1, keepdims=True)
    else:  # rows of chains are combinations of unit wrenches, and may be of none
        weighted = [False] * len(beside)
    sizes = np.linalg.svd(along)[1]
    rank = int((sizes > _DEPENDENT * max(1.0, float(sizes.max(initial=0.0)))).sum())
    gives = np.array([False] * len(differ) + weighted, dtype=bool) | (rank < len(passive))
    owners = [int(of_rows[row.nonzero()[0][0]]) for row in passive[gives]]
    return RowRoles(
        read=np.concatenate(
            [np.array([mine.mean(axis=0) for mine in of_actuators]), passive[gives]]
        ),
        actuator=(*range(len(of_actuators)), *owners),
        held=passive[~gives],
        surplus=len(of_actuators) - robot.machine.m + rank,
    )


def step_units(robot: Robot) -> list[Unit]:
    """Unit of each of the m numbers of a step, "mm" or "rad"."""
    return [COORDINATE_UNITS[name] for name in robot.coordinates]


def moved(robot: Robot, pose: FloatArray, step: FloatArray) -> FloatArray:
    """Poses (N, 6) after steps (N, m)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    return robot.frames.outward(robot.machine.moved(own, np.ascontiguousarray(step)))


def step_twists(robot: Robot, pose: FloatArray) -> FloatArray:
    """Twist of the platform by a step at poses (N, 6): (N, 6, m)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    return robot.frames.twists_outward(own, robot.machine.step_twists(own))


def readings(robot: Robot, pose: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Closures at poses (N, 6) in units of the actuators that read q (N, n).

    Of each limb the coordinate that it needs at the pose less the one read, mm or rad, then its
    other rows, weighted, in mm: (N, rows); and their derivative by a step (N, rows, m).
    """
    own = np.ascontiguousarray(robot.frames.inward(pose))
    residual, by_step, _ = robot.machine.readings(robot.slots, own, q)
    return residual, by_step


def readings_by_numbers(
    robot: Robot, pose: FloatArray, q: FloatArray, places: IntArray
) -> FloatArray:
    """Derivative of `readings` by numbers of the geometry at `places` (k,), (N, rows, k)."""
    own = np.ascontiguousarray(robot.frames.inward(pose))
    columns, chain = robot.geometry.driven(places)
    by_number = robot.machine.readings(robot.slots, own, q, columns)[2]
    assert by_number is not None
    if chain is None:
        return by_number
    by_places: FloatArray = by_number.reshape(math.prod(by_number.shape[:2]), -1) @ chain
    return by_places.reshape(*by_number.shape[:2], len(places))


def readings_by_tension(robot: Robot, pose: FloatArray) -> FloatArray:
    """Derivative of limbs' `readings` by what they pull with, a limb an actuator, (N, limbs)."""
    machine = robot.machine
    if not isinstance(machine, DrivenMachine):
        return np.zeros((len(pose), machine.rows))
    own = np.ascontiguousarray(robot.frames.inward(pose))
    return machine.by_tension(robot.slots, own)


def sphere_actuators(robot: Robot) -> list[int]:
    """Return the actuator of each row of `readings`; -1 for rows beside a limb's own."""
    return robot.model.mechanism.row_actuators(robot.machine.rows)
