"""printer.cfg in and out: the numbers of Klipper's model, and not a character more."""

from __future__ import annotations

import difflib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "examples" / "linear-delta" / "printer.cfg"
LOGS = ROOT.parent / "shared" / "data" / "klipper" / "logs.json"

OWN = """\
# mine
[include other.cfg]
[gcode_macro PARK]
gcode:
    G1 Z{printer.toolhead.position.z + 5}   # arm_length: 1
[stepper_a]
rotation_distance = 40 ; a belt
microsteps: 16
full_steps_per_rotation: 400
gear_ratio: 57:19, 2:1
position_endstop: 297.05 # by hand
arm_length: 333.0
[stepper_b]
rotation_distance: 40
microsteps: 32
[stepper_c]
rotation_distance: 40
microsteps: 16
position_endstop: 296.9
[printer]
kinematics: delta
delta_radius: 174.75

#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
#*# [printer]
#*# delta_radius = 170.000000
#*#
#*# [stepper_a]
#*# angle = -149.500000
#*#
#*# [stepper_b]
#*# arm_length = 334.250000
#*#
#*# [delta_calibrate]
#*# height0 = 1.250000
#*# height0_pos = 1000.500,2000.250,3000.000
#*# manual_height0 = -0.100
#*# manual_height0_pos = 4000.000,5000.000,6000.000
#*# distance0 = 65.5
#*# distance0_pos1 = 1,2,3
#*# distance0_pos2 = 4,5,6
"""


def own(folder: Path, text: str = OWN) -> Path:
    (folder / "mine.cfg").write_text(text)
    return folder / "mine.cfg"


def in_the_middle(radius: float, arm: float, endstop: float) -> float:
    """Height of a carriage whose nozzle is in the middle at the end stop's height."""
    return float(endstop + np.sqrt(arm**2 - radius**2))


def firmware_inverse(config: dict[str, Any], nozzle: Any) -> Any:
    """Klipper's published model: height of each carriage, (N, 3)."""
    angle = np.radians(config["angle"])
    towers = config["radius"] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = ((nozzle[:, None, :2] - towers) ** 2).sum(axis=2)
    return nozzle[:, 2:3] + np.sqrt(np.square(config["arm_length"]) - across)


def changed_lines(before: str, after: str) -> list[str]:
    diff = difflib.ndiff(before.splitlines(keepends=True), after.splitlines(keepends=True))
    return [line for line in diff if line[0] in "+-"]


def test_what_the_firmware_reads_is_what_is_imported(tmp_path: Path) -> None:
    """An option goes before the saved one; towers b and c take what a says; gears count."""
    printer = pk.import_printer(own(tmp_path))
    g = printer.robot.geometry
    assert (g["radius"], g["rod1"], g["rod2"], g["rod3"]) == (174.75, 333.0, 334.25, 333.0)
    angles = np.degrees([g[f"angle{i}"] for i in (1, 2, 3)])
    np.testing.assert_allclose(angles, [-149.5, 330.0, 90.0], rtol=1e-15)
    steps = [-40 / (16 * 400 * 6), -40 / (32 * 200), -40 / (16 * 200)]
    np.testing.assert_allclose([g[f"gain{i}"] for i in (1, 2, 3)], steps, rtol=1e-15)
    for i, (arm, endstop) in enumerate(((333.0, 297.05), (334.25, 297.05), (333.0, 296.9)), 1):
        assert g[f"offset{i}"] == pytest.approx(in_the_middle(174.75, arm, endstop), rel=1e-15)
    assert printer.measurements is not None and printer.measurements.kind == "height"
    np.testing.assert_array_equal(printer.measurements.values, [1.25, -0.1])
    np.testing.assert_array_equal(printer.measurements.actuators[0], [1000.5, 2000.25, 3000.0])
    assert printer.distances is not None and printer.distances.kind == "between"
    np.testing.assert_array_equal(printer.distances.actuators, [[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(printer.distances.other, [[4.0, 5.0, 6.0]])
    assert printer.distances.values.tolist() == [65.5]
    assert "1 distance of a printed part" in str(printer) and "rod1" in printer.robot.model.free


def test_imported_printer_goes_where_the_firmware_goes(tmp_path: Path) -> None:
    robot = pk.import_printer(own(tmp_path)).robot
    config = {"radius": 174.75, "angle": [-149.5, 330.0, 90.0], "arm_length": [333, 334.25, 333]}
    nozzle = np.random.default_rng(1).uniform([-90, -90, 0], [90, 90, 200], (50, 3))
    heights = firmware_inverse(config, nozzle)
    g = robot.geometry
    q = robot.inverse(np.pad(nozzle, ((0, 0), (0, 3))))
    for i in (1, 2, 3):
        rising = q[:, i - 1] * g[f"gain{i}"] + g[f"offset{i}"]
        np.testing.assert_allclose(rising, heights[:, i - 1], rtol=0, atol=1e-10)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_nothing_but_changed_numbers_is_touched(tmp_path: Path, newline: str) -> None:
    file = tmp_path / "mine.cfg"
    file.write_bytes(OWN.replace("\n", newline).encode())
    robot = pk.import_printer(file).robot
    out = tmp_path / "new.cfg"
    pk.export.klipper(robot, out, config=file)
    assert out.read_bytes() == file.read_bytes()
    pk.export.klipper(robot.replace({"rod2": 334.5, "angle1": np.radians(-149.0)}), out, file)
    endstop = in_the_middle(174.75, 334.25, 297.05) - in_the_middle(174.75, 334.5, 0.0)
    end = newline.replace("\r", "\\r").replace("\n", "\\n")
    found = changed_lines(file.read_bytes().decode(), out.read_bytes().decode())
    assert sorted(ascii(line)[1:-1].replace(end, "") for line in found) == sorted(
        [
            f"+ position_endstop: {endstop:.6f}",
            "- #*# angle = -149.500000",
            "+ #*# angle = -149.000000",
            "- #*# arm_length = 334.250000",
            "+ #*# arm_length = 334.500000",
        ]
    )


def indented(text: str, by: str) -> str:
    """Options further in than their sections, as configparser lets them be."""
    lines = text.partition("\n#*#")[0].splitlines()
    return "\n".join(line if line[:1] in "[#" else by + line for line in lines) + "\n"


@pytest.mark.parametrize("by", ["  ", "\t"])
def test_indented_options_are_read_and_written_where_they_are(tmp_path: Path, by: str) -> None:
    text = indented(OWN.replace("    G1 Z", "G1 Z"), by)
    file = own(tmp_path, text)
    robot = pk.import_printer(file).robot
    plain = pk.import_printer(own(tmp_path, OWN.partition("\n#*#")[0])).robot
    assert dict(robot.geometry.items()) == dict(plain.geometry.items())
    file = own(tmp_path, text)
    pk.export.klipper(robot.replace({"rod2": 334.5, "angle3": 1.6}), tmp_path / "n", config=file)
    lines = changed_lines(text, (tmp_path / "n").read_text())
    assert f"+ {by}arm_length: 334.500000\n" in lines
    assert f"+ {by}angle: {np.degrees(1.6):.6f}\n" in lines


def test_an_option_added_behind_a_changed_one_is_not_lost(tmp_path: Path) -> None:
    """Both stand in the last line of the section."""
    text = OWN.replace("microsteps: 32\n", "microsteps: 32\nangle: 329\n").partition("\n#*#")[0]
    file = own(tmp_path, text)
    robot = pk.import_printer(file).robot
    robot = robot.replace({"rod2": 334.5, "angle2": np.radians(331.0)})
    pk.export.klipper(robot, tmp_path / "n", config=file)
    again = pk.import_printer(tmp_path / "n").robot.geometry
    assert (again["rod2"], round(np.degrees(again["angle2"]), 9)) == (334.5, 331.0)


def test_a_value_goes_on_in_lines_that_are_indented_more(tmp_path: Path) -> None:
    """As configparser has it: what would be a second option is part of a number that is none."""
    file = own(tmp_path, OWN.replace("arm_length: 333.0", "arm_length:\n  333.0"))
    assert pk.import_printer(file).robot.geometry["rod1"] == 333.0
    pk.export.klipper(pk.import_printer(file).robot.replace({"rod1": 335.0}), tmp_path / "n", file)
    assert "arm_length:\n  335.000000\n" in (tmp_path / "n").read_text()
    text = OWN.replace("microsteps: 32", "microsteps: 32\n  arm_length: 340")
    with pytest.raises(pk.FileError, match=r"microsteps must be a number, found '32\\narm_length"):
        pk.import_printer(own(tmp_path, text))


def test_characters_that_end_no_line_do_not_and_a_mark_stays(tmp_path: Path) -> None:
    text = "\ufeff" + OWN.replace("# mine", "# mine\x0c[printer]\x85delta_radius: 1")
    file = own(tmp_path)
    file.write_text(text, encoding="utf-8", newline="")
    robot = pk.import_printer(file).robot
    assert robot.geometry["radius"] == 174.75
    pk.export.klipper(robot.replace({"rod2": 334.5}), tmp_path / "n", config=file)
    new = (tmp_path / "n").read_bytes().decode()
    assert new.startswith(text[:40])


def test_a_file_without_heights_says_what_stores_them(tmp_path: Path) -> None:
    """No `probe.csv` is written, which the next command of its owner would name."""
    for text, missing in ((OWN, False), (OWN.partition("\n#*#")[0], True)):
        printer = pk.import_printer(own(tmp_path, text))
        assert (printer.measurements is None) == missing
        assert any("SAVE_CONFIG" in note for note in printer.notes) == missing


def test_included_files_are_read_where_they_are_named_and_never_written(tmp_path: Path) -> None:
    file = own(tmp_path, OWN.replace("\n[printer]", "\n[include towers/*.cfg]\n[printer]", 1))
    (tmp_path / "towers").mkdir()
    (tmp_path / "towers" / "a.cfg").write_text("[stepper_a]\narm_length: 336\n[include b/c.cfg]\n")
    (tmp_path / "towers" / "b").mkdir()
    (tmp_path / "towers" / "b" / "c.cfg").write_text("[printer]\ndelta_radius: 1\n")
    printer = pk.import_printer(file)
    g = printer.robot.geometry
    assert (g["rod1"], g["rod3"], g["radius"]) == (336.0, 336.0, 174.75)  # named before [printer]
    assert printer.notes == ("other.cfg, included, is not there and was not read",)
    assert "other.cfg, included, is not there" in str(printer)
    with pytest.raises(
        pk.FileError, match=r"a\.cfg, line 2: \[stepper_a\] arm_length would be 337"
    ):
        pk.export.klipper(printer.robot.replace({"rod1": 337.0}), tmp_path / "n", config=file)
    assert not (tmp_path / "n").exists()
    pk.export.klipper(printer.robot.replace({"radius": 175.0}), tmp_path / "n", config=file)
    assert "delta_radius: 175.000000" in (tmp_path / "n").read_text()
    (tmp_path / "other.cfg").write_text("[include mine.cfg]\n")
    with pytest.raises(pk.FileError, match="includes itself"):
        pk.import_printer(file)


def test_a_value_that_names_itself_is_no_number(tmp_path: Path) -> None:
    text = OWN.replace("arm_length: 333.0", "arm_length: ${arm_length}")
    with pytest.raises(pk.FileError, match=r"line 12: .* arm_length names itself"):
        pk.import_printer(own(tmp_path, text))
    with pytest.raises(pk.FileError, match=r"\[rods\] long is missing"):
        pk.import_printer(own(tmp_path, text.replace("${arm_length}", "${rods.long}")))


def test_a_saved_block_that_the_firmware_leaves_out_is_not_read(tmp_path: Path) -> None:
    assert pk.import_printer(own(tmp_path, OWN + "\n\n")).measurements is not None
    text = OWN + "\n[gcode_macro LATE]\ngcode: G28\n"
    with pytest.raises(pk.FileError, match="line 44: behind SAVE_CONFIG lines must begin with"):
        pk.import_printer(own(tmp_path, text))


HEADER = "#*# <---------------------- SAVE_CONFIG ---------------------->"


def klippers_own(text: str) -> str:
    """The saved block as Klipper's _find_autosave_data() finds it; "" where it does not."""
    header = f"\n{HEADER}\n#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n"
    above, found, block = text.replace("\r\n", "\n").partition(header + "#*#\n")
    if not found or "\n#*# " in above or header in block:
        return ""
    lines = block.strip().split("\n")
    return block if all(line == "#*#" or line.startswith("#*# ") for line in lines) else ""


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# mine", "# mine\n#*# old", "line 2: begins with '#\\*# ' above SAVE_CONFIG"),
        ("# mine", "#*# mine", ""),  # the firmware looks behind line ends
        ("# mine", "# mine\n#*#", ""),
        ("# mine", "# mine\n #*# in", ""),
        (
            HEADER,
            HEADER.replace("--- S", "-- S"),
            "line 24: the three lines of SAVE_CONFIG's header",
        ),
        (HEADER, HEADER + " ", "line 24: the three lines of SAVE_CONFIG's header"),
        ("auto-generated.", "auto-generated", "line 24: the three lines of SAVE_CONFIG's header"),
        (
            "generated.\n#*#\n",
            "generated.\n#*# \n",
            "line 24: the three lines of SAVE_CONFIG's header",
        ),
        ("generated.\n#*#\n", "generated.\n", "line 24: the three lines of SAVE_CONFIG's header"),
        ("#*# [stepper_a]", HEADER + "\n#*# [stepper_a]", "line 30: behind SAVE_CONFIG"),
        ("#*# [stepper_a]", "[stepper_a]", "line 30: behind SAVE_CONFIG"),
    ],
)
def test_a_saved_block_counts_where_the_firmware_takes_it(
    old: str, new: str, message: str, newline: str, tmp_path: Path
) -> None:
    text = OWN.replace(old, new, 1).replace("\n", newline)
    assert text != OWN.replace("\n", newline)
    (tmp_path / "mine.cfg").write_bytes(text.encode())
    if message:
        with pytest.raises(pk.FileError, match=message):
            pk.import_printer(tmp_path / "mine.cfg")
    else:
        assert klippers_own(text) and pk.import_printer(tmp_path / "mine.cfg").measurements
    if not new.startswith(HEADER + "\n"):  # that is no line of any section, and refused as such
        assert bool(klippers_own(text)) is not bool(message)


def test_comments_stay_and_a_gain_becomes_a_rotation_distance(tmp_path: Path) -> None:
    file = own(tmp_path)
    robot = pk.import_printer(file).robot
    gain = robot.geometry["gain1"] * 1.01
    pk.export.klipper(robot.replace({"gain1": gain, "radius": 175.0}), tmp_path / "n", file)
    text = (tmp_path / "n").read_text()
    assert "rotation_distance = 40.400000 ; a belt\n" in text
    assert "delta_radius: 175.000000\n" in text and "delta_radius = 170.000000\n" in text
    assert " # by hand\n" in text
    again = pk.import_printer(tmp_path / "n").robot
    assert again.geometry["gain1"] == pytest.approx(gain, rel=1e-9)
    far = robot.replace({"gain2": -3.0})
    with pytest.raises(pk.ArgumentError, match=r"moves a carriage by 3 mm.*\[stepper_b\]"):
        pk.export.klipper(far, tmp_path / "far", file)
    assert not (tmp_path / "far").exists()


def test_exported_numbers_are_the_robot(tmp_path: Path) -> None:
    """Joints of the platform, heights of joints and all: read back, the same motion."""
    limbs = [
        {"platform": robots.ring(20.0, a, -7.0), "offset": 600.0 + a / 100} for a in (210, 330)
    ]
    limbs += [{"platform": robots.ring(20.0, 90, -7.0), "offset": 601.0}]
    robot = robots.linear_delta(*[limb | {"gain": -1.0, "rod": 340.5} for limb in limbs])
    loss = pk.export.klipper(robot, tmp_path / "lines")
    assert loss.exact
    steppers = "".join(f"[stepper_{a}]\nmicrosteps: 1\nrotation_distance: 200\n" for a in "abc")
    file = own(tmp_path, "[printer]\nkinematics: delta\n" + steppers)
    pk.export.klipper(robot, file, config=file)
    again = pk.import_printer(file).robot
    poses = np.zeros((20, 6))
    poses[:, :3] = np.random.default_rng(2).uniform([-60, -60, 0], [60, 60, 99], (20, 3))
    found = again.forward(robot.inverse(poses)).pose
    np.testing.assert_allclose(found, poses, rtol=0, atol=1e-5)  # six decimals in the file


def test_what_the_firmware_cannot_hold_is_refused_or_projected(tmp_path: Path) -> None:
    robot = pk.import_printer(own(tmp_path)).robot
    leaning = robot.replace({"slider1.tilt1": 0.003})
    with pytest.raises(pk.ArgumentError, match=r"one radius and vertical towers.*off by 0\.\d+ mm"):
        pk.export.klipper(leaning, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    file = own(tmp_path)
    loss = pk.export.klipper(leaning, file, config=file, project=True)
    nearest = pk.import_printer(file).robot
    poses = np.zeros((400, 6))
    poses[:, :3] = np.random.default_rng(3).uniform([-95, -95, 0], [95, 95, 140], (400, 3))
    q = leaning.inverse(poses)
    off = np.linalg.norm((nearest.forward(q).pose - poses)[:, :3], axis=1)
    before = np.linalg.norm((robot.forward(q).pose - poses)[:, :3], axis=1)
    assert np.sqrt((off**2).mean()) < min(1.2 * loss.rms, 0.3 * np.sqrt((before**2).mean()))
    assert off.max() < 1.2 * loss.worst


def test_other_machines_are_refused(tmp_path: Path) -> None:
    for name in ("hexapod", "linear-delta-6"):
        with pytest.raises(pk.ArgumentError, match="no linear delta"):
            pk.export.klipper(pk.load(name), tmp_path / "x")
    with pytest.raises(pk.ArgumentError, match="q must be 0 at the end stops"):
        pk.export.klipper(pk.load("linear-delta"), tmp_path / "x")
    with pytest.raises(pk.ArgumentError, match="and q 0 at the end stops"):
        pk.export.klipper(pk.load("rotary-delta"), tmp_path / "x")
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "kinematics: delta",
            "kinematics: corexy",
            "line 21: [printer] kinematics must be delta or rotary",
        ),
        ("microsteps: 32", "", "[stepper_b] microsteps is missing"),
        (
            "arm_length: 333.0",
            "arm_length: long",
            "line 12: [stepper_a] arm_length must be a number",
        ),
        ("arm_length: 333.0", "arm_length: 150", "line 12: [stepper_a] arm_length must be above"),
        ("57:19", "57/19", "line 10: [stepper_a] gear_ratio must be like"),
        *(
            ("57:19", ratio, "line 10: [stepper_a] gear_ratio must be like")
            for ratio in ("0:19", "57:0", "-57:19", "57:nan", "inf:1", "57:19:2")
        ),
        ("microsteps: 32", "microsteps: 0", "line 15: [stepper_b] microsteps must be above 0"),
        ("1000.500,2000.250,3000.000", "1,2", "[delta_calibrate] height0_pos must be 3 numbers"),
    ],
)
def test_mistakes_are_named_with_their_line(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(pk.FileError) as caught:
        pk.import_printer(own(tmp_path, OWN.replace(old, new)))
    assert message in str(caught.value)


def stored(log: dict[str, Any], longer: float) -> str:
    """A printer.cfg with what is measured in a log, and with numbers that are off."""
    text = f"[printer]\nkinematics: delta\ndelta_radius: {log['radius'] + 1.5}\n"
    for i, axis in enumerate("abc"):
        text += f"[stepper_{axis}]\nrotation_distance: {log['stepdist'][i] * 3200!r}\n"
        text += f"microsteps: 16\narm_length: {log['arm_length'][i] + longer * i}\n"
        text += f"angle: {log['angle'][i] + 0.3 * (i - 2)}\n"
        text += f"position_endstop: {log['position_endstop'][i] - 1 + i}\n"
    text += "[delta_calibrate]\n"
    for i, (height, pos) in enumerate(zip(log["height"], log["pos"], strict=True)):
        text += f"height{i}: {height}\nheight{i}_pos: {','.join(map(str, pos))}\n"
    for i, (distance, *ends) in enumerate(log.get("distance") or []):
        text += f"distance{i}: {distance}\n"
        for end, pos in enumerate(ends, 1):
            text += f"distance{i}_pos{end}: {','.join(map(str, pos))}\n"
    return text


@pytest.mark.skipif(not LOGS.exists(), reason=f"{LOGS} is not here")
def test_real_logs_lead_to_what_the_firmware_found(tmp_path: Path) -> None:
    """Four printers: from numbers that are off, the stored heights lead to the saved ones."""
    logs = [log for log in json.loads(LOGS.read_text()) if not log.get("distance")]
    assert logs
    for log in logs:
        file = own(tmp_path, stored(log, 0.0))
        printer = pk.import_printer(file)
        assert printer.measurements is not None
        found = pk.identify(printer.robot, printer.measurements)
        pk.export.klipper(found.robot, file, config=file)
        lines = file.read_text()

        def written(option: str, lines: str = lines) -> list[float]:
            named = (line.split(": ") for line in lines.splitlines() if line.startswith(option))
            return [float(value) for name, value in named if name == option]

        np.testing.assert_allclose(written("delta_radius"), log["radius"], atol=1e-3)
        np.testing.assert_allclose(written("angle"), log["angle"], atol=1e-3)
        endstops, saved = written("position_endstop"), np.array(log["position_endstop"])
        shift = endstops - saved  # of all three alike: the first layer, set by hand afterwards
        assert abs(shift).max() < 0.1
        np.testing.assert_allclose(shift, shift.mean(), rtol=0, atol=1e-3)


@pytest.mark.skipif(not LOGS.exists(), reason=f"{LOGS} is not here")
def test_distances_of_a_print_lead_to_the_nine_numbers_the_firmware_found(
    run: Any, tmp_path: Path
) -> None:
    """From rods and all that are off, through files in steps, with the firmware's own weights.

    calculate_params() of Klipper's delta_calibrate.py weighs heights by 2 n_distances / n_heights.
    """
    logs = [log for log in json.loads(LOGS.read_text()) if log.get("distance")]
    assert len(logs) == 2
    for log in logs:
        out = tmp_path / str(log["printer"]).replace(" ", "")
        assert run("import", own(tmp_path, stored(log, 0.5)), "--out", out).exit_code == 0
        robot = pk.load(out / "robot.toml")
        assert {"rod1", "rod2", "rod3"} < set(robot.model.free)
        heights = pk.read_measurements(out / "probe.csv", robot)
        distances = pk.read_measurements(out / "distances.csv", robot)
        assert (len(heights), len(distances), distances.kind) == (7, 12, "between")
        weight = 2.0 * len(distances) / len(heights)
        both = [replace(heights, sigma=0.2 / weight**0.5), replace(distances, sigma=0.2)]
        g = pk.identify(robot, both).robot.geometry
        np.testing.assert_allclose([g[f"rod{i}"] for i in (1, 2, 3)], log["arm_length"], atol=1e-3)
        assert g["radius"] == pytest.approx(log["radius"], abs=1e-3)
        angles = np.degrees([g[f"angle{i}"] for i in (1, 2, 3)])
        np.testing.assert_allclose(angles, log["angle"], atol=1e-3)
        carriages = [in_the_middle(g["radius"], g[f"rod{i}"], 0.0) for i in (1, 2, 3)]
        shift = [g[f"offset{i}"] for i in (1, 2, 3)] - np.add(carriages, log["position_endstop"])
        assert abs(shift).max() < 0.3  # of all three alike: the first layer, set by hand
        np.testing.assert_allclose(shift, shift.mean(), rtol=0, atol=1e-3)


def test_three_commands_lead_from_a_config_to_its_changed_lines(run: Any, tmp_path: Path) -> None:
    folder = str(tmp_path / "made")
    assert run("import", CONFIG, "--out", folder).exit_code == 0
    robot, probe = f"{folder}/robot.toml", f"{folder}/probe.csv"
    assert run("calibrate", robot, probe, "--report", f"{folder}/report").exit_code == 0
    out = tmp_path / "new.cfg"
    calibrated = f"{folder}/report/robot.toml"
    done = run("export", calibrated, "--as", "klipper", "--config", CONFIG, "--out", out)
    assert (done.exit_code, done.stdout) == (0, f"{out}: printer\n")
    names = {line[2:].split(":")[0] for line in changed_lines(CONFIG.read_text(), out.read_text())}
    assert names == {"position_endstop", "angle", "delta_radius"}
    probed = pk.import_printer(out)
    assert probed.measurements is not None
    z = probed.robot.forward(probed.measurements.actuators).pose[:, 2]
    assert np.sqrt(np.mean((z - probed.measurements.values) ** 2)) < 0.03
    assert run("import", CONFIG, "--out", folder).exit_code == 0  # nobody has touched it
    Path(robot).write_text(Path(robot).read_text() + "# mine\n")
    again = run("import", CONFIG, "--out", folder)
    assert again.exit_code == 2 and "would be replaced" in again.stderr


def test_options_of_another_target_are_refused(refused: Any, tmp_path: Path) -> None:
    arguments = ("export", "hexapod", "--out", tmp_path / "x", "--as")
    assert "--config says nothing of --as c" in refused(*arguments, "c", "--config", CONFIG)
    assert "--number says nothing" in refused(*arguments, "klipper", "--number", "float")
    assert "--number must be double or float" in refused(*arguments, "c", "--number", "half")
    assert "--as" in refused(*arguments, "basic")
