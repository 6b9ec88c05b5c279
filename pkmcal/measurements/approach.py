"""Approach of each actuator to its reading, for drives with backlash."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn, numbered
from pkmcal.measurements.actuator_columns import read_of_actuators
from pkmcal.measurements.field import Field
from pkmcal.readings import rows
from pkmcal.readings.reading import Reading


class Approach(Field):
    """1 where a reading had grown, -1 where it had fallen, 0 where that is not known."""

    logged = True

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Signs (N, n); "order": by the order of the rows, and of both places of each."""
        if isinstance(given, str):
            if given != "order":
                raise ArgumentError(f"approach must be 'order' or numbers; found {given!r}")
            if m.other is None:
                return _in_order(m.actuators)
            way = np.stack([m.actuators, m.other], axis=1)  # from each place to the next
            return _in_order(way.reshape(-1, way.shape[2]))[::2]
        return rows.signs("approach", given, m.actuators.shape)

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return the names of the columns: one for all actuators, or one for each."""
        return {self.name, *(f"{self.name}.{q}" for q in actuators)}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Read whole numbers (rows, n)."""
        return read_of_actuators(table, self.name, len(units), table.integers)

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write a column for each actuator."""
        if m.approach is not None:
            yield from numbered(self.name, "", m.approach.astype(np.int64))

    def said(self, m: Any) -> str:
        """Say that the approach is stated."""
        return "" if m.approach is None else "approach stated"


def _in_order(way: FloatArray) -> FloatArray:
    """Return the approach of each actuator to places (P, n) that follow one another."""
    moved: FloatArray = np.sign(np.diff(way, axis=0, prepend=way[:1]))
    for row, before in zip(moved[1:], moved[:-1], strict=True):
        row[row == 0.0] = before[row == 0.0]  # it stood still since
    return moved
