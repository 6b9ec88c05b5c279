"""A CSV file as columns with a name and a unit, and errors that say where they are.

Any of comma, semicolon and tab separates; with the latter two, numbers may have a decimal comma.
Lines that start with ``#`` and empty lines are skipped; units are converted here and nowhere else.
A column is headed ``x [mm]``, or as instruments write it: ``x (mm)``, ``x_mm``, ``x/mm``, ``x mm``.
The first sheet of an Excel workbook is read likewise.
"""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from pkmcal import arguments
from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.exceptions import FileError
from pkmcal.files import reading
from pkmcal.files.reading import LONGEST_NAME, MOST_CELLS, MOST_COLUMNS
from pkmcal.files.xlsx_rows import xlsx_rows

# What one unit is in mm, in rad: (multiply by, divide by), so that 1 um is 1/1000 mm exactly.
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "mm": {
        "mm": (1.0, 1.0),
        "um": (1.0, 1000.0),
        "µm": (1.0, 1000.0),
        "cm": (10.0, 1.0),
        "m": (1000.0, 1.0),
        "in": (25.4, 1.0),
    },
    "rad": {
        "rad": (1.0, 1.0),
        "mrad": (1.0, 1000.0),
        "deg": (math.pi, 180.0),
        "°": (math.pi, 180.0),
    },
}
# Other spellings of units; a unit may also be in capitals.
_SPELLINGS = {
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "inch": "in", "inches": "in",
    "micron": "um", "microns": "um", "degree": "deg", "degrees": "deg", "radians": "rad",
}  # fmt: skip
_UNIT = "|".join(
    sorted((*UNITS["mm"], "\u03bcm", *UNITS["rad"], *_SPELLINGS), key=len, reverse=True)
)
_LOOSE = re.compile(
    rf"(?P<name>.*[^\s_/])\s*(?:\(\s*(?P<in>{_UNIT})\s*\)|[_/ ]\s*(?P<after>{_UNIT}))",
    re.IGNORECASE,
)
_HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?")


@dataclass(frozen=True)
class Column:
    """One column: its name and unit as written (None: no unit), and its cells."""

    name: str
    unit: str | None
    cells: tuple[str, ...]


class Table:
    """The columns of one CSV file.

    Parameters
    ----------
    path : str or path
        A file in UTF-8, with or without a byte-order mark, or UTF-16 with one, with any line
        ends; or an Excel workbook, ``.xlsx``.

    Raises
    ------
    ValueError
        Naming the file and the line: no header, no rows, a ragged row, a column without a name
        or with the name of another, bytes that are not text.
    OSError
        The file cannot be read.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = arguments.path("path", path)
        self._separator = ""
        if self.path.suffix.lower() in (".xlsx", ".xlsm", ".xls"):
            every = xlsx_rows(path)
        else:
            lines = _lines(self.path, reading.content(path, reading.MOST_TABLE))
            self._separator = max(",;\t", key=lines[0][1].count) if lines else ","
            every = [(line, self._cells(line, text)) for line, text in lines]
        if not every:
            raise FileError(f"{self.path}: the file is empty: expected a line of column names")
        self._header_line, headings = every[0]
        if len(headings) > MOST_COLUMNS or len(headings) * len(every) > MOST_CELLS:
            raise FileError(
                f"{self.path}: {len(headings)} columns and {len(every) - 1} rows; at most"
                f" {MOST_COLUMNS} columns and {MOST_CELLS} cells are read"
            )
        rows = [(line, cells) for line, cells in every[1:] if any(cells)]
        if not rows:
            raise FileError(
                f"{self.path}: no rows below the column names of line {self._header_line}"
            )
        for line, cells in rows:
            if len(cells) != len(headings):
                hint = ""
                if self._separator == "," and len(cells) > len(headings):
                    hint = " (a decimal comma needs ';' or tabs between columns)"
                raise FileError(
                    f"{self.path}, line {line}: {len(cells)} cells under {len(headings)} column"
                    f" names{hint}"
                )
        self.lines = [line for line, _ in rows]
        self.columns: dict[str, Column] = {}
        for i, heading in enumerate(headings):
            self._add(i, heading, tuple(cells[i] for _, cells in rows))

    def __len__(self) -> int:
        return len(self.lines)

    def _cells(self, line: int, text: str) -> list[str]:
        try:
            (cells,) = csv.reader(
                [text], delimiter=self._separator, skipinitialspace=True, strict=True
            )
        except csv.Error as error:
            raise FileError(f"{self.path}, line {line}: {error}") from None
        return [cell.strip() for cell in cells]

    def _add(self, i: int, heading: str, cells: tuple[str, ...]) -> None:
        heading = " ".join(heading.split())
        if len(heading) > LONGEST_NAME:
            raise self.header_error(
                f"the heading of column {i + 1} has {len(heading)} characters, at most"
                f" {LONGEST_NAME} are taken"
            )
        match = _HEADING.fullmatch(heading)
        loose = _LOOSE.fullmatch(heading)
        if match is None or not match["name"]:
            raise self.header_error(f"column {i + 1} is headed {heading!r}: expected 'name [unit]'")
        name, unit = match["name"], match["unit"]
        if unit is None and loose is not None:
            name, unit = loose["name"], loose["in"] or loose["after"]
        if name in self.columns:
            first = list(self.columns).index(name) + 1
            raise self.header_error(f"column {name!r} appears twice (columns {first} and {i + 1})")
        self.columns[name] = Column(name, unit, cells)

    def leave_out(self, names: Collection[str]) -> None:
        """Forget columns that are not looked at."""
        self.columns = {n: column for n, column in self.columns.items() if n not in names}

    def header_error(self, message: str) -> FileError:
        """An error in the line of column names."""
        return FileError(f"{self.path}, line {self._header_line}: {message}")

    def cell_error(self, name: str, row: int, message: str) -> FileError:
        """An error in one cell; rows count from 0."""
        written = self.columns[name].name if name in self.columns else name
        return FileError(f"{self.path}, line {self.lines[row]}, column {written!r}: {message}")

    def rename(self, known_as: Callable[[str], str]) -> None:
        """Call columns by other names; messages go on naming them as they are written.

        Raises
        ------
        ValueError
            Two columns by one name.
        """
        renamed: dict[str, Column] = {}
        for name, column in self.columns.items():
            other = renamed.setdefault(known_as(name), column)
            if other is not column:
                raise self.header_error(
                    f"columns {other.name!r} and {column.name!r} are both {known_as(name)!r}"
                )
        self.columns = renamed

    def refuse_unknown(self, known: Callable[[str], bool], names: Collection[str]) -> None:
        """Raise for the first column that is not known, saying which of `names` is near."""
        for name in self.columns:
            if not known(name):
                raise self.header_error(f"unknown column {name!r}{did_you_mean(name, names)}")

    def require(self, names: Collection[str]) -> None:
        """Raise for the first of `names` that is not a column."""
        for name in names:
            if name not in self.columns:
                raise self.header_error(f"missing column {name!r}")

    def numbers(self, name: str, *quantities: str, blank: bool = False) -> tuple[FloatArray, str]:
        """A column of finite numbers in mm or rad.

        Parameters
        ----------
        name : str
            A column that is there.
        *quantities : str
            What it may be: "mm" for lengths, "rad" for angles, "mm*mm", "mm*rad"… for products.
        blank : bool
            Whether an empty cell is NaN instead of an error.

        Returns
        -------
        values : (rows,) array
        quantity : str
            Which of `quantities` its unit belongs to.
        """
        quantity, (times, over) = self._conversion(self.columns[name], quantities)
        values = np.empty(len(self))
        for row, cell in enumerate(self.columns[name].cells):
            values[row] = math.nan if blank and not cell else self._number(name, row, cell)
        with np.errstate(over="ignore"):
            converted = values * times / over
        if (row := int(np.argmax(np.isinf(converted)))) or np.isinf(converted[0]):
            cell = self.columns[name].cells[row]
            raise self.cell_error(name, row, f"expected a smaller number, found {cell!r}")
        return converted, quantity

    def _conversion(
        self, column: Column, quantities: tuple[str, ...]
    ) -> tuple[str, tuple[float, float]]:
        units = {unit: q for q in quantities for unit in _factors(q)}
        usual = ", ".join(unit for unit in units if unit.isascii())
        if not column.unit:
            raise self.header_error(
                f"column {column.name!r} has no unit: expected '{column.name} [{quantities[0]}]'"
                f" (or another of {usual})"
            )
        unit = _plain(column.unit, units)
        if unit not in units:
            raise self.header_error(
                f"column {column.name!r} has unit [{column.unit}]: expected one of {usual}"
            )
        return units[unit], _factors(units[unit])[unit]

    def _number(self, name: str, row: int, cell: str) -> float:
        text = cell
        if self._separator != "," and "." not in cell:
            text = cell.replace(",", ".", 1)
        try:
            value = float(text.replace("_", "no number"))  # float() takes 1_000 for 1000
        except ValueError:
            found = f"found {cell!r}" if cell else "found an empty cell"
            raise self.cell_error(name, row, f"expected a number, {found}") from None
        if not math.isfinite(value):
            raise self.cell_error(name, row, f"expected a finite number, found {cell!r}")
        return value

    def texts(self, name: str) -> tuple[str, ...]:
        """A column of names, without unit and none of them empty."""
        column = self.columns[name]
        if column.unit:
            raise self.header_error(f"column {name!r} takes no unit; found [{column.unit}]")
        for row, cell in enumerate(column.cells):
            if not cell:
                raise self.cell_error(name, row, "found an empty cell")
        return column.cells

    def integers(self, name: str) -> Int64Array:
        """A column of whole numbers, without unit."""
        cells = self.texts(name)
        for row, cell in enumerate(cells):
            if not re.fullmatch(r"[+-]?[0-9]{1,18}", cell):
                raise self.cell_error(name, row, f"expected a whole number, found {cell!r}")
        return np.array([int(cell) for cell in cells], dtype=np.int64)


def _factors(quantity: str) -> dict[str, tuple[float, float]]:
    """Units of a quantity; those of a product are products of mm and rad alone."""
    return UNITS.get(quantity, {quantity: (1.0, 1.0)})


def _plain(unit: str, known: Collection[str]) -> str:
    """A unit as it is known here."""
    unit = unit.replace("\u03bc", "\u00b5")  # the Greek mu for the micro sign
    lower = _SPELLINGS.get(unit.lower(), unit.lower())
    return lower if unit not in known and lower in known else unit


def _lines(path: Path, content: bytes) -> list[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers counted from 1."""
    utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: not a UTF-8 text file ({error.reason})") from None
    numbered = enumerate(io.StringIO(text, newline=None), start=1)
    return [
        (i, line.rstrip("\n"))
        for i, line in numbered
        if not line.isspace() and not line.lstrip().startswith("#")
    ]
