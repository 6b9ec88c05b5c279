"""Arguments with an entry for every row: arrays of the right shape, or an error that names them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import shown, words
from pkmcal.arrays import FloatArray, IntArray, TextArray, as_numbers
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.reading import LONGEST_NAME


def numbers(name: str, given: ArrayLike, blank: bool = False) -> FloatArray:
    """A copy as finite doubles; `blank`: NaN is a number that is not there."""
    array = np.array(as_numbers(name, given, "n"), dtype=np.float64, order="C")
    wrong = np.isinf(array) if blank else ~np.isfinite(array)
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f" at index {', '.join(map(str, first))}" if first else ""
        raise ArgumentError(f"{name} must be finite; found {array[first]}{where}")
    return array


def of_actuators(
    name: str, given: ArrayLike, shape: tuple[int, ...], blank: bool = False
) -> FloatArray:
    """Numbers of each actuator (N, n), given for all, for each or for each row."""
    found = numbers(name, given, blank)
    if found.shape not in ((), shape[1:], shape):
        raise ArgumentError(
            f"{name} must be one number or have shape {shape[1:]} or {shape}; found {found.shape}"
        )
    return np.array(np.broadcast_to(found, shape))


def signs(name: str, given: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Sign of each actuator's approach (N, n): 1, -1 or 0."""
    found = of_actuators(name, given, shape)
    if not np.isin(found, (-1.0, 0.0, 1.0)).all():
        raise ArgumentError(f"{name} must be 1, -1 or 0 for each actuator")
    return found


def is_name(text: str) -> bool:
    """Return whether a name can be written and read: on one line, not empty, not too long."""
    return 0 < len(text) <= LONGEST_NAME and text == " ".join(text.split())


def names(argument: str, given: Sequence[str] | TextArray, rows: int) -> TextArray:
    """Check names, one per row; of one row the name alone will do."""
    if isinstance(given, str) and rows == 1:
        given = [given]
    found = words(argument, given.tolist() if isinstance(given, np.ndarray) else given)
    if isinstance(given, str) or len(found) != rows:
        raise ArgumentError(f"{argument} must be {rows} names, one a row; found {shown(given)}")
    for name in dict.fromkeys(found):
        if not is_name(name):
            raise ArgumentError(
                f"{argument} must be names on one line, of at most {LONGEST_NAME} characters;"
                f" found {shown(name)}"
            )
    return np.array(found)


def each(argument: str, given: ArrayLike, rows: int) -> np.ndarray:
    """A copy with an entry of any class, or an array, for each row."""
    try:
        found = np.array(given)
    except ValueError:  # arrays of several shapes
        found = np.empty(0)
    if found.shape[:1] != (rows,):
        raise ArgumentError(
            f"{argument} must have an entry for each of {rows} rows; found {shown(given)}"
        )
    return found


def of_names(table: Table, wanted: Mapping[str, str]) -> IntArray:
    """Rows of a table whose columns, as far as it has them, have these names.

    Raises
    ------
    ValueError
        A column with several names of which none is wanted, ""; a name that it has not.
    """
    own = np.ones(len(table), dtype=bool)
    for column, name in wanted.items():
        if column not in table.columns:
            continue
        texts = np.array(table.texts(column))
        there = list(dict.fromkeys(texts.tolist()))
        if not name and len(there) > 1:
            raise table.header_error(
                f"column {column!r}: there are several, {', '.join(there)}; name each, as"
                f" --{column} {there[0]}=… --{column} {there[1]}=… ({column}_name=)"
            )
        if name and name not in there:
            raise table.header_error(
                f"column {column!r}: no row of {name!r}; found {', '.join(there)}"
            )
        own &= (texts == name) | (not name)
    said = " and ".join(f"{column} {name!r}" for column, name in wanted.items() if name)
    if not own.any():
        raise table.header_error(f"there is no row of {said}")
    if not own.all():
        table.note(f"read {own.sum()} of {len(own)} rows, those of {said}")
    return np.flatnonzero(own)
