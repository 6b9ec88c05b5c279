"""A measurement done again out of its log: which rows would have been enough."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.live.course import Course
from pkmcal.measurements.measurements import Measurements


def places(robot: Robot | SerialArm, log: Measurements) -> tuple[FloatArray, list[IntArray]]:
    """Places of the poses of a log, in the order of their first rows, and the rows of each.

    Returns
    -------
    candidates : ndarray (P, 6), of a serial arm (P, n)
        Poses, or joint coordinates.
    rows : list of ndarray of int
        The rows of each.

    Raises
    ------
    ValueError
        The machine has no pose at some rows.
    """
    index = log.pose_index
    rows = [np.flatnonzero(index == i) for i in dict.fromkeys(index.tolist())]
    at = log.actuators[[own[0] for own in rows]]
    if as_machine(robot).kind == "arm":
        return at, rows
    poses = as_machine(robot).forward(at).pose
    none = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    if len(none):
        raise ArgumentError(f"replay: at row {rows[none[0]][0]} {robot.name} has no pose")
    return poses, rows


def replayed(
    course: Course,
    log: Measurements,
    rows: Sequence[IntArray],
    order: Iterable[int] | None = None,
) -> Iterator[Course]:
    """Measure again, pose by pose, what a log holds.

    Parameters
    ----------
    course : Course
        At its beginning, its candidates those of `places`.
    log : Measurements
        What was measured.
    rows : sequence of ndarray of int
        The rows of each candidate.
    order : iterable of int, optional
        Candidates in their order, in place of those that are chosen.
    """
    given, taken = None if order is None else iter(order), list[int]()
    while not course.over:
        index = course.choice.index if given is None else next(given)
        taken += rows[index].tolist()
        course = course.after(index, log.select(taken))
        yield course
