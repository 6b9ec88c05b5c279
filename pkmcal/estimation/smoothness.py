"""Tables of drive laws are known to be smooth: a prior on how far each correction bends them.

What a correction is off the line through its neighbours is 0, but for the deviation `smoothness`
that the robot file states: a combination of numbers where an ordinary prior is of one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.kinematics.calibratable import Calibratable, as_parallel
from pkmcal.kinematics.robot import Robot


def smoothness_rows(
    robot: Calibratable, places: IntArray, columns: Sequence[IntArray], size: int
) -> tuple[FloatArray, FloatArray]:
    """Bends of all tables in standard deviations, as they follow the parameters.

    Parameters
    ----------
    robot : Calibratable
        The machine.
    places : ndarray of int (g,)
        Of the free numbers in the geometry's values.
    columns : sequence of ndarray of int (g,)
        The parameters that they are, of each machine.
    size : int
        How many parameters there are, n.

    Returns
    -------
    rows : ndarray (s, n)
        By the parameters, in mm and rad.
    constant : ndarray (s,)
        Of the numbers that are not free.
    """
    none = np.empty((0, size)), np.empty(0)
    parallel = as_parallel(robot)
    bends = np.empty((0, 0)) if parallel is None else _bends(parallel)
    if not len(bends):
        return none
    geometry = robot.geometry
    by_free = bends @ geometry.chain[:, places]
    count = bends.shape[1]
    fixed = bends @ geometry.values[:count] - by_free @ geometry.values[places]
    free = by_free.any(axis=1)
    rows = np.zeros((len(columns), int(free.sum()), size))
    for s, own in enumerate(columns):
        np.add.at(rows[s].T, own, by_free[free].T)
    whole = rows.reshape(-1, size)
    constant = np.tile(fixed[free], len(columns))
    _, first = np.unique(whole, axis=0, return_index=True)  # common to all sessions
    kept = np.sort(first)
    return whole[kept], constant[kept]


def _bends(robot: Robot) -> FloatArray:
    """Bends in standard deviations by the numbers of the limbs, (s, k)."""
    names = {number.name: i for i, number in enumerate(robot.geometry.numbers)}
    rows = []
    for d, law in enumerate(robot.model.laws, 1):
        if law is None or law.table is None or law.smoothness is None:
            continue
        for j in range(1, len(law.table) - 1):
            before, at, behind = law.table[j - 1 : j + 2]
            part = (at - before) / (behind - before)
            row = np.zeros(len(names))
            for place, weight in ((j - 1, part - 1.0), (j, 1.0), (j + 1, -part)):
                row[names[f"drive{d}.table{place + 1}"]] = weight / law.smoothness
            rows.append(row)
    return np.array(rows).reshape(len(rows), len(names))
