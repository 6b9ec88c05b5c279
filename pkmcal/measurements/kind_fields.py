"""The fields of `Measurements` that single kinds have: what is read there is not one pose alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number, shown, word, words
from pkmcal.arrays import FloatArray, TextArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.components import TOUCHES, Artefact, Kind
from pkmcal.measurements.fields import is_name, numbers

TouchDistances = tuple[tuple[str, str, float, float], ...]  # two names, mm, standard deviation
GAUGE = 0.001  # mm; standard deviation of a known distance

_KIND_OF = {
    "other": "between",
    "run": "relative-distance",
    "touched": "touch",
    "artefact": "touch",
    "joint": "angle",
}
_NEEDED = {
    "other": "a distance between two places needs the actuators at the second",
    "run": "relative distances need the run that each is of",
}


class KindFields(NamedTuple):
    """What the caller gave of these fields, as `Measurements` describes each."""

    other: ArrayLike | None
    run: Sequence[str] | TextArray | None
    touched: Sequence[str] | TextArray | None
    artefact: Artefact | None
    touch_distances: Mapping[tuple[str, str], Any] | TouchDistances
    joint: str | None


def kind_fields(
    kind: Kind, shape: tuple[int, ...], values: ArrayLike | None, given: KindFields
) -> tuple[dict[str, Any], ArrayLike | None]:
    """The fields, checked, and the values: of touches how far off they are, which is 0.

    Raises
    ------
    ValueError, TypeError
        What this kind does not have, or has not got.
    """
    rows = shape[0]
    for name, of in _KIND_OF.items():
        if getattr(given, name) is not None and kind != of:
            raise ArgumentError(f"{name}: goes with values of kind {of!r}, not of {kind!r}")
        if getattr(given, name) is None and kind == of and name in _NEEDED:
            raise ArgumentError(f"{name}: {_NEEDED[name]}")
    if given.touch_distances and kind not in ("touch", "touch-distance"):
        raise ArgumentError(f"touch_distances: go with values of kind 'touch', not of {kind!r}")
    touched, artefact = given.touched, given.artefact
    if kind == "touch":
        artefact = word("artefact", given.artefact or "point", TOUCHES)
        if touched is None:
            touched, values = _names_touched(values), None
        if values is None:
            wide = len(TOUCHES[artefact])
            values = np.zeros((rows, wide) if wide > 1 else rows)
    fields = {
        "other": _other(given.other, shape),
        "run": _labels("run", given.run, rows),
        "touched": _labels("values" if given.touched is None else "touched", touched, rows),
        "artefact": artefact,
        "touch_distances": _distances(given.touch_distances, artefact),
        "joint": _joint(given.joint, kind),
    }
    return fields, values


def kind_fields_of_row(
    kind: Kind, values: ArrayLike | None, given: KindFields
) -> tuple[ArrayLike | None, KindFields]:
    """What is given of one row, a name where there are names, as that of (1,) rows."""
    if kind == "touch" and isinstance(values, str):
        values = [values]
    run, touched = ([n] if isinstance(n, str) else n for n in (given.run, given.touched))
    other = None if given.other is None else np.atleast_2d(np.asarray(given.other))
    return values, given._replace(other=other, run=run, touched=touched)


def _names_touched(values: ArrayLike | None) -> Sequence[str] | TextArray:
    named = np.asarray(values) if isinstance(values, list | tuple | np.ndarray) else None
    if named is None or named.ndim != 1 or named.dtype.kind != "U":
        raise ArgumentTypeError(
            "values of kind 'touch' must name what each row touches, one str a row; found"
            f" {shown(values)}"
        )
    return named


def _other(given: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray | None:
    if given is None:
        return None
    other = numbers("other", given)
    if other.shape != shape:
        raise ArgumentError(f"other must have shape {shape}, as actuators; found {other.shape}")
    return other


def _labels(argument: str, given: Sequence[str] | TextArray | None, rows: int) -> TextArray | None:
    """One name per row."""
    if given is None:
        return None
    names = words(argument, given.tolist() if isinstance(given, np.ndarray) else given)
    if isinstance(given, str) or len(names) != rows:
        raise ArgumentError(f"{argument} must be {rows} names, one a row; found {shown(given)}")
    for name in dict.fromkeys(names):
        if not is_name(name):
            raise ArgumentError(
                f"{argument} must be names on one line, of at most {LONGEST_NAME} characters;"
                f" found {shown(name)}"
            )
    return np.array(names)


def _distances(
    given: Mapping[tuple[str, str], Any] | TouchDistances, artefact: Artefact | None
) -> TouchDistances:
    if given and artefact in ("line", "plane"):
        raise ArgumentError(
            f"touch_distances: between points and centres of spheres, found {artefact!r}"
        )
    if not isinstance(given, Mapping):
        given = {(one, other): (mm, sigma) for one, other, mm, sigma in given}
    found = []
    for pair, distance in given.items():
        if not isinstance(pair, tuple) or len(words("touch_distances", pair)) != 2:
            raise ArgumentError(
                f"touch_distances: between two names, found {shown(pair)} (a known distance is"
                ' {("A", "B"): 50.0})'
            )
        both = distance if isinstance(distance, tuple | list) else (distance, GAUGE)
        if len(both) != 2 or pair[0] == pair[1]:
            raise ArgumentError(f"touch_distances of {pair}: found {shown(distance)}")
        said = f"touch_distances of {pair[0]} and {pair[1]}"
        mm, sigma = number(said, both[0], above=0), number(f"sigma of {said}", both[1], above=0)
        found.append((*pair, mm, sigma))
    return tuple(found)


def _joint(given: str | None, kind: Kind) -> str | None:
    if kind == "angle" and not (isinstance(given, str) and given):
        raise ArgumentError(f"joint: an angle is of a passive joint, by name; found {shown(given)}")
    return given
