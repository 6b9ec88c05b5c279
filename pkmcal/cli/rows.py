"""Rows of coordinates as tables on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal import display
from pkmcal.arrays import FloatArray

POSE_UNITS = ("mm", "mm", "mm", "rad", "rad", "rad")


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
