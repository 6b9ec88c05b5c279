"""Write a CSV file whole: comment lines, headings, rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike
from typing import NamedTuple

import numpy as np

from pkmcal import arguments
from pkmcal.arrays import FloatArray, IntArray, TextArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole


class WrittenColumn(NamedTuple):
    """A column that is to be written or printed.

    Attributes
    ----------
    name : str
        Its name, without unit.
    unit : str
        "mm", "rad" or another; "" where it has none.
    values : ndarray (N,)
        Numbers, NaN where there is none, or texts.
    """

    name: str
    unit: str
    values: FloatArray | IntArray | TextArray

    @property
    def heading(self) -> str:
        """Heading of the column: its name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def cells(self) -> list[str]:
        """The shortest decimals that are read back to the same bits; nothing for NaN."""
        values = np.asarray(self.values)
        if values.dtype.kind != "f":
            return [str(value) for value in values.tolist()]
        return ["" if math.isnan(value) else repr(value) for value in values.tolist()]


def with_cells(
    columns: Iterable[WrittenColumn], rows: int, owner: object
) -> Iterator[WrittenColumn]:
    """The columns of a reading; refuses one without a cell for each of its rows.

    Raises
    ------
    ValueError
        The class and the column, by their names.
    """
    for column in columns:
        if np.shape(column.values) != (rows,):
            raise ArgumentError(
                f"kind: the class {type(owner).__name__} writes the column {column.name!r} with"
                f" shape {np.shape(column.values)}: one cell for each of {rows} rows is needed"
            )
        yield column


def numbered(
    name: str, unit: str | Sequence[str], values: FloatArray | IntArray
) -> Iterable[WrittenColumn]:
    """Columns ``name.q1`` … of numbers (N, n) of the actuators, each with its unit."""
    units = [unit] * values.shape[1] if isinstance(unit, str) else unit
    for i, (one, column) in enumerate(zip(units, values.T, strict=True)):
        yield WrittenColumn(f"{name}.q{i + 1}", one, column)


def write_csv(
    path: str | PathLike[str],
    headings: Iterable[str],
    rows: Iterable[Iterable[str]],
    *,
    comment: str = "",
) -> None:
    """Write a file that `pkmcal.files.csv_table.Table` reads back, or nothing.

    Parameters
    ----------
    path : str or path
        The file; replaced as a whole or not at all.
    headings : iterable of str
        Of the columns, each with its unit.
    rows : iterable of iterables of str
        Cells.
    comment : str, optional
        Lines for its head, each with its ``#``.

    Raises
    ------
    ValueError
        A line of the comment without its ``#``.
    OSError
        The file cannot be written; one that was there before is untouched.
    """
    write_whole(path, arguments.comment(comment) + lines_of([headings, *rows]))


def lines_of(rows: Iterable[Iterable[str]]) -> str:
    """Lines of a CSV file, each with its end."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
