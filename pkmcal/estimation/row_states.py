"""States of a machine at each distinct row of actuators."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.result import ReadOnly


@dataclass(frozen=True, eq=False)
class RowStates(ReadOnly):
    """The state of a machine at each distinct row of actuators.

    Attributes
    ----------
    pose : ndarray (K, 6)
        mm and rad; NaN where there is none.
    actuators : ndarray (K, n)
        Where the actuators are.
    status : ndarray of int (K,)
        Of the forward kinematics.
    tension : ndarray (K, n) or None
        Of what actuators drive, N, where it is unknown and has been found.
    """

    pose: FloatArray
    actuators: FloatArray
    status: Int32Array
    tension: FloatArray | None = None

    def at_poses(self, rows: IntArray, poses: FloatArray) -> RowStates:
        """Return the states with some rows at poses (s, 6)."""
        pose = self.pose.copy()
        pose[rows] = poses
        return replace(self, pose=pose)

    def chosen(self, rows: BoolArray, others: RowStates) -> RowStates:
        """Choose these states where `rows` (K,), else the others."""
        if rows.all():
            return self
        actuators = self.actuators
        if actuators is not others.actuators:
            actuators = np.where(rows[:, None], actuators, others.actuators)
        tension = self.tension
        if tension is not None and others.tension is not None:
            tension = np.where(rows[:, None], tension, others.tension)
        return RowStates(
            np.where(rows[:, None], self.pose, others.pose),
            actuators,
            np.where(rows, self.status, others.status),
            tension,
        )
