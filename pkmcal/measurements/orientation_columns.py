"""Which columns of a file state an orientation, and the words for what they may mean."""

from __future__ import annotations

import itertools

from pkmcal.exceptions import ArgumentError
from pkmcal.files.column_names import ORIENTATIONS
from pkmcal.files.csv_table import Table

ANGLES = ("alpha", "beta", "gamma")
ORDERS = [
    "".join(order)
    for letters in ("xyz", "XYZ")
    for order in itertools.product(letters, repeat=3)
    if order[0] != order[1] != order[2]
]
QUATERNIONS = ("wxyz", "xyzw")
WORDS = (*QUATERNIONS, "rotvec")


def checked(rotation: str | None) -> str | None:
    """One of the words for how orientations are stated.

    Raises
    ------
    ValueError
        Another word.
    """
    if rotation is not None and rotation not in (*ORDERS, *WORDS):
        raise ArgumentError(
            f"rotation must be an order of axes such as ZYX (each about the turned axis) or xyz"
            f" (about fixed axes), rotvec, wxyz or xyzw; found {rotation!r}"
        )
    return rotation


def names_in(table: Table) -> tuple[str, ...]:
    """The columns of an orientation; none where there are none, or not all of them."""
    for names in (ANGLES, *ORIENTATIONS):
        if all(name in table.columns for name in names):
            return names
    return ()
