"""Further numbers of the rows, for readings and effects of a user's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal.arguments import shown
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.measurements.field import Field, row_numbers
from pkmcal.readings.reading import Reading


class Beside(Field):
    """Numbers by a name, as a current: a structured array (N,), with the columns ``beside.NAME``.

    NaN: not read there.
    """

    logged = True
    named = True

    def kept(self, given: Any, m: Any) -> Any:
        """Numbers (N,) by name; or an array that has them by name."""
        if isinstance(given, np.ndarray) and given.dtype.names:
            given = {name: given[name] for name in given.dtype.names}
        if not isinstance(given, Mapping) or not given:
            raise ArgumentTypeError(
                f"{self.name} must be numbers of the rows by their names, as in"
                f" {self.name}={{'current': …}}; found {shown(given)}"
            )
        for name in given:
            if not isinstance(name, str) or not name.isidentifier():
                raise ArgumentError(
                    f"{self.name}: names are letters, digits and _, and begin with no digit;"
                    f" found {name!r}"
                )
        found = np.empty(len(m), dtype=[(name, np.float64) for name in given])
        for name, values in given.items():
            found[name] = row_numbers(f"{self.name}: {name}", values, len(m), blank=True)
        return found

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> Any:
        """Read every column ``beside.NAME``."""
        start = f"{self.name}."
        names = [name for name in table.columns if name.startswith(start)]
        if not names:
            return None
        return {name.removeprefix(start): table.numbers(name, "1", blank=True)[0] for name in names}

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write a column for each name."""
        if (given := self.of(m)) is not None:
            for name in given.dtype.names:
                yield WrittenColumn(f"{self.name}.{name}", "", given[name])

    def said(self, m: Any) -> str:
        """Name the functions and their numbers in one line."""
        given = self.of(m)
        return "" if given is None else f"beside them {', '.join(given.dtype.names)}"
