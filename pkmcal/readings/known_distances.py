"""Known distances between touched points: as the caller states them, and as columns of a file.

============================  =====================================================================
columns                       meaning
============================  =====================================================================
``touch.to``                  another artefact to which the distance is known …
``touch.distance [mm]``       … and which it is …
``touch.sigma [mm]``          … and its standard deviation, 1 µm by default
============================  =====================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pkmcal.arguments import number, shown, words
from pkmcal.arrays import TextArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn

TouchDistances = tuple[tuple[str, str, float, float], ...]  # two names, mm, standard deviation
STATED_DISTANCES = ("touch.to", "touch.distance", "touch.sigma")

_GAUGE = 0.001  # mm; standard deviation of a known distance


def checked_distances(
    given: Mapping[tuple[str, str], Any] | TouchDistances, artefact: str
) -> TouchDistances:
    """Known distances, each with its deviation.

    Raises
    ------
    ValueError, TypeError
        A pair that is not of two names, a number that does not fit, artefacts without a centre.
    """
    if given and artefact in ("line", "plane"):
        raise ArgumentError(f"distances: between points and centres of spheres, found {artefact!r}")
    if not isinstance(given, Mapping):
        given = {(one, other): (mm, sigma) for one, other, mm, sigma in given}
    found = []
    for pair, distance in given.items():
        if not isinstance(pair, tuple) or len(words("distances", pair)) != 2:
            raise ArgumentError(
                f"distances: between two names, found {shown(pair)} (a known distance is"
                ' {("A", "B"): 50.0})'
            )
        both = distance if isinstance(distance, tuple | list) else (distance, _GAUGE)
        if len(both) != 2 or pair[0] == pair[1]:
            raise ArgumentError(f"distances of {pair}: found {shown(distance)}")
        said = f"distances of {pair[0]} and {pair[1]}"
        mm, sigma = number(said, both[0], above=0), number(f"sigma of {said}", both[1], above=0)
        found.append((*pair, mm, sigma))
    return tuple(found)


def distances_read(table: Table, touch: str) -> TouchDistances:
    """Known distances that a table states beside the column `touch` of what is touched."""
    if not any(name in table.columns for name in STATED_DISTANCES):
        return ()
    table.require(STATED_DISTANCES[:2])
    touched, to = table.texts(touch), table.columns["touch.to"].cells
    mm = table.numbers("touch.distance", "mm", blank=True)[0]
    sigma = np.full(len(table), np.nan)
    if "touch.sigma" in table.columns:
        sigma = table.numbers("touch.sigma", "mm", blank=True, like="touch.distance")[0]
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for row, other in enumerate(to):
        if not other and np.isnan(mm[row]):
            continue
        if not other or np.isnan(mm[row]):
            empty = "touch.distance" if other else "touch.to"
            raise table.cell_error(empty, row, "found an empty cell beside one with a distance")
        said = float(mm[row]), _GAUGE if np.isnan(sigma[row]) else float(sigma[row])
        if found.setdefault((touched[row], other), said) != said:
            raise table.cell_error("touch.distance", row, "found another distance than before")
    return tuple((*pair, *said) for pair, said in found.items())


def stated_columns(touched: TextArray, distances: TouchDistances) -> Iterator[WrittenColumn]:
    """Columns of known distances, each in a row that touches one of the two.

    Raises
    ------
    ValueError
        Neither is touched by a row that states no other distance.
    """
    to = [""] * len(touched)
    mm, sigma = np.full(len(touched), np.nan), np.full(len(touched), np.nan)
    for one, other, distance, deviation in distances:
        pairs = ((here, there) for here, there in ((one, other), (other, one)))
        row, there = next(
            ((int(row), there) for here, there in pairs for row in np.flatnonzero(touched == here)
             if not to[row]),
            (-1, ""),
        )  # fmt: skip
        if row < 0:
            raise ValueError(
                f"distances: no row is left that touches {one} or {other}, to state it in"
            )
        to[row], mm[row], sigma[row] = there, distance, deviation
    named, *numbers = STATED_DISTANCES
    yield WrittenColumn(named, "", np.array(to))
    for name, column in zip(numbers, (mm, sigma), strict=True):
        yield WrittenColumn(name, "mm", column)
