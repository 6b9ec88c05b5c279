"""A table of a file as columns with a name and a unit, and errors that say where they are.

Tabs, semicolons, commas or spaces separate; with all but commas, numbers may have a decimal comma.
What 1,234 or 1.234 means, a thousand or less, the column says, or else all of the file.
Empty lines and lines that start with ``#``, ``//`` or ``%`` are skipped, and what lies above the
column names; units are converted here and nowhere else.
A column is headed ``x [mm]``, or as instruments write it: ``x (mm)``, ``x_mm``, ``x/mm``, ``x mm``;
its unit may also stand below it, or above the table as in ``Units: mm``.
The first sheet of an Excel workbook that is not hidden is read likewise. What was assumed is kept
as `Table.notes`.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from pkmcal import arguments
from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.display import printable
from pkmcal.exceptions import FileError
from pkmcal.files import reading, units
from pkmcal.files.column_names import BESIDE, is_known
from pkmcal.files.header import Header, find_header, parted
from pkmcal.files.number_text import Signs, decimals, numbers_alone, plain, thousands, undecided
from pkmcal.files.reading import LONGEST_NAME, MOST_CELLS, MOST_COLUMNS
from pkmcal.files.text_rows import is_number, text_rows
from pkmcal.files.understood import Understood
from pkmcal.files.xlsx_rows import xlsx_rows

_UNSEEN = ("-", "--", "---", "n/a", "na", "nan", "null", "none", "#n/a", "?")
_LONGEST = 60  # letters of a line in a note
SHOWN = 8  # names of columns in a message


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        As written.
    unit : str or None
        As written.
    cells : tuple of str
    place : str
        The file it stands in.
    heading : int
        The line of its heading; 0 where no line has it.
    lines : tuple of int
        The line of each cell.
    decimal_comma : bool
        Whether its numbers may have one.
    decimals : mapping of str to str
        The marks of decimals in its file, each with a cell that can be read in no other way.
    stated : mapping of str to (str, int)
        Units that its file states for all columns, of "mm" and "rad", with their lines.
    also : bool
        Whether it is a second reading of a column that is listed already.
    """

    name: str
    unit: str | None
    cells: tuple[str, ...]
    place: str
    heading: int
    lines: tuple[int, ...]
    decimal_comma: bool
    decimals: Mapping[str, str]
    stated: Mapping[str, tuple[str, int]]
    also: bool = False

    def take(self, rows: Sequence[int]) -> Column:
        """The cells of these rows."""
        cells = tuple(self.cells[row] for row in rows)
        return replace(self, cells=cells, lines=tuple(self.lines[row] for row in rows))


class Table:
    """The columns of one file.

    Parameters
    ----------
    path : str or path
        A text file in UTF-8, UTF-16 with a byte-order mark, or Windows-1252, with any line ends;
        or an Excel workbook, ``.xlsx``.
    headings : sequence of str, optional
        Names of the columns of a file that has no line of them.
    default_units : mapping of str to str, optional
        Units of "mm" (lengths) and "rad" (angles) where the file states none.

    Attributes
    ----------
    columns : dict of str to Column
    lines : list of int
        The line of each row.
    notes : list of str
        What was assumed where the file does not say.
    elsewhere : list of str
        The same of tables that were joined with it, each with its file.

    Raises
    ------
    ValueError
        Naming the file and the line: no header, no rows, a ragged row, a column without a name
        or with the name of another, bytes that are not text.
    OSError
        The file cannot be read.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        headings: Sequence[str] | None = None,
        default_units: Mapping[str, str] | None = None,
    ) -> None:
        self.path = arguments.path("path", path)
        packed = self.path.suffix.lower() in (".xlsx", ".xlsm", ".xls")
        if packed:
            text = xlsx_rows(path)
        else:
            text = text_rows(self.path, reading.content(path, reading.MOST_TABLE))
        if headings is not None:
            header = Header(0, list(headings), text.rows)
        else:
            header = find_header(self.path, text)
        self._comma = packed or text.separator != ","
        self._header_line = header.line
        self._units = dict(header.units)
        self.left_out: dict[str, str | None] = {}  # headings of unknown columns, and their units
        self._forgotten: list[Column] = []
        self._units_taken: dict[str, tuple[str, str]] = {}  # of columns, and where each is stated
        self._default_units = dict(default_units or {})
        self.notes, self.elsewhere = [*text.notes, *header.notes], list[str]()
        names = header.headings
        if len(names) > MOST_COLUMNS or len(names) * len(text.rows) > MOST_CELLS:
            raise FileError(
                f"{self.path}: {len(names)} columns and {len(text.rows) - 1} rows; at most"
                f" {MOST_COLUMNS} columns and {MOST_CELLS} cells are read"
            )
        rows = self._rows_below(header, packed, text.separator)
        self.lines = [line for line, _ in rows]
        self._decimals = decimals(cells for _, cells in rows) if self._comma else {}
        self.columns: dict[str, Column] = {}
        columns = zip(*(cells for _, cells in rows), strict=True)
        for i, (heading, cells) in enumerate(zip(names, columns, strict=True)):
            self._add(i, heading, cells)

    def _rows_below(
        self, header: Header, packed: bool, separator: str
    ) -> list[tuple[int, list[str]]]:
        """The rows of the table with their lines, each as wide as the header."""
        names = header.headings
        rows = [(line, _fitted(cells, names, packed)) for line, cells in header.rows if any(cells)]
        again = {line: None for line, cells in rows if cells == names}
        if again and header.line:
            self.notes.append(f"line {next(iter(again))} repeats the column names and is left out")
            rows = [(line, cells) for line, cells in rows if line not in again]
        if not rows:
            raise FileError(f"{self.path}: no rows below the column names of line {header.line}")
        width = len(names)
        while len(rows) > 1 and len(rows[-1][1]) < width and not any(map(is_number, rows[-1][1])):
            line, below = rows.pop()
            self.notes.append(
                f"line {line} below the table left out: {' '.join(below)[:_LONGEST]!r}"
            )
        for line, cells in rows:
            if len(cells) != width:
                hint = ""
                if separator == "," and len(cells) > width and not packed:
                    hint = " (a decimal comma needs ';' or tabs between columns)"
                found = f"{len(cells)} cell{'s' * (len(cells) != 1)}"
                raise FileError(
                    f"{self.path}, line {line}: {found} under {width} column names{hint}"
                )
        return rows

    def __len__(self) -> int:
        return len(self.lines)

    def _add(self, i: int, heading: str, cells: tuple[str, ...]) -> None:
        heading = " ".join(heading.split())
        if len(heading) > LONGEST_NAME:
            raise self.header_error(
                f"the heading of column {i + 1} has {len(heading)} characters, at most"
                f" {LONGEST_NAME} are taken"
            )
        if not heading and not any(cells):
            return  # what a separator at the ends of lines makes
        if not heading and i == 0 and _number_rows(cells):
            self.notes.append("the first column, which has no name, numbers the rows: left out")
            return
        name, unit = parted(heading)
        if not name:
            raise self.header_error(f"column {i + 1} is headed {heading!r}: expected 'name [unit]'")
        if name in self.columns and not is_known(name):
            name = f"{name} ({i + 1})"
        if name in self.columns:
            first = list(self.columns).index(name) + 1
            raise self.header_error(f"column {name!r} appears twice (columns {first} and {i + 1})")
        lines = tuple(self.lines)
        place = str(self.path)
        self.columns[name] = Column(
            *(name, unit, cells, place, self._header_line, lines, self._comma),
            *(self._decimals, self._units),
        )

    def leave_out(self, names: Collection[str]) -> None:
        """Forget columns that are not looked at."""
        self._forgotten += [self.columns[name] for name in names if name in self.columns]
        self.columns = {n: column for n, column in self.columns.items() if n not in names}

    def without(self, names: Collection[str]) -> Table:
        """The table without some columns; this one keeps them."""
        found = copy(self)
        found.columns = {n: column for n, column in self.columns.items() if n not in names}
        return found

    def take(self, rows: Sequence[int]) -> None:
        """Keep these rows, in this order."""
        self.lines = [self.lines[row] for row in rows]
        self.columns = {name: column.take(rows) for name, column in self.columns.items()}

    def understood(self) -> tuple[Understood, ...]:
        """List the meaning of each column: those that are read, then those that are left out."""
        read = [(name, each) for name, each in self.columns.items() if not each.also]
        found = []
        for meaning, column in [*read, *((None, each) for each in self._forgotten)]:
            unit, stated = self._units_taken.get(meaning or "", (None, ""))
            found.append(
                Understood(column.name, meaning, unit, stated, column.place, column.heading)
            )
        return tuple(found)

    def take_over(self, other: Table) -> None:
        """Have the columns that were left out of another table among those of this one."""
        self._forgotten += other._forgotten

    def put(self, name: str, column: Column) -> None:
        """Add a column, of another table or made here, with a cell for each row."""
        self.columns[name] = column

    def written(self, name: str, cells: Sequence[str]) -> Column:
        """A column that is made of what another says; messages name that one."""
        return replace(self.columns[name], unit=None, cells=tuple(cells))

    def header_error(self, message: str, column: Column | None = None) -> FileError:
        """An error in the line of column names; of a column in that of its own file."""
        place, line = str(self.path), self._header_line
        if column is not None:
            place, line = column.place, column.heading
        return FileError(f"{place}, line {line}: {message}" if line else f"{place}: {message}")

    def cell_error(self, name: str, row: int, message: str) -> FileError:
        """An error in one cell; rows count from 0."""
        column = self.columns.get(name)
        if column is None:
            return FileError(f"{self.path}, line {self.lines[row]}, column {name!r}: {message}")
        where = f"{column.place}, line {column.lines[row]}, column {column.name!r}"
        return FileError(f"{where}: {message}")

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
            if other is not column and known_as(name) not in BESIDE:
                raise self.header_error(
                    f"columns {other.name!r} and {column.name!r} are both {known_as(name)!r};"
                    " ignore one, as with --ignore"
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
                raise self.missing(name)

    def missing(self, name: str, otherwise: str = "") -> FileError:
        """An error that a column is not there; `otherwise` is said where none was left out."""
        hint = otherwise
        if self.left_out:
            named = ", ".join(map(repr, list(self.left_out)[:SHOWN]))
            more = ", …" if len(self.left_out) > SHOWN else ""
            number = re.findall(r"\d+", name)[-1:]
            alike = [
                each for each in self.left_out if number and re.findall(r"\d+", each) == number
            ]
            typed = shlex.quote(f"{alike[0] if len(alike) == 1 else 'OLD'}={name}")
            hint = f"; not known: {named}{more}; if one of them is it: --rename {typed}"
        return self.header_error(f"missing column {name!r}{hint}")

    def _column(self, name: str) -> Column:
        self.require([name])
        return self.columns[name]

    def numbers(
        self,
        name: str,
        *quantities: str,
        blank: bool = False,
        unseen: bool = False,
        like: str | None = None,
        expected: str | None = None,
    ) -> tuple[FloatArray, str]:
        """A column of finite numbers in mm or rad.

        Parameters
        ----------
        name : str
            The column.
        *quantities : str
            What it may be: "mm" for lengths, "rad" for angles, "mm*mm", "mm*rad"… for products;
            "count" for steps and revolutions, "1" for a number without unit.
        blank : bool
            Whether an empty cell is NaN instead of an error.
        unseen : bool
            Whether ``---``, ``n/a`` and the like are, too.
        like : str, optional
            The column whose unit counts where this one has none.
        expected : str, optional
            Which of `quantities` it is, where that decides between units that are stated for all.

        Returns
        -------
        values : (rows,) array
        quantity : str
            Which of `quantities` its unit belongs to.
        """
        column = self._column(name)
        if column.unit is None and like in self.columns and (unit := self.columns[like].unit):
            other = self.columns[like].name
            self.note(f"column {column.name!r} has no unit, taken as [{unit}] like {other!r}")
            column = replace(column, unit=unit)
            self._units_taken[name] = unit, other
        elif column.unit:
            self._units_taken[name] = column.unit, "heading"
        quantity, (times, over) = self._conversion(name, column, quantities, expected)
        values = self._values(name, column, blank, unseen)
        with np.errstate(over="ignore"):
            converted = values * times / over
        if (row := int(np.argmax(np.isinf(converted)))) or np.isinf(converted[0]):
            cell = column.cells[row]
            raise self.cell_error(
                name, row, f"expected a smaller number, found {printable(cell)!r}"
            )
        return converted, quantity

    def _values(self, name: str, column: Column, blank: bool, unseen: bool) -> FloatArray:
        """The numbers of a column as they stand."""
        alone = numbers_alone(column.cells)  # as programs write them, which may be very many
        if alone is not None and np.isfinite(alone).all():
            if column.decimal_comma:
                self._decide(name, column)
            return np.array(alone)
        values = np.empty(len(self))
        signs = self._signs(name, column)
        for row, cell in enumerate(column.cells):
            if unseen and cell.lower() in _UNSEEN:
                values[row] = math.nan
                self.note(f"cells with {printable(cell)!r} taken as not measured")
                continue
            values[row] = math.nan if blank and not cell else self._number(name, row, cell, signs)
        return values

    def stacked(self, names: Sequence[str], units: Sequence[str]) -> FloatArray:
        """Columns of numbers side by side (rows, k), each in its unit; all have to be there."""
        self.require(names)
        columns = [self.numbers(name, unit)[0] for name, unit in zip(names, units, strict=True)]
        return np.stack(columns, axis=1)

    def _conversion(
        self, name: str, column: Column, quantities: tuple[str, ...], expected: str | None
    ) -> tuple[str, tuple[float, float]]:
        known = {unit: q for q in reversed(quantities) for unit in units.factors(q)}
        usual = ", ".join(
            dict.fromkeys(
                u for q in quantities for u in units.factors(q) if u.isascii() and u.isalnum()
            )
            or quantities
        )
        if not column.unit and "1" in quantities:
            return "1", (1.0, 1.0)
        column_unit = {"rad": "deg"}.get(quantities[0], quantities[0])
        stated = column.unit or self._stated(name, column, (expected,) if expected else quantities)
        if not stated:
            option = f"--rename '{column.name}={column.name} [{column_unit}]'"
            if units.quantity_of(column_unit):
                option = f"--units {column_unit} for all columns without one"
            raise self.header_error(
                f"column {column.name!r} has no unit: expected '{column.name} [{quantities[0]}]'"
                f" (or another of {usual}), or {option}",
                column,
            )
        unit = units.plain(stated, known)
        if unit not in known:
            raise self.header_error(
                f"column {column.name!r} has unit [{column.unit}]: expected one of {usual}",
                column,
            )
        return known[unit], units.factors(known[unit])[unit]

    def _stated(self, name: str, column: Column, quantities: tuple[str, ...]) -> str | None:
        """The unit of a column without one, as the file or the caller states it for all."""
        of = [q for q in quantities if q in self._default_units or q in column.stated]
        if len(of) != 1:
            return None
        what = {"mm": "lengths", "rad": "angles"}.get(of[0], of[0])
        if of[0] in self._default_units:
            self._units_taken[name] = self._default_units[of[0]], "options"
            return self._default_units[of[0]]
        unit, line = column.stated[of[0]]
        where = f"line {line}" if column.place == str(self.path) else f"{column.place}, line {line}"
        self.note(f"{what} without a unit in {unit}, as {where} states")
        self._units_taken[name] = unit, f"line {line}"
        return unit

    def note(self, text: str) -> None:
        """Say what was assumed, once."""
        if text not in self.notes:
            self.notes.append(text)

    def _signs(self, name: str, column: Column) -> Signs | None:
        found = thousands(column.cells)
        if found is None:
            if column.decimal_comma:
                self._decide(name, column)
            return None
        self.note(f"{found[1]!r} in column {column.name!r} taken as a number with thousands apart")
        return found[0]

    def _decide(self, name: str, column: Column) -> None:
        """Take 1,234 for less than two where the other decimals of its file do not contradict."""
        for row, mark in undecided(column.cells):
            cell = printable(column.cells[row])
            less, more = cell.replace(mark, "."), cell.replace(mark, "")
            others = [shown for other, shown in column.decimals.items() if other != mark]
            if others:
                raise self.cell_error(
                    name,
                    row,
                    f"{cell!r} may be {less} or {more}: others, such as {printable(others[0])!r},"
                    " have decimals in another way",
                )
            if mark == "," and not column.decimals:
                self.note(f"{cell!r} in column {column.name!r} taken as {less}")

    def _number(self, name: str, row: int, cell: str, signs: Signs | None) -> float:
        try:
            value = float(plain(cell, signs, self.columns[name].decimal_comma))
        except ValueError:
            found = f"found {printable(cell)!r}" if cell else "found an empty cell"
            raise self.cell_error(name, row, f"expected a number, {found}") from None
        if not math.isfinite(value):
            raise self.cell_error(name, row, f"expected a finite number, found {printable(cell)!r}")
        return value

    def texts(self, name: str) -> tuple[str, ...]:
        """A column of names, without unit and none of them empty."""
        column = self._column(name)
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
                raise self.cell_error(
                    name, row, f"expected a whole number, found {printable(cell)!r}"
                )
        return np.array([int(cell) for cell in cells], dtype=np.int64)


def _number_rows(cells: Sequence[str]) -> bool:
    """Return whether cells are an index of a data frame: whole numbers, no two alike."""
    return all(cell.isdecimal() for cell in cells) and len({*cells}) == len(cells)


def _fitted(cells: list[str], names: Sequence[str], packed: bool) -> list[str]:
    """A row without blank cells beyond the last name; rows of a workbook end where they end."""
    width = len(names)
    if len(cells) > width and not any(cells[width:]):
        return cells[:width]
    if len(cells) < width and (packed or not any(names[len(cells) :])):
        return cells + [""] * (width - len(cells))
    return cells
