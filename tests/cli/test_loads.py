"""Payloads and stiffness on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table
from pkmcal.measurements.pose_csv import write_poses

LOAD = ("--payload", "11 lb", "--payload-at", "5,0,40", "--tool-force", "0,30,-10")


@pytest.fixture
def stiff(tmp_path: Path) -> Path:
    path = tmp_path / "stiff.toml"
    pk.load("hexapod").yielding({"offset*": 1e-4}).save(path)
    return path


def test_poses_under_a_payload_are_those_of_the_package(run: Any, stiff: Path) -> None:
    load = pk.Load(11 * 0.45359237, (5.0, 0.0, 40.0), (0.0, 30.0, -10.0))
    robot, pose = pk.load(stiff), [10.0, 20.0, 820.0, 0.0, 0.0, 0.0]
    said = json.loads(run("inverse", stiff, "10,20,820,0,0,0", *LOAD, "--json").stdout)
    q = robot.inverse(pose, load=load)
    assert np.abs(np.array(said["actuators"][0]) - q).max() < 1e-12
    line = ",".join(map(repr, said["actuators"][0]))
    said = json.loads(run("forward", stiff, line, *LOAD, "--json").stdout)
    assert np.abs(np.array(said["pose"][0]) - pose).max() < 1e-9


def test_stiffness_is_that_of_the_package(run: Any, stiff: Path) -> None:
    said = json.loads(run("stiffness", stiff, "0,0,800,0,0,0", "--rated", "200", "--json").stdout)
    robot = pk.load(stiff)
    found = pk.stiffness(robot, robot.home)
    assert np.abs(np.array(said["compliance"][0]) - found.compliance).max() < 1e-15
    table = pk.compliance_table(robot, robot.home, rated=200.0)
    assert np.abs(np.array(said["displacement"]) - table.displacement).max() < 1e-12
    beyond = run("stiffness", stiff, "0,0,8000,0,0,0")
    assert beyond.exit_code == 0 or "of 1 poses" in beyond.stdout
    assert "softest" in run("stiffness", stiff).stdout


def test_cut_moves_the_tool_as_the_machine_under_that_force(
    run: Any, stiff: Path, tmp_path: Path
) -> None:
    robot, cut = pk.load(stiff), (3.0, -2.0, 5.0)
    poses = pk.sample_poses(robot.rigid, 5, seed=3)
    table = tmp_path / "poses.csv"
    write_poses(table, poses)
    out = tmp_path / "map.csv"
    said = run("stiffness", stiff, table, "--cut", "3,-2,5", "--out", out, "--json").stdout
    moved = np.array(json.loads(said)["moved"])
    q = robot.inverse(poses)
    held = robot.forward(q, guess=poses, load=pk.Load(force=cut)).pose
    assert np.abs(moved - (held - poses)[:, :3]).max() < 1e-3 * np.abs(moved).max()
    rows = Table(out)
    written = np.stack([rows.numbers(f"moved {axis}", "mm")[0] for axis in "xyz"], axis=1)
    assert np.abs(written - moved).max() < 1e-7
    assert "3,-2,5 N at the tool move it by" in run("stiffness", stiff, "--cut", "3,-2,5").stdout


def test_program_is_corrected_for_the_load_of_each_tool(
    run: Any, refused: Any, stiff: Path, tmp_path: Path
) -> None:
    program = tmp_path / "part.ngc"
    program.write_text("G0 X0 Y0 Z800 A0 B0 C0\nT1 M6\nG0 X5 Y0 Z800 A0 B3 C0\n", encoding="utf-8")
    words = ("compensate", "hexapod", program, stiff, "--firmware", "linuxcnc")
    options = ("--payload", "2kg", "--load", "T1=40kg,0,10,60", "--out", tmp_path / "out")
    assert run(*words, *options).exit_code == 0
    wanted = pk.compensate_program(
        pk.load("hexapod"),
        pk.load(stiff).carrying(pk.Load(2.0)),
        program,
        firmware="linuxcnc",
        loads={1: pk.Load(40.0, (0.0, 10.0, 60.0))},
    ).text
    written = (tmp_path / "out" / "part.ngc").read_text(encoding="utf-8")
    assert wanted in written
    assert "T1 twice" in refused(*words, "--out", tmp_path, "--load", "T1=1", "--load", "1=2")
    assert "T1=MASS" in refused(*words, "--out", tmp_path, "--load", "1kg")
    assert "--load says nothing of a table" in refused(
        "compensate", stiff, "a.csv", "b.csv", "--load", "T1=1kg"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("inverse", "hexapod", "0,0,800,0,0,0", "--payload", "5kg"), "nothing of hexapod yields"),
        (("stiffness", "hexapod"), "nothing of hexapod yields"),
        (("stiffness", "hexapod", "--compliance", "offset*=1e-4", "--cut", "1"), "--cut"),
        (("stiffness", "hexapod", "--compliance", "offset1"), "--compliance must be NAME=C"),
        (
            ("stiffness", "hexapod", "--compliance", "offset*=1e-4,offset2=2e-4"),
            "offset2 twice, by offset* and offset2",
        ),
        (("stiffness", "hexapod", "--compliance", "offset*=0"), "what does not yield is left out"),
        (("stiffness", "hexapod", "--compliance", "offset*=2e4"), "its compliance is 5e-05"),
        (("forward", "3r", "0,0,0", "--payload", "5"), "of which nothing yields to a payload"),
    ],
)
def test_what_makes_no_sense_is_refused(refused: Any, arguments: tuple, message: str) -> None:
    assert message in refused(*arguments)


def test_masses_have_known_units(refused: Any, stiff: Path) -> None:
    said = refused("inverse", stiff, "0,0,800,0,0,0", "--payload", "5 stone")
    assert "--payload must be a mass in kg, g, t, lb" in said
    said = refused("inverse", stiff, "0,0,800,0,0,0", "--payload-at", "1,2,3")
    assert "--payload is missing" in said
