"""The rows of an Excel workbook, through openpyxl."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from pkmcal.exceptions import FileError


def xlsx_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Rows of the first sheet as text, with their numbers; neither empty ones nor comments.

    Numbers are written so that they are read back to the last bit; of a formula its last value.

    Parameters
    ----------
    path : Path
        An ``.xlsx`` or ``.xlsm`` file.

    Raises
    ------
    ValueError
        No such workbook, or openpyxl is not installed.
    OSError
        The file cannot be read.
    """
    if path.suffix.lower() == ".xls":
        raise FileError(f"{path}: the old format of Excel; save it as .xlsx or CSV")
    content = path.read_bytes()
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise FileError(
            f"{path}: reading Excel files takes openpyxl (pip install 'pkmcal[xlsx]');"
            " or save it as CSV"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and what else is not looked at
            book = load_workbook(io.BytesIO(content), data_only=True)
    except (BadZipFile, KeyError, ValueError, OSError) as error:
        raise FileError(f"{path}: not an Excel workbook ({error})") from None
    if not book.worksheets:
        return []
    found = []
    width = 0
    for number, row in enumerate(book.worksheets[0].iter_rows(), start=1):
        texts = [_text(cell.value) for cell in row]
        filled = [cell for cell, text in zip(row, texts, strict=True) if text]
        if not filled or (_text(filled[0].value).startswith("#") and filled[0].data_type != "e"):
            continue
        width = width or max(i for i, text in enumerate(texts, start=1) if text)
        last = max(i for i, text in enumerate(texts, start=1) if text)
        found.append((number, texts[: max(width, last)]))
    return found


def _text(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return "" if value is None else str(value).strip()
