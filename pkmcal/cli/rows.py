"""Rows of coordinates: numbers on the command line, and tables on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal import display
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed

POSE_UNITS = ("mm", "mm", "mm", "rad", "rad", "rad")


def numbers_on_line(what: str, text: str, units: Sequence[str], rad: bool) -> FloatArray | None:
    """Return the numbers of one row (1, n) in mm and rad; None for the name of a file."""
    try:
        row = np.array([typed(part) for part in text.split(",")])
    except ValueError:
        return None
    if len(row) != len(units):
        raise ArgumentError(f"{what} {text}: {len(row)} numbers, the machine has {len(units)}")
    if not np.isfinite(row).all():
        raise ArgumentError(f"{what} {text}: the numbers must be finite")
    if not rad:
        row[[unit == "rad" for unit in units]] *= np.pi / 180
    return row[None]


def table(heads: Sequence[str], units: Sequence[str], rows: FloatArray) -> str:
    """Return rows as a table, to 0.1 µm and 0.0001 deg."""
    named = zip(heads, units, strict=True)
    shown = [f"{name} [{display.displayed(0.0, unit)[1]}]" for name, unit in named]
    cells = (
        [
            display.fixed(display.displayed(float(value), unit)[0], 4)
            for value, unit in zip(row, units, strict=True)
        ]
        for row in rows
    )
    return str(display.Table(["row", *shown], [[str(i), *line] for i, line in enumerate(cells)]))
