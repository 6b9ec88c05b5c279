"""`pkmcal compensate`: from two files to corrected commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table
from pkmcal.measurements.pose_csv import write_poses

from ..simulated import tilted_poses, with_errors

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "2tpr2tps-compensation"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, np.ndarray, np.ndarray]:
    """desired.csv, poses.csv and positions.csv in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    robot = pk.load("2tpr2tps")
    rng = np.random.default_rng(0)
    desired = tilted_poses(robot, 6, rng).round(4)
    reached = with_errors(robot, 0.5, rng).forward(robot.inverse(desired)).pose
    write_poses("desired.csv", desired)
    write_poses("poses.csv", reached)
    rows = "\n".join(",".join(map(repr, row)) for row in reached[:, :3].tolist())
    Path("positions.csv").write_text(f"x [mm],y [mm],z [mm]\n{rows}\n")
    return robot, desired, reached


def test_commands_are_those_of_the_library(run: Any, files: Any) -> None:
    robot, desired, reached = files
    result = run("compensate", "2tpr2tps", "desired.csv", "poses.csv", "--out", "new")
    assert result.exit_code == 0
    assert "orientation as measured" in result.stdout
    expected = pk.compensate(robot, desired, reached)
    table = Table("new/corrected.csv")
    for word, values in (("q", expected.actuators), ("dq", expected.correction)):
        written = np.stack([table.numbers(f"{word}{i}", "mm")[0] for i in range(1, 5)], axis=1)
        np.testing.assert_allclose(written, values, atol=1e-5)
    np.testing.assert_allclose(table.numbers("beta", "rad")[0], desired[:, 4], atol=1e-8)


def test_positions_are_read_as_the_machine_allows(run: Any, refused: Any, files: Any) -> None:
    robot, desired, reached = files
    result = run("compensate", "2tpr2tps", "desired.csv", "positions.csv", "--json")
    found = json.loads(result.stdout)
    expected = pk.compensate(robot, desired, reached[:, :3], orientation="from-position")
    assert found["orientation"] == "from-position"
    np.testing.assert_allclose(found["correction"], expected.correction, atol=1e-5)
    assumed = run(
        "compensate", "2tpr2tps", "desired.csv", "positions.csv", "--orientation", "assumed"
    )
    assert "orientation assumed as desired: its error stays" in assumed.stdout
    assert "--orientation assumed" in refused(
        "compensate", "hexapod", "desired.csv", "positions.csv"
    )


def test_a_swarm_by_the_command_line_is_reproducible(run: Any, files: Any) -> None:
    arguments = ("2tpr2tps", "desired.csv", "poses.csv", "--method", "pso", "--seed", "5", "--json")
    first, again = (json.loads(run("compensate", *arguments).stdout) for _ in range(2))
    assert first == again
    assert len(first["history"][0]) == 201
    bounded = json.loads(run("compensate", *arguments, "--bounds", "0.1", "--common").stdout)
    assert np.abs(bounded["correction"]).max() <= 0.1


def test_a_pose_out_of_reach_is_exit_code_1(run: Any, files: Any) -> None:
    robot = pk.load("linear-delta")
    poses = np.tile(robot.home, (2, 1))
    write_poses("reached.csv", poses)
    poses[1, 0] = 1e4
    write_poses("far.csv", poses)
    result = run("compensate", "linear-delta", "far.csv", "reached.csv")
    assert result.exit_code == 1
    assert "nan" in result.stdout


def test_what_does_not_fit_is_one_line(refused: Any, files: Any) -> None:
    Path("one.csv").write_text("x [mm],y [mm],z [mm]\n1,2,400\n")
    assert "1 rows for the 6 of desired.csv" in refused(
        "compensate", "2tpr2tps", "desired.csv", "one.csv"
    )
    Path("half.csv").write_text("x [mm],y [mm],z [mm],beta [deg]\n1,2,400,0\n")
    assert "missing column 'alpha'" in refused("compensate", "2tpr2tps", "desired.csv", "half.csv")
    Path("named.csv").write_text("x [mm],y [mm],zz [mm]\n1,2,400\n")
    assert "unknown column 'zz'" in refused("compensate", "2tpr2tps", "desired.csv", "named.csv")
    wrong = refused("compensate", "2tpr2tps", "desired.csv", "poses.csv", "--method", "fast")
    assert "method must be one of exact, pso" in wrong


def test_the_example_runs_on_the_command_line(run: Any, tmp_path: Path) -> None:
    result = run(
        "compensate",
        "2tpr2tps",
        EXAMPLE / "desired.csv",
        EXAMPLE / "measured.csv",
        "--out",
        tmp_path,
    )
    assert result.exit_code == 0
    assert "30 poses" in result.stdout
    assert "beta from the position" in result.stdout


def test_rows_measured_grossly_off_are_done_but_not_trusted(run: Any, tmp_path: Path) -> None:
    far = pk.load("2tpr2tps").home[None] + np.array([[0, 0, 9000, 0, 0, 0]])
    write_poses(tmp_path / "desired.csv", pk.load("2tpr2tps").home[None])
    write_poses(tmp_path / "far.csv", far)
    result = run("compensate", "2tpr2tps", tmp_path / "desired.csv", tmp_path / "far.csv")
    assert result.exit_code == 1
    assert "check units, frame and order of the rows" in result.stdout
