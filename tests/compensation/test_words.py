"""Words that mean something else to a controller than they seem to, and feeds of turns."""

from __future__ import annotations

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
