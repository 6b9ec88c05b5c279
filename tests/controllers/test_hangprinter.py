"""M669 of a Hangprinter: the firmware's published model lets out the lines that the robot does."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots

ANCHORS = np.array([[16.4, -1610.9, -131.5], [1314.2, 1268.1, -121.3], [-1415.7, 707.6, -121.8]])
ANCHORS = np.vstack([ANCHORS, [1.5, -2.5, 2299.8]])
REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "hangprinter" / "robot.toml"


def machine(**changes: float) -> pk.Robot:
    joint = np.array([5.0, 6.0, 7.0])
    limbs = [
        {"kind": "UPS", "base": anchor + joint, "platform": joint}
        | {"offset": np.linalg.norm(anchor)}
        for anchor in ANCHORS
    ]
    return robots.made("translation", {"z": 300.0}, limbs).replace(changes)


def firmware_lines(text: str, nozzle: Any) -> Any:
    """CartesianToMotorSteps() of the firmware, before spools: line let out since the origin."""
    anchors = [
        [float(value) for value in re.search(rf"{letter}(\S+)", text)[1].split(":")]  # type: ignore[index]
        for letter in "ABCD"
    ]
    far = np.linalg.norm(nozzle[:, None] - anchors, axis=2)
    return far - np.linalg.norm(anchors, axis=1)


def test_firmware_lets_out_what_the_robot_does_and_it_is_read_back(tmp_path: Path) -> None:
    robot = machine()
    loss = pk.export.hangprinter(robot, tmp_path / "config.g")
    assert loss.exact
    text = (tmp_path / "config.g").read_text()
    assert text.startswith("M669 K6 N4 A16.400000:-1610.900000:-131.500000 B")
    nozzle = np.random.default_rng(1).uniform([-500, -500, 0], [500, 500, 900], (30, 3))
    poses = np.pad(nozzle, ((0, 0), (0, 3)))
    np.testing.assert_allclose(firmware_lines(text, nozzle), robot.inverse(poses), atol=1e-5)
    (tmp_path / "config.g").write_text("M669 K1 X1\n" + text.replace("\n", " P2000 ; mine\n"))
    again = pk.import_printer(tmp_path / "config.g", "hangprinter")
    assert str(again) == "config: a Hangprinter, no stored heights"
    np.testing.assert_allclose(again.robot.inverse(poses), robot.inverse(poses), atol=1e-5)


def test_lengths_of_their_own_are_refused_or_projected(tmp_path: Path) -> None:
    robot = machine(offset2=1825.0, offset4=2303.0)
    with pytest.raises(pk.ArgumentError, match=r"length of a line at the origin.*off by \d"):
        pk.export.hangprinter(robot, tmp_path / "x.g")
    assert not (tmp_path / "x.g").exists()
    loss = pk.export.hangprinter(robot, tmp_path / "x.g", project=True)
    nearest = pk.import_printer(tmp_path / "x.g", "hangprinter").robot
    nozzle = np.random.default_rng(2).uniform([-400, -400, 0], [400, 400, 900], (100, 3))
    poses = np.pad(nozzle, ((0, 0), (0, 3)))
    q = robot.inverse(poses)
    off, before = (
        np.linalg.norm((each.forward(q, guess=poses).pose - poses)[:, :3], axis=1)
        for each in (nearest, machine())
    )
    assert np.sqrt((off**2).mean()) < min(1.5 * loss.rms, 0.5 * np.sqrt((before**2).mean()))


@pytest.mark.skipif(not REAL.exists(), reason=f"{REAL} is not here")
def test_a_real_machines_numbers_are_stated_with_their_loss(tmp_path: Path) -> None:
    """Its lengths at the origin were measured by tape: they are not quite the distances."""
    loss = pk.export.hangprinter(pk.load(str(REAL)), tmp_path / "x.g", project=True)
    assert 0.001 < loss.rms < 20.0


def test_what_is_no_hangprinter_is_refused(tmp_path: Path) -> None:
    for name in ("hexapod", "linear-delta"):
        with pytest.raises(pk.ArgumentError, match="no point that only translates on four"):
            pk.export.hangprinter(pk.load(name), tmp_path / "x.g")
    for text, reason in (
        ("M665 R1\n", "M669 is missing"),
        ("M669 K5 A1:2:3\n", "must be K6"),
        ("M669 K6 A1:2:3 B1:2 C1:2:3 D1:2:3\n", "B of M669 must be an anchor x:y:z"),
    ):
        (tmp_path / "c.g").write_text(text)
        with pytest.raises(pk.FileError, match=reason):
            pk.import_printer(tmp_path / "c.g", "hangprinter")
