"""Columns of temperatures: of the whole machine, or of base, platform and what actuators drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.csv_table import Table

WHOLE = "temperature"
_TO_CELSIUS = {"°C": (1.0, 0.0), "K": (1.0, -273.15), "°F": (5.0 / 9.0, -160.0 / 9.0)}


def parts_of(actuators: int) -> list[str]:
    """The columns of a machine with so many actuators, in the order of the field."""
    parts = ["base", "platform", *(f"q{i + 1}" for i in range(actuators))]
    return [f"{WHOLE}.{part}" for part in parts]


def read_temperature(table: Table, actuators: int) -> FloatArray | None:
    """Temperatures (rows, 2 + n) in °C; NaN where none was read, or of a part without a column."""
    given = [name for name in table.columns if name.partition(".")[0] == WHOLE]
    if not given:
        return None
    parts = parts_of(actuators)
    for name in given:
        if name not in (WHOLE, *parts):
            raise table.header_error(
                f"column {table.columns[name].name!r} is the temperature of an actuator that the"
                f" machine has not: it has {actuators}"
            )
    read = {name: values for name in given if (values := _celsius(table, name)) is not None}
    whole = read.get(WHOLE, np.full(len(table), np.nan))
    return np.column_stack([read.get(name, whole) for name in parts]) if read else None


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


def temperature_cells(temperature: FloatArray) -> Iterator[tuple[str, Sequence[str]]]:
    """Headings and cells of temperatures (N, 2 + n): one column if all parts have the same."""
    same = np.array_equal(temperature, np.repeat(temperature[:, :1], temperature.shape[1], 1), True)
    names = [WHOLE] if same else parts_of(temperature.shape[1] - 2)
    for name, column in zip(names, temperature.T, strict=False):
        cells = ["" if math.isnan(value) else repr(value) for value in column.tolist()]
        if any(cells):
            yield f"{name} [°C]", cells
