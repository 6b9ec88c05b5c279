"""Temperatures of the machine, or of base, platform and what actuators drive."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.measurements.field import Field
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import numbers

_COLDEST = -273.15  # °C
_TO_CELSIUS = {"°C": (1.0, 0.0), "K": (1.0, -273.15), "°F": (5.0 / 9.0, -160.0 / 9.0)}


class Temperature(Field):
    """Temperatures (N, 2 + n) of base, platform and what each actuator drives, °C."""

    logged = True
    log_first = True

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Check temperatures of all, of each row or of each part; NaN where none was read."""
        found = numbers("temperature", given, blank=True)
        rows, parts = len(m), m.actuators.shape[1] + 2
        if found.shape not in ((), (rows,), (rows, parts)):
            raise ArgumentError(
                f"temperature must be a number or have shape ({rows},) or ({rows}, {parts}): of"
                f" base, platform and {parts - 2} actuators; found {found.shape}"
            )
        if (found < _COLDEST).any():
            raise ArgumentError(
                f"temperature in °C is above {_COLDEST}; found {np.nanmin(found):g}"
            )
        of_rows = found[:, None] if found.ndim == 1 else found
        return np.array(np.broadcast_to(of_rows, (rows, parts)))

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return the names of the columns: one for the whole machine, or one for each part."""
        return {self.name, *(f"{self.name}.{part}" for part in ("base", "platform", *actuators))}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Read temperatures in °C; NaN where none was read, or of a part without a column."""
        given = [name for name in table.columns if name.partition(".")[0] == self.name]
        if not given:
            return None
        parts = self._parts(len(units))
        for name in given:
            if name not in (self.name, *parts):
                raise table.header_error(
                    f"column {table.columns[name].name!r} is the temperature of an actuator that"
                    f" the machine has not: it has {len(units)}"
                )
        read = {name: values for name in given if (values := _celsius(table, name)) is not None}
        whole = read.get(self.name, np.full(len(table), np.nan))
        return np.column_stack([read.get(name, whole) for name in parts]) if read else None

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write one column if all parts have the same; none of a part that was never read."""
        if (given := m.temperature) is None:
            return
        same = np.array_equal(given, np.repeat(given[:, :1], given.shape[1], 1), True)
        names = [self.name] if same else self._parts(given.shape[1] - 2)
        for name, column in zip(names, given.T, strict=False):
            if np.isfinite(column).any():
                yield WrittenColumn(name, "°C", column)

    def _parts(self, actuators: int) -> list[str]:
        parts = ["base", "platform", *(f"q{i + 1}" for i in range(actuators))]
        return [f"{self.name}.{part}" for part in parts]


def _celsius(table: Table, name: str) -> FloatArray | None:
    """A column in °C; None, and a note, where it cannot be read: nothing else needs it."""
    try:
        return _read(table, name)
    except FileError as error:
        table.note(f"temperature left out: {error}")
        return None


def _read(table: Table, name: str) -> FloatArray:
    values, unit = table.numbers(name, *_TO_CELSIUS, "1", blank=True, unseen=True)
    if unit == "1":
        column = table.columns[name]
        where = "" if column.place == str(table.path) else f" of {column.place}"
        table.note(f"{column.name!r}{where} has no unit, taken as °C")
        return values
    factor, zero = _TO_CELSIUS[unit]
    return factor * values + zero
