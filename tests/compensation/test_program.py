"""G-code for a controller with other numbers: the machine goes where the program meant."""

from __future__ import annotations

import json
import re
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots
from ..driven import content, parsed

DELTA = pk.load("linear-delta")
OFF = {"rod1": 215.6, "base2.x": DELTA.geometry["base2.x"] + 0.4, "offset3": 0.3}
OFF |= {"slider1.tilt1": 0.003}
PRINT = """\
; printed by hand: G1 X1 Y2 Z3
M117 Hello (world) X5
PRINT_START BED=60
M203 X80 Y80
G90
G21
M82
G92 E0
G1 X-60 Y0 Z10 F3000 ; first
G1 X60 E6.5 F1200
G4 P200
G1 Y10.5
G0 X0 Y0 Z50
G91
G1 Z5
G1 X10 Y-10
G90
M83
N70 G01 X 30 Y30.000 E2.5 S100
M104 S0
%
"""
HEXAPOD_CHANGES = {"base1.x": 306.0, "platform3.z": 0.5, "offset5": -0.4, "base4.y": -208.0}


def corrected(tmp_path: Path, text: str, **options: Any) -> pk.CorrectedProgram:
    path = tmp_path / "part.gcode"
    path.write_bytes(text.encode())
    options = {"firmware": "linuxcnc" if options.get("joints") else "marlin"} | options
    return pk.compensate_program(DELTA, DELTA.replace(OFF), path, **options)


def followed(text: str, letters: str = "XYZ") -> Any:
    """Positions that a controller commands, one a move: an interpreter of its own."""
    at, relative, rows = dict.fromkeys(letters, 0.0), False, []
    for line in text.splitlines():
        code = re.sub(r"\(.*?\)|;.*", "", line)
        if re.match(r"\s*(M|PRINT|G92|%)", code):
            continue
        relative = ("G91" in code) if re.search("G9[01]", code) else relative
        words = re.findall(r"([A-Z])\s*([-\d.]+)", code)
        axes = [(letter, float(value)) for letter, value in words if letter in letters]
        for letter, value in axes:
            at[letter] = at[letter] + value if relative else value
        if axes:
            rows.append([at[letter] for letter in letters])
    return np.array(rows)


def in_pose(rows: Any) -> Any:
    return np.concatenate([rows, np.zeros_like(rows)], axis=-1)


def test_the_machine_goes_where_the_program_meant(tmp_path: Path) -> None:
    found = corrected(tmp_path, PRINT, chord=100.0)
    assert found.moves == found.segments == 7
    meant, commanded = followed(PRINT), followed(found.text)
    assert np.abs(commanded - meant).max() > 0.2  # without correction it would miss by as much
    reached = DELTA.replace(OFF).forward(DELTA.inverse(in_pose(commanded))).pose
    np.testing.assert_allclose(reached[:, :3], meant, rtol=0, atol=3e-5)  # five decimals, added up


def test_only_axis_words_change(tmp_path: Path) -> None:
    for newline in ("\n", "\r\n"):
        text = PRINT.replace("\n", newline)
        found = corrected(tmp_path, text, chord=100.0).text

        def without_axes(program: str) -> list[str]:
            moves = re.compile(r"^(?:N70 )?G0?[01] [^;(]*", re.MULTILINE)
            kept = [re.sub(r"[XYZ] ?[-\d.]+", "", line) for line in program.splitlines(True)]
            return [
                re.sub(r" +", " ", line).replace(" \r", "\r").strip(" ")
                if moves.match(old)
                else old
                for old, line in zip(program.splitlines(True), kept, strict=True)
            ]

        before, after = without_axes(text), without_axes(found)
        assert [re.sub(r"\s+", "", a) for a in after] == [re.sub(r"\s+", "", b) for b in before]
        assert all(line.endswith(newline) for line in found.splitlines(True))
        untouched = [line for line in text.splitlines() if re.match(r"[;M%P]|G4|G9[012]", line)]
        assert [line for line in found.splitlines() if line in untouched] == untouched


def test_a_machine_without_errors_keeps_its_program_to_the_character(tmp_path: Path) -> None:
    path = tmp_path / "part.gcode"
    path.write_bytes(PRINT.encode())
    assert pk.compensate_program(DELTA, DELTA, path, firmware="marlin").text == PRINT


@pytest.mark.parametrize("chord", [0.05, 0.003])
def test_long_moves_are_split_so_that_the_machine_keeps_to_the_line(
    chord: float, tmp_path: Path
) -> None:
    machine = DELTA.replace(OFF)
    text = "M82\nG92 E0\nG1 X-70 Y-20 Z5 F900\nG1 X70 Y20 E10 F1200\n"
    found = corrected(tmp_path, text, chord=chord)
    rows = followed(found.text)
    assert found.segments == len(rows) > 2
    between = np.linspace(rows[1:-1], rows[2:], 50, axis=1).reshape(-1, 3)
    reached = machine.forward(DELTA.inverse(in_pose(between))).pose[:, :3]
    along = np.array([140.0, 40.0, 0.0]) / np.hypot(140.0, 40.0)
    off = reached - [-70.0, -20.0, 5.0]
    off -= (off @ along)[:, None] * along
    worst = np.linalg.norm(off, axis=1).max()
    assert worst <= chord + 1e-5
    assert worst > 0.05 * chord  # not split far more than needed
    lines = found.text.splitlines()[2:]
    assert lines[1].endswith("F1200") and not any("F" in line for line in lines[2:])
    extruded = [float(value) for value in re.findall(r"E(\S+)", found.text)][1:]
    np.testing.assert_allclose(np.diff([0.0, *extruded]), 10.0 / len(extruded), atol=2e-5)
    assert extruded[-1] == 10.0


def test_relative_extrusion_is_shared_among_the_parts(tmp_path: Path) -> None:
    text = "M83\nG1 X-70 Y-20 Z5 F900\nG1 X70 Y20 E1\n"
    found = corrected(tmp_path, text, chord=0.01).text
    parts = [float(value) for value in re.findall(r"E(\S+)", found)]
    assert len(parts) > 2 and sum(parts) == pytest.approx(1.0, abs=1e-12)


def test_inches_are_inches(tmp_path: Path) -> None:
    mm = followed(corrected(tmp_path, "G21\nG1 X25.4 Y-12.7 Z5.08\n").text)
    inches = followed(corrected(tmp_path, "G20\nG1 X1 Y-0.5 Z0.2\n").text)
    np.testing.assert_allclose(inches * 25.4, mm, rtol=0, atol=2e-4)


def test_a_hexapod_is_given_the_orientations_too(tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    machine = robot.replace(HEXAPOD_CHANGES)
    path = tmp_path / "part.ngc"
    text = "G1 X10 Y20 Z810 F600\nG1 X30 A2 B-3 C5\nG1 X-40 Y5 Z790\n"
    path.write_text(text)
    found = pk.compensate_program(robot, machine, path, chord=10.0, firmware="linuxcnc")
    commanded, meant = followed(found.text, "XYZABC"), followed(text, "XYZABC")
    commanded[:, 3:], meant[:, 3:] = np.radians(commanded[:, 3:]), np.radians(meant[:, 3:])
    reached = machine.forward(robot.inverse(commanded), guess=meant).pose
    np.testing.assert_allclose(reached[:, :3], meant[:, :3], rtol=0, atol=5e-5)
    np.testing.assert_allclose(reached[:, 3:], meant[:, 3:], rtol=0, atol=5e-7)


def test_angles_stay_in_the_turn_of_the_program(tmp_path: Path) -> None:
    """A controller told 190° and then -170° would turn all the way back."""
    robot = robots.made(
        "planar",
        {"x": 0.0, "gamma": np.pi - 0.2},
        [
            {"kind": "UPS", "base": robots.ring(300, a), "platform": robots.ring(60, a + 150.0)}
            for a in (0, 120, 240)
        ],
    )
    machine = robot.replace({"base1.x": 301.0})
    path = tmp_path / "part.ngc"
    path.write_text("G1 X0 Y0 C170 F600\nG1 X5 C189\nG1 C-175\n")
    found = pk.compensate_program(robot, machine, path, chord=10.0, firmware="linuxcnc")
    turns = followed(found.text, "XYC")[:, 2]
    np.testing.assert_allclose(turns[[0, 1, -1]], [170, 189, -175], atol=1.0)
    assert not np.isclose(turns[[0, 1, -1]], [170, 189, -175], atol=1e-3).all()


def test_a_crank_goes_on_beyond_half_a_turn(tmp_path: Path) -> None:
    """As joint moves, the inverse's turn is the one near home; the path goes through the other."""
    robot = pk.load("rotary-delta")
    shift = np.radians(175.0) - robot.inverse(robot.home)[0]
    robot = robot.replace({"offset1": robot.geometry["offset1"] - shift})
    path = tmp_path / "part.ngc"
    path.write_text("G0 X0 Y0 Z-900\nG1 Z-1300 F600\n")
    found = pk.compensate_program(robot, robot, path, joints=True, chord=0.5, firmware="linuxcnc")
    crank = followed(found.text, "X")[:, 0]
    assert crank.min() < 180.0 < crank.max() and np.abs(np.diff(crank)).max() < 30.0


def test_a_machine_that_constrains_its_pose_is_given_its_own_coordinates(tmp_path: Path) -> None:
    robot = pk.load("3prs")
    machine = robot.replace({"rod1": 500.4, "base2.x": robot.geometry["base2.x"] + 0.3})
    path = tmp_path / "part.ngc"
    path.write_text("G1 Z710 A2 B-3 F600\nG1 Z690 A-4\n")
    found = pk.compensate_program(robot, machine, path, chord=10.0, firmware="linuxcnc")
    commanded = followed(found.text, "ZAB")
    poses = np.zeros((2, 6))
    poses[:, 2], poses[:, 3:5] = commanded[:, 0], np.radians(commanded[:, 1:])
    reached = machine.forward(robot.inverse(poses, match=True), guess=poses).pose
    np.testing.assert_allclose(reached[:, 2], [710, 690], rtol=0, atol=5e-5)
    np.testing.assert_allclose(np.degrees(reached[:, 3:5]), [[2, -3], [-4, -3]], atol=5e-5)


def test_joint_moves_are_actuators_in_the_time_that_the_feed_gives(tmp_path: Path) -> None:
    text = "G0 X0 Y0 Z30\nG1 X30 Y40 F1500 S3\nM5\nG1 Z60\n"
    found = corrected(tmp_path, text, joints=True, chord=0.02)
    lines = found.text.splitlines()
    assert lines[0] == "G93" and "M5" in lines and lines[-1] == "G94"
    rows = followed(found.text)
    machine = DELTA.replace(OFF)
    reached = machine.forward(rows).pose[:, :3]
    corners = [0, lines.index("M5") - 2, len(rows) - 1]
    meant = [[0, 0, 30], [30, 40, 30], [30, 40, 60]]
    np.testing.assert_allclose(reached[corners], meant, rtol=0, atol=3e-5)
    minutes = [1.0 / float(value) for value in re.findall(r"F(\S+)", found.text)]
    assert len(minutes) == len(rows) - 1
    assert sum(minutes) == pytest.approx((50.0 + 30.0) / 1500.0, rel=1e-4)
    assert np.isnan(found.correction) and found.chord_error <= 0.02
    for other, line in (("G20\nG0 X1 Y1 Z1", 2), ("G0 X1 Y1 Z9\nG91\nG0 X1", 3)):
        with pytest.raises(pk.FileError, match=f"line {line}: joint moves are made of"):
            corrected(tmp_path, other, joints=True)
    for text in ("G0 X1 Y1 Z9\nG1 X2", "G0 X1 Y1 Z9\nG95\nG1 X2 F1"):
        with pytest.raises(pk.FileError, match="a joint move needs the feed"):
            corrected(tmp_path, text, joints=True)
    with pytest.raises(pk.FileError, match="line 1: where this move begins is not known"):
        corrected(tmp_path, "G1 X1 Y1 Z9 F9", joints=True)
    with pytest.raises(pk.ArgumentError, match="joints: Marlin has no inverse time feed"):
        corrected(tmp_path, "G0 X1 Y1 Z9", joints=True, firmware="marlin")


def test_behind_homing_the_first_move_names_all_lengths(tmp_path: Path) -> None:
    """Where homing ends is in the controller's configuration, and not where the program began."""
    for start in (None, [0, 0, 235.0, 0, 0, 0]):
        for text in ("G28\nG1 X5 F600\n", "G28\nG91\nG1 Z5 F600\n"):
            with pytest.raises(pk.FileError, match="is not known here, behind homing"):
                corrected(tmp_path, text, start=start)
    assert corrected(tmp_path, "G28\nG1 X1 Y2 Z3\n").moves == 1
    found = corrected(tmp_path, "G1 X5 F600\n", start=[0, 0, 235.0, 0, 0, 0]).text
    assert found.count("X") == found.count("Y") == 1  # the controller stands at the middle


def test_feed_beside_a_change_of_units_is_refused(tmp_path: Path) -> None:
    """LinuxCNC takes F before G20 and G21, in the units before the block."""
    with pytest.raises(pk.FileError, match="line 2: F beside a change of units"):
        corrected(tmp_path, "G0 X0 Y0 Z200\nG20 F10\nG21\nG1 X1\n", firmware="linuxcnc")
    assert corrected(tmp_path, "G21 G90 G94 F100\nG1 X0 Y0 Z200\n", firmware="linuxcnc").moves == 1


@pytest.mark.parametrize("firmware", ["linuxcnc", "klipper", "reprap"])
def test_a_carriage_return_alone_ends_no_line(firmware: str, tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match=r"line 2: .* ends no line at a carriage return alone"):
        corrected(tmp_path, "G1 X0 Y0 Z200 F600\n; note\rG1 X5\n", firmware=firmware)


@pytest.mark.parametrize("firmware", ["linuxcnc", "marlin", "reprap", "klipper"])
def test_a_zero_byte_may_end_a_line_wherever_it_is(firmware: str, tmp_path: Path) -> None:
    """Binary G-code has some, too."""
    for text in ("G1 X0 Y0 Z200 F600\n; note\0G1 X5\n", "GCDE\1\0\0\0\n"):
        with pytest.raises(pk.FileError, match=r"line [12]: has a zero byte"):
            corrected(tmp_path, text, firmware=firmware)


def test_g1_alone_would_stop_a_program_that_states_times(tmp_path: Path) -> None:
    """LinuxCNC wants F with each G1 in G93, though not in G94."""
    begin = "G21 G90 G94\nG0 X0 Y0 Z30\n"
    for line in ("G1", "G1 S400", "G1 M8"):
        text = f"{begin}{line}\nX3 F900\n"
        assert corrected(tmp_path, text, firmware="linuxcnc", chord=1.0).moves == 2
        with pytest.raises(pk.FileError, match=r"line 3: .* needs axis words or F"):
            corrected(tmp_path, text, joints=True, chord=1.0)
    stated = corrected(tmp_path, f"{begin}G1 F900\nX3\n", joints=True, chord=1.0).text
    assert stated.splitlines()[2] == "G1 F900"


ORIGIN = "moves the origin, or skews or scales axes"
NUMBERS = "gives the controller other numbers than ROBOT has"
PLAIN = "is no plain G-code"
REFUSED = [
    *[("linuxcnc", f"{each} X1 Y1 Z1", f"{each} cannot be followed") for each in ("G2", "G81")],
    *[("linuxcnc", each, f"{each[:3]} {ORIGIN}") for each in ("G92 X0", "G55", "G10 L2 P1 X1")],
    *[("linuxcnc", each, f"{each!r} {PLAIN}") for each in ("G1 X#1", "G1 X[1+2]", "o100 sub")],
    ("linuxcnc", "/G1 X1", f"'/G1 X1' {PLAIN}"),
    ("linuxcnc", "G1 X0 X5", "X stands twice"),
    ("linuxcnc", "G0 G1 X5", "G0 or G1 stands twice"),
    ("linuxcnc", "M72", "M72 restores modes"),
    ("linuxcnc", "G93", "G93 states the time of a move"),
    ("linuxcnc", "G28 X0", "G28 with axis words goes by a point"),
    ("linuxcnc", "G1 X5 E1", "E is no word of G1"),
    ("linuxcnc", "M428", f"M428 {NUMBERS}"),
    ("marlin", "G92 X0", "G92 moves the origin"),
    *[("marlin", f"{each} X1", f"{each} {ORIGIN}") for each in ("M206", "M851", "M218", "M290")],
    *[("marlin", f"{each} X1", f"{each} {NUMBERS}") for each in ("M92", "M501", "M502", "M665")],
    ("marlin", "M420 S1", "M420 adds a map of the bed"),
    ("marlin", "M808 L5", "M808 is a condition, a loop"),
    ("marlin", "M24", "M24 runs another program"),
    ("marlin", "M32 part.gco", "M32 runs another program"),
    ("marlin", "N2 G1 X1*71", "the checksum would no longer be right"),
    ("marlin", "G1 A5", "A is no axis of the robot, which has XYZ"),
    ("marlin", "G1 X900", "the machine does not reach a pose of this move"),
    ("marlin", "G1 X1e-05", "E right behind a number"),
    ("marlin", "G90 G21", "Marlin reads one command a line and passes over G21"),
    ("marlin", "G4 P9 G1 X20", "Marlin reads one command a line and passes over G1"),
    ("marlin", "g1 x5", "g1 is not in capitals"),
    ("marlin", "G1 X60 (across)", f"'G1 X60 (across)' {PLAIN}"),
    ("marlin", "X9", "axis words without G0 or G1"),
    ("marlin", "G91.1", "G91.1 may be read as G91"),
    ("marlin", "FOO X9", "FOO has axis letters and is none of Marlin's listed words"),
    ("reprap", "G1 H2 X5", "H is no word of G1"),
    ("reprap", "G1 R2 X0 Y0 Z5", "R is no word of G1"),
    ("reprap", "M64 P1 X20", "M64 has axis letters"),
    ("reprap", "M121", "M121 restores modes"),
    ("reprap", "if move.axes[0].homed", "IF is a condition"),
    ("reprap", "M584 X0 Y1", f"M584 {NUMBERS}"),
    ("reprap", "G32", f"G32 {NUMBERS}"),
    ("reprap", "M375", "M375 adds a map of the bed"),
    ("reprap", "M376 H5", "M376 adds a map of the bed"),
    ("reprap", "G1 X1E-5", "E right behind a number"),
    ("reprap", 'M32 "a.g"', "M32 runs another program"),
    ("reprap", "M906 X5 'G1 X9", "a G or M behind '"),
    ("reprap", "G1 X5 G1 Y5", "two moves stand in it"),
    ("reprap", "M505 Psys G91", "what follows M505 may be a text"),
    ("reprap", "M505 Pmy_folder G91", "what follows M505 may be a text"),
    ("reprap", 'M505 Pmy"folder" G91', "what follows M505 may be a text"),
    ("reprap", "M20 SG91", "what follows M20 may be a text"),
    ("reprap", "M550 P5 G91", "what follows M550 may be a text"),
    *[
        ("klipper", f"{each} X=1", f"{each} {ORIGIN}")
        for each in ("SET_GCODE_OFFSET", "SET_KINEMATIC_POSITION", "SET_SKEW", "SKEW_PROFILE")
    ],
    ("klipper", "RESTORE_GCODE_STATE NAME=a", "RESTORE_GCODE_STATE restores modes"),
    ("klipper", "FORCE_MOVE STEPPER=x", "FORCE_MOVE drives motors"),
    ("klipper", "BED_MESH_PROFILE LOAD=a", "BED_MESH_PROFILE adds a map of the bed"),
    ("klipper", "SDCARD_PRINT_FILE FILENAME=a", "SDCARD_PRINT_FILE runs another program"),
    ("klipper", "G01 X5", "G01 has axis letters and is none of Klipper's listed words"),
    ("klipper", "park x=5", "PARK has axis letters"),
    ("klipper", "(G28)", f"'(G28)' {PLAIN}"),
]


@pytest.mark.parametrize(("firmware", "line", "reason"), REFUSED)
def test_what_cannot_be_followed_is_refused_with_its_line(
    firmware: str, line: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(pk.FileError) as caught:
        corrected(tmp_path, f"G1 X1 Y1 Z20\n{line}\n", firmware=firmware)
    assert f"part.gcode, line 2: {reason}" in str(caught.value)


def test_what_stands_behind_a_quoted_text_is_a_command(tmp_path: Path) -> None:
    begin = "G90\nG1 X1 Y1 Z20\n"
    quoted = corrected(tmp_path, begin + 'M505 P"sys" G91\nG1 X5\n', firmware="reprap")
    alone = corrected(tmp_path, begin + "G91\nG1 X5\n", firmware="reprap")
    assert quoted.text.splitlines()[-1] == alone.text.splitlines()[-1]


def test_a_spindle_that_turns_by_x_is_refused_with_joint_moves(tmp_path: Path) -> None:
    """X is the length of a joint then; of poses it is the radius, nearly as it was."""
    text = "G0 X1 Y1 Z20\nG96 D900 S50\nG1 X5 F100\n"
    with pytest.raises(pk.FileError, match="line 2: G96 turns the spindle by X"):
        corrected(tmp_path, text, joints=True)
    assert "G96 D900 S50" in corrected(tmp_path, text, firmware="linuxcnc").text


def test_a_word_that_is_passed_is_taken_to_do_no_harm(tmp_path: Path) -> None:
    """What is unknown is as if it were not there; behind what is refused all axes are named."""
    text = "G1 X1 Y1 Z20 F600\nPARK X=5\n{}G1 X5\n"
    found = corrected(tmp_path, text.format(""), firmware="klipper", passed=["park"])
    assert found.left == () and found.text.splitlines()[1] == "PARK X=5"
    passed = {"firmware": "klipper", "passed": ["PARK", "SET_SKEW", "T1"]}
    with pytest.raises(pk.FileError, match="where Y and Z is, is not known") as caught:
        corrected(tmp_path, text.format("SET_SKEW SKEW=1\n").replace(" X5", " E1 X5"), **passed)
    assert "behind SET_SKEW" in str(caught.value)
    assert corrected(tmp_path, text.format("T1\n"), **passed).moves == 2
    with pytest.raises(pk.ArgumentError, match="passed: G2 is a word of Marlin that cannot"):
        corrected(tmp_path, "G1 X1 Y1 Z20\n", passed=["g2"])


@pytest.mark.parametrize(
    ("firmware", "modes"),
    [
        ("marlin", "M83\nG90\n"),  # relative in Marlin 1, absolute in Marlin 2
        ("marlin", "G91\nM82\nG91\nG90\nM83\nG90\n"),
        ("marlin", "G90\n"),  # as what was before the program left it
        ("klipper", "G91\nG90\n"),
        ("reprap", "G91\nG90\n"),
    ],
)
def test_extrusion_that_may_be_relative_or_not_is_not_divided(
    firmware: str, modes: str, tmp_path: Path
) -> None:
    text = f"{modes}G92 E0\nG1 X-70 Y-20 Z5 F900\nG1 X70 Y20 E10\n"
    with pytest.raises(pk.FileError, match="whether E is relative is not certain"):
        corrected(tmp_path, text, firmware=firmware)
    assert corrected(tmp_path, text, firmware=firmware, chord=1.0).segments == 2


def test_where_e_is_has_to_be_known_of_a_move_in_parts(tmp_path: Path) -> None:
    move = "G1 X-70 Y-20 Z5 F900\n{}G1 X70 Y20 E10\n"
    for text in ("", "G92 E0\nT1\nG1 X-70 Y-20 Z5\n", "G20\n"):
        with pytest.raises(pk.FileError, match="where E is before it is not known"):
            corrected(tmp_path, "M82\n" + move.format(text).replace("G20\n", "G20\nG21\n"))
    mixed = "G92 E0\nM83\n" + move.format("G1 E3\nM82\n")
    assert "E5.33333" in corrected(tmp_path, mixed, chord=0.02).text
    with pytest.raises(pk.FileError, match="where E is before it is not known"):
        corrected(tmp_path, mixed, firmware="reprap")  # its versions differ


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_joint_moves_state_their_times_wherever_a_program_sets_modes(
    end: str, tmp_path: Path
) -> None:
    """G93 behind the mark, the number and the first modes of a program, and in place of any G94."""
    lines = ["%", "O1000 (PART)", "N1 G21 G90 G94 G17", "G0 X0 Y0 Z30", "G94 G1 X3 F1500", "%"]
    found = corrected(tmp_path, end.join(lines) + end, joints=True, chord=1.0).text
    written = found.split(end)
    assert written[:3] == ["%", "O1000 (PART)", "N1 G21 G90 G93 G17"]
    assert written[4].startswith("G93 G1 X") and written[-3:] == ["G94", "%", ""]
    plain = corrected(tmp_path, "(a)" + end + end.join(lines[3:5]), joints=True, chord=1.0).text
    assert plain.split(end)[:2] == ["(a)", "G93"] and plain.split(end)[-2] == "G94"
    ended = corrected(tmp_path, end.join([*lines[2:5], "M30"]), joints=True, chord=1.0).text
    assert ended.split(end)[-1] == "M30"


def test_moves_beside_other_codes_are_corrected(tmp_path: Path) -> None:
    """Words of a block act together, commands of RepRapFirmware one after the other."""
    begin, plain = "G1 X0 Y0 Z50 F1000\n", "G1 X20 F100\nG1 Y5\n"
    for firmware, line in (
        ("linuxcnc", "G4 P0.5 G1 X20 F100"),
        ("linuxcnc", "M64 P1 X20 F100"),
        ("reprap", "G4 P500 G1 X20 F100"),
        ("reprap", "M106 S9 G1 X20 F100 M107"),
    ):
        meant = followed(corrected(tmp_path, begin + plain, firmware=firmware, chord=1.0).text)
        found = corrected(tmp_path, f"{begin}{line}\nG1 Y5\n", firmware=firmware, chord=1.0).text
        found = re.sub(r"^(G4 P\S+|M106 S9|M64 P1) ", "", found, flags=re.MULTILINE)
        np.testing.assert_array_equal(followed(found), meant)
    for firmware, line in (("linuxcnc", "G1 X-60 M30"), ("reprap", "G1 X-60 M107")):
        with pytest.raises(pk.FileError, match=r"line 2: M.* acts behind a move that is"):
            corrected(tmp_path, begin + line, firmware=firmware)


@pytest.mark.parametrize("unit", [1.0, 25.4])
def test_a_turn_takes_the_time_that_its_feed_states(unit: float, tmp_path: Path) -> None:
    """Corrected, it moves X, Y and Z a little, along which a controller would take F."""
    robot = pk.load("hexapod")
    machine = robot.replace(HEXAPOD_CHANGES)
    path = tmp_path / "part.ngc"
    place = f"X{10 / unit:.6f} Y{20 / unit:.6f} Z{810 / unit:.6f}"
    path.write_text(f"{'G21' if unit == 1.0 else 'G20'}\nG1 {place} F600\nG1 A4 B-3\nG1 X0\n")
    found = pk.compensate_program(robot, machine, path, firmware="linuxcnc", chord=0.01).text
    lines = found.splitlines()[1:]
    ways = np.linalg.norm(np.diff(followed(found, "XYZABC")[:, :3], axis=0), axis=1)
    back = lines.index("F600")
    feeds = [float(re.findall(r"F(\S+)", line)[0]) for line in lines[1:back]]
    assert len(feeds) == back - 1 > 0 and ways[: back - 1].all()
    minutes = np.sum(ways[: back - 1] / np.array(feeds))
    assert minutes == pytest.approx(5.0 / 600.0, rel=0.02)
    assert not any("F" in line for line in lines[back + 1 :])


def test_a_part_behind_one_with_another_feed_has_its_own_feed(tmp_path: Path) -> None:
    """The F that is written for a part is in force for the next ones."""
    robot = pk.load("hexapod")
    path = tmp_path / "part.ngc"
    begin, end = [5.395, 0.989, 794.645, -8.144, 11.278, 0.386], [4.627, 1.236, 795.199]
    end += [10.015, -11.05, 0.686]
    lines = [
        "G1 " + " ".join(f"{k}{v}" for k, v in zip("XYZABC", at, strict=True))
        for at in (begin, end)
    ]
    path.write_text(f"{lines[0]} F600\n{lines[1]}\nG1 X9\n")
    machine = robot.replace(HEXAPOD_CHANGES)
    found = pk.compensate_program(robot, machine, path, firmware="linuxcnc", chord=0.005).text
    lines = found.splitlines()
    back = lines.index("F600")
    ways = np.linalg.norm(np.diff(followed(found, "XYZABC")[:back, :3], axis=0), axis=1)
    feeds: list[float] = []
    for line in lines[1:back]:
        feeds += [float(each) for each in re.findall(r"F(\S+)", line)] or feeds[-1:] or [600.0]
    meant = np.linalg.norm(np.subtract(begin, end)[:3]) / 600.0 / (back - 1)
    assert back > 3
    np.testing.assert_allclose(ways / np.array(feeds), meant, rtol=0.0201)


@pytest.mark.parametrize(
    "line",
    [
        "M117 G1 X9 Y9",  # a message
        "; a note\x0cG1 X9 Y9",  # no line ends at a form feed, nor at these
        "; a note\x85G1 X9 Y9",
        "; a note\u2028G1 X9 Y9",
        "G10 P0 S195 R175",  # temperatures of a tool
    ],
)
def test_what_is_no_move_moves_nothing(line: str, tmp_path: Path) -> None:
    text = "G1 X1 Y1 Z20 F600\n{}\nG1 X-30 Y20\n"
    found = corrected(tmp_path, text.format(line), firmware="reprap")
    assert found.moves == 2
    plain = corrected(tmp_path, text.format("M400"), firmware="reprap")
    assert found.text == plain.text.replace("M400", line)


def test_what_may_move_the_machine_is_said_and_all_axes_are_named_behind_it(
    tmp_path: Path,
) -> None:
    """Once each with its line; what only sets something is not."""
    text = 'T1 ; knife\nG1 X1 Y1 Z20 F600\nPARK_HEAD\n{}PARK_HEAD\nM98 P"a.g"\nG1 X-30 Y20{}\n'
    settings = "M106 S255\nM204 P500 T500\nM104 S200 T0\nM117 PARK\n; PARK\n"
    whole = text.format(settings, " Z20")
    found = corrected(tmp_path, whole, firmware="reprap")
    assert found.left == ("T1 (line 1)", "PARK_HEAD (line 3)", "M98 (line 10)")
    assert "may move the machine: T1 (line 1), PARK_HEAD" in str(found)
    assert [line for line in found.text.splitlines() if line[:2] != "G1"] == [
        line for line in whole.splitlines() if line[:2] != "G1"
    ]
    assert found.segments == 2  # from where to divide a line is not known
    with pytest.raises(pk.FileError, match="line 11: where Z is, is not known here, behind M98"):
        corrected(tmp_path, text.format(settings, ""), firmware="reprap")
    names = ["PARK_HEAD", "M98"]
    taken = corrected(
        tmp_path, text.format(settings, ""), firmware="reprap", passed=names, chord=1e-3
    )
    assert taken.left == ("T1 (line 1)",) and taken.segments > 2
    assert corrected(tmp_path, settings + "G1 X1 Y1 Z20\n", firmware="reprap").left == ()


def test_axes_that_are_homed_need_no_numbers(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="line 3: where X and Y is, is not known"):
        corrected(tmp_path, "G1 X1 Y1 Z20\nG28 X Y\nG1 Z20 F600\n")


def test_a_byte_order_mark_stays_before_a_remark_and_is_refused_before_words(
    tmp_path: Path,
) -> None:
    """Controllers read it as letters, and pass over the words behind it."""
    text = "; part\nG1 X1 Y1 Z20 F600\n"
    assert corrected(tmp_path, "\ufeff" + text).text == "\ufeff" + corrected(tmp_path, text).text
    for words in ("G91\n", "%\n", "G28\n", "M83 ; a\n", "PARK\n"):
        with pytest.raises(pk.FileError, match="line 1: a byte-order mark stands before it"):
            corrected(tmp_path, "\ufeff" + words + text)


@pytest.mark.parametrize(
    ("firmware", "line", "why"),
    [
        ("linuxcnc", ";py,self.execute('G0 X9')", "runs Python"),
        ("linuxcnc", "(PYRUN,park.py)", "runs Python"),
        ("linuxcnc", "G43.4", "G43.4 may be read as G43"),
        ("marlin", "G1 X\t5 Y5", "a tab"),
        ("marlin", "; C:\\", "ends a line"),
        ("marlin", "G1 Y0X10", "base 16"),
        ("marlin", "M665.1 L215", "M665.1 may be read as M665"),
        ("marlin", "n5 G1 X5", "not in capitals"),
        ("marlin", "G1" + 90 * " " + "X5 Y5", "reads 95 characters"),
        ("reprap", "G 91", "not all read"),
        ("reprap", "M106 (fan, not G91) S1", "a remark to some versions"),
        ("reprap", "M106 S1 (fan, not G91", "a remark to some versions"),
        ("reprap", "M106 S1 (fan ; on) G91", "a remark to some versions"),
        ("reprap", "M37 S1", "runs another program"),
        ("reprap", "M26 S0", "cannot be followed"),
        ("klipper", "G 1 X7", "not all read"),
        ("klipper", "SET_TMC_FIELD STEPPER=a FIELD=MRES VALUE=3", "other numbers"),
    ],
)
def test_lines_that_act_unseen_or_are_not_read_by_all_are_refused(
    firmware: str, line: str, why: str, tmp_path: Path
) -> None:
    with pytest.raises(pk.FileError, match=f"line 2: .*{why}"):
        corrected(tmp_path, f"G1 X1 Y1 Z20 F600\n{line}\nG1 X2\n", firmware=firmware)


@pytest.mark.parametrize(
    ("firmware", "most", "remark"),
    [
        ("marlin", 95, " ; and a long remark, which does not count"),
        ("reprap", 100, " ; and a long remark, which does not count"),
        ("linuxcnc", 251, ""),
        ("linuxcnc", 251, " ; a remark counts"),
        ("linuxcnc", 251, " (each Ä has two bytes)"),
    ],
)
def test_a_line_that_becomes_longer_than_its_firmware_reads_is_refused(
    firmware: str, most: int, remark: str, tmp_path: Path
) -> None:
    """Printers pass over the end, and so over the feed; LinuxCNC stops there."""
    text = "G1 X1 Y1 Z20 F600\nG1 X1.1{}F12345.678" + remark + "\n"
    counted = len(remark.encode()) if firmware == "linuxcnc" else 0
    spaces = most - counted - len("G1 X1.23456 Y1.23456 Z20.23456F12345.678")
    found = corrected(tmp_path, text.format((spaces - 2) * " "), firmware=firmware).text
    line = found.splitlines()[1]
    read = len(line.encode()) if counted else len(line.removesuffix(remark))
    assert most - 5 < read <= most
    with pytest.raises(pk.FileError, match=f"line 2: as corrected: .* reads {most}"):
        corrected(tmp_path, text.format((spaces + 4) * " "), firmware=firmware)
    with pytest.raises(pk.FileError, match=f"line 2: [^:]* reads {most}"):
        corrected(tmp_path, text.format(most * " "), firmware=firmware)


def test_angles_of_the_start_are_not_those_of_homing(tmp_path: Path) -> None:
    """A program for a hexapod in Marlin: behind G28 it has to name angles that began otherwise."""
    robot = pk.load("hexapod")
    path = tmp_path / "part.gcode"
    x, y, z = robot.home[:3]
    for tilt, names, taken in ((0.0, "", True), (5.0, "", False), (5.0, " A0 B0 C0", True)):
        path.write_text(f"G28\nG1 X{x} Y{y} Z{z + 5}{names} F600\n")
        start = [x, y, z, np.radians(tilt), 0.0, 0.0]
        if taken:
            pk.compensate_program(robot, robot, path, firmware="marlin", start=start)
            continue
        with pytest.raises(pk.FileError, match="line 2: where A is, is not known here"):
            pk.compensate_program(robot, robot, path, firmware="marlin", start=start)


def test_the_command_line_writes_the_program_by_its_name(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    DELTA.replace(OFF).save(tmp_path / "robot.toml")
    program = tmp_path / "part.gcode"
    program.write_text(PRINT)
    arguments = ("compensate", "linear-delta", program, tmp_path / "robot.toml")
    marlin = ("--firmware", "marlin")
    done = run(*arguments, *marlin, "--out", tmp_path / "new", "--chord", "0.02")
    assert done.exit_code == 0 and "7 moves in" in done.stdout
    written = (tmp_path / "new" / "part.gcode").read_text()
    assert written == corrected(tmp_path, PRINT, chord=0.02).text
    assert "is an input" in refused(*arguments, *marlin, "--out", tmp_path)
    assert "did not write it" in refused(*arguments, *marlin, "--out", tmp_path / "new")
    assert "--firmware is needed" in refused(*arguments, "--out", tmp_path / "new")
    shown = run(*arguments, *marlin, "--out", tmp_path / "json", "--chord", "0.02", "--json")
    assert json.loads(shown.stdout)["text"] == written
    program.write_text("G1 X1 Y1 Z20\nPARK X=5\nG1 X2\n")
    passed = ("--firmware", "klipper", "--out", tmp_path / "passed")
    assert "--pass PARK" in refused(*arguments, *passed)
    assert run(*arguments, *passed, "--pass", "PARK").exit_code == 0
    assert "--out is needed" in refused(*arguments)
    assert "--match says nothing of a program" in refused(*arguments, "--match", "x")
    assert "--start must be" in refused(*arguments, "--out", "x", "--start", "a", *marlin)


def test_commands_below_zero_are_said_where_the_program_has_none(tmp_path: Path) -> None:
    """Printers keep to their limits without a word."""
    machine = DELTA.replace({f"rod{k}": DELTA.geometry[f"rod{k}"] - 0.6 for k in (1, 2, 3)})
    path = tmp_path / "part.gcode"
    path.write_text("G1 X0 Y0 Z0.2 F600\nG1 X9\n")
    found = pk.compensate_program(DELTA, machine, path, firmware="marlin")
    lowest = followed(found.text)[:, 2].min()
    assert found.lowest_meant == 0.2 and found.lowest == pytest.approx(lowest, abs=1e-5)
    assert lowest < -0.1 and f"commands go down to Z{lowest:.3f}" in str(found)
    path.write_text("G1 X0 Y0 Z20 F600\nG1 X9\n")
    assert "go down" not in str(pk.compensate_program(DELTA, machine, path, firmware="marlin"))
    path.write_text("G0 X0 Y0 Z0.2\n")
    found = pk.compensate_program(DELTA, machine, path, firmware="linuxcnc", joints=True)
    assert np.isnan([found.lowest, found.lowest_meant]).all()


@pytest.mark.parametrize(("room", "beyond"), [(0.02, 0), (-0.02, 1)])
def test_limits_are_looked_at_where_a_constrained_machine_is(
    room: float, beyond: int, tmp_path: Path
) -> None:
    """Tilted, it is moved aside, too, and its sliders are elsewhere than the tilt alone says."""
    robot = pk.load("3prs")
    tilted = np.array([[0.0, 0.0, 700.0, *np.radians([12.0, 9.0]), 0.0]])
    needed = robot.inverse(tilted, match=True)[0]
    assert np.abs(needed - robot.inverse(robot.forward(needed).pose)).max() < 1e-6
    data = content(robot)
    for limb, q in zip(data["limb"], needed, strict=True):
        limb["stroke"] = [0.0, float(q) + room if q == needed.max() else 420.0]
    path = tmp_path / "part.ngc"
    path.write_text("G0 Z700 A12 B9\n")
    machine = parsed(data)
    found = pk.compensate_program(robot, machine, path, firmware="linuxcnc")
    assert found.beyond == beyond


@pytest.mark.parametrize("joints", [False, True])
def test_limits_that_the_machine_states_are_said_where_they_are_broken(
    joints: bool, tmp_path: Path
) -> None:
    low, high = DELTA.model.limbs[0].stroke or (0.0, 0.0)
    rest = float(DELTA.inverse(DELTA.home)[0]) - float(DELTA.home[2])
    inside, *outside = high - rest - 9, high - rest + 9, low - rest - 9
    text = f"G0 X0 Y0 Z{inside:.3f}\nM5\n" + "".join(f"G0 Z{z:.3f}\n" for z in outside)
    found = corrected(tmp_path, text, firmware="linuxcnc", joints=joints)
    assert (found.beyond, found.beyond_line) == (2, 3)
    assert "2 ends of segments are beyond limits" in str(found) and "line 3" in str(found)
    found = corrected(tmp_path, text.partition("M5")[0], firmware="linuxcnc", joints=joints)
    assert found.beyond == 0 and found.beyond_line is None and "beyond" not in str(found)


def test_machines_that_are_not_alike_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text("G1 X1 Y1 Z1\n")
    for other in (pk.load("rotary-delta"), robots.hexapod()):
        with pytest.raises(pk.ArgumentError, match="machine of the controller with other numbers"):
            pk.compensate_program(DELTA, other, tmp_path / "a.nc", firmware="marlin")


@pytest.mark.parametrize("joints", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_bends_of_a_table_are_looked_at_wherever_they_are(
    seed: int, joints: bool, tmp_path: Path
) -> None:
    """Between quarters of a segment a kink hides; the path is judged at 1000 places of each."""
    rng = np.random.default_rng(seed)
    data = content(DELTA)
    home = DELTA.inverse(DELTA.home)
    for limb, q in zip(data["limb"], home, strict=True):
        nodes = q + np.sort(rng.uniform(-90, 90, 9))
        limb["drive"] = {"table": np.column_stack([nodes, rng.uniform(-0.2, 0.2, 9)]).tolist()}
        limb["stroke"] = [-2000.0, 2000.0]
    machine = parsed(data)
    path = tmp_path / "part.gcode"
    path.write_text("G0 X-70 Y-20 Z5\nG1 X70 Y20 Z25 F900\n")
    controller = machine.replace({name: 0.0 for name in machine.geometry.names if "table" in name})
    found = pk.compensate_program(
        controller, machine, path, chord=0.02, joints=joints, firmware="linuxcnc"
    )
    rows = followed(found.text)
    shares = np.linspace(0, 1, 1001)[:, None, None]
    between = (1 - shares) * rows[:-1] + shares * rows[1:]
    q = between if joints else controller.inverse(in_pose(between))
    start, way = np.array([-70.0, -20.0, 5.0]), np.array([140.0, 40.0, 20.0])
    k = np.arange(len(rows) - 1)[:, None]
    meant = start + (k + shares) / (len(rows) - 1) * way
    off = np.linalg.norm(machine.forward(q, guess=in_pose(meant)).pose[..., :3] - meant, axis=-1)
    assert found.chord_error <= 0.02
    assert off.max() > 0.9 * found.chord_error - 2e-5
    assert off.max() < 17 / 16 * found.chord_error + 2e-5  # five decimals


@pytest.mark.slow
def test_memory_does_not_grow_with_a_program(tmp_path: Path) -> None:
    """But for the program itself, when it is written to a file."""
    peaks = []
    for count in (15_000, 30_000):  # more than are in memory at once
        path = tmp_path / f"{count}.gcode"
        lines = (f"G1 X{k % 60 - 30} Y{k % 47 - 23} Z{k % 31} F900\n" for k in range(count))
        path.write_text("".join(lines))
        tracemalloc.start()
        found = pk.compensate_program(
            DELTA, DELTA.replace(OFF), path, firmware="marlin", chord=1.0, out=tmp_path / "new"
        )
        peaks.append(tracemalloc.get_traced_memory()[1] - path.stat().st_size)
        tracemalloc.stop()
        assert found.moves == count and found.text == ""
    assert peaks[1] < 1.1 * peaks[0]


def test_a_program_is_written_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    """Piece by piece it is the program that the result holds."""
    many = "".join(f"G1 X{k % 60 - 30} Y{k % 47 - 23} Z{k % 31} F900\n" for k in range(4_200))
    path, out = tmp_path / "long.gcode", tmp_path / "new.gcode"
    path.write_text(many)
    options: Any = {"firmware": "marlin", "chord": 1.0}
    machine = DELTA.replace(OFF)
    found = pk.compensate_program(DELTA, machine, path, out=out, **options)
    whole = pk.compensate_program(DELTA, machine, path, **options)
    assert found.text == "" and out.read_text() == whole.text
    assert (found.moves, found.segments) == (whole.moves, whole.segments) == (4_200, found.segments)
    path.write_text(many + "G2 X1 Y1\n")
    before = out.read_bytes()
    with pytest.raises(pk.FileError, match="line 4201: G2 cannot be followed"):
        pk.compensate_program(DELTA, machine, path, out=out, **options)
    assert out.read_bytes() == before and len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(("units", "other"), [("G21", "G20"), ("G20", "G21")])
def test_units_behind_a_move_whose_feed_changes_are_refused(
    units: str, other: str, tmp_path: Path
) -> None:
    """The feed that is written again behind it would be read in the other units."""
    robot = pk.load("hexapod")
    numbers = {name: robot.geometry[name] + 0.7 for name in ("base1.x", "base3.y", "offset5")}
    program = tmp_path / "program.g"
    height = 800 if units == "G21" else 31.5
    program.write_text(f"{units}\nG90\nG1 X0 Y0 Z{height} A0 B0 C0 F600\nG1 C8 {other}\n")
    with pytest.raises(ValueError, match=f"line 4: {other} acts behind a move"):
        pk.compensate_program(robot, robot.replace(numbers), program, firmware="reprap", chord=1.0)
