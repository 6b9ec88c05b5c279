"""From the files and the documented commands alone: a printer's new values, a sheet to sign."""

from __future__ import annotations

import datetime
import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pkmcal.files.toml_lines import tomllib

ROOT = Path(__file__).resolve().parents[2]
NOISE = 0.01


# --- the owner of a printer --------------------------------------------------------------------


def test_from_printer_cfg_to_new_values(run: Any, tmp_path: Path) -> None:
    """The commands are those of docs/klipper.md, one by one."""
    page = (ROOT / "docs" / "klipper.md").read_text("utf-8")
    commands = [shlex.split(line[2:]) for line in page.splitlines() if line.startswith("$ ")]
    assert [command[:2] for command in commands[:3]] == [
        ["pkmcal", "import"], ["pkmcal", "calibrate"], ["pkmcal", "export"],
    ]  # fmt: skip
    config = ROOT / "examples" / "linear-delta" / "printer.cfg"
    (tmp_path / "printer.cfg").write_bytes(config.read_bytes())
    for command in commands[:3]:
        assert run(*command[1:]).exit_code == 0, command
    new = (tmp_path / "new.cfg").read_text("utf-8")
    robot = tomllib.loads((tmp_path / "report" / "robot.toml").read_text("utf-8"))
    radius = robot["parameters"]["radius"]
    assert float(_value(new, "delta_radius")) == pytest.approx(radius, abs=1e-4)
    rod, offset = robot["limb"][0]["rod"], robot["limb"][0]["offset"]
    end = offset - np.sqrt(rod**2 - radius**2)
    stepper = new.split("[stepper_a]")[1].split("\n[")[0]
    stated = next(part for part in (stepper, new) if "position_endstop" in part)
    assert float(_value(stated, "position_endstop")) == pytest.approx(end, abs=1e-3)


def _value(text: str, key: str) -> str:
    """The last value of a key: the block of SAVE_CONFIG counts."""
    return re.findall(rf"^(?:#\*# )?{key}\s*[:=]\s*(\S+)", text, re.MULTILINE)[-1]


# --- the metrologist ---------------------------------------------------------------------------

BASE = np.radians([110, 130, 230, 250, -10, 10])
PLATFORM = np.radians([70, 170, 190, 290, -50, 50])
HOME = np.array([0, 0, 760.0, 0, 0, 0])
GROSS = ((17, 1, [0.0, 0.9, 0.0]), (41, 0, [-0.35, 0.2, 0.5]))


def _joints(radius: float, angles: np.ndarray, z: float) -> np.ndarray:
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(6, z)])


def _lengths(pose: np.ndarray, base: np.ndarray, platform: np.ndarray) -> np.ndarray:
    turned = Rotation.from_euler("xyz", pose[3:]).apply(platform)
    return np.linalg.norm(pose[:3] + turned - base, axis=1)


@pytest.fixture(scope="module")
def hexapod(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot file, the export of a tracker, and the log of a controller; none by the package.

    Struts 3 and 4 are exchanged in the log, two readings are gross errors.
    """
    folder, rng = tmp_path_factory.mktemp("metrologist"), np.random.default_rng(42)
    base, platform = _joints(508.0, BASE, 0.0), _joints(304.8, PLATFORM, -38.1)
    off = rng.normal(0, 0.4, 6)
    true = base + rng.normal(0, 0.2, (6, 3)), platform + rng.normal(0, 0.2, (6, 3))
    poses = HOME + rng.uniform(-1, 1, (60, 6)) * [120, 120, 90, 0.25, 0.25, 0.3]
    poses[[0, 10, 20, 30]] = HOME
    log = np.array([_lengths(pose, base, platform) for pose in poses])
    reflectors = np.array([[280, 0, 35], [-140, 242, 35], [-140, -242, 38.0]])
    reflectors += rng.normal(0, 2, (3, 3))
    frame = Rotation.from_euler("xyz", [-0.02, 0.03, 1.1])
    points = np.zeros((60, 3, 3))
    for i, start in enumerate(poses):
        at = least_squares(
            lambda pose, wanted=log[i] + off: _lengths(pose, *true) - wanted, start, x_scale="jac",
            xtol=1e-14, ftol=1e-14, gtol=1e-14,
        ).x  # fmt: skip
        seen = at[:3] + Rotation.from_euler("xyz", at[3:]).apply(reflectors)
        points[i] = frame.apply(seen) + np.array([2650.3, -1820.7, 311.2])
    points += rng.normal(0, NOISE, points.shape)
    for i, k, error in GROSS:
        points[i, k] += error
    log[:, [2, 3]] = log[:, [3, 2]]
    begin = datetime.datetime(2026, 11, 3, 9)
    lines = ["// SpatialAnalyzer export", "// Units: Millimeters, Degrees"]
    lines.append("// Collection, Group, Point, X, Y, Z, Timestamp, Temp C")
    for i, pose in enumerate(points):
        for k, point in enumerate(pose):
            when = (begin + datetime.timedelta(seconds=45 * i + 12 + 6 * k)).isoformat(" ")
            cells = ", ".join(f"{number:.4f}" for number in point)
            lines.append(f"A, HexCal, P{i + 1:02d}_SMR{k + 1}, {cells}, {when}, 20.1")
    (folder / "tracker.txt").write_text("\n".join(lines) + "\n", "utf-8")
    rows = ["timestamp;prog_line;strut1;strut2;strut3;strut4;strut5;strut6;inpos"]
    plain = [rows[0].partition(";")[2]]
    for i, row in enumerate(log):
        when = (begin + datetime.timedelta(seconds=45 * i)).isoformat(" ")
        numbers = ";".join(f"{number:.4f}" for number in row)
        rows.append(f"{when};N{10 * i + 10};{numbers};1")
        plain.append(f"N{10 * i + 10};{numbers};1")
    (folder / "log.csv").write_text("\n".join(rows) + "\n", "utf-8")
    late = [plain[0], *plain[2:], plain[-1]]  # begun a pose too late
    (folder / "late.csv").write_text("\n".join(late) + "\n", "utf-8")
    limbs = "".join(
        f'[[limb]]\nkind = "UPS"\nbase = {{ radius = 508.0, angle = {a:.0f}, z = 0 }}\n'
        f"platform = {{ radius = 304.8, angle = {b:.0f}, z = -38.1 }}\n"
        for a, b in zip(np.degrees(BASE), np.degrees(PLATFORM), strict=True)
    )
    head = 'name = "GS"\nunits = { length = "mm", angle = "deg" }\n[pose]\nmap = "spatial"\n'
    free = '[calibration]\nfree = ["base*", "platform*", "offset*"]\n'
    (folder / "gs.toml").write_text(f"{head}home = {{ z = 760 }}\n{free}{limbs}", "utf-8")
    (folder / "certificate.toml").write_text('serial = "0042"\noperator = "N. N."\n', "utf-8")
    return folder


@pytest.fixture
def command(hexapod: Path) -> list[Any]:
    files = hexapod / "gs.toml", hexapod / "tracker.txt"
    return ["calibrate", *files, "--frame", "unknown", "--target", "unknown", "--units", "mm"]


EXCHANGED = ("--rename", "strut3=q4", "--rename", "strut4=q3")


def test_exchanged_struts_are_named(run: Any, command: list[Any], hexapod: Path) -> None:
    result = run(*command, "--controller", hexapod / "log.csv")
    assert result.exit_code in (1, 2)  # a search that ends nowhere near, or none that can begin
    assert "if q3 and q4 are exchanged" in " ".join(result.output.split())


@pytest.mark.parametrize(
    "options", [(), ("--holdout", "0.2", "--drop-outliers", "--datum", "auto")], ids=str
)
def test_a_log_that_is_a_row_late_is_named(
    run: Any, command: list[Any], hexapod: Path, options: tuple[str, ...]
) -> None:
    late = ("--controller", hexapod / "late.csv", "--join", "row", *EXCHANGED)
    result = run(*command, *late, *options)
    assert result.exit_code != 0
    said = result.stdout + result.stderr
    assert "belongs to the pose 1 " in " ".join(said.split())


def test_a_log_that_is_a_row_late_is_joined_as_its_message_says(
    run: Any, command: list[Any], hexapod: Path
) -> None:
    late = ("--controller", hexapod / "late.csv", *EXCHANGED)
    result = run(*command, *late, "--join", "row")
    said = " ".join((result.stdout + result.stderr).split())
    there = re.search(r"belongs to the pose 1 (before|after) it", said)
    assert there is not None
    join = "row+1" if there[1] == "after" else "row-1"
    result = run(*command, *late, "--join", join, "--drop-outliers", "--holdout", "0.2")
    assert result.exit_code == 0, result.stdout + result.stderr
    assert f"each with the row 1 {there[1]} it" in result.stderr


def test_from_two_raw_files_to_a_sheet(
    run: Any, command: list[Any], hexapod: Path, tmp_path: Path
) -> None:
    """The command is that of docs/certificate.md."""
    page = " ".join((ROOT / "docs" / "certificate.md").read_text("utf-8").split())
    options = ("--drop-outliers", "--datum", "auto", "--certificate", "certificate.toml")
    assert " ".join(options) in page
    options = (*options[:-1], str(hexapod / "certificate.toml"))
    result = run(
        *command, "--controller", hexapod / "log.csv", *EXCHANGED, *options, "--holdout", "0.2",
        "--report", tmp_path / "sheet",
    )  # fmt: skip
    assert result.exit_code == 0, result.stdout + result.stderr
    said = " ".join(result.stdout.split())
    assert said.startswith("Calibrated: ")
    for i, k, _ in GROSS:
        assert f"line {4 + 3 * i + k}, pose {i + 1} (SMR{k + 1})" in said
    assert "± inf" not in said
    told = json.loads((tmp_path / "sheet" / "report.json").read_text("utf-8"))
    found = told["calibration"]
    assert found["holdout_rms"] < 3.0 * NOISE < found["holdout_rms_before"]
    assert len(found["datum"]["names"]) == 12 and len(found["dropped"]) == 2
    assert told["certificate"]["expanded_uncertainty"] > 2.0 * NOISE
    assert 'id="certificate"' in (tmp_path / "sheet" / "report.html").read_text("utf-8")


def test_arguments_in_another_order_are_told(run: Any, refused: Any) -> None:
    run("new", "hexapod", "mine.toml")
    Path("m.csv").write_text("q1 [mm],z [mm]\n1,2\n")
    Path("printer.cfg").write_text("[printer]\nkinematics: delta\n")
    assert refused("calibrate", "m.csv", "mine.toml") == (
        "m.csv: measurements, where a robot is needed: the robot comes first"
    )
    assert refused("calibrate", "hexapod", "mine.toml") == (
        "mine.toml: a robot file, where measurements are needed"
    )
    assert "pkmcal import makes one of it" in refused("calibrate", "printer.cfg", "m.csv")
