"""Stated uncertainties through the command line and files: the numbers that Python gives."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.measurement_writer import write_measurements

Run = Callable[..., Any]


def compared(result: Any, found: pk.Identification[Any]) -> None:
    """Values and deviations of the command line are those of Python, to the bit."""
    assert result.exit_code in (0, 1), result.stdout + result.stderr
    said = json.loads(result.stdout)["parameters"]
    assert list(said) == list(found.free)
    np.testing.assert_array_equal([each["value"] for each in said.values()], found.values)
    np.testing.assert_array_equal([each["stderr"] for each in said.values()], found.stderr)


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    """What is measured of a hexapod whose offset is wrong."""
    robot = pk.load("hexapod")
    true = robot.replace({"offset2": 0.3})
    q = robot.inverse(pk.sample_poses(robot, 30, seed=3))
    path = tmp_path / "rows.csv"
    pk.VirtualMachine(true, noise=0.01, seed=2).measure(q, "position").write(path)
    return path


@pytest.mark.parametrize(
    ("options", "stated"),
    [
        (["--uncertainty", "gain*=1e-3"], {"gain*": 1e-3}),
        (["--uncertainty", "base*=50um"], {"base*": 0.05}),
        (["--uncertainty", "gain*=1e-3,common"], {"common": {"gain*": 1e-3}}),
        (["--consider", "base*=0.02"], {"consider": {"base*": 0.02}}),
        (["--uncertainty", "scale=20e-6"], {"scale": 20e-6}),
        (["--uncertainty", "target*=0.1"], {"target*": 0.1}),
        (
            ["--uncertainty", "frame.?=0.1", "--uncertainty", "frame.*a=1deg"],
            {"frame.?": 0.1, "frame.*a": np.pi / 180},
        ),
        (
            ["--uncertainty", "gain*=1e-3", "--uncertainty", "gain4=0"],
            {"gain*": 1e-3, "gain4": 0.0},
        ),
        (
            ["--uncertainty", "gain*=1e-3", "--consider", "platform*=0.02"],
            {"gain*": 1e-3, "consider": {"platform*": 0.02}},
        ),
    ],
)
def test_options_are_the_argument(run: Run, rows: Path, options: list[str], stated: Any) -> None:
    robot = pk.load("hexapod")
    found = pk.identify(robot, pk.read_measurements(rows, robot), "offset*", uncertainty=stated)
    result = run("calibrate", "hexapod", rows, "--free", "offset*", *options, "--json")
    compared(result, found)


@pytest.mark.parametrize(
    ("option", "text", "said"),
    [
        ("--uncertainty", "frame*=0.1", "lengths (frame.x, frame.y, frame.z) and angles (frame."),
        ("--uncertainty", "mounting*=0.1", "is an angle; give it a unit"),
        ("--uncertainty", "scale=1mm", "unit 'mm'"),
        ("--uncertainty", "anchor1.x=1", "no reading of these measurements depends on anchor1.x"),
        ("--uncertainty", "offset*=1", "offset* is free or unknown"),
        ("--consider", "offset*=1", "offset* is free or unknown"),
        ("--uncertainty", "base*=1e300", "must be 0 or from 1e-15 to 1e+15"),
        ("--consider", "base*=1e300", "must be 0 or from 1e-15 to 1e+15"),
        ("--uncertainty", "0.1", "expected NAME=NUMBER"),
        ("--uncertainty", "gain*=1e-3,alike", "expected NAME=σ"),
    ],
)
def test_mistakes_are_told(run: Run, rows: Path, option: str, text: str, said: str) -> None:
    result = run("calibrate", "hexapod", rows, "--free", "offset*", option, text)
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


ARM_TABLE = '[uncertainty]\n"joint3.d?" = 0.02\n"target*" = 0.05\nscale = 1e-5\n\n[[joint]]'


@pytest.fixture
def arm_rows(tmp_path: Path) -> Path:
    """What is measured of an arm of three joints."""
    arm, rng = pk.load("3r"), np.random.default_rng(1)
    errors = np.zeros((3, 6))
    errors[0, 2], errors[1, 1] = 0.3, -0.2
    q = rng.uniform(-1.2, 1.2, (50, 3))
    seen = arm.replace(errors).forward(q)[:, :3, 3] + rng.normal(0, 0.01, (50, 3))
    path = tmp_path / "arm.csv"
    write_measurements(pk.Measurements(q, seen, "position"), path, "", ("rad",) * 3)
    return path


def test_files_of_arms_state_it_as_options_do(run: Run, arm_rows: Path, tmp_path: Path) -> None:
    arm, file = pk.load("3r"), tmp_path / "arm.toml"
    arm.save(file)
    file.write_text(file.read_text().replace("[[joint]]", ARM_TABLE, 1))
    free = ["joint1.dz", "joint2.dy"]
    stated = {"joint3.d?": 0.02, "target*": 0.05, "scale": 1e-5}
    found = pk.identify(arm, pk.read_measurements(arm_rows, arm), free, uncertainty=stated)
    assert {each.name for each in found.nuisances} >= {"joint3.dx", "target1.x", "scale"}
    compared(run("calibrate", file, arm_rows, "--free", ",".join(free), "--json"), found)
    options = ["--uncertainty", "joint3.d?=0.02", "--uncertainty", "target*=0.05"]
    options += ["--uncertainty", "scale=1e-5", "--free", ",".join(free), "--json"]
    compared(run("calibrate", "3r", arm_rows, *options), found)


def test_files_of_arms_keep_it(tmp_path: Path) -> None:
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    pk.load("3r").save(first)
    first.write_text(first.read_text().replace("[[joint]]", ARM_TABLE, 1))
    arm = pk.load(first)
    assert arm.uncertainty.own == {"joint3.d?": 0.02, "target*": 0.05, "scale": 1e-5}
    for changed in (arm, arm.replace(arm.joint_errors + 0.1), arm.corrected()):
        changed.save(second)
        assert pk.load(second).uncertainty == arm.uncertainty
    turned = first.read_text().replace("joint3.d?", "joint7.dx")
    first.write_text(turned)
    with pytest.raises(ValueError, match=r"line \d+.*no number of the arm matches 'joint7"):
        pk.load(first)


def test_arms_of_urdf_files_take_the_option(run: Run, arm_rows: Path, tmp_path: Path) -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(5))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{place}"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for i, (axis, place) in enumerate(
            [("0 0 1", "0 0 0"), ("1 0 0", "0 0 0.52"), ("1 0 0", "0 0.35 0")]
        )
    )
    tool = '<joint name="t" type="fixed"><parent link="l3"/><child link="l4"/>'
    tool += '<origin xyz="0 0.25 0"/></joint>'
    file = tmp_path / "arm.urdf"
    file.write_text(f'<robot name="arm">{links}{joints}{tool}</robot>')
    m = pk.read_measurements(arm_rows, pk.load("3r"))
    found = pk.identify(pk.load(file), m, "joint1.dz", uncertainty={"joint2.dz": 0.1})
    options = ["--free", "joint1.dz", "--uncertainty", "joint2.dz=0.1", "--json"]
    compared(run("calibrate", file, arm_rows, *options), found)


def test_templates_say_how_to_state_it(run: Run, tmp_path: Path) -> None:
    for machine in ("3r", "hexapod", "delta-parallelograms"):
        result = run("new", machine, tmp_path / f"{machine}.toml")
        assert result.exit_code == 0
        assert "# [uncertainty] how wrong" in (tmp_path / f"{machine}.toml").read_text()


@pytest.mark.parametrize("options", [[], ["--uncertainty", "gain*=1e-7"], ["--fix", "gain*"]])
def test_a_wrong_gain_is_named_whatever_is_stated_of_it(
    run: Run, tmp_path: Path, options: list[str]
) -> None:
    robot, path = pk.load("rotary-delta"), tmp_path / "rows.csv"
    q = robot.inverse(pk.sample_poses(robot, 50, seed=1, share=0.5))
    true = robot.replace({"gain2": 1.004})
    pk.VirtualMachine(true, noise=0.03, seed=1).measure(q, "position").write(path)
    result = run("calibrate", "rotary-delta", path, "--json", *options)
    assert result.exit_code == 1
    verdict = json.loads(result.stdout)["verdict"]
    assert verdict["state"] == "doubtful"
    assert "residuals look like gains" in " ".join(verdict["reasons"])
