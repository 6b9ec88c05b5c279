"""Marlin, from its documentation: marlinfw.org/docs/gcode, and the notes on its parser.

One command a line, in capitals; letters behind it are parameters. G90 and G91 set all axes with E,
M82 and M83 set E alone, and the last one counts (2.x); in 1.x E is relative with M83 or G91.
"""

from __future__ import annotations

from .controller import Controller, Odd, without_mark

# by their pages: other geometry, offsets, levelling, other programs, loops, curves
ODD = {
    *("M92", "M206", "M218", "M290", "M350", "M360", "M364", "M420", "M421", "M422", "M423"),
    *("M425", "M428", "M501", "M502", "M605", "M665", "M666", "M808", "M851", "M852"),
    *("M23", "M24", "M28", "M29", "M32", "M33", "G2", "G3", "G5", "G6", "G29", "G80", "G33", "G38"),
    *("G53", "G54", "G55", "G59", "G810", "M810", "M819", "M26", "M351"),
}
ELSEWHERE = {
    *(
        "G12",
        "G26",
        "G27",
        "G30",
        "G31",
        "G32",
        "G34",
        "G35",
        "G42",
        "G61",
        "G76",
        "M18",
        "M48",
        "M306",
    ),
    *("M84", "M125", "M401", "M402", "M410", "M600", "M701", "M702", "G425", "M871"),
}
KNOWN = {
    *("G4", "G10", "G11", "G17", "G18", "G19", "G60", "M0", "M1", "M3", "M5", "M73"),
    *("M104", "M105", "M106", "M107", "M109", "M114", "M117", "M118", "M140", "M190", "M200"),
    *("M201", "M203", "M204", "M205", "M207", "M208", "M211", "M220", "M221", "M400", "M486"),
    *("M500", "M503", "M900"),
}


def run(text: str, start: dict[str, float], home: dict[str, float], version: int) -> Controller:
    """Run a program in Marlin 1 or 2."""
    it = Controller(dict(start))
    relative, e_relative, inch = False, False, 1.0
    text = without_mark(text).replace("\r\n", "\n").replace("\r", "\n")
    if version == 1:
        text = text.replace("\\\n", " ")  # it reads on, in a comment too
    for line in text.split("\n"):
        line = _without_number(line.partition(";")[0][:95].strip(" "))
        letter = line[:1]
        rest = line[1:].lstrip(" ")
        digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
        if letter not in ("G", "M", "T") or (not digits and letter != "T"):
            if line and line[0] != "(":
                it.other(line)
            continue
        rest = rest[len(digits) :]
        name = letter + str(int(digits or 0))
        if rest[:1] == "." and name in ("G0", "G1", "G92", "G91", "G90", "M92", "M665"):
            raise Odd("a subcode, which is read or not as Marlin was built")
        if name in ("M117", "M118", "M16", "M30", "M928"):
            it.other(line)
            continue
        words = _parameters(rest, hexadecimal=version == 1)
        if letter == "T":
            it.other(line)
            it.hidden()
        elif name in ("G0", "G1"):
            counts = e_relative if version == 2 else (e_relative or relative)
            _move(it, name, words, inch, relative, counts)
        elif name in ("G20", "G21"):
            inch = 25.4 if name == "G20" else 1.0
        elif name in ("G90", "G91"):
            relative = name == "G91"
            if version == 2:
                e_relative = name == "G91"
        elif name in ("M82", "M83"):
            e_relative = name == "M83"
        elif name == "G92":
            _renamed(it, words, inch)
        else:
            _other(it, name, line, home)
    return it


def _other(it: Controller, name: str, line: str, home: dict[str, float]) -> None:
    if name in ODD:
        raise Odd(name)
    it.other(line)
    if name == "G28":
        it.at = dict(home)
    elif name in ELSEWHERE or name not in KNOWN:
        it.hidden()


def _without_number(line: str) -> str:
    if line[:1] == "N" and line[1:2].isdigit():
        line = line.partition(" ")[2].strip()
    if "*" in line:
        raise Odd("checksum")
    return line


def _move(
    it: Controller,
    name: str,
    words: dict[str, float | None],
    inch: float,
    relative: bool,
    e_relative: bool,
) -> None:
    targets = {}
    for axis in "XYZ":
        if words.get(axis) is not None:
            value = words[axis] * inch
            targets[axis] = it.at[axis] + value if relative else value + it.shift[axis]
    if words.get("F"):
        it.feed = words["F"] * inch
    e = 0.0
    if words.get("E") is not None:
        value = words["E"] * inch
        e = value if e_relative else value - it.extruder
        it.extruder += e
    if targets or e:
        it.move(name, targets, e, None)


def _renamed(it: Controller, words: dict[str, float | None], inch: float) -> None:
    """G92: the place where it is gets other coordinates."""
    for axis in "XYZ":
        if words.get(axis) is not None:
            it.shift[axis] = it.at[axis] - words[axis] * inch
    if words.get("E") is not None:
        it.extruder = words["E"] * inch


def _parameters(rest: str, hexadecimal: bool) -> dict[str, float | None]:
    """Letters with their numbers; of a letter that stands twice the last one counts."""
    found: dict[str, float | None] = {}
    k = 0
    while k < len(rest):
        letter = rest[k]
        k += 1
        if not "A" <= letter <= "Z":
            continue
        while rest[k : k + 1] == " ":
            k += 1
        begin = k
        while k < len(rest) and rest[k] in "+-.0123456789":
            k += 1
        if hexadecimal and rest[begin:k].lstrip("+-").strip("0") == "" and rest[k : k + 1] == "X":
            raise Odd("0X may be a number in base 16")  # as strtod reads it
        try:
            found[letter] = float(rest[begin:k])
        except ValueError:
            found[letter] = None
    return found
