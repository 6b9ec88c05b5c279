"""Every kind of reading by its name: a class that `pkmcal.readings` exports is one."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple, cast

import pkmcal.readings as exported
from pkmcal.arguments import shown, word
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.csv_table import Table
from pkmcal.readings.closure import Closure
from pkmcal.readings.reading import Reading

Kind = str  # a word of `KINDS`

_CLASSES = (each for each in vars(exported).values() if isinstance(each, type))
_EVERY = [each() for each in _CLASSES if issubclass(each, Reading) and each is not Reading]
KINDS: dict[Kind, Reading] = {each.name: each for each in sorted(_EVERY, key=lambda e: e.name)}


class _Headings(NamedTuple):
    """A table that has columns of some names and nothing else."""

    columns: dict[str, None]


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


require_own_columns(_EVERY)


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
        _require_stated(given, argument)
        return given
    if not isinstance(given, str):
        raise ArgumentTypeError(f"{argument} must be a word or a Reading, found {shown(given)}")
    return KINDS[word(argument, given, KINDS)]


def _require_stated(reading: Reading, argument: str) -> None:
    of = type(reading)
    if not isinstance(reading.name, str) or not reading.name:
        raise ArgumentTypeError(
            f'{argument}: the class {of.__name__} has to state its name, as in name = "loop"'
        )
    _require_fields(type(reading))  # type: ignore[arg-type]
    pairs = reading.components
    stated = isinstance(pairs, tuple) and all(
        isinstance(pair, tuple) and [*map(type, pair)] == [str, str] for pair in pairs
    )
    if not stated or (not pairs and not isinstance(reading, Closure)):
        raise ArgumentTypeError(
            f"{argument}: the class {of.__name__} has to state its components with their units, as"
            f' in components = (("length", "mm"),); found {shown(pairs)}'
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
    pair = of.nouns
    if pair is not None and not (isinstance(pair, tuple) and [*map(type, pair)] == [str, str]):
        raise ArgumentTypeError(
            f"kind: nouns of the class {of.__name__} are one and several, as in"
            f' nouns = ("foot", "feet"); found {shown(pair)}'
        )
    if of.turning is not None and len(of.components) != of.turning + 3:
        raise ArgumentTypeError(
            f"kind: turning of the class {of.__name__} is the first of its last three components,"
            f" and it has {len(of.components)}; found {of.turning}"
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
