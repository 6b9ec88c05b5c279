"""The rows of an Excel workbook, through openpyxl."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from pkmcal import arguments
from pkmcal.display import printable
from pkmcal.exceptions import FileError
from pkmcal.files import reading

_MOST_CELLS = 1_000_000  # a cell takes 10 microseconds
_MOST_ROWS = 1_048_576  # Excel's own limit
_LONGEST_SAID = 200  # letters
_CELL = re.compile(rb"<(?:\w+:)?c[\s/>]")


def xlsx_rows(path: str | PathLike[str]) -> list[tuple[int, list[str]]]:
    """Rows of the first sheet as text, with their numbers; neither empty ones nor comments.

    Numbers are written so that they are read back to the last bit; of a formula its last value.

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
            f"{place}: reading Excel files takes openpyxl (pip install 'pkmcal[xlsx]');"
            " or save it as CSV"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and what else is not looked at
            return list(_rows(place, content))
    except (FileError, MemoryError):
        raise
    except Exception as error:  # openpyxl has no error of its own for what is damaged
        said = printable(str(error), _LONGEST_SAID)  # it may quote a whole part of the file
        raise FileError(f"{place}: not an Excel workbook ({said})") from None


def _rows(path: Path, content: bytes) -> Iterator[tuple[int, list[str]]]:
    from openpyxl import load_workbook

    packed = ZipFile(io.BytesIO(content))
    unpacked = sum(part.file_size for part in packed.infolist())
    if unpacked > reading.MOST_WORKBOOK:
        raise FileError(
            f"{path}: {unpacked // reading.MB} MB unpacked, at most"
            f" {reading.MOST_WORKBOOK // reading.MB} MB are read; save it as CSV"
        )
    sheets = (name for name in packed.namelist() if name.startswith("xl/worksheets/"))
    for name in sheets:  # openpyxl reads a row as a whole, however long
        if sum(1 for _ in _CELL.finditer(packed.read(name))) > _MOST_CELLS:
            raise FileError(f"{path}: more than {_MOST_CELLS} cells; save it as CSV")
    book = load_workbook(io.BytesIO(content), data_only=True, read_only=True)
    if not book.worksheets:
        return
    sheet = book.worksheets[0]
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
    return "" if value is None else str(value).strip()
