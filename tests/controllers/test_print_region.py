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
    np.testing.assert_array_equal(robot.feasible(poses).stroke.all(axis=1), below)
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


def rotary(folder: Path, out: int, shoulders: int = 180) -> Path:
    motors = [f"[stepper_{axis}]\ngear_ratio: 107:16, 60:16\nmicrosteps: 16\n" for axis in "bca"]
    (path := folder / "rotary.cfg").write_text(
        f"[printer]\nkinematics: rotary_delta\nshoulder_radius: {shoulders}\n"
        f"shoulder_height: 520\n[delta_calibrate]\nradius: {out}\n{''.join(motors)}"
        "position_endstop: 252\nupper_arm_length: 170\nlower_arm_length: 400\n"
    )
    return path


@pytest.mark.parametrize(("out", "shoulders"), [(60, 180), (219, 180), (100, 90)])
def test_the_firmware_of_cranks_takes_every_pose_of_the_workspace(
    tmp_path: Path, out: int, shoulders: int
) -> None:
    """Of `check_move`: above the lowest elbow less its rod no farther out than below the top."""
    robot = pk.import_printer(rotary(tmp_path, out, shoulders)).robot
    box = robot.model.workspace
    radius, top = box["radius"][1], box["z"][1]
    # the elbow with the nozzle at the end stop, from the two lengths of its triangle
    elbows = np.linspace(-np.pi / 2, np.pi / 2, 200_001)
    across, down = shoulders + 170 * np.cos(elbows), 520 - 252 - 170 * np.sin(elbows)
    elbow = elbows[np.argmin(np.abs(np.hypot(across, down) - 400))]
    limit = 520 - 170 * np.sin(elbow) - 400
    assert top <= 252 and (top <= limit + 0.1 or radius <= 252 - top + 1e-9)
    assert radius == out or (radius < out and top >= 25.2)
    assert robot.feasible(robot.home[None]).ok.all()


def test_cranks_of_a_rotary_delta_stay_below_their_end_stops(tmp_path: Path) -> None:
    robot = pk.import_printer(rotary(tmp_path, 60)).robot
    assert robot.model.workspace["radius"] == (0.0, 60.0)
    poses = np.zeros((3, 6))
    poses[:, 2] = [0.0, 251.0, 251.0]
    poses[2, 0] = 40.0  # away from the middle a crank would be above its end stop
    steps = robot.inverse(poses)
    assert (steps[:2] >= 0.0).all() and (steps[2] < 0.0).any()
    assert robot.feasible(poses).stroke.all(axis=1).tolist() == [True, True, False]


def taken(config: dict[str, float], poses: Any) -> Any:
    """The rule of Klipper's `check_move` for a linear delta with three equal towers."""
    radius, arm, top = config["delta_radius"], config["arm_length"], config["position_endstop"]
    limit = top + np.sqrt(arm**2 - radius**2) - arm
    over = np.clip(poses[:, 2] - limit, 0.0, arm)
    narrow = radius - np.sqrt(arm**2 - (arm - over) ** 2)
    most = np.minimum(config["print_radius"], narrow)
    return (np.hypot(poses[:, 0], poses[:, 1]) <= most + 1e-9) & (poses[:, 2] <= top)


@pytest.mark.parametrize("out", [95.0, 140.0, 170.0, 185.0])
def test_the_firmware_takes_every_pose_of_the_workspace_and_not_much_above(
    tmp_path: Path, out: float
) -> None:
    stated = f"delta_radius: 170\nprint_radius: {out}\n#"
    box = klipper(tmp_path, "delta_radius: 170", stated).model.workspace
    config = {"delta_radius": 170.0, "arm_length": 340.0, "position_endstop": 330.551363}
    turn = np.linspace(0.0, 2 * np.pi, 30)
    radius, top = min(box["radius"][1], box["x"][1]), box["z"][1]
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + top], axis=1)
    config["print_radius"] = out
    assert taken(config, rim).all()
    if out <= 170.0:  # as far as the towers: their carriages would be above the end stops
        assert not taken(config, rim + np.array([0.0, 0.0, 0.01])).any()


def test_a_bed_of_unknown_size_stays_within_the_radius_of_the_towers(tmp_path: Path) -> None:
    box = klipper(tmp_path, "radius: 120", "").model.workspace
    corner = np.array([[box["x"][1], box["y"][1], box["z"][1]]])
    config = {"delta_radius": 170.0, "arm_length": 340.0, "position_endstop": 330.551363}
    assert taken(config | {"print_radius": 170.0}, corner).all()


def test_a_low_machine_gets_a_smaller_radius_before_it_gets_no_height(tmp_path: Path) -> None:
    """End stops so low that the firmware narrows the radius that is stated from the bed on."""
    text = PRINTER.read_text().replace("330.551363", "40").replace("radius: 120", "radius: 169")
    (path := tmp_path / "low.cfg").write_text(text)
    robot = pk.import_printer(path).robot
    box = robot.model.workspace
    assert 0.0 < box["radius"][1] < 169.0 and box["z"][1] >= 4.0
    rim = np.array([[box["radius"][1], 0.0, box["z"][1]]])
    config = {"delta_radius": 170.0, "arm_length": 340.0, "position_endstop": 40.0}
    assert taken(config | {"print_radius": 170.0}, rim).all()
    assert robot.feasible(robot.home[None]).ok.all()
