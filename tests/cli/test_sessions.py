"""`pkmcal calibrate` with sessions: of a column, of files, of ``--session``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot

from ..simulated import hexapod_poses

FREE = ("--free", "base*.x,offset*")


@pytest.fixture(scope="module")
def zeros() -> tuple[Robot, list[Robot]]:
    """A hexapod, and how it was on two days."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(1)
    names = robot.geometry.match("offset*")
    return robot, [robot.replace(dict(zip(names, rng.normal(0, 1, 6), strict=True))) for _ in "ab"]


@pytest.fixture
def files(zeros: tuple[Robot, list[Robot]], tmp_path: Path) -> list[Path]:
    robot, trues = zeros
    paths = []
    for name, true in zip(("monday", "thursday"), trues, strict=True):
        rng = np.random.default_rng(len(name))
        q = robot.inverse(hexapod_poses(robot, 25, rng))
        paths.append(tmp_path / f"{name}.csv")
        pk.VirtualMachine(true, seed=len(name)).measure(q).write(paths[-1])
    return paths


def calibrated(run: Callable[..., Any], *arguments: object) -> dict[str, Any]:
    result = run("calibrate", "hexapod", *arguments, *FREE, "--json")
    assert result.exit_code == 0, result.stdout
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_files_are_sessions(
    run: Callable[..., Any], files: list[Path], zeros: tuple[Robot, list[Robot]]
) -> None:
    found = calibrated(run, *files, "--per-session", "offset*", "--out", "done")
    assert found["sessions"] == ["monday", "thursday"] == list(found["robots"])
    assert "base1.x" in found["parameters"] and "base1.x@monday" not in found["parameters"]
    for day, true in zip(found["sessions"], zeros[1], strict=True):
        own = found["parameters"][f"offset4@{day}"]
        assert abs(own["value"] - true.geometry["offset4"]) < 4 * own["stderr"]
        assert found["robots"][day]["geometry"]["offset4"] == own["value"]
    written = pk.load("done/robot.toml")
    assert isinstance(written, Robot)
    assert written.geometry["offset4"] == found["parameters"]["offset4@thursday"]["value"]


def test_they_may_be_named_or_have_a_column(run: Callable[..., Any], files: list[Path]) -> None:
    named = calibrated(
        run, *files, "--per-session", "offset*", "--session", "a", "--session", "b"
    )  # fmt: skip
    assert named["sessions"] == ["a", "b"]
    head, *rows = files[0].read_text().splitlines()
    more = files[1].read_text().splitlines()[1:]
    whole = Path("whole.csv")
    lines = [f"{head},session", *(f"{r},a" for r in rows), *(f"{r},b" for r in more)]
    whole.write_text("\n".join(lines) + "\n")
    column = calibrated(run, whole, "--per-session", "offset[1-3],offset[456]")
    assert column["sessions"] == ["a", "b"]
    for name, own in named["parameters"].items():
        assert column["parameters"][name]["value"] == pytest.approx(own["value"], abs=1e-6)


def test_a_file_held_out_finds_its_own_first(
    run: Callable[..., Any], files: list[Path], zeros: tuple[Robot, list[Robot]]
) -> None:
    first, later = files
    plain = run("calibrate", "hexapod", first, *FREE, "--holdout", later)
    assert plain.exit_code == 1 and "per_session='offset*'" in plain.stdout
    found = calibrated(run, first, "--holdout", later, "--per-session", "offset*")
    assert found["sessions"] == ["monday"] and not found["holdout_contradicts"]
    assert [*found["holdout_parameters"]] == [f"offset{i}@thursday" for i in range(1, 7)]
    own = found["holdout_parameters"]["offset2@thursday"]
    assert abs(own["value"] - zeros[1][1].geometry["offset2"]) < 4 * own["stderr"]
    printed = run(
        "calibrate", "hexapod", first, *FREE, "--holdout", later, "--per-session", "offset*"
    )
    assert "sessions: monday; numbers without an @ are common, the robot is monday's" in (
        printed.stdout
    )
    assert "found for the points held out" in printed.stdout
    assert "offset6@thursday" in printed.stdout


def test_files_of_the_same_name_are_told_apart_by_their_folders(
    run: Callable[..., Any], files: list[Path]
) -> None:
    for day, path in zip(("mon", "thu"), files, strict=True):
        Path(day).mkdir()
        path.rename(Path(day) / "log.csv")
    both = calibrated(run, "mon/log.csv", "thu/log.csv", "--per-session", "offset*")
    assert both["sessions"] == ["mon/log", "thu/log"]
    held = calibrated(run, "mon/log.csv", "--holdout", "thu/log.csv", "--per-session", "offset*")
    assert "offset1@thu/log" in held["holdout_parameters"]


def test_what_does_not_fit_is_refused(refused: Callable[..., str], files: list[Path]) -> None:
    said = refused("calibrate", "hexapod", *files, *FREE, "--session", "a")
    assert said == "--session a: 1 names for 2 files"
    said = refused("calibrate", "hexapod", *files, *FREE, "--per-session", "ofset*")
    assert said.startswith("per_session: no free parameter matches 'ofset*'; did you mean 'offset")
    Path("own.csv").write_text("q1 [mm],session\n1,a\n")
    lines = files[0].read_text().splitlines()
    Path("own.csv").write_text("\n".join([f"{lines[0]},session", *(f"{x},a" for x in lines[1:])]))
    said = refused("calibrate", "hexapod", "own.csv", *FREE, "--session", "b")
    assert said == "--session: own.csv has a column session"


def test_a_prior_may_name_the_number_of_one_session(
    run: Callable[..., Any], files: list[Path]
) -> None:
    found = calibrated(
        run, *files, "--per-session", "offset*", "--prior", "offset*=2", "--prior",
        "offset5@thursday=3",
    )  # fmt: skip
    assert found["rank"] == len(found["free"]) == 18


def test_the_report_shows_them(run: Callable[..., Any], files: list[Path]) -> None:
    first, later = files
    done = run("calibrate", "hexapod", first, *FREE, "--holdout", later, "--per-session", "offset*",
               "--report", "shown")  # fmt: skip
    assert done.exit_code == 0
    page = Path("shown/report.html").read_text(encoding="utf-8")
    assert "Sessions: monday." in page and "offset6@thursday" in page
    data = json.loads(Path("shown/report.json").read_text(encoding="utf-8"))
    assert data["calibration"]["sessions"] == ["monday"]
    assert [row["name"] for row in data["held_out_numbers"]] == [
        f"offset{i}@thursday" for i in range(1, 7)
    ]
