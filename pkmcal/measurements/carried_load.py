"""The load on the platform and the force on the tool, row by row."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, Unit
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.geometry.carried import CARRIED, Load
from pkmcal.measurements.field import Field
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import numbers

_UNITS: tuple[Unit, ...] = ("kg", *("mm",) * 3, *("N",) * 3, *("N mm",) * 3)
_COLUMNS = tuple(
    "payload" if name == "mass" else name.replace("centre", "payload") for name in CARRIED
)  # payload, payload.x …, force.x …, moment.x …


class CarriedLoad(Field):
    """Mass, centre, force and moment (N, 10), in the order of `CARRIED`."""

    logged = True

    def kept(self, given: Any, m: Any) -> FloatArray:
        """A `Load`, or its numbers (10,) or (N, 10)."""
        if not isinstance(given, Load):
            if isinstance(given, list | tuple) and any(isinstance(each, Load) for each in given):
                raise ArgumentTypeError(
                    "load must be one Load, found several in a list: give one Load for all rows,"
                    " of which mass, centre, force or moment may have a value for each row"
                )
            rows = numbers(self.name, given)
            if rows.shape[-1:] != (len(CARRIED),):
                raise ArgumentError(
                    f"load must be a Load, or have shape (N, {len(CARRIED)}); found {rows.shape}"
                )
            given = Load.of_rows(rows)
        found = given.rows((len(m),))
        return np.array(np.broadcast_to(found, (len(m), len(CARRIED))))

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """``payload``, ``payload.x`` …, ``force.x`` …, ``moment.x`` …."""
        return set(_COLUMNS)

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Read loads in kg, mm, N and N mm; 0 of what has no column."""
        given = [name for name in _COLUMNS if name in table.columns]
        if not given:
            return None
        found = np.zeros((len(table), len(_COLUMNS)))
        for name in given:
            i = _COLUMNS.index(name)
            found[:, i] = table.numbers(name, _UNITS[i])[0]
        if (found[:, 0] < 0.0).any():
            row = int(np.argmax(found[:, 0] < 0.0))
            cell = table.columns["payload"].cells[row]
            raise table.cell_error("payload", row, f"a mass is not negative, found {cell}")
        if "payload" not in given and found[:, 1:4].any():
            raise table.header_error("payload.x … are the centre of a payload without a column")
        return found

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """The mass, and what else is not 0 in all rows."""
        if m.load is None:
            return
        for i, (name, unit) in enumerate(zip(_COLUMNS, _UNITS, strict=True)):
            if i == 0 or m.load[:, i].any():
                yield WrittenColumn(name, unit, m.load[:, i])

    def said(self, m: Any) -> str:
        """The masses that it carried, or that it was pulled at."""
        if m.load is None:
            return ""
        least, most = m.load[:, 0].min(), m.load[:, 0].max()
        if not most:
            return "load stated"
        return f"payload {most:g} kg" if least == most else f"payload {least:g} to {most:g} kg"
