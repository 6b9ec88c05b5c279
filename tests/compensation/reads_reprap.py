"""RepRapFirmware, from its G-code dictionary and "G-code in RepRapFirmware" (docs.duet3d.com).

Several commands a line, each up to the next G or M outside of quotation marks. M82 and M83 alone
set E. In CNC mode parentheses are comments and axis words repeat the last G0 or G1; else neither.
"""

from __future__ import annotations

from .controller import Controller, Odd, without_mark

ODD = {
    *("M92", "M206", "M290", "M350", "M375", "M376", "M425", "M501", "M502", "M556", "M569"),
    *("M579", "M584", "M665", "M666", "M667", "M669", "M23", "M24", "M28", "M32", "M121", "G2"),
    *("G3", "G29", "G32", "G53", "G55", "G68", "G31", "G93", "M606", "M560", "M594", "M596"),
    *("M916", "M26", "M37"),
}
ELSEWHERE = {
    *("G30", "G27", "M18", "M84", "M98", "M401", "M402", "M600", "M701", "M702", "M0", "M1"),
    *("M125", "M582", "M585", "M675", "G38", "M109", "M226", "M601", "M957"),
}
KNOWN = {
    *(
        "G4",
        "G10",
        "G11",
        "G17",
        "G60",
        "G94",
        "M3",
        "M5",
        "M30",
        "M36",
        "M42",
        "M73",
        "M104",
        "M105",
        "M106",
        "M107",
    ),
    *("M114", "M116", "M117", "M118", "M120", "M140", "M190", "M201", "M203", "M204"),
    *("M207", "M220", "M221", "M291", "M400", "M486", "M566", "M568", "M572", "M593"),
}


def run(text: str, start: dict[str, float], home: dict[str, float], version: int) -> Controller:
    """Run it; version 1 counts relative extrusion in absolute numbers, and is in CNC mode."""
    it = Controller(dict(start))
    state = {"relative": False, "e_relative": False, "inch": False, "last": ""}
    for line in without_mark(text).replace("\r\n", "\n").replace("\r", "\n").split("\n"):
        line = line.strip()
        if line[:1] in "Nn" and line[1:2].isdigit():
            line = line[1:].lstrip("0123456789").lstrip()
            if "*" in line:
                raise Odd("checksum")
        line = _bare(line, cnc=version == 1).strip()
        first = line.split()[0] if line.split() else ""
        if first in ("if", "elif", "else", "while", "break", "continue", "abort"):
            raise Odd(first)
        if first in ("echo", "var", "set", "global"):
            it.other(line)
            continue
        while line:
            command, line = _first(line)
            _act(it, command, state, home, version)
            if state.pop("macro", False) and version == 1:
                break  # "must be the last command in that line"
    return it


def _bare(line: str, cnc: bool) -> str:
    """Without comments."""
    kept, quoted, inside = "", False, False
    for each in line:
        if inside:
            inside = each != ")"
            continue
        quoted ^= each == '"'
        if each == ";" and not quoted:
            break
        if each == "(" and not quoted and cnc:
            inside = True
            continue
        kept += each
    return kept


def _first(line: str) -> tuple[str, str]:
    """The first command, and what stands behind it."""
    if line[0].upper() not in "GMTXYZ":
        return line, ""  # bad, to its end
    name = line[1:].lstrip(" 0123456789.")
    if line[:4].upper() == "M117" and line[4:].lstrip()[:1] != '"':
        return line, ""
    quoted = braces = 0
    for k in range(len(line) - len(name), len(line)):
        quoted ^= line[k] == '"'
        braces += (line[k] == "{") - (line[k] == "}")
        if line[k] in "GgMm" and not quoted and not braces and k:
            return line[:k].strip(), line[k:]
    return line, ""


def _act(it: Controller, command: str, state: dict, home: dict, version: int) -> None:
    letter = command[0].upper()
    rest = command[1:]
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
    name = letter + str(int(digits)) if digits else letter
    rest = rest[len(digits) :]
    if letter in "XYZ":
        if version == 0 or state["last"] not in ("G0", "G1"):
            raise Odd("axis words alone: read in one mode and not in another")
        name, rest = state["last"], command
    elif letter not in "GMT" or (not digits and letter != "T"):
        it.other(command)
        return
    if letter == "T":
        it.other(command)
        it.hidden()
        state["macro"] = True
    elif name in ("G0", "G1"):
        _move(it, name, rest, state, version)
    elif name in ("G20", "G21"):
        state["inch"] = name == "G20"
    elif name in ("G90", "G91"):
        if rest[:1] == ".":
            raise Odd("arc modes are none of its words")
        state["relative"] = name == "G91"
    elif name in ("M82", "M83"):
        state["e_relative"] = name == "M83"
    elif name == "G92":
        _renamed(it, _words(rest), state)
    elif name == "G28":
        it.other(command)
        it.at, state["macro"] = dict(home), True
    elif name == "G10" and set("LXYZ") & set(_words(rest)):
        raise Odd("G10 sets offsets")
    elif name in ODD:  # also with a fraction
        raise Odd(name)
    else:
        it.other(command)
        moved = name == "M291" and set("XYZ") & set(_words("".join(rest.split('"')[::2])))
        if name in ELSEWHERE or name not in KNOWN or moved:
            it.hidden()
            state["macro"] = True


def _move(it: Controller, name: str, rest: str, state: dict, version: int) -> None:
    if rest[:1] == ".":
        raise Odd("G1 with a fraction")
    state["last"] = name
    words = _words(rest)
    if set("HRPS") & set(words):
        raise Odd("a move of motors, to a stored point, or with outputs")
    inch = 25.4 if state["inch"] else 1.0
    targets = {}
    for axis in "XYZ":
        if axis in words:
            value = words[axis] * inch
            targets[axis] = it.at[axis] + value if state["relative"] else value + it.shift[axis]
    it.feed = words["F"] * inch if "F" in words else it.feed
    e = 0.0
    if "E" in words:
        value = words["E"] * inch
        e = value if state["e_relative"] else value - it.extruder
        if not state["e_relative"]:
            it.extruder = value
        elif version == 1:
            it.extruder += value
    if targets or e:
        it.move(name, targets, e, None)


def _renamed(it: Controller, words: dict[str, float], state: dict) -> None:
    """G92: the place where it is gets other coordinates."""
    for axis in "XYZ":
        if axis in words:
            it.shift[axis] = it.at[axis] - words[axis]
    if "E" in words:  # as XYZ it is in the unit of the program, from firmware 2 on
        it.extruder = words["E"] * (25.4 if state["inch"] else 1.0)
    if not words:
        raise Odd("G92 alone")


def _words(rest: str) -> dict[str, float]:
    """Letters with their numbers; E right behind a digit belongs to the number."""
    found: dict[str, float] = {}
    k = 0
    while k < len(rest):
        letter = rest[k].upper()
        k += 1
        if not letter.isalpha():
            continue
        begin = k
        while k < len(rest) and (
            rest[k] in "+-.0123456789 " or (rest[k] in "eE" and rest[k - 1].isdigit())
        ):
            k += 1
        try:
            found.setdefault(letter, float(rest[begin:k].replace(" ", "")))
        except ValueError:
            found.setdefault(letter, 0.0)
    return found
