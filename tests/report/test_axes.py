"""Scores of each axis are those of the deviations that a machine was given."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.iso230 import axis_performance
from pkmcal.report.axes import axes

from .. import workspaces

TARGETS = np.array([[80.0, 0, 20], [-40, 70, 10], [-40, -70, 30]])


def test_a_table_of_five_runs_by_hand() -> None:
    """Five targets, five runs, by the definitions of the standard one by one."""
    rng = np.random.default_rng(0)
    runs = rng.normal([0, 3, -2, 5, 1], 1.0, (5, 5))
    found = axis_performance(runs.T.ravel(), np.repeat(np.arange(5), 5))
    mean, s = runs.mean(axis=0), runs.std(axis=0, ddof=1)
    assert found.systematic == pytest.approx(mean.max() - mean.min())
    assert found.repeatability == pytest.approx(4 * s.max())
    assert found.accuracy == pytest.approx((mean + 2 * s).max() - (mean - 2 * s).min())
    assert (found.targets, found.repeated) == (5, 5)


def test_without_repeats_there_is_no_repeatability() -> None:
    found = axis_performance([1.0, -1.0], [0, 1])
    assert found.systematic == 2.0 and np.isnan([found.accuracy, found.repeatability]).all()
    with pytest.raises(ArgumentError, match="deviation and target"):
        axis_performance([], [])


@pytest.mark.parametrize("kind", ["pose", "position"])
def test_shifts_and_turnings_of_the_platform_are_seen_in_both_kinds(kind: str) -> None:
    """Three reflectors show what a pose does: a turning about y of 2 mrad at every second pose."""
    robot = pk.load("hexapod")
    q = np.repeat(robot.inverse(workspaces.poses("hexapod", 20, 1)), 2, axis=0)
    poses = robot.forward(q).pose
    turned = np.zeros((40, 3))
    turned[20:, 1] = 2e-3
    shift = np.zeros((40, 3))
    shift[:, 0] = np.tile([0.1, -0.1], 20)
    R = Rotation.from_rotvec(turned) * Rotation.from_euler("xyz", poses[:, 3:])
    at = poses[:, :3] + shift
    if kind == "pose":
        values = np.hstack([at, R.as_euler("xyz")])
        measured = pk.Measurements(q, values, "pose", sigma=[0.1] * 3 + [1e-3] * 3)
    else:
        points = np.stack([at + R.apply(target) for target in TARGETS], axis=1).reshape(-1, 3)
        rows = np.repeat(q, 3, axis=0)
        index = np.tile(np.arange(3), 40)
        measured = pk.Measurements(
            rows, points, "position", sigma=0.1, target=TARGETS, target_index=index
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)  # nothing is to be found
        found = pk.identify(robot, measured, free="offset1", prior=1e-6)
    table = {row["name"]: row for row in axes(found)}
    assert table["b"]["E_before"] == pytest.approx(2e-3, rel=1e-2)
    assert table["a"]["E_before"] == pytest.approx(0.0, abs=1e-5)
    assert table["b"]["mean_before"] == pytest.approx(1e-3, rel=1e-2)
    x = table["x"]
    assert x["R_before"] == pytest.approx(4 * np.std([0.1, -0.1], ddof=1), rel=0.1)
    assert (x["targets"], x["repeated"]) == (20, 20)
    if kind == "pose":
        assert x["E_before"] == pytest.approx(0.0, abs=1e-6)


def test_one_reflector_does_not_show_how_the_platform_turns() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(workspaces.poses("hexapod", 20, 1))
    measured = pk.Measurements(q, robot.forward(q).pose[:, :3], "position", sigma=0.1)
    found = pk.identify(robot, measured, free="offset*")
    assert [row["name"] for row in axes(found)] == ["x", "y", "z"]
