"""What a machine depends on beside what its actuators read: how these came there, and its load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.robot import Robot


class DriveState(NamedTuple):
    """Of each actuator, and of the platform, at N rows; None where nothing is known.

    Attributes
    ----------
    approach : ndarray (N, n) or None
        +1 where its reading had grown, -1 where it had fallen, 0 where that is not known.
    tension : ndarray (N, n) or None
        Of what it drives, N.
    load : ndarray (N, 10) or None
        What the platform carries, as `pkmcal.geometry.carried.Load.rows` has it. A machine of which
        nothing yields does not follow it.
    """

    approach: FloatArray | None = None
    tension: FloatArray | None = None
    load: FloatArray | None = None

    def at(self, rows: IntArray | np.intp) -> DriveState:
        """That of some rows, or of one."""
        return DriveState(*(None if each is None else each[rows] for each in self))

    def of(self, robot: Robot) -> Robot:
        """The robot in this state."""
        if self.approach is not None:
            robot = robot.approaching(self.approach)
        if self.tension is not None:
            robot = robot.tensioned(self.tension)
        if self.load is None or robot.rigid is robot:
            return robot
        return robot.under(Load.of_rows(self.load))
