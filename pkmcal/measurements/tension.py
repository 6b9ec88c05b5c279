"""Tension of what each actuator drives, and how well it was read."""

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
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import of_actuators


class Tension(Field):
    """Tensions (N, n), N; NaN where they were not read."""

    logged = True
    blank = True

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Check tensions of each actuator, given for all, for each or for each row."""
        return of_actuators(self.name, given, m.actuators.shape, self.blank)

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return the names of the columns: one for all actuators, or one for each."""
        return {self.name, *(f"{self.name}.{q}" for q in actuators)}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Read tensions in N."""
        return read_of_actuators(
            table,
            self.name,
            len(units),
            lambda name: table.numbers(name, "N", blank=self.blank)[0],
        )

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write a column for each actuator."""
        if self.of(m) is not None:
            yield from numbered(self.name, "N", self.of(m))

    def said(self, m: Any) -> str:
        """Say whether tensions are exact."""
        if m.tension is None:
            return ""
        return "tension stated" if m.tension_sigma is None else "tension read"


class TensionSigma(Tension):
    """Standard deviations (N, n) of tensions, N."""

    blank = False

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Positive, and of tensions that are there."""
        if m.tension is None:
            raise ArgumentError("tension_sigma: no tension was read that it could be of")
        found = super().kept(given, m)
        if not (found > 0.0).all():
            raise ArgumentError(
                f"tension_sigma must be positive, found {found.min():g}; without it tensions are"
                " exact"
            )
        return found

    def said(self, m: Any) -> str:
        """Nothing beside what is said of tensions."""
        return ""


def filled_tension(tension: FloatArray) -> FloatArray:
    """Tensions (N, n), those that were not read (NaN) at the mean of their row, else at 0.

    Examples
    --------
    >>> filled_tension(np.array([[10.0, np.nan, 30.0]]))
    array([[10., 20., 30.]])
    """
    read = np.isfinite(tension)
    if read.all():
        return tension
    count = np.maximum(read.sum(axis=1, keepdims=True), 1)
    mean = np.nansum(tension, axis=1, keepdims=True) / count
    return np.where(read, tension, mean)
