"""Machines of chains that are singular exactly at home, where every call begins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.chain_files import delta_of_hinges
from tests.kinematics.test_chains import loaded

SINGULAR = (45.0, 135.0, 225.0, 315.0)  # arms of an H4 in pairs across: no closure holds a turn


def test_a_home_that_is_singular_is_named_and_one_beside_it_is_not(tmp_path: Path) -> None:
    found = pk.check_geometry(loaded(delta_of_hinges(SINGULAR), tmp_path))
    assert found.kinds == ("singular",)
    assert "home is singular" in found.findings[0].what
    away = loaded(delta_of_hinges((95.0, 180.0, 225.0, 305.0)), tmp_path)
    assert pk.check_geometry(away).ok


def test_poses_around_a_singular_home_are_refused_for_that(tmp_path: Path) -> None:
    robot = loaded(delta_of_hinges(SINGULAR), tmp_path)
    assert np.isnan(robot.inverse(robot.home)).all()
    assert np.isfinite(robot.home_actuators).all()
    with pytest.raises(pk.ArgumentError, match="home is singular"):
        pk.sample_poses(robot, 3)
