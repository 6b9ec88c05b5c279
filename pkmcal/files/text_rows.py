"""The text of a table as lines and cells: its encoding, what separates its columns, its comments.

Python's csv splits a line; its Sniffer guesses the separator from letters and would take a decimal
comma for one, so that the separator is found here, by which most lines have equally many cells.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from pkmcal.exceptions import FileError
from pkmcal.files.height_map import bed_points, is_height_map
from pkmcal.files.text_lines import lines_of

SEPARATORS = ("\t", ";", ",", " ")  # the first of those that fit equally well
_LOOKED_AT = 200  # lines
_COMMENT = re.compile(r"\s*(?:#|//|%)+")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?")
_TRIGGER = re.compile(  # Klipper until 2025 and Kalico
    r"probe at (-?[0-9.]+),(-?[0-9.]+) is z=(-?[0-9.]+)"
)
# Klipper since, and Marlin (Probe::probe_at_point): not of the nozzle when the probe triggered, but
# of the bed, with the offsets of the probe taken in.
_CONTACT = re.compile(
    r"probe: at (-?[0-9.]+),(-?[0-9.]+) bed will contact at z=(-?[0-9.]+)"
    r"|Bed X: ?(-?[0-9.]+) Y: ?(-?[0-9.]+) Z: ?(-?[0-9.]+)"
)
_REPORTS = ("probe at ", "Bed X:", "bed will contact at")  # what such lines hold
_LONGEST_CELL = 131_072  # that csv takes
_MOST_BROKEN = 8  # lines of one cell: more are a mark that nothing closes
_GAP = re.compile(r" {2,}")
_BRACKET = re.compile(r"\s+(?=[\[(])")


@dataclass
class TextRows:
    """Lines of a text, numbered from 1.

    Attributes
    ----------
    rows : list of (int, list of str)
        Cells of the lines that are neither empty nor comments.
    comments : list of (int, str)
        Comments, without what begins them.
    separator : str
        What separates cells.
    notes : list of str
        What had to be assumed.
    """

    rows: list[tuple[int, list[str]]] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)
    separator: str = ","
    notes: list[str] = field(default_factory=list)


def is_number(cell: str) -> bool:
    """Return whether a cell holds a number, with a point or a comma."""
    return _NUMBER.fullmatch(cell) is not None


def text_rows(path: Path, content: bytes) -> TextRows:
    """Split a text into lines and cells."""
    text, notes = _decoded(path, content)
    found = TextRows(notes=notes)
    lines: list[tuple[int, str]] = []
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if line.isspace() or line.startswith("\x1a"):  # the end of a file, once
            continue
        if match := _COMMENT.match(line):
            found.comments.append((number, line[match.end() :].strip()))
        else:
            lines.append((number, line.rstrip("\n")))
    if is_height_map(text):
        points = bed_points(path, lines)
        found.rows = [(lines[0][0], ["x [mm]", "y [mm]", "contact [mm]"]), *points]
        found.notes.append(f"a height map with {len(points)} points that were probed")
        return found
    if any(words in text for words in _REPORTS):
        reports = {
            what: [(n, m) for n, line in enumerate(lines_of(text), 1) if (m := form.search(line))]
            for what, form in (("probe", _TRIGGER), ("contact", _CONTACT))
        }
        if all(reports.values()):
            new, old = reports["contact"][0][0], reports["probe"][0][0]
            raise FileError(
                f"{path}, line {new}: the firmware reports its probe in another way than in line"
                f" {old}: make two files of it"
            )
        for what, found_in in reports.items():
            if found_in:
                _take_triggers(found, what, found_in)
                return found
    found.separator = _separator([line for _, line in lines[:_LOOKED_AT]])
    lines = _unbroken(lines, found.separator)
    found.rows = [(number, cells(path, number, line, found.separator)) for number, line in lines]
    if found.separator == " ":
        _widen_headings(found, lines)
    return found


def _take_triggers(found: TextRows, what: str, triggers: list[tuple[int, re.Match[str]]]) -> None:
    """Make a table of the lines in which a firmware reports its probe."""
    found.rows = [(triggers[0][0], ["x [mm]", "y [mm]", f"{what} [mm]"])]
    found.rows += [(n, [part for part in m.groups() if part is not None]) for n, m in triggers]
    found.notes.append(f"{len(triggers)} lines in which a firmware reports its probe")


def _unbroken(lines: list[tuple[int, str]], separator: str) -> list[tuple[int, str]]:
    """The lines, with those that a cell in quotation marks breaks in one, as wrapped headings."""
    found: list[tuple[int, str]] = []
    opened = re.compile(rf'(?:^|{re.escape(separator)})\s*"(?:[^"]|"")*$')
    begun = 0  # lines of the cell that is open
    for number, line in lines:
        if begun:
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
        else:
            found.append((number, line))
        still = '"' in found[-1][1] and opened.search(found[-1][1]) is not None
        begun = begun + 1 if still and begun < _MOST_BROKEN else 0
    return found


def cells(path: Path, line: int, text: str, separator: str) -> list[str]:
    """The cells of one line."""
    if '"' not in text and len(text) <= _LONGEST_CELL:
        parts = [cell.strip() for cell in text.split(separator)]
        return [cell for cell in parts if cell] if separator == " " else parts
    try:
        (found,) = csv.reader([text], delimiter=separator, skipinitialspace=True, strict=True)
    except csv.Error as error:
        raise FileError(f"{path}, line {line}: {error}") from None
    if separator == " ":
        found = [cell for cell in found if cell]
    return [cell.strip() for cell in found]


def _decoded(path: Path, content: bytes) -> tuple[str, list[str]]:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    else:
        encoding = "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        reason = error.reason
    else:
        if "\0" in text:
            raise FileError(
                f"{path}: has zero bytes, as UTF-16 without its mark and UTF-32 have: save it as"
                " UTF-8"
            )
        return text, []
    try:
        text = content.decode("cp1252" if encoding == "utf-8-sig" else encoding)
    except UnicodeDecodeError:
        text = "\0"
    if any(c < " " and c not in "\t\n\r\f\x1a" for c in text):
        raise FileError(f"{path}: not a UTF-8 text file ({reason})")
    return text, ["not UTF-8, read as Windows-1252"]


def _separator(lines: list[str]) -> str:
    """Return the separator that gives most lines equally many cells."""
    best, most = ",", 0
    for separator in SEPARATORS:
        counts: Counter[int] = Counter()
        for line in lines:
            try:
                (split,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
            except (csv.Error, ValueError):
                continue
            counts[len([c for c in split if c] if separator == " " else split)] += 1
        del counts[1], counts[0]
        fitting = max(counts.values(), default=0)
        if separator == " " and fitting < 2:
            continue
        if fitting > most:
            best, most = separator, fitting
    return best


def _widen_headings(found: TextRows, lines: list[tuple[int, str]]) -> None:
    """Names of several words between spaces: two spaces part them, or a bracket belongs to one."""
    width = Counter(len(row) for _, row in found.rows).most_common(1)[0][0]
    for i, (number, line) in enumerate(lines):
        if len(found.rows[i][1]) > width:
            for split in (_GAP.split(line.strip()), _BRACKET.sub("", line).split()):
                if len(split) == width:
                    found.rows[i] = (number, split)
                    break
