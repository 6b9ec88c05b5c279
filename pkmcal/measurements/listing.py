"""Measurements as they are printed: a line of what they are, and a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal import display
from pkmcal.display import Table
from pkmcal.files.csv_writer import WrittenColumn, numbered, with_cells
from pkmcal.measurements.field import row_fields
from pkmcal.measurements.sigma import deviations

_LISTED_ROWS = 12  # a longer list of measurements is printed with its middle left out


def table(m: Any, units: Sequence[str] | None = None) -> Table:
    """The rows, of many the first and the last.

    Parameters
    ----------
    m : Measurements
        The rows.
    units : sequence of str, optional
        Of the actuators, as `reading_units` has them; those of the measurements by default, which
        do not know of counts.
    """
    heads, columns = ["row"], [[str(row) for row in range(len(m))]]
    for column, sigma in _columns(m, units):
        shown = display.displayed(0.0, column.unit)[1]
        heads.append(column._replace(unit=shown).heading)
        columns.append(_cells(column, sigma))
    rows = list(zip(*columns, strict=True))
    if len(rows) > _LISTED_ROWS:
        rows[_LISTED_ROWS - 4 : -3] = [("⋮",) * len(heads)]
    return Table(heads, rows)


def title(m: Any) -> str:
    """Return the title of the printed table: number and kind of rows, stated fields."""
    n = m.actuators.shape[1]
    said = (field.said(m) for field in row_fields(type(m)))
    return ", ".join([m.instrument.title(m), f"{n} actuator{'' if n == 1 else 's'}",
                      *filter(None, said)])  # fmt: skip


def _columns(m: Any, units: Sequence[str] | None) -> Iterator[tuple[WrittenColumn, float | None]]:
    """Columns, with the least deviation of those that have one."""
    units = units or m.actuator_units or ("",) * m.actuators.shape[1]
    for column in numbered("", units, m.actuators):
        yield column._replace(name=column.name[1:]), None
    for column in with_cells(m.instrument.columns(units), len(m), m.instrument):
        yield column, None
    sigmas = deviations(m)
    values = m.values.reshape(len(m), -1)
    shown = m.instrument.value_columns(values)
    for i, column in enumerate(with_cells(shown, len(m), m.instrument)):
        yield column, None if sigmas is None else float(sigmas[:, i].min())
    for field in row_fields(type(m)):
        for column in field.printed(m):
            yield column, None


def _cells(column: WrittenColumn, sigma: float | None) -> list[str]:
    """Numbers to the digits their sigma supports, else to 0.1 µm and 0.0001 degrees."""
    values = np.asarray(column.values)
    if values.dtype.kind != "f":
        return [display.printable(cell) for cell in column.cells()]
    unit = column.unit
    places = 4
    if sigma is not None:
        places = display.decimals(display.displayed(sigma, unit)[0])
    return [
        "" if np.isnan(value) else display.fixed(display.displayed(float(value), unit)[0], places)
        for value in values
    ]
