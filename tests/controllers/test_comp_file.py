"""Screw tables for LinuxCNC: what its motion controller makes of them takes the machine there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.controllers.comp_file import without_laws

from ..driven import content, parsed

TABLE = [[500.0, 0.02], [700.0, -0.15], [900.0, 0.1], [1000.0, 0.3]]
DRIVES = [{"table": TABLE, "backlash": 0.06}, {"backlash": 0.1}, {"table": TABLE}]


def screws() -> pk.Robot:
    data = content(pk.load("hexapod"))
    for limb, drive in zip(data["limb"], DRIVES, strict=False):
        limb["drive"] = drive
    data["limb"][0] |= {"gain": -1.01, "offset": 3.0, "drive": {
        "table": [[-1000.0, 0.1], [-800.0, -0.1], [-600.0, 0.2]], "backlash": 0.06,
    }}  # fmt: skip
    return parsed(data)


def corrected(text: str, joint: np.ndarray, direction: int) -> np.ndarray:
    """Where the motor is sent for positions of the joint, as the motion controller interpolates."""
    nominal, forward, reverse = np.loadtxt(text.splitlines()).T
    return joint + np.interp(joint, nominal, forward if direction > 0 else reverse)


def test_the_motor_is_sent_where_the_law_takes_the_joint_to_its_pose(tmp_path: Path) -> None:
    robot = screws()
    pk.export.linuxcnc(robot, tmp_path / "mill")
    ini = (tmp_path / "mill" / "mill.ini").read_text(encoding="utf-8")
    assert ini.count("COMP_FILE_TYPE = 1") == 3 and "COMP_FILE = joint2.comp" in ini
    plain = without_laws(robot)
    poses = robot.home + np.random.default_rng(0).uniform(-1, 1, (50, 6)) * (
        [60.0, 60.0, 90.0, 0.2, 0.2, 0.2]
    )
    joints = plain.inverse(poses)  # what the kinematics module gives
    rng = np.random.default_rng(1)
    direction = rng.choice([-1, 1], joints.shape)
    motors = joints.copy()
    for i in range(3):
        text = (tmp_path / "mill" / f"joint{i}.comp").read_text(encoding="utf-8")
        for sign in (-1, 1):
            mine = direction[:, i] == sign
            motors[mine, i] = corrected(text, joints[mine, i], sign)
    reached = robot.approaching(direction).forward(motors, guess=poses).pose
    assert abs(reached[:, :3] - poses[:, :3]).max() < 1e-4  # backlash times the table's slope
    blind = robot.approaching(direction).forward(joints, guess=poses).pose
    assert abs(blind[:, :3] - poses[:, :3]).max() > 0.05
    assert not (tmp_path / "mill" / "joint3.comp").exists()


def test_a_machine_without_laws_has_the_same_files_as_ever(tmp_path: Path) -> None:
    pk.export.linuxcnc(pk.load("hexapod"), tmp_path / "plain")
    assert "COMP_FILE" not in (tmp_path / "plain" / "plain.ini").read_text(encoding="utf-8")


def test_a_table_is_read_back(tmp_path: Path) -> None:
    pk.export.linuxcnc(screws(), tmp_path / "mill")
    found = pk.import_comp_file(tmp_path / "mill" / "joint2.comp", rows="trims")
    law = [[float(q), float(c)] for q, c in zip(found.readings, found.corrections, strict=True)]
    assert abs(np.interp([500, 700, 900, 1000], *np.array(law).T) - np.array(TABLE)[:, 1]).max() < (
        1e-9
    )
    assert found.backlash == 0.0
    found = pk.import_comp_file(tmp_path / "mill" / "joint1.comp", rows="trims")
    assert found.backlash == pytest.approx(0.1) and abs(found.corrections).max() < 1e-12


def test_measured_positions_become_a_law_that_predicts_them(tmp_path: Path) -> None:
    """COMP_FILE_TYPE 0: where the joint was when sent somewhere from below, and from above."""
    nominal = np.linspace(600.0, 1000.0, 9)
    up = nominal + 0.1 * np.sin(nominal / 70.0)
    rows = np.column_stack([nominal, up, up + 0.03])
    (tmp_path / "x.comp").write_text(
        "\n".join(" ".join(map(repr, row)) for row in rows.tolist()), encoding="utf-8"
    )
    found = pk.import_comp_file(tmp_path / "x.comp")
    data = content(pk.load("hexapod"))
    data["limb"][0]["drive"] = found.drive
    robot = parsed(data)
    every = np.repeat(nominal[:, None], 6, axis=1)
    for direction, expected in ((1, up), (-1, up + 0.03)):
        one = robot.approaching(np.full(6, direction))
        assert abs(one.machine.drives(one.slots, every)[:, 0] - expected).max() < 1e-12


@pytest.mark.parametrize(("text", "message"), [
    ("", "a table has two or more lines of three numbers"),
    ("0 0 0\n# 1 1 1\n", "a table has two or more lines"),
    ("1 0 0\n0 0 0\n", "must be numbers, and rise"),
    ("1 0 0\nnan 0 0\n", "must be numbers, and rise"),
])  # fmt: skip
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "x.comp").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        pk.import_comp_file(tmp_path / "x.comp")


def test_laws_that_are_no_tables_go_into_the_component(tmp_path: Path) -> None:
    """Joints are then what the controller commands, and their limits the ends of the strokes."""
    data = content(pk.load("hexapod"))
    data["limb"][3] |= {"drive": {"quadratic": 1e-4}, "stroke": [500.0, 1200.0]}
    data["limb"][1]["drive"] = {"table": TABLE}
    robot = parsed(data)
    pk.export.linuxcnc(robot, tmp_path / "mill")
    files = {path.name for path in (tmp_path / "mill").iterdir()}
    assert files == {"pkm_mill.c", "mill.ini", "mill.hal"}  # genhexkins has no laws
    ini = (tmp_path / "mill" / "mill.ini").read_text(encoding="utf-8").partition("[JOINT_3]")[2]
    limits = dict(re.findall(r"(M\w+_LIMIT) = (\S+)", ini.partition("[JOINT_4]")[0]))
    for name, way in (("MIN_LIMIT", 500.0), ("MAX_LIMIT", 1200.0)):
        q = float(limits[name])
        assert q + 1e-4 * q * q == pytest.approx(way, rel=1e-12)


def test_a_law_that_no_table_holds_is_named(tmp_path: Path) -> None:
    data = content(pk.load("hexapod"))
    data["limb"][3]["drive"] = {"quadratic": 1e-6, "backlash": 0.1}
    with pytest.raises(
        ValueError, match=r"limb 4 of .* \(quadratic, backlash\), which a COMP_FILE"
    ):
        pk.export.linuxcnc(parsed(data), tmp_path / "mill")
    assert not (tmp_path / "mill").exists()
