"""Constants of an instrument, as a focal length: a column ``KIND.FIELD`` of a file each.

Every field of its class that no other column holds: numbers and words are written and read back,
anything else is refused, so that no file is read with another instrument than it was written with.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np

from pkmcal.arguments import kind
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings.reading import Reading

R = TypeVar("R", bound=Reading)


def names_of_constants(reading: Reading) -> tuple[str, ...]:
    """Fields that no other column of its kind holds, and that are no truth of a simulation."""
    of = (reading.per_row, reading.labels, reading.own_points, reading.truth, reading.stated)
    others = {name for names in of for name in names}
    return tuple(each.name for each in _fields(reading) if each.name not in others)


def columns_of_constants(reading: Reading, rows: int) -> Iterator[WrittenColumn]:
    """A column of equal cells for each that is stated.

    Raises
    ------
    ValueError
        A field that is no number and no word.
    """
    for name in names_of_constants(reading):
        value = getattr(reading, name)
        if value is None or value == _default(reading, name) == "":
            continue  # an empty cell says nothing
        if not isinstance(value, bool | int | float | str | np.integer | np.floating):
            raise ArgumentError(
                f"kind: {name} of {reading.name!r} is of class {kind(value)}, and a column holds"
                " numbers or words: the class has to write and read it (columns_in_file, read) and"
                " to name it in stated"
            )
        whole = isinstance(value, bool | str | int | np.integer)
        yield WrittenColumn(
            _heading(reading, name), "", np.full(rows, str(value) if whole else float(value))
        )


def with_constants(reading: R, table: Table) -> R:
    """The instrument with the constants that columns of a table hold.

    Raises
    ------
    ValueError
        A cell that is no such number, differs from those above it, or contradicts what the caller
        states of the instrument.
    """
    found: dict[str, Any] = {}
    for name in names_of_constants(reading):
        column = _heading(reading, name)
        if column not in table.columns:
            continue
        cells = table.texts(column)
        for row, cell in enumerate(cells):
            if cell != cells[0]:
                raise table.cell_error(
                    column, row, f"an instrument has one {name}, found {cell!r} and {cells[0]!r}"
                )
        own, default = getattr(reading, name), _default(reading, name)
        try:
            found[name] = _value(cells[0], own)
        except ValueError:
            message = f"expected a {kind(own)} as {own!r}, found {cells[0]!r}"
            raise table.cell_error(column, 0, message) from None
        if own != default and own != found[name]:
            raise table.cell_error(column, 0, f"{cells[0]} is not {name}={own!r} of the kind given")
    return reading.with_fields(found)


def headings_of_constants(reading: Reading) -> set[str]:
    """Names of their columns."""
    return {_heading(reading, name) for name in names_of_constants(reading)}


def _heading(reading: Reading, name: str) -> str:
    return f"{reading.name}.{name}"


def _fields(reading: Reading) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(reading) if dataclasses.is_dataclass(reading) else ()


def _default(reading: Reading, name: str) -> Any:
    (field,) = (each for each in _fields(reading) if each.name == name)
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _value(cell: str, like: Any) -> Any:
    """Return a cell as the field's type; for None a number, or else a word."""
    if isinstance(like, str):
        return cell
    if isinstance(like, bool):
        return bool(("False", "True").index(cell))  # a ValueError of any other word
    if like is not None and not isinstance(like, int | np.integer):
        return float(cell)
    if re.fullmatch(r"[+-]?[0-9]+", cell):
        return int(cell)
    try:
        return float(cell)
    except ValueError:
        if like is None:
            return cell
        raise
