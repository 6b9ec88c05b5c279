"""Rotary deltas of Klipper: the robot goes where the firmware's published model goes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

ROTARY = """\
[stepper_a]
gear_ratio: 107:16, 60:16
microsteps: 16
position_endstop: 252.0
upper_arm_length: 170.0
lower_arm_length: 400.0
[stepper_b]
gear_ratio: 107:16, 60:16
microsteps: 32
lower_arm_length: 401.0
angle: 150.5
[stepper_c]
gear_ratio: 107:16, 60:16
microsteps: 16
position_endstop: 251.5
[printer]
kinematics: rotary_delta
max_velocity: 200
max_accel: 3000
shoulder_radius: 180.0
shoulder_height: 520.0
[delta_calibrate]
radius: 60
height0: 0.5
height0_pos: 1000.0,2000.0,1000.0
"""


def written(folder: Path, text: str = ROTARY) -> Path:
    (folder / "mine.cfg").write_text(text)
    return folder / "mine.cfg"


def elbows(robot: pk.Robot, q: Any) -> Any:
    """Angles of the cranks above the horizontal, as the firmware counts them."""
    return -(robot.slots[:, 7] * q + robot.slots[:, 6])


def firmware_gap(config: dict[str, Any], angles: Any, nozzle: Any) -> Any:
    """Klipper's elbow_coord(): how far the nozzle is from each elbow, less the lower arm."""
    tower = np.radians(config["angle"])
    out = config["radius"] + config["upper"] * np.cos(angles)
    elbow = np.stack(
        [
            out * np.cos(tower),
            out * np.sin(tower),
            config["height"] + config["upper"] * np.sin(angles),
        ],
        axis=-1,
    )
    return np.linalg.norm(elbow - nozzle[:, None], axis=-1) - config["lower"]


MODEL = {
    "radius": 180.0,
    "height": 520.0,
    "angle": np.array([30.0, 150.5, 270.0]),
    "upper": np.array([170.0, 170.0, 170.0]),
    "lower": np.array([400.0, 401.0, 400.0]),
}


def test_imported_printer_goes_where_the_firmware_goes(tmp_path: Path) -> None:
    printer = pk.import_printer(written(tmp_path))
    assert str(printer) == "mine: a rotary delta, 1 stored heights"
    robot = printer.robot
    nozzle = np.random.default_rng(1).uniform([-80, -80, 100], [80, 80, 220], (50, 3))
    q = robot.inverse(np.pad(nozzle, ((0, 0), (0, 3))))
    assert np.abs(firmware_gap(MODEL, elbows(robot, q), nozzle)).max() < 1e-9
    steps = 2 * np.pi / (200 * np.array([16, 32, 16]) * 107 / 16 * 60 / 16)
    np.testing.assert_allclose(robot.slots[:, 7], steps, rtol=1e-12)  # down from the end stop
    middle = np.array([[0.0, 0.0, 252.0], [0.0, 0.0, 252.0], [0.0, 0.0, 251.5]])
    at_switch = np.array(
        [firmware_gap(MODEL, elbows(robot, np.zeros(3)), m[None])[0] for m in middle]
    )
    assert np.abs(np.diag(at_switch)).max() < 1e-9
    out = MODEL["upper"] * np.cos(elbows(robot, np.zeros(3)))
    assert (out > 0).all()  # knees outward


def test_nothing_but_changed_numbers_is_touched(tmp_path: Path) -> None:
    file = written(tmp_path)
    robot = pk.import_printer(file).robot
    loss = pk.export.klipper(robot, tmp_path / "same.cfg", config=file)
    assert loss.exact and (tmp_path / "same.cfg").read_text() == ROTARY
    changed = robot.replace({"radius": 181.25, "crank3": 170.5, "rod2": 401.5})
    pk.export.klipper(changed, tmp_path / "new.cfg", config=file)
    new = (tmp_path / "new.cfg").read_text()
    assert "shoulder_radius: 181.250000\n" in new and "lower_arm_length: 401.500000\n" in new
    again = pk.import_printer(tmp_path / "new.cfg").robot
    for name in again.geometry.names:
        if not name.startswith(("axis", "base", "platform")):
            assert again.geometry[name] == pytest.approx(changed.geometry[name], abs=1e-7), name
    added = set(new.splitlines()) - set(ROTARY.splitlines())
    kinds = {re.split(r"[:=]", line)[0] for line in added}
    assert kinds == {"shoulder_radius", "upper_arm_length", "lower_arm_length", "position_endstop"}


def test_what_the_firmware_cannot_hold_is_refused_or_projected(tmp_path: Path) -> None:
    robot = pk.import_printer(written(tmp_path)).robot
    leaning = robot.replace({"axis1.tilt1": 0.004})
    with pytest.raises(pk.ArgumentError, match=r"turn in radial planes.*off by \d\.\d+ mm"):
        pk.export.klipper(leaning, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    file = written(tmp_path)
    loss = pk.export.klipper(leaning, file, config=file, project=True)
    nearest = pk.import_printer(file).robot
    poses = pk.sample_poses(leaning, 300, seed=3)
    off = np.linalg.norm((nearest.forward(leaning.inverse(poses)).pose - poses)[:, :3], axis=1)
    before = np.linalg.norm((robot.forward(leaning.inverse(poses)).pose - poses)[:, :3], axis=1)
    assert np.sqrt((off**2).mean()) < min(1.3 * loss.rms, 0.7 * np.sqrt((before**2).mean()))
    with pytest.raises(pk.ArgumentError, match=r"moves a crank by .* rad; in .*\[stepper_a\]"):
        pk.export.klipper(robot.replace({"gain1": 1e-3}), tmp_path / "new", config=file)
    linear = pk.load("linear-delta").replace({f"offset{i}": 500.0 for i in (1, 2, 3)})
    with pytest.raises(pk.FileError, match=r"line \d+: .* kinematics must be delta, as linear"):
        pk.export.klipper(linear, tmp_path / "new", config=file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("shoulder_height: 520.0", "", "[printer] shoulder_height is missing"),
        (
            "position_endstop: 252.0",
            "position_endstop: 600.0",
            "line 4: [stepper_a] position_endstop 600 is nowhere the arms can reach",
        ),
    ],
)
def test_mistakes_are_named_with_their_line(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(pk.FileError) as caught:
        pk.import_printer(written(tmp_path, ROTARY.replace(old, new)))
    assert message in str(caught.value)


def test_noisy_heights_lead_sideways_errors_down_too(tmp_path: Path) -> None:
    """Heights hardly tell the radius from height and end stops: it is not free."""
    text = ROTARY.replace("shoulder_radius: 180.0", "shoulder_radius: 33.9")
    text = text.replace("shoulder_height: 520.0", "shoulder_height: 412.9")
    text = text.replace("er_arm_length: 40", "er_arm_length: 32").replace("320.0", "320")
    robot = pk.import_printer(written(tmp_path, text)).robot
    turns = [(r, t) for r, n in ((0.0, 1), (57.0, 6), (95.0, 6)) for t in np.arange(n) / n]
    poses = np.zeros((len(turns), 6))
    poses[:, :2] = [[r * np.cos(2 * np.pi * t), r * np.sin(2 * np.pi * t)] for r, t in turns]
    q = robot.inverse(poses)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        off = {f"offset{i}": robot.geometry[f"offset{i}"] + rng.normal(0, 0.003) for i in (1, 2, 3)}
        true = robot.replace(off | {"height": robot.geometry["height"] + rng.normal(0, 0.3)})
        heights = true.forward(q, poses).pose[:, 2] + rng.normal(0, 0.02, len(q))
        found = pk.identify(robot, pk.Measurements(q, heights, "height")).robot
        before, after = (
            np.abs(true.forward(each.inverse(poses), poses).pose - poses)[:, :2].max()
            for each in (robot, found)
        )
        assert after < 0.25 * before, (seed, before, after)
