"""Search for the line that names a table's columns; meaning of headings and lines above."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pkmcal.exceptions import FileError
from pkmcal.files import units
from pkmcal.files.column_names import is_known
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.files.text_rows import TextRows, cells, is_number

Row = tuple[int, list[str]]
POINTS = ("collection", "group", "name")  # names before the coordinates, where no line names them
_LOOSE = re.compile(
    rf"(?P<name>.*[^\s_/])\s*"
    rf"(?:\(\s*(?P<in>{units.IN_BRACKETS})\s*\)|[_/ ]\s*(?P<after>{units.PATTERN}))",
    re.IGNORECASE,
)
_HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?")
_LOOKED_AT = 20  # rows at the top of a file among which its column names are
_NUMBERED = re.compile(r"(?P<name>.*)\[(?P<number>[0-9]+)\]\s*")


@dataclass
class Header:
    """The headings of a table, its rows, and what was said or assumed about them.

    Attributes
    ----------
    line : int
        Where the headings stand; 0 where no line holds them.
    headings : list of str
        One for each column, each different where the file tells them apart.
    rows : list of (int, list of str)
        What is below.
    units : dict of str to (str, int)
        Units of lengths ("mm") and angles ("rad") that lines above state, with those lines.
    notes : list of str
        What was assumed.
    """

    line: int
    headings: list[str]
    rows: list[Row]
    units: dict[str, tuple[str, int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def find_header(path: Path, text: TextRows) -> Header:
    """Find the line of column names: of those above the first numbers the one most recognised.

    Parameters
    ----------
    path : Path
        For messages.
    text : TextRows
        The lines of the file.

    Raises
    ------
    ValueError
        The file is empty, or no line names the columns.
    """
    rows = text.rows
    if not rows:
        raise FileError(f"{path}: the file is empty: expected a line of column names")
    first = _first_data(rows)
    stated = units.stated_in([*text.comments, *((n, " ".join(r)) for n, r in rows[:first])])
    if first == 0:
        header = _without(path, text)
        header.units = stated
        return header
    above = rows[: first or 1]
    counts = [sum(_recognised(cell) for cell in row) for _, row in above]
    best = max(range(len(above)), key=lambda i: (counts[i], i if counts[i] else -i))
    line, headings = above[best]
    below = rows[best + 1 :]
    header = Header(line, list(headings), below, stated)
    if below and _are_units(below[0][1]):
        _give_units(header, below[0][1])
        header.rows = below[1:]
    _tell_apart(header.headings, [row for _, row in above[:best]])
    if best:
        lines = f"lines {above[0][0]} to {above[best - 1][0]}" if best > 1 else "line 1"
        what = "lie" if best > 1 else "lies"
        lines = lines if best > 1 else f"line {above[0][0]}"
        header.notes.append(f"column names in line {line}; {lines} above {what} outside the table")
    return header


def _recognised(heading: str) -> bool:
    if not heading or is_number(heading):  # most cells, and quickly told
        return False
    heading = " ".join(heading.split())
    return len(heading) <= LONGEST_NAME and is_known(parted(heading)[0])


def parted(heading: str) -> tuple[str, str | None]:
    """Name and unit of a heading."""
    match, loose = _HEADING.fullmatch(heading), _LOOSE.fullmatch(heading)
    if numbered := _NUMBERED.fullmatch(heading):  # actual_q[0], not a unit
        return f"{numbered['name']}{numbered['number']}", None
    if match is None:
        return "", None
    if match["unit"] is None and loose is not None:
        return loose["name"], loose["in"] or loose["after"]
    return match["name"], match["unit"]


def _first_data(rows: Sequence[Row]) -> int | None:
    """The first row of numbers; None where there is none.

    Numbers above a line of column names, such as those of rigid bodies, are not data.
    """
    width = Counter(len(row) for _, row in rows).most_common(1)[0][0]
    named = [sum(map(_recognised, row)) for _, row in rows[:_LOOKED_AT]]
    last = max((i for i, count in enumerate(named) if count > 1), default=-1)
    start = (
        0 if any(count > 1 for count in named[: _first_numbers(rows, width, 0) or 0]) else last + 1
    )
    return _first_numbers(rows, width, start)


def _first_numbers(rows: Sequence[Row], width: int, start: int) -> int | None:
    for i, (_, row) in enumerate(rows[start:], start):
        filled = [cell for cell in row if cell]
        numbers = sum(map(is_number, filled))
        if len(row) == width and numbers and (numbers > 1 or 2 * numbers >= len(filled)):
            return i
    return None


def _are_units(row: Sequence[str]) -> bool:
    filled = [cell.strip("[]() ") for cell in row if cell]
    return bool(filled) and all(units.quantity_of(cell) or _is_other(cell) for cell in filled)


def _is_other(cell: str) -> bool:
    """A unit of time, temperature or nothing, beside those of lengths and angles."""
    return cell.lower() in ("s", "sec", "ms", "hz", "-", "°c", "c", "degc", "k")


def _give_units(header: Header, row: Sequence[str]) -> None:
    for i, cell in enumerate(row[: len(header.headings)]):
        bare = cell.strip("[]() ")
        if bare and "[" not in header.headings[i]:
            header.headings[i] += f" [{bare}]"


def _tell_apart(headings: list[str], above: Sequence[Sequence[str]]) -> None:
    """Put before headings that are alike what stands above them, one line after the other.

    A blank heading is called what stands above it.
    """
    for row in reversed(above):
        groups = Counter(heading for heading in headings)
        if all(count == 1 or not heading for heading, count in groups.items()) and "" not in groups:
            return
        filled, last = [], ""
        for cell in [*row, *[""] * len(headings)][: len(headings)]:
            last = cell or last
            filled.append(last)
        put: set[int] = set()
        for name in {h for h, count in groups.items() if count > 1 and h}:
            places = [i for i, heading in enumerate(headings) if heading == name]
            if len({filled[i] for i in places}) > 1:
                parents = {filled[i] for i in places} - {""}
                put |= {i for i, parent in enumerate(filled) if parent in parents and headings[i]}
        for i in put:
            headings[i] = f"{filled[i]} {headings[i]}"
        for i, heading in enumerate(headings):
            if not heading and i < len(row):
                headings[i] = row[i]


def _without(path: Path, text: TextRows) -> Header:
    """A table whose first line holds numbers: the names are in a comment, or names and x y z."""
    line, first = text.rows[0]
    for number, comment in reversed(text.comments):
        names = cells(path, number, comment, text.separator) if comment else []
        if (
            ":" not in comment
            and len(names) == len(first)
            and 2 * sum(map(_recognised, names)) >= len(names)
        ):
            note = f"column names in line {number}, a comment"
            return Header(number, names, text.rows, notes=[note])
    words = sum(not is_number(cell) for cell in first)
    leads = all(not is_number(cell) for cell in first[:words])
    if leads and 0 < words <= len(POINTS) and len(first) == words + 3:
        named = [*POINTS[-words:], "x", "y", "z"]
        note = f"no line of column names; taken as {', '.join(named)}"
        return Header(0, named, text.rows, notes=[note])
    raise FileError(
        f"{path}, line {line}: found {len(first)} cells with numbers, expected a line of column"
        " names above them; write one, such as q1 [mm],x [mm], or name the columns with header ="
        " [...] in the file of --columns"
    )
