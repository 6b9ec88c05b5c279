"""How platforms move as their actuators do, beside differences of forward kinematics."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

from ..workspaces import WORKSPACE, poses

NODES = np.array([-3, -2, -1, 1, 2, 3])
FIRST = np.array([-1, 9, -45, 45, -9, 1]) / 60.0  # of seventh order, over the step
SECOND = np.array([2, -27, 270, 270, -27, 2]) / 180.0


@pytest.mark.parametrize("name", WORKSPACE)
def test_velocity_and_acceleration_of_a_pose_are_derivatives_along_the_path(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(poses(name, 4, seed=6))
    at = robot.forward(q).pose
    rng = np.random.default_rng(7)
    q1, q2 = np.ptp(q, axis=0) * rng.uniform(-1, 1, (2, *q.shape))
    _, velocity, acceleration = robot.machine.motion(robot.slots, at, q, q1, q2)
    step = 0.01
    times = step * NODES[:, None, None]
    along = robot.forward(q + q1 * times + 0.5 * q2 * times**2, guess=at)
    assert along.ok.all()
    first = np.tensordot(FIRST, along.pose, 1) / step
    second = (np.tensordot(SECOND, along.pose, 1) - 49.0 / 18.0 * at) / step**2
    size = np.abs(first).max(axis=0), np.abs(second).max(axis=0)
    np.testing.assert_allclose(velocity, first, rtol=1e-6, atol=1e-7 * size[0].max())
    np.testing.assert_allclose(acceleration, second, rtol=1e-4, atol=1e-5 * size[1].max())
