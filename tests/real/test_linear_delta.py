"""A real delta printer, calibrated from its own bed-probe log: 41 heights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

ROOT = Path(__file__).parents[2]
LOG = ROOT.parent / "shared" / "data" / "linear-delta" / "probe41.csv"
STEP = 60 / 6400  # mm

pytestmark = pytest.mark.skipif(
    not LOG.exists(), reason="the probe log is not beside this checkout (../shared/data)"
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return pk.load(ROOT / "examples" / "linear-delta" / "robot.toml")


@pytest.fixture(scope="module")
def heights() -> Measurements:
    log = np.genfromtxt(LOG, delimiter=",", names=True)
    steps = np.column_stack([log[f"steps_{carriage}"] for carriage in "abc"])
    return Measurements(-steps * STEP, log["height_mm"], "height")


def test_six_parameters(robot: Robot, heights: Measurements) -> None:
    found = identify(robot, heights)
    assert found.rank == 6
    assert found.rms <= 0.0392
    assert np.abs(found.residuals[0]).max() == pytest.approx(0.085, abs=0.0006)


def test_nine_parameters_and_how_little_heights_tell_of_rods(
    robot: Robot, heights: Measurements
) -> None:
    found = identify(robot, heights, free=[*robot.model.free, "rod*"])
    assert found.rank == 9
    assert found.rms <= 0.0311
    assert np.abs(found.residuals[0]).max() == pytest.approx(0.0912, abs=0.0002)
    rods = [found.parameters[f"rod{i}"] for i in (1, 2, 3)]
    assert [rod["value"] for rod in rods] == pytest.approx([334.67, 335.44, 337.56], abs=0.02)
    assert [rod["stderr"] for rod in rods] == pytest.approx([1.37] * 3, abs=0.03)
    assert "± 1.4" in found.summary()


def test_heights_cannot_tell_how_the_printer_is_turned(robot: Robot, heights: Measurements) -> None:
    found = identify(robot, heights, free=[*robot.model.free, "angle3"])
    assert found.rank == 6
    assert found.unidentifiable == ("angle1 + … + angle3",)


def test_points_that_were_not_fitted_are_as_near(robot: Robot, heights: Measurements) -> None:
    found = identify(robot, heights, holdout=0.25)
    assert found.holdout_rms < 0.06
    assert found.holdout_rms == pytest.approx(found.holdout_expected, rel=0.5)
