"""A machine beside itself with errors drawn larger than they are."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.report.exaggerated import exaggerated


def test_change_is_drawn_as_many_times_as_said_and_can_be_seen() -> None:
    robot = pk.load("hexapod")
    true = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.3, "offset4": -0.2})
    poses = pk.sample_poses(robot, 12)
    q = robot.inverse(poses)
    machine = pk.VirtualMachine(true)
    found = pk.identify(robot, machine.measure(q, "pose"), free=["base1.x", "offset4"])
    drawn = exaggerated(found.fit.parameters, found.start, found.values, q[0], poses[0])
    assert drawn is not None
    before, after, times = drawn
    shift = after.limbs[0][0] - before.limbs[0][0]
    np.testing.assert_allclose(shift, [times * (found.values[0] - found.start[0]), 0, 0], atol=1e-9)
    size = np.ptp(before.joints, axis=0).max()
    most = np.linalg.norm(after.joints - before.joints, axis=1).max()
    assert 0.02 * size < most < 0.2 * size
