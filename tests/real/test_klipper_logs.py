"""Probe logs of real delta printers, seven points each: one spare equation, and what it allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.measurements import Measurements

LOGS = Path(__file__).parents[3] / "shared" / "data" / "klipper" / "logs.json"

pytestmark = pytest.mark.skipif(
    not LOGS.exists(), reason="the logs are not beside this checkout (../shared/data)"
)


def logs() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(LOGS.read_text(encoding="utf-8"))
    return found


def printer(log: dict[str, Any], path: Path) -> pk.Robot:
    """With the numbers that its firmware had saved."""
    rods = np.array(log["arm_length"])
    heights = np.array(log["position_endstop"]) + np.sqrt(rods**2 - log["radius"] ** 2)
    lines = [
        'name = "delta"', 'units = { length = "mm", angle = "deg" }',
        "[pose]", 'map = "translation"', "home = { z = 20.0 }",
        "[parameters]", f"radius = {log['radius']}",
        *(f"angle{i + 1} = {angle}" for i, angle in enumerate(log["angle"])),
        "[calibration]", 'free = ["radius", "angle1", "angle2", "offset*"]',
    ]  # fmt: skip
    for i in range(3):
        lines += [
            "[[limb]]", 'kind = "PUS"',
            f'base = {{ radius = "radius", angle = "angle{i + 1}", z = 0.0 }}',
            "platform = [0.0, 0.0, 0.0]", "slider = [0, 0, 1]",
            f"rod = {rods[i]}", f"offset = {heights[i]}", "branch = -1",
        ]  # fmt: skip
    path.write_text("\n".join(lines), encoding="utf-8")
    return pk.load(path)


def probed(log: dict[str, Any]) -> Measurements:
    q = -np.array(log["pos"]) * np.array(log["stepdist"])
    return Measurements(q, np.array(log["height"]), "height")


def test_one_spare_equation_is_doubtful_and_says_to_probe_more(tmp_path: Path) -> None:
    for log in logs():
        found = pk.identify(printer(log, tmp_path / "robot.toml"), probed(log))
        assert found.dof == 1 and found.verdict.state == "doubtful"
        assert "only 1 spare equation shows the noise" in found.verdict.reasons[0]
        assert "probe 20 points or more" in found.verdict.reasons[0]
        assert found.parameter_dof == pytest.approx(np.ones(6))
        assert found.rms < 0.05


def test_two_logs_of_one_printer_agree_and_a_moved_height_is_named(tmp_path: Path) -> None:
    """A hold-out cannot contradict one spare equation; both logs fitted jointly can."""
    first, later = logs()[4:6]
    robot = printer(first, tmp_path / "robot.toml")
    assert pk.identify(robot, probed(first), holdout=probed(later)).moved == ()
    bed = dict(later, height=(np.array(later["height"]) - 1.0).tolist())
    found = pk.identify(robot, probed(first), holdout=probed(bed))
    assert not found.holdout_contradicts
    assert str(found.moved[0]) == "offset1 … offset3 alike"
    assert found.moved[0].shift[0] == pytest.approx(-1.0, abs=0.2)
    assert any("offset1 … offset3 alike by -" in text for text in found.verdict.reasons)


# distances between printed points ---------------------------------------------------------------

ARMS = ["radius", "angle1", "angle2", "offset*", "rod*"]
HEIGHT = 0.02  # mm; the firmware weighs a distance half as much as a height


def printed(log: dict[str, Any], sigma: float | None) -> Measurements:
    """Distances between two points of a print, which were measured with a caliper."""
    distances, first, then = zip(*log["distance"], strict=True)
    first, then = (-np.array(pos) * np.array(log["stepdist"]) for pos in (first, then))
    return Measurements(first, distances, pk.readings.Between(then), sigma=sigma)


def with_distances() -> list[dict[str, Any]]:
    return [log for log in logs() if log["distance"]]


def test_seven_heights_cannot_tell_the_arms_at_all(tmp_path: Path) -> None:
    for log in with_distances():
        with pytest.warns(pk.CalibrationWarning, match="7 equations for 9 parameters"):
            found = pk.identify(printer(log, tmp_path / "robot.toml"), probed(log), ARMS)
        assert found.rank == 7
        assert np.isinf(found.stderr).all()


@pytest.mark.filterwarnings("ignore:residuals are")  # of the first, 4 times what is said here
def test_twelve_distances_tell_the_arms_as_the_firmwares_own_least_squares_does(
    tmp_path: Path,
) -> None:
    """It minimises the same squares of heights and of distances, these at half the weight."""
    for log, sure in zip(with_distances(), (2.1, 1.3), strict=True):
        assert len(log["distance"]) == 12
        heights = probed(log)
        heights = Measurements(heights.actuators, heights.values, "height", sigma=HEIGHT)
        both = [heights, printed(log, 2 * HEIGHT)]
        found = pk.identify(printer(log, tmp_path / "robot.toml"), both, ARMS)
        arms = [found.free.index(f"rod{i}") for i in (1, 2, 3)]
        off = found.values[arms] - log["arm_length"]
        print(log["printer"], found.values[arms], found.stderr[arms], off)
        assert found.rank == 9
        assert (found.stderr[arms] < sure).all()
        np.testing.assert_allclose(off, 0.0, atol=0.15)
