"""Fields that number rows: the pose they repeat, the line they were read from."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import Int64Array, TextArray
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.measurements.field import Field, integers
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import names


class Group(Field):
    """Rows with the same number are repeats of one pose."""

    def kept(self, given: Any, m: Any) -> Int64Array:
        """Check whole numbers (N,)."""
        return integers(self.name, given, len(m))

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> Int64Array | None:
        """Read whole numbers."""
        return table.integers(self.name) if self.name in table.columns else None

    def printed(self, m: Any) -> Iterator[WrittenColumn]:
        """Return the column of the printed table."""
        return self.framed(m)


class PoseName(Field):
    """The name of the pose of each row, such as a picture's, where a file has names of poses."""

    unit = None

    def kept(self, given: Any, m: Any) -> TextArray:
        """Check names (N,)."""
        return names(self.name, given, len(m))

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> TextArray | None:
        """Read names beside which a table has got their numbers, the `Group`."""
        return np.array(table.texts(self.name)) if self.name in table.columns else None


class Lines(Field):
    """The line of each row in the file it was read from; no column states it."""

    def kept(self, given: Any, m: Any) -> Int64Array:
        """Check whole numbers (N,)."""
        return integers(self.name, given, len(m))

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return no names: the column is read elsewhere."""
        return set()

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> Int64Array:
        """Read the place of each row in its file."""
        return np.array(table.lines, dtype=np.int64)

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Return no names: the column is read elsewhere."""
        return iter(())
