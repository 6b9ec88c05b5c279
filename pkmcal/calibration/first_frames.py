"""Where the search for unknown frames and targets starts: see `alignment`.

Frame by frame; targets that several frames have in common are placed with the first of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.calibration.alignment import PointPairs, of_heights, of_points, of_poses
from pkmcal.calibration.evaluation import Evaluation
from pkmcal.calibration.parameters import Parameters
from pkmcal.core import instruments

if TYPE_CHECKING:
    from pkmcal.calibration.readings import Readings

Rows = dict[int, IntArray]  # of a frame, in each set


def aligned(
    readings: Readings, evaluation: Evaluation, own: BoolArray | None = None
) -> tuple[Parameters, FloatArray]:
    """Parameters whose frames lie nearest to the readings, and their values (n,).

    Parameters
    ----------
    readings : Readings
        What was read.
    evaluation : Evaluation
        Where the machine is with the present parameters.
    own : ndarray of bool (n,), optional
        Which parameters may be changed; all by default.
    """
    parameters, theta = readings.parameters, evaluation.theta.copy()
    free = np.ones(len(parameters), dtype=bool) if own is None else own.copy()
    for first, rows in readings.frames.items():
        if free[first]:
            frame = _aligned(readings, evaluation, rows, theta, free)
            parameters, theta = parameters.aligned(theta, first, frame)
    return parameters, theta


def _aligned(
    readings: Readings, evaluation: Evaluation, rows: Rows, theta: FloatArray, free: BoolArray
) -> FloatArray:
    """The frame (6,) nearest to the readings; targets that are free are moved and then not free."""
    kinds = {
        kind: [i for i in rows if readings.sets[i].kind == kind] for kind in ("pose", "height")
    }
    of_points_in = [i for i in rows if readings.sets[i].kind == "position"]
    if not of_points_in:
        kind = "pose" if kinds["pose"] else "height"
        values = np.concatenate([readings.sets[i].values[rows[i]] for i in kinds[kind]])
        if kind == "pose":
            poses = [evaluation.pose[readings.pose_of[i][rows[i]]] for i in kinds[kind]]
            return of_poses(values, np.concatenate(poses))
        parts = [_points(readings, evaluation, i, rows[i], theta) for i in kinds[kind]]
        return of_heights(values, np.concatenate([places for places, _ in parts]))
    columns = np.concatenate([_sought(readings, i, rows[i], free) for i in of_points_in])
    sought, target = np.unique(columns[:, 0], return_inverse=True)
    parts = [_points(readings, evaluation, i, rows[i], theta) for i in of_points_in]
    seen = PointPairs(
        values=np.concatenate([readings.sets[i].values[rows[i]] for i in of_points_in]),
        point=np.concatenate([places for places, _ in parts]),
        turn=np.concatenate([turn for _, turn in parts]),
        target=target.reshape(-1) - int(sought[0] < 0),
    )
    frame, shifts = of_points(seen)
    lower, upper = readings.parameters.bounds
    for first, shift in zip(sought[sought >= 0], shifts, strict=True):
        mine = slice(first, first + 3)
        theta[mine] = np.clip(theta[mine] + shift, lower[mine], upper[mine])
        free[mine] = False
    return frame


def _sought(readings: Readings, i: int, rows: IntArray, free: BoolArray) -> IntArray:
    """Parameters (N, 3) of the target of each row of set `i`; -1 where it is not free."""
    columns = readings.columns_of(i, "target")
    if columns is None:
        return np.full((len(rows), 3), -1)
    mine = columns[rows]
    return np.where(free[mine], mine, -1)


def _points(
    readings: Readings, evaluation: Evaluation, i: int, rows: IntArray, theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where targets of rows of set `i` are in the base frame (N, 3), and how they are turned."""
    target = readings.points_of(i, "target", theta)
    pose = evaluation.pose[readings.pose_of[i][rows]]
    places, _, turn = instruments.points(pose, np.ascontiguousarray(target[rows]))
    return places, turn
