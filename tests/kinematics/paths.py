"""A path of a platform with what its actuators do, by differences."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.core.library import POSE


def on_a_path(robot: pk.Robot, pose: np.ndarray) -> tuple[np.ndarray, ...]:
    """A pose (6,), its coordinates, their speed and acceleration, and the motion (3, 4, 4).

    What the machine cannot move stays 0.
    """
    h = 1e-3
    free = np.isin(POSE, robot.coordinates)
    a = pose * free
    b = np.array([50.0, 80, -60, 0.2, -0.1, 0.15]) * free
    c = np.array([30, -40, 20, -0.1, 0.2, 0.1]) * free
    path = [a + b * t + c * t * t for t in (-h, 0.0, h)]
    q = robot.inverse(np.array(path))
    frames = np.array([pk.screw.from_pose(each) for each in path])
    (speed, bend), (turned, accelerated) = (
        ((each[2] - each[0]) / (2 * h), (each[2] - 2 * each[1] + each[0]) / h**2)
        for each in (q, frames)
    )
    return a, q[1], speed, bend, np.array([frames[1], turned, accelerated])
