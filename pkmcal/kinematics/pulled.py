"""Poses at which all cables pull, under their load or against what holds them at home."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.geometry.load import CableLoad
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.tensions import can_pull

PRELOAD = CableLoad(least=1.0)
_SOME = 1e-3  # N: with a force of 1 N


def on_cables(robot: Robot) -> bool:
    """Return whether every limb is a cable."""
    return all(limb.cable for limb in robot.model.limbs)


def load_of(robot: Robot) -> CableLoad | None:
    """The load under which cables have to pull; None without cables, and where nothing is known.

    That of the robot file. Where it states none, of machines on cables alone what holds these taut
    at home: each other, or a force along an axis.
    """
    if robot.model.load is not None or not on_cables(robot):
        return robot.model.load
    trials = [PRELOAD]
    for axis in ("-z", "-y", "-x", "+z", "+y", "+x"):
        if axis[1] in robot.coordinates:
            trials.append(along(axis))
    return next((load for load in trials if can_pull(robot, robot.home[None], load)[0]), None)


def along(axis: str) -> CableLoad:
    """A force of 1 N along an axis, such as "-z"."""
    x, y, z = ((axis[1] == name) * (1.0 if axis[0] == "+" else -1.0) for name in "xyz")
    return CableLoad(force=(x, y, z), least=_SOME)


def pulled(robot: Robot, poses: FloatArray) -> BoolArray:
    """Mark poses (N, 6) where no cable would have to push; all where no load is known."""
    load = load_of(robot)
    everywhere = np.ones(len(poses), dtype=bool)
    return everywhere if load is None else can_pull(robot, poses, load)
