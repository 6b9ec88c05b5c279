"""Klipper, from its documentation: G-Codes and Code Overview, and how lines are taken apart there.

One command a line, in any case, as it is spelt: G01 is none. The rest are parameters. E is relative
with M83 or with G91.
"""

from __future__ import annotations

from .controller import Controller, Odd, without_mark

ODD = {
    *("SET_GCODE_OFFSET", "SET_KINEMATIC_POSITION", "SET_SKEW", "SKEW_PROFILE", "FORCE_MOVE"),
    *("BED_MESH_PROFILE", "BED_MESH_CALIBRATE", "BED_MESH_OFFSET", "RESTORE_GCODE_STATE"),
    *("MANUAL_STEPPER", "SET_DUAL_CARRIAGE", "DELTA_CALIBRATE", "SDCARD_PRINT_FILE", "M23", "M24"),
    *(
        "SDCARD_LOOP_BEGIN",
        "STEPPER_BUZZ",
        "SET_TMC_FIELD",
        "G2",
        "G3",
        "G20",
        "BED_TILT_CALIBRATE",
    ),
}
KNOWN = {
    *("G4", "G10", "G11", "G17", "M73", "M104", "M105", "M106", "M107", "M109", "M114", "M117"),
    *("M118", "M140", "M190", "M204", "M220", "M221", "M400", "SET_FAN_SPEED", "SET_PIN"),
    *("SET_PRESSURE_ADVANCE", "SET_VELOCITY_LIMIT", "EXCLUDE_OBJECT_START", "RESPOND"),
    *("SET_HEATER_TEMPERATURE", "TEMPERATURE_WAIT", "SAVE_GCODE_STATE", "BED_MESH_CLEAR", "M201"),
    *("M900", "G90.1", "G91.1"),
}


def run(text: str, start: dict[str, float], home: dict[str, float], version: int = 0) -> Controller:
    """Run a program."""
    it = Controller(dict(start))
    absolute = absolute_e = True
    for line in without_mark(text).replace("\r\n", "\n").replace("\r", "\n").split("\n"):
        whole = line.strip()
        line = whole.partition(";")[0].strip().upper()
        pairs = _taken_apart(line)
        if pairs and pairs[0][0] == "N":
            pairs = pairs[1:]
        if not pairs:
            if line:
                it.other(line)
            continue
        if "*" in line:
            raise Odd("checksum")
        name = pairs[0][0] + pairs[0][1]
        if version == 0 and _is_of_another_name(line, pairs[0][0]):
            it.other(line)
            continue
        extended = line.split()[0]
        words = dict(pairs)
        if name in ("G0", "G1"):
            _move(it, name, words, absolute, absolute and absolute_e)
        elif name in ("G90", "G91"):
            absolute = name == "G90"
        elif name in ("M82", "M83"):
            absolute_e = name == "M82"
        elif name == "G21":
            continue
        elif name == "G92":
            _renamed(it, words)
        elif name == "G28":
            it.other(line)
            it.at = dict(home)
        elif {name, extended} & ODD:
            raise Odd(extended)
        else:
            it.other(line)
            known = {name, extended} & KNOWN
            if not known and (pairs[0][0] not in "GM" or name in ("M18", "M84", "M600")):
                it.hidden()  # a macro of the user
    return it


def _is_of_another_name(line: str, letter: str) -> bool:
    """Since 2024 what stands before a command, and a space in it, is part of its name."""
    return line[0] in "(#" or (letter in ("G", "M") and f"{letter} " in line)


def _move(
    it: Controller, name: str, words: dict[str, str], absolute: bool, absolute_e: bool
) -> None:
    targets = {}
    for axis in "XYZ":
        if axis in words:
            value = float(words[axis])
            targets[axis] = it.at[axis] + value if not absolute else value + it.shift[axis]
    if "F" in words:
        it.feed = float(words["F"])
    e = 0.0
    if "E" in words:
        value = float(words["E"])
        e = value - it.extruder if absolute_e else value
        it.extruder += e
    if targets or e:
        it.move(name, targets, e, None)


def _renamed(it: Controller, words: dict[str, str]) -> None:
    """G92: the place where it is gets other coordinates."""
    for axis in "XYZ":
        if axis in words:
            it.shift[axis] = it.at[axis] - float(words[axis])
    if "E" in words:
        it.extruder = float(words["E"])
    if not set("XYZE") & set(words):
        it.shift, it.extruder = dict(it.at), 0.0


def _taken_apart(line: str) -> list[tuple[str, str]]:
    """Runs of letters, each with what stands behind it."""
    pairs: list[tuple[str, str]] = []
    key, value = "", ""
    for each in line:
        if each.isalpha() or each == "_":
            if value or not key:
                if key:
                    pairs.append((key, value.strip()))
                key, value = each, ""
            else:
                key += each
        elif key:
            value += each
    return [*pairs, (key, value.strip())] if key else pairs
