"""Every kind of reading by its name: a class that `pkmcal.readings` exports is one."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple, cast, get_args

import pkmcal.readings as exported
from pkmcal.arguments import shown, word
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import (
    ArgumentError,
    ArgumentTypeError,
    of_the_package,
)
from pkmcal.files.csv_table import Table
from pkmcal.readings.closure import Closure
from pkmcal.readings.reading import HeldNumbers, Reading
from pkmcal.readings.unknowns import Body

_IN_BRACKETS = frozenset("[]\n\r")  # what ends a unit in a heading
Kind = str  # a word of `KINDS`
_OF_KINDS = ("other", "touched", "distances")  # fields that `Measurements` and calibrations know


class _Headings(NamedTuple):
    """A table that has columns of some names and nothing else."""

    columns: dict[str, None]


def registered(classes: Iterable[type[Reading]]) -> dict[Kind, Reading]:
    """A reading of each class by its name, in the order of the names.

    Raises
    ------
    TypeError
        A class that is not whole, or cannot be made without arguments; two of one name; two that
        would read the same columns.
    """
    found: dict[Kind, Reading] = {}
    for of in classes:
        try:
            kind = of()
        except TypeError as error:
            raise ArgumentTypeError(
                f"pkmcal.readings: each field of the class {of.__name__} needs a default: {error}"
            ) from error
        _require_stated(kind, "pkmcal.readings")
        if (other := found.setdefault(kind.name, kind)) is not kind:
            raise ArgumentTypeError(
                f"pkmcal.readings: the classes {type(other).__name__} and {of.__name__} have one"
                f" name, {kind.name!r}"
            )
    require_own_columns(found.values())
    return {name: found[name] for name in sorted(found)}


def require_own_columns(kinds: Iterable[Reading]) -> None:
    """Refuse two kinds of which both would read a table with the columns of one of them.

    Raises
    ------
    TypeError
        Such kinds, by their names; a class without a name.
    """
    every = tuple(kinds)
    for kind in every:
        _refuse_both(kind, _readers(kind, every))


def require_read_back(kind: Reading, values: FloatArray, actuators: FloatArray) -> None:
    """Refuse a kind of the user's own whose table would be read back as a kind of the package.

    Raises
    ------
    TypeError
        Such kinds, by their names.
    """
    if kind.name in KINDS:
        return
    for other in _readers(kind, KINDS.values()):
        try:
            other.of_rows(values, actuators, None)
        except ArgumentError:  # it needs more: an error when the table is read
            continue
        _refuse_both(kind, [other, kind])


def _readers(kind: Reading, every: Iterable[Reading]) -> list[Reading]:
    """The kinds that would read a table with the columns of one of them."""
    headings = dict.fromkeys((*(name for name, _ in kind.components), *kind.labels))
    table = cast(Table, _Headings(headings))
    return [each for each in every if each.found_in(table)]


def _refuse_both(kind: Reading, readers: Sequence[Reading]) -> None:
    if len(readers) > 1:
        columns = dict.fromkeys((*(name for name, _ in kind.components), *kind.labels))
        raise ArgumentTypeError(
            f"kinds {' and '.join(each.name for each in readers)} both read the columns"
            f" {', '.join(columns)}: names of components, or found_in of their classes, have to"
            " tell files apart"
        )


def as_reading(given: Kind | Reading, argument: str = "kind") -> Reading:
    """The instrument itself, or the one that a word stands for.

    Raises
    ------
    TypeError
        Neither, or a reading whose class does not state its name and its components.
    ValueError
        An unknown word.
    """
    if isinstance(given, Reading):
        of = type(given)
        _require_stated(given, argument)
        if given.name in KINDS and not of_the_package(given):
            raise ArgumentTypeError(
                f"{argument}: the class {of.__name__} has the name of a kind of pkmcal,"
                f" {given.name!r}: its readings would be taken for those; give it another one"
            )
        return given
    if not isinstance(given, str):
        raise ArgumentTypeError(f"{argument} must be a word or a Reading, found {shown(given)}")
    return KINDS[word(argument, given, KINDS)]


def _require_stated(reading: Reading, argument: str) -> None:
    """Refuse a reading whose class lacks what it has to state, or states it wrongly."""
    of = type(reading)
    if not isinstance(reading.name, str) or not reading.name:
        raise ArgumentTypeError(
            f'{argument}: the class {of.__name__} has to state its name, as in name = "loop"'
        )
    _require_fields(of)  # type: ignore[arg-type]
    pairs = reading.components
    stated = isinstance(pairs, tuple) and all(
        isinstance(pair, tuple) and [*map(type, pair)] == [str, str] for pair in pairs
    )
    if not stated or (not pairs and not isinstance(reading, Closure)):
        raise ArgumentTypeError(
            f"{argument}: the class {of.__name__} has to state its components with their units, as"
            f' in components = (("length", "mm"),); found {shown(pairs)}'
        )
    names = [name for name, _ in pairs]
    for name, unit in pairs:
        if names.count(name) > 1:
            raise ArgumentTypeError(
                f"{argument}: the class {of.__name__} has two components of one name, {name!r}: a"
                " file has a column for each"
            )
        if not unit.strip() or unit.isdecimal() or not _IN_BRACKETS.isdisjoint(unit):
            raise ArgumentTypeError(
                f"{argument}: the class {of.__name__} has to state the unit of {name!r} as the"
                f' heading of a column can, a plain number\'s as "ratio"; found {unit!r}'
            )


def _require_free(of: type[Reading], names: Sequence[str]) -> None:
    """Refuse fields of a user's class whose names mean something else to the package."""
    of_kinds = {
        each.name
        for base in of.__mro__
        if of_the_package(base) and dataclasses.is_dataclass(base)
        for each in dataclasses.fields(base)
    }
    for name in names:
        if name not in of_kinds and (name in vars(Reading) or name in _OF_KINDS):
            whose = "every reading has" if name in vars(Reading) else "some kinds of pkmcal have"
            raise ArgumentTypeError(
                f"kind: a field of the class {of.__name__} is called {name!r}, which {whose} for"
                " something else; give it another name"
            )


@cache
def _require_fields(of: type[Reading]) -> None:
    """Refuse a class that is no dataclass, or lists what is none of its fields.

    Raises
    ------
    TypeError
        What it lacks, by name.
    """
    own = "__dataclass_fields__" in vars(of) or "__init__" not in vars(of)
    if not (dataclasses.is_dataclass(of) and own):
        raise ArgumentTypeError(
            f"kind: the class {of.__name__} has to be a dataclass, @dataclass(frozen=True,"
            " eq=False), whose fields are the instrument's own"
        )
    if of.predict is Reading.predict:
        raise ArgumentTypeError(
            f"kind: the class {of.__name__} has no method predict(self, at, **numbers), which says"
            " what is read there"
        )
    names = [each.name for each in dataclasses.fields(of)]
    _require_free(of, names)
    for listed in ("labels", "per_row", "own_points", "truth", "stated"):
        several = getattr(of, listed)
        if not isinstance(several, tuple):
            raise ArgumentTypeError(
                f"kind: {listed} of the class {of.__name__} has to be a tuple of names, as in"
                f' {listed} = ("wire",); found {shown(several)}'
            )
        for name in several:
            if name not in names:
                raise ArgumentTypeError(
                    f"kind: {listed} of the class {of.__name__} names {shown(name)}, which is no"
                    f" field of it; it has {', '.join(names) or 'none'}"
                )
    for member, like in vars(Reading).items():
        stated = isinstance(like, bool | int | str | tuple) and not member.startswith("_")
        if stated and type(mine := getattr(of, member)) is not type(like):
            raise ArgumentTypeError(
                f"kind: {member} of the class {of.__name__} must be such as {like!r}; found"
                f" {shown(mine)}"
            )
        method = inspect.isfunction(like)
        if (method or isinstance(like, property)) and callable(getattr(of, member)) != method:
            raise ArgumentTypeError(
                f"kind: {member} of the class {of.__name__} must be a"
                f" {'method' if method else 'property'}; found {shown(getattr(of, member))}"
            )
    if of.point not in get_args(Body):
        raise ArgumentTypeError(
            f"kind: point of the class {of.__name__} must be one of"
            f" {', '.join(map(repr, get_args(Body)))}; found {of.point!r}"
        )
    if not all(isinstance(each, HeldNumbers) for each in of.held):
        raise ArgumentTypeError(
            f"kind: held of the class {of.__name__} has to be of HeldNumbers; found"
            f" {shown(of.held)}"
        )
    if of.anew and of.anew not in of.labels:
        raise ArgumentTypeError(
            f"kind: anew of the class {of.__name__} must be one of its labels; found {of.anew!r}"
        )
    pair = of.nouns
    if pair is not None and not (isinstance(pair, tuple) and [*map(type, pair)] == [str, str]):
        raise ArgumentTypeError(
            f"kind: nouns of the class {of.__name__} are one and several, as in"
            f' nouns = ("foot", "feet"); found {shown(pair)}'
        )
    if of.turning not in (None, len(of.components) - 3):
        raise ArgumentTypeError(
            f"kind: turning of the class {of.__name__} is the first of its last three components,"
            f" and it has {len(of.components)}; found {of.turning!r}"
        )


def stated(kind: Kind | Reading | None, instrument: Reading | None) -> Reading:
    """The instrument that `kind` and `instrument` state."""
    own = None if instrument is None else as_reading(instrument, "instrument")
    if kind is None:
        return as_reading("position") if own is None else own
    if own is None or not isinstance(kind, str):
        return as_reading(kind)
    if kind != own.name:
        raise ArgumentError(
            f"kind: {kind!r} contradicts the instrument, {type(own).__name__}; an object, such as"
            " kind=pkmcal.readings.Pose(), takes the place of both"
        )
    return own


KINDS = registered(
    each
    for each in vars(exported).values()
    if isinstance(each, type) and issubclass(each, Reading) and each is not Reading
)
