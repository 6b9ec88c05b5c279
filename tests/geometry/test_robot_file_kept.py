"""A calibrated robot file is the user's: only values differ, and they are the calibrated ones."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

pytest.importorskip("tomlkit")

FILE = """\
# our printer, no. 7
name = 'printer'   # as on the plate
units = { angle = "deg", length = "in" }

[pose]
map = "translation"
home = { z = 1.5 }

[parameters]
# from the data sheet
radius = 6.25 # inch
angle1 = 210

rod    = 13.5 # new belts; ± 0.5

[[limb]] # the front left
offset = 24.0
kind = "PUS"
rod = "rod"
base = { radius = "radius", angle = "angle1", z = 0 }
platform = [0, 0.0, 0.0]  # measured from
slider = [0, 0, 1]
branch = -1

[[limb]]
kind = "PUS"
base = {radius=6.25, angle = 330.0, z=0.0} # by hand
platform = [
  0.0, # x
  0.0,
  0.0 ]
slider = [0, 0, 1]
rod = "rod"
offset = 24.0
branch = -1

[[limb]]
kind = "PUS"
base = [0.0, 6.25, 0.0]
platform = [0.0, 0.0, 0.0]
slider = [0, 0, 1]
slider_tilt = [0.0, 0.0]
rod = 13.5
offset = 24.0
branch = -1
"""
CHANGES = {
    "radius": 160.123456789,
    "angle1": 3.67,
    "rod": 344.25,
    "offset1": 610.5,
    "base2.x": 138.0,
    "base2.y": -79.75,
    "base3.x": 0.125,
    "slider2.tilt1": 0.001,
    "slider3.tilt2": -0.002,
    "gain3": 1.0005,
}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "mine.toml").write_text(FILE)
    return tmp_path / "mine.toml"


def words(line: str) -> str:
    """A line without its numbers, and without what was said of deviations."""
    return re.sub(r"[-+]?[0-9.]+(e-?[0-9]+)?", "0", re.sub(r"\s*[;#]?\s*±.*", "", line))


def test_only_values_change(source: Path, tmp_path: Path) -> None:
    robot = pk.load(source).replace(CHANGES)
    robot.save(tmp_path / "new.toml", like=source)
    new, old = (tmp_path / "new.toml").read_text().splitlines(), FILE.splitlines()
    added = [line for line in new if line.startswith(("slider_tilt = [0.05", "gain"))]
    assert len(added) == 2
    kept = [line for line in new if line not in added]
    assert [words(line) for line in kept] == [words(line) for line in old]
    again = pk.load(tmp_path / "new.toml")
    np.testing.assert_allclose(again.geometry.values, robot.geometry.values, rtol=1e-14, atol=1e-13)


def test_a_file_without_changes_is_the_same_to_the_letter(source: Path, tmp_path: Path) -> None:
    pk.load(source).save(tmp_path / "new.toml", like=source)
    assert (tmp_path / "new.toml").read_text() == FILE


def test_deviations_are_comments_in_the_files_units_beside_the_users(
    source: Path, tmp_path: Path
) -> None:
    deviations = {"rod": 0.0254, "angle1": np.radians(0.12), "base3.x": 2.54, "offset2": np.inf}
    robot = pk.load(source).replace({"rod": 344.25, "base3.x": 0.125})
    robot.save(tmp_path / "new.toml", like=source, deviations=deviations)
    text = (tmp_path / "new.toml").read_text()
    assert re.search(r"^rod    = 13\.55\d+ # new belts; ± 0\.001$", text, re.M)
    assert re.search(r"^angle1 = 210\s+# ± 0\.12$", text, re.M)
    assert re.search(r"^base = \[0\.0049\d+, 6\.25, 0\.0\]\s+# ± 0\.1, fixed, fixed$", text, re.M)
    assert re.search(r"^offset = 24\.0\s+# ± inf$", text, re.M)


def test_a_second_calibration_replaces_what_the_first_said(source: Path, tmp_path: Path) -> None:
    robot, first, second = pk.load(source), tmp_path / "1.toml", tmp_path / "2.toml"
    head = "# Written by pkmcal 1 from\n#   mine.toml, sha256 00ff\n"
    robot.save(first, head, like=source, deviations={"rod": 25.4})
    robot.save(second, head.replace("1", "2"), like=first, deviations={"rod": 50.8})
    text = second.read_text()
    assert text.startswith(head.replace("1", "2") + "# our printer, no. 7\n")
    assert text.count("±") == 1 and "# new belts; ± 2\n" in text


def test_deviations_beside_a_radius_and_an_angle_say_what_they_are_of(tmp_path: Path) -> None:
    """A joint at 90° has its radius along y: what is said of x is no deviation of the radius."""
    source = tmp_path / "3rps.toml"
    text = (Path(pk.__file__).parent / "builtin" / "machines" / "3rps.toml").read_text("utf-8")
    source.write_text(text, "utf-8")
    robot = pk.load(source)
    moved = robot.replace({"platform2.y": robot.geometry["platform2.y"] + 0.1})
    said = {"platform2.x": 0.004, "platform2.y": 0.02, "base3.z": 0.3}
    out = tmp_path / "out.toml"
    moved.save(out, like=source, deviations=said)
    (line,) = [each for each in out.read_text("utf-8").splitlines() if "±" in each]
    assert line.startswith("platform = { radius = ")
    assert line.endswith("# ± x 0.004, y 0.02, z fixed")
    again = tmp_path / "again.toml"
    moved.save(again, like=out, deviations={"platform2.y": 0.5})
    assert "± x fixed, y 0.5, z fixed" in again.read_text("utf-8")
    assert again.read_text("utf-8").count("±") == 1


def test_line_ends_of_windows_stay(source: Path, tmp_path: Path) -> None:
    source.write_bytes(FILE.replace("\n", "\r\n").encode())
    pk.load(source).replace({"radius": 160.0}).save(tmp_path / "new.toml", like=source)
    content = (tmp_path / "new.toml").read_bytes()
    assert content.count(b"\n") == content.count(b"\r\n") == FILE.count("\n")


def test_another_robots_file_is_refused(source: Path, tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="describes another robot"):
        pk.load("hexapod").save(tmp_path / "new.toml", like=source)
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize("name", [n for n in pk.machines() if n != "3r"])
def test_every_number_of_every_machine_can_be_written(name: str, tmp_path: Path) -> None:
    robot, source = pk.load(name), Path(pk.__file__).parent / f"builtin/machines/{name}.toml"
    free = ~robot.geometry.tied
    rng = np.random.default_rng(0)
    values = robot.geometry.values + free * rng.uniform(-1e-3, 1e-3, free.size)
    changed = robot.replace(
        dict(zip(np.array(robot.geometry.names)[free], values[free], strict=True))
    )
    changed.save(tmp_path / "new.toml", like=source)
    again = pk.load(tmp_path / "new.toml").geometry
    np.testing.assert_allclose(again.values, changed.geometry.values, rtol=1e-13, atol=1e-12)
