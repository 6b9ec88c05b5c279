"""Words that mean something else to a controller than they seem to, and feeds of turns."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk
from pkmcal.compensation.gcode_dialect import Meaning, table

DELTA = pk.load("linear-delta")
MACHINE = DELTA.replace({"rod1": 215.6, "base2.x": DELTA.geometry["base2.x"] + 0.4})


def compensated(
    text: str, folder: Path, robot: pk.Robot = DELTA, machine: pk.Robot = MACHINE, **options: Any
) -> pk.CorrectedProgram:
    path = folder / "part.gcode"
    path.write_text(text)
    return pk.compensate_program(robot, machine, path, **({"firmware": "marlin"} | options))


def test_no_word_means_two_things_in_a_table() -> None:
    with pytest.raises(ValueError, match="G1 stands twice"):
        table({"G1": Meaning.FOLLOWED}, harmless="G1")


@pytest.mark.parametrize(
    "line", ['M291 P"put it right" S3 X1 Z1', "M109 S200", "M226", "M7", "M25", "M957"]
)
def test_what_may_move_a_duet_asks_for_all_axes(tmp_path: Path, line: str) -> None:
    """M291 lets axes be moved, M109 may select a tool, unknown numbers run macros."""
    text = f"G1 X0 Y0 Z50 F3000\n{line}\nG1 X3\n"
    with pytest.raises(pk.FileError, match=r"where Y and Z is|where X and Y and Z is"):
        compensated(text, tmp_path, firmware="reprap")


@pytest.mark.parametrize(
    ("firmware", "line", "why"),
    [
        ("reprap", f'M36 "{40 * "a"}" x,G91', "may be a text to it"),
        ("reprap", f'M36 "a" {40 * "1"}x, G91', "may be a text to it"),
        ("klipper", f"G1 X{200_000 * '1'}z", "is no plain G-code"),
    ],
)
def test_a_line_is_read_in_little_time_however_long_it_is(
    tmp_path: Path, firmware: str, line: str, why: str
) -> None:
    """Each took half an hour or more: all ways to see parts in it were tried."""
    with pytest.raises(pk.FileError, match=f"line 1: .*{why}"):
        compensated(line, tmp_path, firmware=firmware)


@pytest.mark.parametrize(("firmware", "line"), [("klipper", "M25"), ("marlin", "M43 T")])
def test_what_pauses_or_toggles_pins_may_have_moved_it(
    tmp_path: Path, firmware: str, line: str
) -> None:
    with pytest.raises(pk.FileError, match="where Y and Z is, is not known here, behind M"):
        compensated(f"G1 X0 Y0 Z50 F3000\n{line}\nG1 X3\n", tmp_path, firmware=firmware)


@pytest.mark.parametrize("firmware", ["marlin", "reprap", "klipper"])
def test_motors_without_power_may_have_been_moved(tmp_path: Path, firmware: str) -> None:
    """M81 switches the power supply off."""
    text = "G1 X0 Y0 Z50 F3000\nM81\nM80\nG1 {}\n"
    with pytest.raises(pk.FileError, match=r"line 4: where Y and Z is, .* behind M8[01]"):
        compensated(text.format("X3"), tmp_path, firmware=firmware)
    assert "M81 (line 2)" in compensated(text.format("X3 Y0 Z50"), tmp_path, firmware=firmware).left


def test_each_part_of_a_laser_move_states_its_power(tmp_path: Path) -> None:
    found = compensated("G1 X-30 Y0 Z50 F3000\nG1 X30 S128\n", tmp_path, chord=1e-3)
    parts = found.text.splitlines()[1:]
    assert len(parts) > 2
    assert all(" S128" in part for part in parts)


TURNING = pk.load("hexapod")
TURNED = TURNING.replace({"base1.x": TURNING.geometry["base1.x"] + 1.5, "offset2": 0.8})


@pytest.mark.parametrize("firmware", ["linuxcnc", "marlin", "reprap"])
def test_turns_keep_their_time_behind_a_change_of_units_or_are_refused(
    tmp_path: Path, firmware: str
) -> None:
    """A pure turn goes by F in degrees a minute, whatever the units of lengths are."""
    x, y, z = TURNING.home[:3] / 25.4
    begin = f"G90\nG20\nG1 X{x:.5f} Y{y:.5f} Z{z:.5f} A0 B0 C0 F4\n"
    options: dict[str, Any] = {"firmware": firmware, "chord": 1.0}

    def found(text: str) -> str:
        return compensated(text, tmp_path, TURNING, TURNED, **options).text

    same = minutes_of(found(begin + "G1 F90\nG1 A2\n"))
    assert abs(same[-1] - 2.0 / 90.0) < 0.03 * 2.0 / 90.0
    with pytest.raises(pk.FileError, match=r"stated in other units.*state F again"):
        found(begin + "G1 F90\nG21\nG1 A2\n")
    again = minutes_of(found(begin + "G1 F4\nG21\nG1 F90\nG1 A2\n"))
    assert abs(again[-1] - 2.0 / 90.0) < 0.03 * 2.0 / 90.0


def minutes_of(text: str) -> list[float]:
    """The time of each G1 with axes: F is of X Y Z, and of A B C where none of these moves."""
    at, unit, rates, found = dict.fromkeys("XYZABC", 0.0), 1.0, (0.0, 0.0), []
    for line in text.splitlines():
        unit = {"G20": 25.4, "G21": 1.0}.get(line, unit)
        words = {word[0]: float(word[1:]) for word in line.split()}
        rates = (words["F"] * unit, words["F"]) if "F" in words else rates
        new = at | {k: v * (unit if k in "XYZ" else 1.0) for k, v in words.items() if k in at}
        ways = [sum((new[k] - at[k]) ** 2 for k in axes) ** 0.5 for axes in ("XYZ", "ABC")]
        if ways[0] or ways[1]:
            found.append(ways[0] / rates[0] if ways[0] else ways[1] / rates[1])
        at = new
    return found


# Words that move axes, or change what coordinates mean, of the makers' lists: the G-code dictionary
# of RepRapFirmware (docs.duet3d.com, 3.5) and the quick reference of LinuxCNC (2.9).
MOVING = {
    "reprap": """
        G2 G3 G27 G28 G29 G30 G31 G32 G38.2 G38.3 G38.4 G38.5 G53 G55 G56 G57 G58 G59 G59.1 G59.2
        G59.3 G61 G68 G80 G81 M0 M1 M23 M24 M25 M32 M92 M98 M99 M109 M121 M125 M206 M226 M290 M350
        M375 M376 M401 M402 M425 M428 M501 M502 M556 M559 M560 M563 M569 M574 M579 M582 M584 M585
        M594 M596 M600 M601 M606 M665 M666 M667 M668 M669 M673 M674 M675 M701 M702 M703 M851 M916
        M957 M999
    """,
    "linuxcnc": """
        G2 G3 G5 G5.1 G5.2 G5.3 G6 G6.1 G6.2 G6.3 G7 G10 G28 G30 G33 G33.1 G38.2 G38.3 G38.4 G38.5
        G41 G41.1 G42 G42.1 G43 G43.1 G43.2 G52 G53 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3 G70 G71
        G71.1 G71.2 G72 G72.1 G72.2 G73 G74 G76 G81 G82 G83 G84 G85 G86 G87 G88 G89 G92 G92.3 M6
        M72 M73 M98 M99 M100 M137 M199
    """,
}


@pytest.mark.parametrize(("firmware", "words"), MOVING.items())
def test_no_published_word_that_moves_axes_passes_as_harmless(
    tmp_path: Path, firmware: str, words: str
) -> None:
    """Each is refused, or where the machine is then is unknown: all axes have to be stated."""
    passed = []
    for name in words.split():
        for line in (name, f"{name} X1 Y1"):
            text = f"G1 X0 Y0 Z50 F3000\n{line}\nG1 X3\n"
            with suppress(pk.FileError):
                compensated(text, tmp_path, firmware=firmware)
                passed.append(line)
    assert passed == []


@pytest.mark.parametrize("firmware", ["grbl", "fluidnc"])
def test_a_firmware_without_a_table_is_refused_by_name(tmp_path: Path, firmware: str) -> None:
    with pytest.raises(pk.ArgumentError, match=f"firmware.*{firmware}"):
        compensated("G1 X0 Y0 Z50 F3000\n", tmp_path, firmware=firmware)
