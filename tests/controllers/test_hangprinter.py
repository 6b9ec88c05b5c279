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


GEARS = {"U": [2, 2, 2, 4], "O": [1, 1, 1, 1], "L": [20, 20, 20, 20], "H": [255, 250, 255, 255]}
CONFIG = """\
; mine
M669 K6 N4 P1800 ; print radius
M669 A16.4:-1610.9:-131.5 B1314.2:1268.1:-121.3
m669 C-1415.7:707.6:-121.8 D1.5:-2.5:2299.8
M666 A1 Q0.06875 R75.1:75.2:74.9:75.0 U2:2:2:4 O1:1:1:1 L20:20:20:20 H255:250:255:255
M666 J25:25:25:25 (full steps) W0
"""


def firmware_turns(text: str, nozzle: Any) -> Any:
    """CartesianToMotorSteps() of the firmware, with its spools, for one step a turn."""

    def behind(letter: str, code: str) -> Any:
        (value,) = re.findall(rf"(?im)^{code}.* {letter}(\S+)", text)
        return np.array([float(each) for each in value.split(":")])

    (buildup,), radii = behind("Q", "M666"), behind("R", "M666")
    anchors = np.array([behind(letter, "M669") for letter in "ABCD"])
    gears = {letter: np.array(GEARS[letter]) for letter in GEARS}
    steps_times_radius = gears["U"] * gears["H"] / (2.0 * np.pi * gears["L"])
    k2 = -gears["U"] * gears["O"] * buildup
    k0 = 2.0 * steps_times_radius / k2
    position = np.linalg.norm(nozzle[:, None] - anchors, axis=2) - np.linalg.norm(anchors, axis=1)
    return k0 * (np.sqrt(radii**2 + position * k2) - radii)


def test_spools_of_the_firmware_are_read_and_turn_as_it_turns_them(tmp_path: Path) -> None:
    (tmp_path / "config.g").write_text(CONFIG)
    robot = pk.import_printer(tmp_path / "config.g", "hangprinter").robot
    nozzle = np.random.default_rng(1).uniform([-500, -500, 0], [500, 500, 900], (30, 3))
    poses = np.pad(nozzle, ((0, 0), (0, 3)))
    turns = firmware_turns(CONFIG, nozzle)
    np.testing.assert_allclose(robot.inverse(poses), turns, rtol=0, atol=1e-10)
    found = robot.forward(turns, guess=poses)
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-8)


def test_calibrated_spools_go_into_the_users_file_and_nothing_else_changes(
    run: Any, tmp_path: Path
) -> None:
    file, out = tmp_path / "config.g", tmp_path / "new.g"
    file.write_bytes(CONFIG.replace("\n", "\r\n").encode())
    robot = pk.import_printer(file, "hangprinter").robot
    assert pk.export.hangprinter(robot, out, config=file).exact
    assert out.read_bytes() == file.read_bytes()
    out.unlink()
    changes = {"drive2.spool": 75.9, "base1.y": -1600.0}
    changes["offset1"] = float(np.linalg.norm([16.4, -1600.0, -131.5]))
    changes |= {f"drive{i}.buildup": -0.07 * (4 if i == 4 else 2) for i in (1, 2, 3, 4)}
    better = robot.replace(changes)
    better.save(tmp_path / "better.toml")
    arguments = ("export", tmp_path / "better.toml", "--as", "hangprinter")
    assert run(*arguments, "--config", file, "--out", out).exit_code == 0
    new = out.read_bytes().decode()
    want = CONFIG.replace("16.4:-1610.9:-131.5", "16.400000:-1600.000000:-131.500000")
    want = want.replace("Q0.06875", "Q0.070000")
    want = want.replace("75.1:75.2:74.9:75.0", "75.100000:75.900000:74.900000:75.000000")
    assert new == want.replace("\n", "\r\n")
    nozzle = np.random.default_rng(2).uniform([-500, -500, 0], [500, 500, 900], (30, 3))
    turns = better.inverse(np.pad(nozzle, ((0, 0), (0, 3))))
    np.testing.assert_allclose(firmware_turns(new, nozzle), turns, rtol=0, atol=1e-6)


def test_turns_of_the_motors_lead_from_the_users_file_to_its_changed_numbers(
    run: Any, tmp_path: Path
) -> None:
    file, made = tmp_path / "config.g", tmp_path / "made"
    file.write_text(CONFIG)
    assert run("import", file, "--from", "hangprinter", "--out", made).exit_code == 0
    true = CONFIG.replace("R75.1:75.2:74.9:75.0", "R75.6:75.0:75.4:75.3")
    nozzle = np.random.default_rng(3).uniform([-600, -600, 0], [600, 600, 1000], (40, 3))
    deviations = np.full((40, 2), 0.01)
    table = np.hstack([firmware_turns(true, nozzle), nozzle, deviations])
    heading = "q1 [rev],q2 [rev],q3 [rev],q4 [rev],x [mm],y [mm],z [mm]"
    heading += ",sigma [mm],actuator_sigma [rev]"
    np.savetxt(tmp_path / "m.csv", table, "%.7f", ",", header=heading, comments="")
    files = (made / "robot.toml", tmp_path / "m.csv")
    done = run("calibrate", *files, "--free", "drive*.spool", "--report", tmp_path / "r")
    assert done.exit_code == 0, done.stderr
    assert "(0.1232 rad of the spool each)" in done.stderr
    (tmp_path / "mm.csv").write_text(
        (tmp_path / "m.csv").read_text().replace("sigma [rev]", "sigma [mm]")
    )
    done = run("calibrate", files[0], tmp_path / "mm.csv")  # turns are no mm
    assert done.exit_code == 2
    assert "has unit [mm], and 'q1' [rev]: expected the same" in " ".join(done.stderr.split())
    out = tmp_path / "new.g"
    arguments = ("export", tmp_path / "r" / "robot.toml", "--as", "hangprinter", "--out", out)
    assert run(*arguments, "--config", file).exit_code == 0
    radii = re.findall(r" R(\S+)", out.read_text())[0].split(":")
    np.testing.assert_allclose([float(r) for r in radii], [75.6, 75.0, 75.4, 75.3], atol=1e-3)


def test_spools_that_the_gears_have_not_are_refused_or_projected(
    refused: Any, tmp_path: Path
) -> None:
    (tmp_path / "config.g").write_text(CONFIG)
    robot = pk.import_printer(tmp_path / "config.g", "hangprinter").robot
    with pytest.raises(pk.ArgumentError, match=r"must be a config\.g whose M666 states"):
        pk.export.hangprinter(robot, tmp_path / "x.g")
    other = robot.replace({"gain1": robot.geometry["gain1"] * 1.01, "drive3.buildup": -0.2})
    with pytest.raises(pk.ArgumentError, match=r"one build-up and its gears.*off by \d"):
        pk.export.hangprinter(other, tmp_path / "x.g", config=tmp_path / "config.g")
    assert not (tmp_path / "x.g").exists()
    loss = pk.export.hangprinter(other, tmp_path / "x.g", True, tmp_path / "config.g")
    assert 1e-3 < loss.rms < 20.0
    for text, reason in (
        (CONFIG.replace("U2:2:2:4 ", ""), "U of M666 is missing"),
        (CONFIG.replace("H255:250", "H0:250"), "H of M666 must be above 0, found 0:250:255:255"),
    ):
        (tmp_path / "c.g").write_text(text)
        with pytest.raises(pk.FileError, match=reason):
            pk.import_printer(tmp_path / "c.g", "hangprinter")
    (tmp_path / "c.g").write_text(CONFIG.replace("W0", "W2.5 S20000"))
    assert "stretch of the lines, M666 W and S, is left out" in str(
        pk.import_printer(tmp_path / "c.g", "hangprinter")
    )


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
