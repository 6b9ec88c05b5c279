"""G-code for a controller with other numbers: the machine goes where the program meant."""

from __future__ import annotations

import re
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
M82
M117 Hello (world) X5
PRINT_START BED=60 X=3
M92 X80 Y80
G90 G21
G92 E0
G1 X-60 Y0 Z10 F3000 ; first
G1 X60 E6.5 (across) F1200
G4 P200
Y10.5
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
            moves = re.compile(r"^(?:N70 )?(?:G0?[01] |Y)[^;(]*", re.MULTILINE)
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
    assert pk.compensate_program(DELTA, DELTA, path).text == PRINT


@pytest.mark.parametrize("chord", [0.05, 0.003])
def test_long_moves_are_split_so_that_the_machine_keeps_to_the_line(
    chord: float, tmp_path: Path
) -> None:
    machine = DELTA.replace(OFF)
    found = corrected(tmp_path, "G1 X-70 Y-20 Z5 F900\nG1 X70 Y20 E10 F1200\n", chord=chord)
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
    lines = found.text.splitlines()
    assert lines[1].endswith("F1200") and not any("F" in line for line in lines[2:])
    extruded = [float(value) for value in re.findall(r"E(\S+)", found.text)]
    np.testing.assert_allclose(np.diff([0.0, *extruded]), 10.0 / len(extruded), atol=2e-5)
    assert extruded[-1] == 10.0


def test_relative_extrusion_is_shared_among_the_parts(tmp_path: Path) -> None:
    text = "M83\nG1 X-70 Y-20 Z5 F900\nG1 X70 Y20 E1\n"
    found = corrected(tmp_path, text, chord=0.01).text
    parts = [float(value) for value in re.findall(r"E(\S+)", found)]
    assert len(parts) > 2 and sum(parts) == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(pk.FileError, match="line 3: E after G91 without M82 or M83"):
        corrected(tmp_path, "G1 X-70 Y-20 Z5 F900\nG91\nG1 X140 Y20 E1\n")


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
    found = pk.compensate_program(robot, machine, path, chord=10.0)
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
    found = pk.compensate_program(robot, machine, path, chord=10.0)
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
    found = pk.compensate_program(robot, robot, path, joints=True, chord=0.5)
    crank = followed(found.text, "X")[:, 0]
    assert crank.min() < 180.0 < crank.max() and np.abs(np.diff(crank)).max() < 30.0


def test_a_machine_that_constrains_its_pose_is_given_its_own_coordinates(tmp_path: Path) -> None:
    robot = pk.load("3prs")
    machine = robot.replace({"rod1": 500.4, "base2.x": robot.geometry["base2.x"] + 0.3})
    path = tmp_path / "part.ngc"
    path.write_text("G1 Z710 A2 B-3 F600\nG1 Z690 A-4\n")
    found = pk.compensate_program(robot, machine, path, chord=10.0)
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
    assert lines[0] == "G93" and "M5" in lines
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
    for other, line in (("G20\nG1 X1 Y1 Z1", 2), ("G1 X1 Y1 Z9 F9\nG91\nG1 X1", 3)):
        with pytest.raises(pk.FileError, match=f"line {line}: joint moves are made of"):
            corrected(tmp_path, other, joints=True)
    with pytest.raises(pk.FileError, match="line 1: a joint move needs the feed"):
        corrected(tmp_path, "G1 X1 Y1 Z9", joints=True)


def test_after_homing_the_pose_is_as_stated_or_has_to_be_named(tmp_path: Path) -> None:
    text = "G28\nG1 Z20 F600\nG1 X5\nG28\nG1 X5 Y5 Z20\n"
    with pytest.raises(pk.FileError, match="line 2: where X and Y is, is not known"):
        corrected(tmp_path, text)
    start = np.array([0, 0, 235.0, 0, 0, 0])
    found = corrected(tmp_path, text, start=start, chord=100.0).text.splitlines()
    assert found[1].count("X") == found[1].count("Y") == 1  # the controller stands at the middle
    assert corrected(tmp_path, "G28\nG1 X1 Y2 Z3\n").moves == 1


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("G2 X1 Y1 I1 J0", "G2 cannot be followed"),
        ("G81 X1 Y1 Z1 R2", "G81 cannot be followed"),
        ("G92 X0", "G92 moves the origin"),
        ("G55", "G55 cannot be followed"),
        ("G10 L2 P1 X1", "G10 sets offsets"),
        ("G1 X#1", "no plain G-code"),
        ("G1 X[1+2]", "no plain G-code"),
        ("o100 sub", "no plain G-code"),
        ("/G1 X1", "no plain G-code"),
        ("M206 X1", "M206 moves the origin"),
        ("SET_GCODE_OFFSET Z=0.1", "SET_GCODE_OFFSET moves the origin"),
        ("M665 L360", "M665 gives the controller other numbers"),
        ("N2 G1 X1*71", "the checksum would no longer be right"),
        ("G1 A5", "A is no axis of the robot, which has XYZ"),
        ("M290 Z0.1", "M290 moves the origin"),
        ("RESTORE_GCODE_STATE NAME=a", "RESTORE_GCODE_STATE restores modes"),
        ("M121", "M121 restores modes"),
        ("if move.axes[0].homed", "if: conditions and loops cannot be followed"),
        ("G1 X0 X5", "X stands twice"),
        ("G0 G1 X5", "G0 or G1 stands twice"),
        ("G1 X5 G91", "G91 stands behind axis words"),
        ("G1 X900", "the machine does not reach a pose of this move"),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_line(
    line: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(pk.FileError) as caught:
        corrected(tmp_path, f"G1 X1 Y1 Z20\n{line}\n")
    assert f"part.gcode, line 2: {reason}" in str(caught.value).replace("'" + line + "' is ", "")


@pytest.mark.parametrize(
    "line",
    [
        "M117 G1 X9 Y9",  # a message
        "M118 G1 X9",
        "; a note\x0cG1 X9 Y9",  # no line ends at a form feed, nor at these
        "; a note\x85G1 X9 Y9",
        "; a note\u2028G1 X9 Y9",
        "G10 P0 S195 R175",  # temperatures of a tool
    ],
)
def test_what_is_no_move_moves_nothing(line: str, tmp_path: Path) -> None:
    text = "G1 X1 Y1 Z20 F600\n{}\nG1 X-30 Y20\n"
    found = corrected(tmp_path, text.format(line))
    assert found.moves == 2
    plain = corrected(tmp_path, text.format("M400"))
    assert found.text == plain.text.replace("M400", line)


def test_what_may_move_the_machine_is_left_and_said(tmp_path: Path) -> None:
    """Once each with its line; what only sets something is not."""
    text = 'T1 ; knife\nG1 X1 Y1 Z20 F600\nPARK_HEAD\n{}PARK_HEAD\nM98 P"a.g"\nG1 X-30 Y20\n'
    settings = "SET_FAN_SPEED FAN=a SPEED=1\nM204 P500 T500\nM104 S200 T0\nM117 PARK\n; PARK\n"
    found = corrected(tmp_path, text.format(settings))
    assert found.left == ("T1 (line 1)", "PARK_HEAD (line 3)", "M98 (line 10)")
    assert "taken not to move the machine: T1 (line 1), PARK_HEAD" in str(found)
    kept = [line for line in text.format(settings).splitlines() if line[:2] != "G1"]
    assert [line for line in found.text.splitlines() if line[:2] != "G1"] == kept
    assert corrected(tmp_path, settings + "G1 X1 Y1 Z20\n").left == ()


def test_axes_that_are_homed_need_no_numbers(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="line 3: where X and Y is, is not known"):
        corrected(tmp_path, "G1 X1 Y1 Z20\nG28 X Y\nG1 Z20 F600\n")


def test_a_byte_order_mark_stays_before_the_program(tmp_path: Path) -> None:
    text = "G1 X1 Y1 Z20 F600\n"
    assert corrected(tmp_path, "\ufeff" + text).text == "\ufeff" + corrected(tmp_path, text).text


def test_the_command_line_writes_the_program_by_its_name(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    DELTA.replace(OFF).save(tmp_path / "robot.toml")
    program = tmp_path / "part.gcode"
    program.write_text(PRINT)
    arguments = ("compensate", "linear-delta", program, tmp_path / "robot.toml")
    done = run(*arguments, "--out", tmp_path / "new", "--chord", "0.02")
    assert done.exit_code == 0 and "7 moves in" in done.stdout
    written = (tmp_path / "new" / "part.gcode").read_text()
    assert written == corrected(tmp_path, PRINT, chord=0.02).text
    assert "is an input" in refused(*arguments, "--out", tmp_path)
    assert "did not write it" in refused(*arguments, "--out", tmp_path / "new")
    assert "--out is needed" in refused(*arguments)
    assert "--match says nothing of a program" in refused(*arguments, "--match", "x")
    assert "--start must be" in refused(*arguments, "--out", "x", "--start", "a")


def test_machines_that_are_not_alike_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text("G1 X1 Y1 Z1\n")
    for other in (pk.load("rotary-delta"), robots.hexapod()):
        with pytest.raises(pk.ArgumentError, match="machine of the controller with other numbers"):
            pk.compensate_program(DELTA, other, tmp_path / "a.nc")


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
    path.write_text("G1 X-70 Y-20 Z5 F900\nG1 X70 Y20 Z25 F900\n")
    controller = machine.replace({name: 0.0 for name in machine.geometry.names if "table" in name})
    found = pk.compensate_program(controller, machine, path, chord=0.02, joints=joints)
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
