"""Standard deviations of the actuator readings."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.files.units import UNITS, plain
from pkmcal.measurements.actuator_columns import columns_of_actuators
from pkmcal.measurements.field import Field, one_or_each
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import of_actuators


class ActuatorSigma(Field):
    """Standard deviations (N, n) of the actuators, of which some may be 0 in all rows."""

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Given for all, for each or for each row, mm or rad."""
        whole = of_actuators("actuator_sigma", given, m.actuators.shape)
        if (whole < 0).any() or ((whole == 0).any(axis=0) & (whole > 0).any(axis=0)).any():
            raise ArgumentError(
                "actuator_sigma must be positive, or 0 for an actuator in all rows; found"
                f" {whole.min():g} (None means not known)"
            )
        return whole

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return the names of the columns: one for all actuators, or one for each."""
        return {self.name, *(f"{self.name}.{q}" for q in actuators)}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Read deviations in the unit of each actuator, or in steps where its readings are."""
        names = columns_of_actuators(table, self.name, len(units))
        if not names:
            return None
        if names == [self.name] and len(set(units)) > 1:
            raise table.header_error(
                "column 'actuator_sigma' for lengths and angles: expected"
                f" 'actuator_sigma.q1' to 'actuator_sigma.q{len(units)}'"
            )
        columns = [
            _like_the_reading(table, name, i, unit)
            for i, (name, unit) in enumerate(zip(names, units, strict=False))
        ]
        return np.broadcast_to(np.stack(columns, axis=1), (len(table), len(units)))

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write one column where all actuators have the same, else one for each."""
        if m.actuator_sigma is not None:
            yield from one_or_each(self.name, units, m.actuator_sigma)

    def said(self, m: Any) -> str:
        """Say that the actuators' deviation is stated."""
        return "" if m.actuator_sigma is None else "actuator_sigma stated"


def _like_the_reading(table: Table, name: str, i: int, unit: str) -> FloatArray:
    """Deviations of actuator i: in steps where its readings are, for a gain converts both."""
    of_reading = table.columns.get(f"q{i + 1}")
    if of_reading is None:
        return table.numbers(name, unit)[0]
    of = plain(of_reading.unit or unit)
    counted = of in UNITS["count"] and of not in UNITS[unit]
    values, quantity = table.numbers(name, *(("count", unit) if counted else (unit,)))
    if counted and quantity != "count":
        raise table.header_error(
            f"column {table.columns[name].name!r} has unit [{table.columns[name].unit}], and"
            f" {of_reading.name!r} [{of_reading.unit}]: expected the same"
        )
    return values
