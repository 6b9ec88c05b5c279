"""Rows of coordinates, as options and arguments have them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed


def numbers_on_line(
    what: str, text: str, units: Sequence[str], rad: bool, names: Sequence[str] = ()
) -> FloatArray | None:
    """Return the numbers of one row (1, n) in mm and rad; None for the name of a file.

    Names of the numbers are for a row of too few.
    """
    try:
        row = np.array([typed(part) for part in text.split(",")])
    except ValueError:
        return None
    if len(row) != len(units):
        missing = [text.strip(), *["0"] * (len(units) - len(row))]
        expected = ""
        if names and len(row) < len(units):
            expected = f": {' '.join(names)}, such as {','.join(missing)}"
        raise ArgumentError(
            f"{what} {text}: {len(row)} numbers, the machine has {len(units)}{expected}"
        )
    if not np.isfinite(row).all():
        raise ArgumentError(f"{what} {text}: the numbers must be finite")
    if not rad:
        row[[unit == "rad" for unit in units]] *= np.pi / 180
    return row[None]
