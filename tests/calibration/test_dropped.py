"""Rows that are left out: the fit is that of the others, and their numbers are kept."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.report.contents import iso9283

from .. import workspaces
from ..simulated import with_errors

NOISE, GROSS = 0.01, (17, 43)


def readings(gross: tuple[int, ...] = GROSS, repeats: int = 2) -> tuple[pk.Robot, pk.Measurements]:
    """60 readings of a hexapod, each pose twice; gross ones are off by about 0.5 mm."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(6)
    true = with_errors(robot, 0.2, rng)
    q = np.repeat(robot.inverse(workspaces.poses("hexapod", 60 // repeats, 7)), repeats, axis=0)
    values = true.forward(q).pose
    values += rng.normal(0, NOISE, values.shape) * [1, 1, 1, 0.002, 0.002, 0.002]
    values[list(gross), :3] += rng.choice([-1, 1], (len(gross), 3)) * rng.uniform(0.3, 0.6)
    sigma = NOISE * np.array([1, 1, 1, 0.002, 0.002, 0.002])
    return robot, pk.Measurements(q, values, "pose", sigma=sigma)


def test_a_fit_without_rows_is_the_fit_of_the_others() -> None:
    robot, measured = readings()
    rest = measured.select(np.setdiff1d(np.arange(60), GROSS))
    left_out, plain = pk.identify(robot, measured, drop=GROSS), pk.identify(robot, rest)
    np.testing.assert_allclose(left_out.values, plain.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(left_out.stderr, plain.stderr, rtol=1e-9)
    assert left_out.dropped == GROSS and left_out.dropped_names == "row 17, row 43"
    assert not set(GROSS) & set(left_out.rows.tolist()) and left_out.rows.max() == 59
    assert "2 rows were left out, as asked: row 17, row 43" in left_out.verdict.remarks


def test_outliers_are_found_and_left_out() -> None:
    robot, measured = readings()
    with pytest.warns(pk.CalibrationWarning):
        assert pk.identify(robot, measured).verdict.state != "calibrated"
    found = pk.identify(robot, measured, drop="outliers")
    assert found.dropped == GROSS
    assert found.outliers == () and found.verdict.state == "calibrated"
    assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))


def test_nothing_is_left_out_of_good_measurements() -> None:
    robot, measured = readings(gross=())
    found, plain = pk.identify(robot, measured, drop="outliers"), pk.identify(robot, measured)
    assert found.dropped == () and (found.values == plain.values).all()


def test_outliers_among_held_out_rows_are_left_out_too() -> None:
    robot, measured = readings()
    found = pk.identify(robot, measured, drop="outliers", holdout=0.4)
    assert found.dropped == GROSS and found.holdout_outliers == ()
    kept = {*found.holdout_rows.tolist(), *found.rows.tolist()}
    assert kept == set(range(60)) - set(GROSS)
    with pytest.warns(pk.CalibrationWarning):
        plain = pk.identify(robot, measured, holdout=0.4)
    assert set(plain.holdout_rows.tolist()) & set(GROSS), "one of them was drawn to be held out"
    assert found.holdout_rms < 1.5 * found.holdout_expected


def test_pose_accuracy_is_scored_without_outliers() -> None:
    robot, measured = readings()
    found = pk.identify(robot, measured, loss="cauchy")
    assert found.outliers == GROSS
    (score,) = iso9283(found)
    assert score["outliers"] == 2
    assert max(score["accuracy"]) < 5 * NOISE and score["repeatability_largest"] < 10 * NOISE
    (good,) = iso9283(pk.identify(robot, measured, drop=GROSS))
    assert good["outliers"] == 0
    assert score["accuracy_mean"] == pytest.approx(good["accuracy_mean"], rel=0.05)


@pytest.mark.parametrize(
    "drop, message",
    [
        ([60], "drop: the measurements have rows 0 to 59, found 60"),
        ([-1], "drop: the measurements have rows 0 to 59, found -1"),
        (range(60), "drop: no row of a set is left"),
    ],
)
def test_rows_that_are_not_there_are_refused(drop: Any, message: str) -> None:
    with pytest.raises(pk.ArgumentError, match=message):
        pk.identify(*readings(), drop=drop)


@pytest.mark.parametrize("drop", ["outlier", [1.5], [True], 3])
def test_rows_are_whole_numbers(drop: Any) -> None:
    with pytest.raises(pk.ArgumentTypeError, match="drop: "):
        pk.identify(*readings(), drop=drop)


def test_rows_and_lines_on_the_command_line(run: Any, refused: Any, tmp_path: Path) -> None:
    robot, measured = readings()
    file = tmp_path / "measured.csv"
    measured.write(file)
    command = ("calibrate", "hexapod", file)
    by_number = json.loads(run(*command, "--drop", "17,43", "--json").stdout)
    assert by_number["dropped"] == [17, 43]
    first = int(pk.read_measurements(file, robot).lines[0])  # type: ignore[index]
    lines = f"measured.csv:{first + 17}", f"{file}:{first + 43}"
    by_line = json.loads(run(*command, "--drop", ",".join(lines), "--json").stdout)
    found = json.loads(run(*command, "--drop-outliers", "--json").stdout)
    assert by_line["values"] == found["values"] == by_number["values"]
    said = " ".join(run(*command, "--drop-outliers").stdout.split())
    assert f"2 rows were left out, as asked: measured.csv line {first + 17}" in said
    message = refused(*command, "--drop", "measured.csv:999")
    assert message == "--drop measured.csv:999: no row was read from there"
    assert refused(*command, "--drop", "P18") == (
        "--drop P18: expected the number of a row, or FILE:LINE"
    )
    both = json.loads(run(*command, "--drop", "1", "--drop-outliers", "--json").stdout)
    assert both["dropped"] == [1, 17, 43]


def test_outliers_of_another_file_that_is_held_out_are_left_out_and_named(
    run: Any, tmp_path: Path
) -> None:
    robot, measured = readings(gross=())
    _, gross = readings(gross=(3, 20))
    later = gross.select(slice(0, 30))
    found = pk.identify(robot, measured.select(slice(30, 60)), drop="outliers", holdout=later)
    assert found.holdout_dropped == (3, 20) and found.dropped == ()
    assert found.verdict.state == "calibrated" and len(found.holdout_rows) == 28
    assert found.left_out == "2 rows were left out, as asked: row 3, row 20"
    measured.select(slice(30, 60)).write(tmp_path / "first.csv")
    later.write(tmp_path / "later.csv")
    command = ("calibrate", "hexapod", tmp_path / "first.csv", "--holdout", tmp_path / "later.csv")
    first = int(pk.read_measurements(tmp_path / "later.csv", robot).lines[0])  # type: ignore[index]
    lines = f"later.csv:{first + 3},later.csv:{first + 20}"
    done = run(*command, "--drop", lines)
    assert f"later.csv: lines {first + 3}, {first + 20} left out of the hold-out" in done.stderr
    asked = json.loads(run(*command, "--drop", lines, "--json").stdout)
    assert len(asked["holdout_off"]) == 28 and not asked["holdout_contradicts"]


def test_a_machine_that_moved_has_no_outliers_to_leave_out() -> None:
    """All rows of the second day contradict the fit: none of them is dropped to hide that."""
    robot, measured = readings(gross=())
    values = measured.values + np.array([0.5, 0, 0, 0, 0, 0])
    moved = pk.Measurements(measured.actuators, values, "pose", sigma=measured.sigma)
    found = pk.identify(robot, measured, drop="outliers", holdout=moved)
    assert found.holdout_dropped == () and found.verdict.state == "doubtful"
    assert "contradict the fit" in found.verdict.reasons[0]
