"""Stated uncertainty of numbers that a calibration does not look for.

``[uncertainty]`` of a robot file, and the argument `uncertainty` of `identify`: a standard
deviation by name or wildcard. Under ``common`` all numbers that it matches are wrong by one and
the same amount; under ``consider`` they are not fitted along.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Protocol

from pkmcal.arguments import number, shown
from pkmcal.arrays import Unit
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.toml_table import Table

COMMON, CONSIDER, SCALE = "common", "consider", "scale"
LEAST, MOST = 1e-15, 1e15  # mm, rad or 1, of what a standard deviation may be
Uncertain = Mapping[str, float | Mapping[str, float]] | None
_POINTS = ("target", "anchor", "attachment")  # roles whose numbers have a name behind them
_ROLES = (*_POINTS, "frame", "tool", "mounting")
_QUANTITIES = {"mm": "lengths", "rad": "angles", "1": "ratios"}
_UNITS_BESIDE = (
    {  # of what is no number of the geometry; all other points are lengths
        f"{of}.{axis}": unit
        for of, axes in {"frame": POSE, "tool": POSE, "mounting": POSE[3:]}.items()
        for axis, unit in zip(POSE, ("mm",) * 3 + ("rad",) * 3, strict=True)
        if axis in axes
    }
    | {SCALE: "1"}
)


@dataclass(frozen=True)
class StatedUncertainty:
    """Standard deviations by name or wildcard, mm, rad and 1; later entries before earlier ones.

    Attributes
    ----------
    own : mapping of str to float
        Of each number by itself; 0 where it is exact.
    common : mapping of str to float
        Of one amount that all numbers have in common, of a point each coordinate.
    consider : mapping of str to float
        Of numbers that are not fitted along: deviations alone allow for them.
    roles : tuple of str
        What readings depend on beside frames, targets and the like: those of a user's own.
    """

    own: Mapping[str, float] = field(default_factory=dict)
    common: Mapping[str, float] = field(default_factory=dict)
    consider: Mapping[str, float] = field(default_factory=dict)
    roles: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.own or self.common or self.consider)

    @property
    def patterns(self) -> tuple[str, ...]:
        """Every name or wildcard, once."""
        return tuple(dict.fromkeys([*self.own, *self.common, *self.consider]))

    def with_later(self, other: StatedUncertainty) -> StatedUncertainty:
        """Append the entries of another statement."""
        return StatedUncertainty(
            _behind(self.own, other.own),
            _behind(self.common, other.common),
            _behind(self.consider, other.consider),
            (*self.roles, *other.roles),
        )

    def of_geometry(self, pattern: str, names: Iterable[str]) -> bool:
        """Return whether a pattern is of the geometry, not of frames, points or instruments."""
        beside = rf"({'|'.join(map(re.escape, (*_ROLES, *self.roles)))})[^@]*(@.*)?|{SCALE}"
        own = any(fnmatchcase(name, pattern) for name in names)
        return own or not re.fullmatch(beside, pattern)

    def alike(self, name: str) -> str:
        """Return the kind, coordinate and session that numbers with a common error share."""
        stem, _, behind = name.partition("@")
        point, dot, axis = stem.partition(".")
        roles = "|".join(map(re.escape, (*_POINTS, *self.roles)))
        kind = re.sub(rf"^({roles}).+|\d+$", r"\1", point)
        return f"{kind}{dot}{axis}@{behind}"

    def table(self) -> dict[str, Any]:
        """The statement as a robot file has it, and as `identify` takes it."""
        beside = {COMMON: dict(self.common), CONSIDER: dict(self.consider)}
        return dict(self.own) | {key: own for key, own in beside.items() if own}


NOTHING = StatedUncertainty()


def stated_uncertainty(given: Uncertain, argument: str = "uncertainty") -> StatedUncertainty:
    """The argument `uncertainty` of `identify`, checked.

    Raises
    ------
    ValueError, TypeError
        No mapping, a name that is no text, a deviation that is no number or negative.
    """
    if given is None:
        return NOTHING
    parts: dict[str, dict[str, float]] = {"": {}, COMMON: {}, CONSIDER: {}}
    for name, value in _entries(argument, given):
        beside = name in (COMMON, CONSIDER)
        if not beside and isinstance(value, Mapping):
            raise ArgumentTypeError(
                f"{argument} of {name}: expected a number, found {shown(value)}; a mapping stands"
                f" under {COMMON!r} or {CONSIDER!r} only"
            )
        inner = _entries(f"{argument} {name}", value) if beside else [(name, value)]
        for pattern, sigma in inner:
            of = parts[name if beside else ""]
            of[pattern] = _deviation(f"{argument} of {pattern}", sigma)
    return StatedUncertainty(parts[""], parts[COMMON], parts[CONSIDER])


def _entries(argument: str, given: object) -> Iterable[tuple[str, Any]]:
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise ArgumentTypeError(
            f"{argument}: expected standard deviations by name, such as {{'gain*': 1e-3}}; found"
            f" {shown(given)}"
        )
    return given.items()


def _deviation(name: str, given: object) -> float:
    """A standard deviation: 0 of what is exact, else one whose square the equations can hold."""
    sigma = number(name, given, least=0.0)
    if sigma and not LEAST <= sigma <= MOST:
        raise ArgumentError(f"{name} must be 0 or from {LEAST:g} to {MOST:g}, found {sigma:g}")
    return sigma


def _behind(first: Mapping[str, float], later: Mapping[str, float]) -> dict[str, float]:
    return {name: s for name, s in first.items() if name not in later} | dict(later)


def unit_of(pattern: str, names: Mapping[str, str]) -> str:
    """Unit of what a pattern matches: of the geometry by `names`, else by its own name.

    Raises
    ------
    ValueError
        Lengths, angles and ratios together.
    """
    number = pattern.partition("@")[0]  # of whatever session
    for known in (names, _UNITS_BESIDE):
        covered: dict[str, list[str]] = {}
        for name, unit in known.items():
            if fnmatchcase(name, number):
                covered.setdefault(unit, []).append(name)
        if len(covered) > 1:
            parts = [
                f"{_QUANTITIES[unit]} ({', '.join(own[:3])}{', …' if own[3:] else ''})"
                for unit, own in covered.items()
            ]
            raise ArgumentError(f"{pattern} covers {' and '.join(parts)}: name each of these apart")
        if covered:
            return next(iter(covered))
    return "mm"


class _Named(Protocol):
    """Numbers that a statement may be about, of a parallel machine or an arm."""

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def units(self) -> Sequence[str]: ...

    def match(self, patterns: str, /) -> list[str]: ...


def read_uncertainty(table: Table, geometry: _Named) -> StatedUncertainty:
    """The table ``[uncertainty]`` of a robot file, in mm and rad."""
    units = dict(zip(geometry.names, geometry.units, strict=True))
    parts = {
        key: _deviations(table.table(key) if key in table else Table({}, table.source), units)
        for key in (COMMON, CONSIDER)
    }
    own = {key: value for key, value in table.data.items() if key not in parts}
    found = _deviations(Table(own, table.source, table.path, table.units), units)
    for name in [*found, *parts[COMMON], *parts[CONSIDER]]:
        if NOTHING.of_geometry(name, geometry.names):
            try:
                geometry.match(name)
            except ValueError as error:
                table.fail("", str(error), at=name)
    return StatedUncertainty(found, parts[COMMON], parts[CONSIDER])


def _deviations(table: Table, units: Mapping[str, str]) -> dict[str, float]:
    found = {}
    for name, value in table.flat():
        try:
            unit: Unit = unit_of(name, units)  # type: ignore[assignment]
        except ValueError as error:
            table.fail("", str(error), at=name)
        sigma = table.as_number(name, value, unit)
        try:
            found[name] = _deviation(name, sigma)
        except ValueError as error:
            table.fail("", str(error), at=name)
    return found
