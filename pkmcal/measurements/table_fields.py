"""What a table states of its rows beside what was read: their fields, and what was assumed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pkmcal.files.csv_table import Table
from pkmcal.measurements.field import row_fields
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading

FIELDS = row_fields(Measurements)


def read_fields(table: Table, read: Reading, units: Sequence[str]) -> dict[str, Any]:
    """Fields of the rows that a table states."""
    return {each.name: each.read(table, read, units) for each in FIELDS}


def notes_of(table: Table) -> tuple[str, ...]:
    """What was assumed when the table was read, a line each."""
    return (*table.elsewhere, *(f"{table.path}: {note}" for note in table.notes))
