"""The rows of an Excel workbook, through openpyxl."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from pkmcal import arguments
from pkmcal.display import printable
from pkmcal.exceptions import FileError
from pkmcal.files import reading
from pkmcal.files.number_text import is_either
from pkmcal.files.text_rows import TextRows

_MOST_CELLS = 1_000_000  # a cell takes 10 microseconds
_MOST_ROWS = 1_048_576  # Excel's own limit
_LONGEST_SAID = 200  # letters
_CELL = re.compile(rb"<(?:\w+:)?c[\s/>]")
_HIDDEN = re.compile(
    rb"<(?:\w+:)?row(?=\s)(?=[^>]*\shidden=[\"'](?:1|true)[\"'])[^>]*?\sr=[\"']([0-9]{1,7})[\"']"
)
_COLUMNS = re.compile(rb"<(?:\w+:)?col\s(?=[^>]*?\bhidden=[\"'](?:1|true)[\"'])[^>]*>")
_FROM_TO = re.compile(rb"\b(min|max)=[\"']([0-9]{1,5})[\"']")
_LISTED = 5


def xlsx_rows(path: str | PathLike[str]) -> TextRows:
    """Rows of the first sheet that is not hidden, as text; neither empty ones nor comments.

    Numbers are written so that they are read back to the last bit; of a formula its last value.
    Notes say which sheets were not read, and which rows and columns are hidden, as by a filter:
    they are read.

    Parameters
    ----------
    path : str or path
        An ``.xlsx`` or ``.xlsm`` file.

    Raises
    ------
    ValueError
        No such workbook, one that is too large, or openpyxl is not installed.
    OSError
        The file cannot be read.
    """
    place = arguments.path("path", path)
    if place.suffix.lower() == ".xls":
        raise FileError(f"{place}: the old format of Excel; save it as .xlsx or CSV")
    content = reading.content(path, reading.MOST_WORKBOOK)
    try:
        import openpyxl  # noqa: F401
    except ImportError:
        raise FileError(
            f"{place}: reading Excel files takes openpyxl (pip install openpyxl); or save it as CSV"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and what else is not looked at
            return _first_sheet(place, content)
    except (FileError, MemoryError):
        raise
    except Exception as error:  # openpyxl has no error of its own for what is damaged
        said = printable(str(error), _LONGEST_SAID)  # it may quote a whole part of the file
        raise FileError(f"{place}: not an Excel workbook ({said})") from None


def _first_sheet(path: Path, content: bytes) -> TextRows:
    from openpyxl import load_workbook

    packed = ZipFile(io.BytesIO(content))
    unpacked = sum(part.file_size for part in packed.infolist())
    if unpacked > reading.MOST_WORKBOOK:
        raise FileError(
            f"{path}: {unpacked // reading.MB} MB unpacked, at most"
            f" {reading.MOST_WORKBOOK // reading.MB} MB are read; save it as CSV"
        )
    parts = (name for name in packed.namelist() if name.startswith("xl/worksheets/"))
    cells = {name: sum(1 for _ in _CELL.finditer(packed.read(name))) for name in parts}
    if any(count > _MOST_CELLS for count in cells.values()):  # openpyxl reads whole rows
        raise FileError(f"{path}: more than {_MOST_CELLS} cells; save it as CSV")
    book = load_workbook(io.BytesIO(content), data_only=True, read_only=True)
    if not book.worksheets:
        return TextRows()
    shown = [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"]
    sheet = (shown or book.worksheets)[0]
    others = [
        f"{printable(each.title)!r}{' (hidden)' * (each.sheet_state != 'visible')}"
        for each in book.worksheets
        if each is not sheet and cells.get(_part(each), 1)
    ]
    found = TextRows(list(_rows(path, sheet)))
    if others:
        found.notes.append(
            f"of the workbook the sheet {printable(sheet.title)!r} was read, not {_few(others)}"
        )
    found.notes += _hidden(packed.read(_part(sheet)), found)
    return found


def _hidden(written: bytes, read: TextRows) -> Iterator[str]:
    """Notes on rows and columns with something in them that are hidden in a sheet."""
    from openpyxl.utils import get_column_letter

    taken = {number for number, _ in read.rows}
    width = max((len(row) for _, row in read.rows), default=0)
    columns: set[int] = set()
    for each in _COLUMNS.findall(written):
        ends = {name: int(at) for name, at in _FROM_TO.findall(each)}
        columns.update(range(ends.get(b"min", 1), min(ends.get(b"max", 0), width) + 1))
    for what, names in (
        ("row", [row.decode() for row in _HIDDEN.findall(written) if int(row) in taken]),
        ("column", [get_column_letter(column) for column in sorted(columns)]),
    ):
        if names:
            count = f"{len(names)} {what}{'s' * (len(names) > 1)}"
            yield f"{count} hidden in the workbook, and read: {_few(names)}"


def _part(sheet: Any) -> str:
    """Return the part of the packed workbook that is a sheet."""
    return str(sheet._worksheet_path).lstrip("/")


def _few(names: Iterable[str]) -> str:
    listed = list(names)
    return ", ".join(listed[:_LISTED]) + (", …" if len(listed) > _LISTED else "")


def _rows(path: Path, sheet: Any) -> Iterator[tuple[int, list[str]]]:
    sheet.reset_dimensions()  # what is stated may be wrong
    width = cells = 0
    for number, row in enumerate(sheet.iter_rows(), start=1):
        cells += len(row)
        if cells > _MOST_CELLS or number > _MOST_ROWS:
            raise FileError(
                f"{path}, line {number}: a table of more than {_MOST_CELLS} cells, empty ones"
                " counted; delete what is far from it, or save it as CSV"
            )
        if not row:
            continue
        texts = [_text(cell.value) for cell in row]
        filled = [cell for cell, text in zip(row, texts, strict=True) if text]
        if not filled or (_text(filled[0].value).startswith("#") and filled[0].data_type != "e"):
            continue
        last = max(i for i, text in enumerate(texts, start=1) if text)
        width = width or last
        texts += [""] * (width - len(texts))  # rows end with their last cell
        yield number, texts[: max(width, last)]


def _text(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    if isinstance(value, float):
        text = repr(value)
        return text + "0" if is_either(text) else text  # 1.2340 is no thousand
    return "" if value is None else str(value).strip()
