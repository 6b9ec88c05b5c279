"""Rows of which only the actuators were read, and that are equal: each is a reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

from .test_slack import machine_on

CORNERS = np.array(
    [[0.0, -1600, 0], [1550, 900, 0], [-1370, 790, 0], [0, 0, 2350], [900, -900, 2000]]
)
SHAPE = [f"base{i}.{c}" for i in range(2, 6) for c in "xyz"][2:]


def hung(folder: Path) -> pk.Robot:
    return machine_on(CORNERS, folder / "hung.toml")


def coarse(robot: pk.Robot, count: int, seed: int) -> np.ndarray:
    """What encoders with steps of 0.5 mm read at places in a small part of the workspace."""
    rng = np.random.default_rng(seed)
    poses = np.zeros((count, 6))
    poses[:, :3] = [0.0, 0.0, 700.0] + rng.uniform(-1.0, 1.0, (count, 3)) * [400, 400, 300]
    return np.round((robot.inverse(poses) + rng.normal(0, 0.3, (count, 5))) / 0.5) * 0.5


def fitted(robot: pk.Robot, *tables: np.ndarray) -> pk.Identification:
    sets = [pk.Measurements(table, None, "closure", actuator_sigma=0.3) for table in tables]
    return pk.identify(robot, sets, SHAPE)


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")
@pytest.mark.parametrize("times", [2, 21])
def test_an_equal_row_counts_as_one_that_differs_by_a_billionth(tmp_path: Path, times: int) -> None:
    robot = hung(tmp_path)
    table = coarse(robot, 25, 0)
    again = np.concatenate([table, np.repeat(table[:1], times - 1, axis=0)])
    nearly = again + 1e-9 * np.arange(len(again))[:, None]
    equal, near, once = (fitted(robot, each) for each in (again, nearly, table))
    np.testing.assert_allclose(equal.values, near.values, atol=1e-5)
    np.testing.assert_allclose(equal.stderr, near.stderr, rtol=1e-5)
    assert equal.dof == near.dof == once.dof + 2 * (times - 1)
    assert np.abs(equal.values - once.values).max() > 1e-3


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")
def test_equal_rows_of_two_files_count_unless_one_copies_the_other(tmp_path: Path) -> None:
    robot = hung(tmp_path)
    table = coarse(robot, 25, 0)
    other = np.concatenate([coarse(robot, 24, 1), table[:1]])
    assert fitted(robot, table, other).dof == fitted(robot, table, other + 1e-9).dof
    copied, once = fitted(robot, table, table[:20]), fitted(robot, table)
    np.testing.assert_allclose(copied.values, once.values, atol=1e-9)
    assert copied.dof == once.dof
    assert [each.check for each in copied.verdict.said if each.check == "copies"]


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")
def test_rows_that_are_all_equal_are_one_place(tmp_path: Path) -> None:
    robot = hung(tmp_path)
    table = np.repeat(coarse(robot, 1, 0), 12, axis=0)
    found = pk.identify(
        robot, pk.Measurements(table, None, "closure", actuator_sigma=0.3), "offset1"
    )
    assert "too-few-rows" in [each.check for each in found.verdict.said]
