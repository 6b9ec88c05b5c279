"""Where an imported printer may go: as its firmware says it, and plans that stay there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError, FileError

ROOT = Path(__file__).resolve().parents[2]
PRINTER = ROOT / "examples" / "linear-delta" / "printer.cfg"


def klipper(folder: Path, old: str = "", new: str = "") -> pk.Robot:
    (path := folder / "printer.cfg").write_text(PRINTER.read_text().replace(old, new, 1))
    return pk.import_printer(path).robot


def test_carriages_stay_below_their_end_stops(tmp_path: Path) -> None:
    """Of the firmware's rule a carriage is at z + √(arm² - d²), at the end stop 330.55 + √…"""
    robot = klipper(tmp_path)
    rng = np.random.default_rng(1)
    poses = np.zeros((400, 6))
    poses[:, :2] = rng.uniform(-80, 80, (400, 2))
    poses[:, 2] = rng.uniform(200.0, 330.55, 400)
    towers = 170.0 * np.stack(
        [np.cos(np.radians([210, 330, 90])), np.sin(np.radians([210, 330, 90]))]
    )
    far = np.linalg.norm(poses[:, :2, None] - towers, axis=1)
    carriages = poses[:, 2:3] + np.sqrt(340.0**2 - far**2)
    below = (carriages <= 330.551363 + np.sqrt(340.0**2 - 170.0**2)).all(axis=1)
    assert 50 < below.sum() < 350
    np.testing.assert_array_equal(robot.feasible(poses).ok, below)
    np.testing.assert_array_equal((robot.inverse(poses) >= 0.0).all(axis=1), below)


@pytest.mark.parametrize(
    ("old", "new", "radius", "lowest"),
    [
        ("", "", 120.0, 0.0),  # of DELTA_CALIBRATE
        ("delta_radius: 170", "delta_radius: 170\nprint_radius: 95\n#", 95.0, 0.0),
        ("delta_radius: 170", "delta_radius: 170\nminimum_z_position: -3\n#", 120.0, -3.0),
        ("radius: 120", "", None, 0.0),
    ],
)
def test_a_printer_goes_where_its_configuration_lets_it(
    tmp_path: Path, old: str, new: str, radius: float | None, lowest: float
) -> None:
    box = klipper(tmp_path, old, new).model.workspace
    assert box.get("radius") == (None if radius is None else (0.0, radius))
    assert box["z"][0] == lowest


def test_a_print_radius_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="print_radius"):
        klipper(tmp_path, "delta_radius: 170", "delta_radius: 170\nprint_radius: -5\n#")


def test_reprap_states_the_radius_by_b(tmp_path: Path) -> None:
    (path := tmp_path / "config.g").write_text("M665 L340 R170 H330 B110\nM666 X0 Y0 Z0\n")
    robot = pk.import_printer(path, "reprap").robot
    assert robot.model.workspace["radius"] == (0.0, 110.0)


def test_a_distance_from_the_axis_bounds_a_circle_and_is_kept_by_files(tmp_path: Path) -> None:
    robot = pk.load("linear-delta").within({"radius": (0.0, 50.0)})
    poses = np.zeros((4, 6))
    poses[:, 2] = robot.home[2]
    poses[:, :2] = [[49.9, 0], [0, -50.1], [35, 35], [36, 36]]
    assert robot.feasible(poses).ok.tolist() == [True, False, True, False]
    robot.save(path := tmp_path / "robot.toml")
    assert pk.load(path).model.workspace == robot.model.workspace
    drawn = pk.sample_poses(robot, 100, share=1.0)
    assert 40.0 < np.hypot(drawn[:, 0], drawn[:, 1]).max() <= 50.0
    with pytest.raises(ArgumentError, match="radius"):
        robot.within({"radius": (60.0, 70.0)})


def test_the_plan_of_a_printers_own_probe_stays_on_its_bed(run: Any, tmp_path: Path) -> None:
    assert run("import", PRINTER, "--out", tmp_path).exit_code == 0
    robot = tmp_path / "robot.toml"
    result = run("plan", robot, "--kind", "probe", "--count", "20", "--out", tmp_path / "plan")
    assert result.exit_code == 0 and "predicted error" in result.stdout
    poses = np.loadtxt(tmp_path / "plan" / "poses.csv", delimiter=",", skiprows=4)
    steps = np.loadtxt(
        tmp_path / "plan" / "commands.csv", delimiter=",", skiprows=4, usecols=(0, 1, 2)
    )
    assert len(poses) == len(steps) == 20
    assert (poses[:, 2] == 0.0).all() and (steps >= 0.0).all()
    assert np.hypot(poses[:, 0], poses[:, 1]).max() <= 120.0 + 1e-6
    assert np.hypot(poses[:, 0], poses[:, 1]).max() > 100.0


def test_a_bed_of_unknown_size_is_asked_for(run: Any, refused: Any, tmp_path: Path) -> None:
    assert "--within radius=" in refused("plan", "2tpr2tps", "--kind", "probe")
    result = run("plan", "linear-delta", "--kind", "probe", "--within", "radius=0:80")
    assert result.exit_code == 0, result.output


def test_cranks_of_a_rotary_delta_stay_below_their_end_stops(tmp_path: Path) -> None:
    (path := tmp_path / "rotary.cfg").write_text(
        "[printer]\nkinematics: rotary_delta\nshoulder_radius: 180\nshoulder_height: 520\n"
        "[delta_calibrate]\nradius: 60\n[stepper_a]\ngear_ratio: 107:16, 60:16\nmicrosteps: 16\n"
        "position_endstop: 252\nupper_arm_length: 170\nlower_arm_length: 400\n"
        + "".join(f"[stepper_{axis}]\ngear_ratio: 107:16, 60:16\nmicrosteps: 16\n" for axis in "bc")
    )
    robot = pk.import_printer(path).robot
    assert robot.model.workspace["radius"] == (0.0, 60.0)
    poses = np.zeros((3, 6))
    poses[:, 2] = [0.0, 251.0, 251.0]
    poses[2, 0] = 40.0  # away from the middle a crank would be above its end stop
    steps = robot.inverse(poses)
    assert (steps[:2] >= 0.0).all() and (steps[2] < 0.0).any()
    assert robot.feasible(poses).ok.tolist() == [True, True, False]
