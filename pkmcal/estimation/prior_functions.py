"""Priors on functions of numbers: a tape on the distance of two anchors, gains that are alike.

A function is a sum of numbers, ``base1.z - base2.z``, or the length of a sum of points,
``|base1 - base2|``.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arguments import did_you_mean, number
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable, NamedNumbers

_OPERATOR = re.compile(r"\s+([+-])\s+")
_BEHIND = "@.0123456789"  # a point's name without it says which body it is of
_LEAST = 1e-6  # of the machine's length, below which a length has no direction


def is_function(key: object, value: object) -> bool:
    """Return whether an entry of a prior is of a function, and not of a name or wildcard."""
    function = isinstance(key, str) and ("|" in key or bool(_OPERATOR.search(key)))
    return function or isinstance(value, tuple)


@dataclass(frozen=True, eq=False)
class PriorFunction:
    """A function of numbers, and what is known of it.

    Attributes
    ----------
    name : str
        As it was stated; where each session has its numbers, with the session behind an @.
    rows : ndarray (s, p + n)
        Sums of the geometry's values and of the parameters: one, or three of which it is the
        length.
    columns : ndarray of int (g,)
        The parameters that the free numbers of the geometry are.
    value, sigma : float
        What is stated, and its standard deviation; mm, rad or 1.
    """

    name: str
    rows: FloatArray
    columns: IntArray
    value: float
    sigma: float

    def at(
        self, theta: FloatArray, robot: Calibratable, places: IntArray
    ) -> tuple[float, FloatArray]:
        """Evaluate a function at `theta` (n,), with its derivative (n,).

        `places` (g,) are those of the free numbers in the geometry's values.
        """
        values = robot.geometry.values.copy()
        values[places] = theta[self.columns]
        p, slopes = len(values), self.rows[:, len(values) :].copy()
        by_own = self.rows[:, :p]
        geometry = robot.with_values(values).geometry  # whose numbers may be tied to others
        values, k = geometry.values, len(geometry.chain)
        by_own = by_own[:, :k] @ geometry.chain
        by_own[:, k:] += self.rows[:, k:p]
        np.add.at(slopes.T, self.columns, by_own[:, places].T)
        sums = self.rows @ np.concatenate([values, theta])
        if len(sums) == 1:
            return float(sums[0]), slopes[0]
        length = float(np.linalg.norm(sums))
        along: FloatArray = sums @ slopes / max(length, np.finfo(float).tiny)
        return length, along


def prior_functions(
    prior: Mapping[str, object],
    robot: Calibratable,
    start: Mapping[str, tuple[float, str]],
    places: IntArray,
    columns: Mapping[str, IntArray],
    moved: Collection[str],
    *,
    strict: bool,
) -> tuple[PriorFunction, ...]:
    """The functions among the entries of a prior.

    Parameters
    ----------
    prior : mapping
        As `identify` takes it.
    robot : Calibratable
        The machine.
    start : mapping of str to (float, str)
        Value and unit of each of the n parameters.
    places : ndarray of int (g,)
        Of the free numbers in the geometry's values.
    columns : mapping of str to ndarray of int (g,)
        The parameters that they are in each session, of "" where all are common.
    moved : collection of str
        Parameters that count from where a frame or a carried pose is put: no function is of them.
    strict : bool
        Whether a function of nothing that is free is refused; else it is left out.

    Raises
    ------
    ValueError, TypeError
        What is no function, unknown numbers, different units or bodies, a length that is 0.
    """
    found: list[PriorFunction] = []
    theta = np.array([value for value, _ in start.values()])
    for key, stated in prior.items():
        if not is_function(key, stated):
            continue
        rows = _rows(key, robot.geometry, start, moved)
        known, sigma = _stated(key, stated)
        if len(rows) > 1 and known is not None and known <= 0.0:
            raise ArgumentError(f"prior of {key}: a length must be above 0 mm, found {known:g}")
        theirs: list[PriorFunction] = []
        slopes: list[FloatArray] = []
        for session, mine in columns.items():
            each = PriorFunction(f"{key}@{session}" if session else key, rows, mine, 0.0, sigma)
            at, slope = each.at(theta, robot, places)
            if len(rows) > 1 and not at > _LEAST * robot.length:
                raise ArgumentError(
                    f"prior of {key}: it is {at:.3g} mm now, a length without a direction"
                )
            if not slope.any() or any(np.array_equal(slope, other) for other in slopes):
                continue  # nothing of it is free, or all of it is common to the sessions
            theirs.append(replace(each, value=at if known is None else known))
            slopes.append(slope)
        if strict and not theirs:
            raise ArgumentError(f"prior of {key}: nothing that it depends on is free")
        found += theirs if len(theirs) > 1 else [replace(each, name=key) for each in theirs]
    return tuple(found)


def _rows(
    key: str,
    geometry: NamedNumbers,
    start: Mapping[str, tuple[float, str]],
    moved: Collection[str],
) -> FloatArray:
    """Factors (s, p + n) of all numbers in a function's sums."""
    text = key.strip()
    length = len(text) > 2 and text[0] == text[-1] == "|"
    added = list(terms(key, text[1:-1] if length else text))
    names = [*geometry.names, *start]
    units = dict(zip(names, [*geometry.units, *(unit for _, unit in start.values())], strict=True))
    points = [name[:-2] for name in names if name.endswith(".x") and f"{name[:-2]}.z" in units]
    rows, kinds = np.zeros((3 if length else 1, len(names))), set[str]()
    for factor, name in added:
        known = points if length else names
        if name not in known or name in moved or f"{name}.x" in moved:
            raise ArgumentError(
                f"prior of {key}: no {'point' if length else 'number'} {name!r}"
                f"{did_you_mean(name, known)}; expected a sum such as 'gain1 - gain2', or one"
                " length such as '|base1 - base2|'"
            )
        own = [f"{name}.{axis}" for axis in "xyz"] if length else [name]
        rows[np.arange(len(own)), [names.index(each) for each in own]] += factor
        kinds.add(name.rstrip(_BEHIND) if length else units[name])
    if len(kinds) > 1:
        raise ArgumentError(f"prior of {key}: it adds {' and '.join(sorted(kinds))}")
    return rows


def terms(key: str, text: str) -> Iterator[tuple[float, str]]:
    """Factors and names of the sum in a key's text."""
    text, sign = text.strip(), 1.0
    if text.startswith("-"):
        text, sign = text[1:], -1.0
    parts = _OPERATOR.split(text.strip())
    for operator, term in zip(["+", *parts[1::2]], parts[::2], strict=True):
        factor, _, name = term.rpartition("*")
        try:
            times = sign * float(operator + (factor.strip() or "1"))
        except ValueError:
            times = np.nan
        if not np.isfinite(times):
            raise ArgumentError(f"prior of {key}: {factor.strip()!r} is no factor")
        yield times, name.strip()
        sign = 1.0


def _stated(key: str, stated: object) -> tuple[float | None, float]:
    """Value, None for the present one, and standard deviation."""
    value: object = None
    if isinstance(stated, tuple):
        if len(stated) != 2:
            raise ArgumentError(f"prior of {key} must be (value, deviation), found {stated!r}")
        value, stated = stated
    sigma = number(f"prior of {key}", stated, above=0.0)
    return None if value is None else number(f"prior of {key}: its value", value), sigma
