"""LinuxCNC, from its documents: G-code Overview with the order of execution, G-codes and M-codes.

Spaces and case do not count. The words of a block act in a fixed order; with G93, F is the
reciprocal of the minutes of a move and stands in each G1.
"""

from __future__ import annotations

from .controller import Controller, Odd, without_mark

ODD = {
    2,
    3,
    5,
    5.1,
    7,
    10,
    33,
    38.2,
    41,
    42,
    43,
    43.1,
    52,
    53,
    55,
    59,
    59.1,
    70,
    71,
    72.1,
    73,
    74,
    76,
    81,
    83,
    92.3,
}
ODD_M = {72, 73, 98, 99, 428, 429, 430}
NON_MODAL = {10, 28, 30, 52, 53, 92, 92.1, 92.2, 92.3}


def run(text: str, start: dict[str, float], home: dict[str, float], version: int = 0) -> Controller:
    """Run a program; `version` 1 has no kinematics: X, Y and Z are joints, as another machine's."""
    it = Controller(dict(start))
    state = {"motion": None, "relative": False, "inch": False, "times": False, "turns": False}
    lines = without_mark(text).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    marked = next((line.strip() for line in lines if line.strip()), "") == "%"
    marks = 0
    for line in lines:
        if line.strip() == "%":
            marks += 1
            if marked and marks == 2:
                break
            continue
        words = _block(line)
        if words and _act(it, words, state, line):
            break
    it.other(f"left in G93: {state['times']}")
    return it


def _block(line: str) -> list[tuple[str, float]]:
    """The words of a block."""
    kept, inside = "", False
    for remark in [*line.split("(")[1:], *line.split(";")[1:]]:
        word = remark.strip().lower().partition(",")
        if word[0] in ("py", "pyrun", "pyreload") and word[1]:
            raise Odd("Python in a comment")
    for each in line:
        if inside:
            if each == "(":
                raise Odd("a comment in a comment")
            inside = each != ")"
        elif each == "(":
            inside = True
        elif each == ";":
            break
        elif not each.isspace():
            kept += each.upper()
    if inside:
        raise Odd("a comment that does not end")
    if kept.startswith("O") and kept[1:].isdigit():
        return []
    words: list[tuple[str, float]] = []
    k = 0
    while k < len(kept):
        letter = kept[k]
        begin = k = k + 1
        while k < len(kept) and kept[k] in "+-.0123456789":
            k += 1
        try:
            words.append((letter, float(kept[begin:k])))
        except ValueError:
            raise Odd(f"{kept}: parameters, expressions and O-words") from None
        if not letter.isalpha() or letter == "O":
            raise Odd(f"{kept}: block delete and O-words")
    return words


def _act(it: Controller, words: list[tuple[str, float]], state: dict, line: str) -> bool:
    """Act in the order of execution; whether the program ends."""
    g = [value for letter, value in words if letter == "G"]
    m = [value for letter, value in words if letter == "M"]
    others = [(letter, value) for letter, value in words if letter not in "GMN"]
    values = dict(others)
    if len(values) != len(others) or "E" in values:
        raise Odd("a letter twice, or E")
    _refuse_odd(g, m, values)
    for each in (93, 94, 95):
        if each in g:
            state["times"], state["turns"] = each == 93, each == 95
    if "F" in values:
        it.feed = values["F"] * (25.4 if state["inch"] else 1.0)  # units are changed behind it
    apart = {0, 1, 20, 21, 90, 91, 93, 94, 95, 80}
    rest = [f"{name}{value:g}" for name, value in words if name in "TSPQ" or name in "GM"]
    rest = [each for each in rest if not (each[0] == "G" and float(each[1:]) in apart)]
    before = [each for each in rest if each not in ("M0", "M1", "M2", "M30", "M60")]
    if before:
        it.other(" ".join(before))
    if 6 in m or any(100 <= each < 200 for each in m):
        it.hidden()
    for each in (20, 21):
        state["inch"] = each == 20 if each in g else state["inch"]
    for each in (90, 91):
        state["relative"] = each == 91 if each in g else state["relative"]
    if {28, 30} & set(g):
        it.hidden()
    for each in (0, 1):
        state["motion"] = each if each in g else state["motion"]
    if 1 in g and state["times"] and "F" not in values:
        raise AssertionError("G1 in G93 without F")
    if 80 in g:
        state["motion"] = None
    _move(it, state, values)
    ends = [f"M{each:g}" for each in m if each in (0, 1, 2, 30, 60)]
    if ends:
        it.other(" ".join(ends))
    if {2, 30} & set(m):
        state["times"] = False
        return True
    return False


def _refuse_odd(g: list[float], m: list[float], values: dict[str, float]) -> None:
    if ODD & set(g) or ODD_M & set(m):
        raise Odd(str(g + m))
    if len([each for each in g if each in (0, 1, 80)]) > 1:
        raise Odd("two motions")
    if NON_MODAL & set(g) and set(values) & set("XYZABC"):
        raise Odd("axis words of a code that is no move")


def _move(it: Controller, state: dict, values: dict[str, float]) -> None:
    inch = 25.4 if state["inch"] else 1.0
    targets = {axis: values[axis] * inch for axis in values if axis in "XYZ"}
    if not targets:
        return
    if state["motion"] is None:
        raise Odd("axis words without a motion")
    if state["relative"]:
        targets = {axis: it.at[axis] + value for axis, value in targets.items()}
    did = f"G{state['motion']}"
    if did == "G0":
        it.move(did, targets, 0.0, 0.0)
    elif state["times"]:
        if not values.get("F"):
            raise AssertionError("G1 in G93 without F")
        it.move(did, targets, 0.0, 1.0 / values["F"])
    else:
        it.move(did, targets, 0.0, None)
