"""The picture of what a calibration leaves over: of every kind of measurement, always the same."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.report.residual_figure import residuals

from ..simulated import hexapod_poses

ANCHOR = [400.0, 300.0, -100.0]


@pytest.fixture(scope="module")
def found() -> Identification:
    """Poses, heights and distances together, the fourth row far off."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 15, np.random.default_rng(0)))
    machine = pk.VirtualMachine(robot)
    sets = [
        machine.measure(q, "pose"),
        machine.measure(q, "height"),
        machine.measure(q, "distance", ANCHOR),
    ]
    wrong = sets[0].values.copy()
    wrong[3, 0] += 0.2
    sets[0] = dataclasses.replace(sets[0], values=wrong)
    return pk.identify(robot, sets, free="offset*", loss="cauchy")


def marks(panel: object) -> dict[str, np.ndarray]:
    lines = panel.get_lines()  # type: ignore[attr-defined]
    return {line.get_label(): line.get_ydata() for line in lines}


def test_every_residual_is_drawn_in_its_unit(found: Identification) -> None:
    lengths, angles, *_ = residuals(found).axes
    drawn = marks(lengths)
    np.testing.assert_array_equal(drawn["x"], found.residuals[0][:, 0])
    np.testing.assert_array_equal(drawn["distance"], found.residuals[2][:, 0])
    np.testing.assert_allclose(marks(angles)["beta"], np.degrees(found.residuals[0][:, 4]))
    assert "[mm]" in lengths.get_ylabel() and "[deg]" in angles.get_ylabel()


def test_outliers_are_ringed(found: Identification) -> None:
    assert found.outliers == (3,)
    rings = [line for line in residuals(found).axes[0].get_lines() if line.get_markersize() > 10]
    assert {tuple(ring.get_xdata()) for ring in rings} == {(3,), ()}


def test_good_residuals_lie_on_the_line_of_normal_quantiles() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 80, np.random.default_rng(1)))
    good = pk.identify(robot, pk.VirtualMachine(robot).measure(q))
    points = residuals(good).axes[-1].get_lines()[0]
    normal, scaled = points.get_xdata(), points.get_ydata()
    assert np.abs(scaled - normal)[np.abs(normal) < 1.5].max() < 0.35


@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_a_file_of_the_wanted_kind_is_written_always_the_same(
    found: Identification, tmp_path: Path, ending: str, start: bytes
) -> None:
    contents = []
    for name in ("one", "two"):
        found.plot(tmp_path / f"{name}.{ending}")
        contents.append((tmp_path / f"{name}.{ending}").read_bytes())
    assert contents[0] == contents[1]
    assert contents[0].startswith(start)


def test_another_ending_is_refused_and_nothing_is_written(
    found: Identification, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"path must end in .png or .svg, found .*residuals.gif"):
        found.plot(tmp_path / "residuals.gif")
    assert not list(tmp_path.iterdir())
