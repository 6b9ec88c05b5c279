"""Programs for machines that yield: with each tool the machine goes where the program meant."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

CONTROLLER = pk.load("hexapod")
MACHINE = CONTROLLER.replace({"offset1": 0.3, "base2.x": CONTROLLER.geometry["base2.x"] + 0.4})
MACHINE = MACHINE.yielding({"offset*": 1e-4}).carrying(pk.Load(mass=2, centre=(0, 0, 30)))
LOADS = {
    1: pk.Load(mass=12, centre=(10, 0, 60)),
    2: pk.Load(mass=40, centre=(0, -25, 80), force=(0, 120, -60), moment=(1e4, 0, 0)),
}
BEGIN = "G21 G90\nG0 X0 Y0 Z800 A0 B0 C0\nG1 X40 Y-20 Z810 A5 F900\n"
GO_ON = "G0 X-30 Y10 Z790 A0 B3 C0\nG1 X50 B-4 F600\nG1 Y60 Z830 C8\n"
PROGRAMS = {
    "linuxcnc": f"{BEGIN}T1 M6\n{GO_ON}T2\nG1 X0\nM6\n{GO_ON}M6 T1 (back)\n{GO_ON}M2\n",
    "marlin": f"{BEGIN.replace('G21 G90', 'G90')}T1\n{GO_ON}T2\n{GO_ON}T1 ; back\n{GO_ON}",
    "klipper": f"{BEGIN.replace('G21 G90', 'G90')}T2\n{GO_ON}M104 T1 S200\n{GO_ON}",
    "reprap": f"{BEGIN.replace('G21 G90', 'G90')}T2\n{GO_ON}T1\n{GO_ON}",
}


def followed(text: str, firmware: str, letters: str = "XYZABC") -> tuple[Any, Any]:
    """What a controller commands, a row a move, and with which tool: an interpreter of its own."""
    at, chosen, tool, rows, tools = dict.fromkeys(letters, 0.0), 0, 0, [], []
    for line in text.splitlines():
        code = re.sub(r"\(.*?\)|;.*|M104.*", "", line)
        if found := re.search(r"T(\d+)", code):
            chosen = int(found[1])
            tool = tool if firmware == "linuxcnc" else chosen
        tool = chosen if "M6" in code else tool
        axes = re.findall(rf"([{letters}])\s*([-\d.]+)", code)
        at |= {letter: float(value) for letter, value in axes}
        if axes:
            rows.append([at[letter] for letter in letters])
            tools.append(tool)
    return np.array(rows), np.array(tools)


def as_poses(rows: Any) -> Any:
    return np.concatenate([rows[..., :3], np.radians(rows[..., 3:])], axis=-1)


def reached(q: Any, tools: Any, near: Any) -> Any:
    """Where the simulated machine goes with its tools, row by row."""
    poses = np.empty_like(near)
    for k, tool in enumerate(tools):
        machine = MACHINE.under(LOADS[tool]) if tool else MACHINE
        poses[k] = machine.forward(q[k], guess=near[k]).pose
    return poses


def written(tmp_path: Path, text: str, firmware: Any, **options: Any) -> pk.CorrectedProgram:
    path = tmp_path / "part.ngc"
    path.write_text(text, encoding="utf-8")
    return pk.compensate_program(CONTROLLER, MACHINE, path, firmware=firmware, **options)


@pytest.mark.parametrize("firmware", PROGRAMS)
def test_machine_goes_where_the_program_meant_with_each_tool(firmware: str, tmp_path: Path) -> None:
    text = PROGRAMS[firmware]
    meant, tools = followed(text, firmware)
    assert set(tools) >= {0, 2}

    def off(found: pk.CorrectedProgram) -> Any:
        commanded, same = followed(found.text, firmware)
        assert (same == tools).all()
        at = as_poses(meant)
        return np.abs(reached(CONTROLLER.inverse(as_poses(commanded)), tools, at) - at)

    assert off(written(tmp_path, text, firmware, chord=100.0, loads=LOADS)).max() < 2e-5
    assert off(written(tmp_path, text, firmware, chord=100.0)).max() > 0.1  # of one load alone


def test_joint_moves_lead_there_with_each_tool(tmp_path: Path) -> None:
    text = PROGRAMS["linuxcnc"].replace("T2\nG1 X0\n", "T2\n")
    text = text.replace("G1 X50 B-4 F600", "G1 X50 Y10 Z790 A0 B-4 C0 F600")
    found = written(tmp_path, text, "linuxcnc", chord=100.0, joints=True, loads=LOADS)
    meant, tools = followed(text, "linuxcnc")
    q, same = followed(found.text, "linuxcnc")
    assert (same == tools).all()
    off = np.abs(reached(q, tools, as_poses(meant)) - as_poses(meant))
    assert off.max() < 6e-5  # five decimals of a leg, and 6 mm across by a mm of all legs


def test_machine_keeps_to_the_lines_of_the_program_under_its_load(tmp_path: Path) -> None:
    chord = 0.002
    text = "G21 G90\nT2 M6\nG0 X-120 Y0 Z800 A0 B0 C0\nG1 X120 Y40 F900\n"
    found = written(tmp_path, text, "linuxcnc", chord=chord, loads=LOADS)
    commanded, _ = followed(found.text, "linuxcnc")
    assert len(commanded) > 4 and found.chord_error <= chord
    share = np.linspace(0, 1, 9)[:, None]
    worst = 0.0
    for begin, end in pairwise(commanded):
        at = as_poses(begin + share * (end - begin))
        there = reached(CONTROLLER.inverse(at), np.full(len(at), 2), at)
        along = np.clip((there[:, 0] + 120) / 240, 0, 1)[:, None]
        line = np.array([-120, 0, 800]) + along * np.array([240, 40, 0])
        worst = max(worst, np.linalg.norm(there[:, :3] - line, axis=1).max())
    assert worst < 1.1 * chord


@pytest.mark.parametrize(
    ("firmware", "line", "message"),
    [
        ("linuxcnc", "T3 M6", "line 4: the load of tool 3 is not stated"),
        ("linuxcnc", "M6", "line 4: M6 takes a tool that no T before it names"),
        ("linuxcnc", "M61 Q1", "line 4: M61 may change the tool"),
        (
            "linuxcnc",
            "T1 M6\nG1 X5",
            "B and C is, is not known here, behind a change of tool: name all axes",
        ),
        ("marlin", "T3", "line 4: the load of tool 3 is not stated"),
        ("reprap", "T", "line 4: T names no tool"),
        ("reprap", "M109 S200", "line 4: M109 may change the tool"),
        ("klipper", "ACTIVATE_EXTRUDER EXTRUDER=extruder1", "may change the tool"),
    ],
)
def test_change_that_cannot_be_followed_is_refused_with_its_line(
    firmware: str, line: str, message: str, tmp_path: Path
) -> None:
    text = (BEGIN if firmware == "linuxcnc" else BEGIN.replace("G21 G90", "G90")) + line + "\n"
    with pytest.raises(ValueError, match=re.escape(message)):
        written(tmp_path, text, firmware, loads=LOADS)


def test_tool_cannot_be_changed_by_a_word_that_is_passed(tmp_path: Path) -> None:
    """It moves nothing, perhaps, and the machine sags all the same."""
    with pytest.raises(ValueError, match="line 5: where"):
        written(
            tmp_path,
            BEGIN.replace("G21 G90", "G90") + "T1\nG1 X5\n",
            "marlin",
            loads=LOADS,
            passed=["T1"],
        )


def test_loads_are_of_a_machine_that_yields(tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text(BEGIN, encoding="utf-8")
    with pytest.raises(ValueError, match="nothing of hexapod yields"):
        pk.compensate_program(CONTROLLER, CONTROLLER, path, firmware="linuxcnc", loads=LOADS)
    for loads in ({-1: LOADS[1]}, {"T1": LOADS[1]}, {1: 5.0}):
        with pytest.raises((ValueError, TypeError), match="loads"):
            written(tmp_path, BEGIN, "linuxcnc", loads=loads)
