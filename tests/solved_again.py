"""How poses move with numbers and actuators, by solving again: differences of fourth order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal import Robot
from pkmcal.arrays import FloatArray
from pkmcal.screw import from_pose, log


def _slope(solved: Callable[[float], FloatArray], step: FloatArray) -> FloatArray:
    """Twist (ω, v), (N, 6), of poses of a share of a step; `step` (N,) or a number."""
    poses = [from_pose(solved(share)) for share in (-2.0, -1.0, 0.0, 1.0, 2.0)]
    off = [
        np.concatenate(
            [log(at @ np.linalg.inv(poses[2]))[:, :3], at[:, :3, 3] - poses[2][:, :3, 3]], axis=1
        )
        for at in poses
    ]
    slope = (8.0 * (off[3] - off[1]) - (off[4] - off[0])) / 12.0
    return np.asarray(slope / np.reshape(step, (-1, 1)))


def by_numbers(robot: Robot, pose: FloatArray, q: FloatArray, share: float = 1e-4) -> FloatArray:
    """Twists of the platform in the machine's own frame by every number, (N, 6, p)."""
    steps = {"mm": share * robot.machine.struct.size, "rad": share, "1": share}
    columns, slots = robot.geometry.slot_index, robot.slots
    out = np.empty((len(pose), 6, len(columns)))
    for k, (column, unit) in enumerate(zip(columns, robot.geometry.units, strict=False)):

        def solved(way: float, column: int = column, step: float = steps[unit]) -> FloatArray:
            changed = slots.copy()
            changed.flat[column] += way * step
            return np.asarray(robot.machine.forward(changed, q, pose, threads=None)[0])

        out[:, :, k] = _slope(solved, np.array(steps[unit]))
    return out


def by_actuators(robot: Robot, pose: FloatArray, q: FloatArray, share: float = 1e-4) -> FloatArray:
    """The same by every actuator, (N, 6, n)."""
    out = np.empty((len(pose), 6, q.shape[1]))
    slopes = np.abs(robot.machine.slopes(robot.slots, q))
    for a, unit in enumerate(robot.actuator_units):
        step = share * (robot.machine.struct.size if unit == "mm" else 1.0)
        if slopes.shape == q.shape:
            step = step / slopes[:, a]

        def solved(way: float, a: int = a, step: FloatArray = step) -> FloatArray:
            change = np.zeros(q.shape)
            change[:, a] = way * step
            return np.asarray(robot.machine.forward(robot.slots, q + change, pose, threads=None)[0])

        out[:, :, a] = _slope(solved, np.asarray(step))
    return out
