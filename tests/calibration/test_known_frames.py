"""Targets that nobody measured, in a known frame: they follow from the poses, however far off."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

SIGMA = 0.02


@pytest.mark.parametrize("name", ["hexapod", "linear-delta", "3rrr-planar", "five-bar", "2tpr2tps"])
@pytest.mark.parametrize("size", [30.0, 300.0])
def test_target_far_from_where_the_search_starts_is_found(name: str, size: float) -> None:
    random = np.random.default_rng(0)
    robot = pk.load(name)
    pose = pk.sample_poses(robot, 40, seed=1)
    solved = robot.forward(robot.inverse(pose))
    pose, q = solved.pose[solved.ok], robot.inverse(pose)[solved.ok]
    target = size * np.array([-0.6, 0.5, -0.6])
    seen = (pk.screw.from_pose(pose) @ [*target, 1.0])[:, :3]
    seen += SIGMA * random.normal(size=seen.shape)
    data = pk.Measurements(q, seen, "position", sigma=SIGMA)
    found = pk.identify(robot, data, ["offset1"], unknown="target")
    assert found.verdict.state == "calibrated"
    np.testing.assert_allclose(found.values[-3:], target, atol=5 * SIGMA)


def test_rows_that_were_not_read_place_no_target() -> None:
    robot = pk.load("linear-delta")
    pose = pk.sample_poses(robot, 12, seed=2)
    values = pose[:, :3] + [10.0, 20.0, 30.0]
    values[3] = np.nan
    data = pk.Measurements(robot.inverse(pose), values, "position", sigma=SIGMA)
    found = pk.identify(robot, data, ["offset1"], unknown="target")
    np.testing.assert_allclose(found.values[-3:], [10.0, 20.0, 30.0], atol=1e-6)
