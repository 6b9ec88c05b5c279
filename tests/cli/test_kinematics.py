"""`pkmcal inverse` and `pkmcal forward`: rows on the line and in files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.measurements.command_csv import read_commands, write_commands
from pkmcal.measurements.pose_csv import read_poses, write_poses


def test_pose_on_the_line_is_in_degrees_or_radians(run: Any) -> None:
    robot = pk.load("hexapod")
    pose = [20, -10, 860, 5, 0, 3]
    in_rad = [*pose[:3], *np.radians(pose[3:]).tolist()]
    expected = robot.inverse(in_rad)
    for arguments in (
        ["20,-10,860,5,0,3"],
        [",".join(map(repr, in_rad)), "--rad"],
    ):
        found = json.loads(run("inverse", "hexapod", *arguments, "--json").stdout)
        np.testing.assert_allclose(found["actuators"], expected[None], rtol=0, atol=1e-12)


def test_forward_takes_back_what_inverse_gives_through_files(run: Any, tmp_path: Path) -> None:
    robot = pk.load("6-rus")
    poses = pk.sample_poses(robot, 5)
    write_poses("poses.csv", poses)
    assert run("inverse", "6-rus", "poses.csv", "--out", "there").exit_code == 0
    commands = read_commands("there/commands.csv", robot.actuator_units)
    np.testing.assert_array_equal(commands, robot.inverse(read_poses("poses.csv", robot)))
    result = run("forward", "6-rus", "there/commands.csv", "--out", "back")
    assert result.exit_code == 0
    back = read_poses("back/poses.csv", robot)
    np.testing.assert_allclose(back, poses, atol=1e-5)
    assert "sha256" in Path("there/commands.csv").read_text(encoding="utf-8")


def test_first_number_may_be_negative(run: Any) -> None:
    result = run("forward", "linear-delta", "-30,-30,-30")
    assert result.exit_code == 0 and "x [mm]" in result.stdout


@pytest.mark.parametrize(
    "line",
    [
        ["forward", "2tpr2tps", "45_0,452,400,405"],
        ["plan", "hexapod", "--noise", "0_1"],
        ["plan", "hexapod", "--target", "0,0,1_0"],
        ["plan", "hexapod", "--within", "z=8_00:900"],
    ],
    ids=["row", "noise", "target", "within"],
)
def test_underscores_are_in_no_number(run: Any, line: list[str]) -> None:
    result = run(*line)
    assert result.exit_code == 2 and line[-1] in result.stderr


def test_arm_goes_forward_and_its_inverse_is_refused(run: Any) -> None:
    found = json.loads(run("forward", "3r", "10,20,30", "--json").stdout)
    at = pk.load("3r").forward(np.radians([10, 20, 30]))
    np.testing.assert_allclose(found["pose"][0][:3], at[:3, 3])
    result = run("inverse", "3r", "0,0,0,0,0,0")
    assert result.exit_code == 2 and "parallel machine is needed" in result.stderr


def test_rows_out_of_reach_are_named_and_end_with_1(run: Any) -> None:
    result = run("inverse", "linear-delta", "0,0,300,0,0,0")
    assert result.exit_code in (0, 1)
    result = run("inverse", "linear-delta", "900,0,0,0,0,0")
    assert result.exit_code == 1 and "reach broken in rows 0" in result.stdout
    result = run("forward", "hexapod", "1,1,1,1,1,5000")
    assert result.exit_code == 1 and "row 0: " in result.stdout


def test_match_completes_the_pose_that_the_machine_takes(run: Any) -> None:
    robot = pk.load("2tpr2tps-spatial")
    wrong = [0, 10, 400, 5, 10, 0]
    found = json.loads(
        run("inverse", "2tpr2tps-spatial", "0,10,400,5,10,0", "--match", "--json").stdout
    )
    pose = robot.complete([*wrong[:3], *np.radians(wrong[3:])])
    np.testing.assert_allclose(found["actuators"][0], robot.inverse(pose), atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["inverse", "hexapod", "1,2,3"], "3 numbers, the machine has 6"),
        (["forward", "hexapod", "1,2,3,4,5,nan"], "must be finite"),
        (["forward", "hexapod", "none.csv"], "none.csv: no such file"),
        (["inverse", "hexapod", "1,2,3,4,5,6", "--jsn"], "pkmcal inverse --help"),
    ],
)
def test_wrong_input_is_refused_in_one_line(run: Any, arguments: list[str], words: str) -> None:
    result = run(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr and len(result.stderr.splitlines()) == 1


def test_commands_come_back_to_the_last_bit(tmp_path: Path) -> None:
    q = np.random.default_rng(0).normal(0, 1e3, (20, 2)) * [1, 1e-9]
    write_commands(tmp_path / "q.csv", ("mm", "rad"), q, comment="# from nowhere\n")
    np.testing.assert_array_equal(read_commands(tmp_path / "q.csv", ("mm", "rad")), q)
    with pytest.raises(ValueError, match=r"q.csv, line 2: column 'q2' has unit \[rad\]"):
        read_commands(tmp_path / "q.csv", ("mm", "mm"))


@pytest.mark.parametrize("name", ["3rps", "2tpr2tps", "exechon", "linear-delta", "3rrr-planar"])
def test_inverse_completes_a_pose_that_the_machine_cannot_take(run: Any, name: str) -> None:
    """Its actuators lead to the pose that is printed, which keeps what the file declares."""
    robot = pk.load(name)
    asked = robot.home + np.array([3.0, -2.0, 5.0, 0.03, 0.02, 0.01])
    assert robot.violation(asked) > 0.1
    line = ["inverse", name, ",".join(map(repr, asked.tolist())), "--rad"]
    said = json.loads(run(*line, "--json").stdout)
    pose = np.array(said["pose"][0])
    kept = [POSE.index(c) for c in robot.moved]
    np.testing.assert_allclose(pose[kept], asked[kept], atol=1e-9)
    reached = robot.forward(said["actuators"][0], guess=pose)
    np.testing.assert_allclose(reached.pose, pose, atol=1e-7)
    assert "the others follow" in run(*line).stdout


def test_inverse_that_cannot_be_completed_or_is_not_ends_with_1(run: Any) -> None:
    result = run("inverse", "linear-delta", "900,0,0,0,0,0")
    assert result.exit_code == 1 and "no pose found that keeps x, y, z" in result.stdout
    robot = pk.load("3rps")
    asked = ",".join(map(repr, (robot.home + np.array([0, 5.0, 0, 0, 0, 0])).tolist()))
    assert run("inverse", "3rps", asked, "--rad").exit_code == 0
    result = run("inverse", "3rps", asked, "--rad", "--no-match")
    assert result.exit_code == 1 and "closures miss this pose by" in result.stdout
