"""A field of the rows of measurements: all that the package knows of it stands in its one class.

Its array and what is checked of it, its columns in a file and in a data frame, and what the printed
table says of it. `Measurements` names the fields it has; who reads, writes, joins and prints asks
them, in their order there.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from pkgutil import resolve_name
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import kind, words
from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.files.column_names import known_as
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings.own_methods import watch
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import numbers


class Field:
    """A field of the rows, which has one entry for each of them.

    Attributes
    ----------
    name : str
        Of the attribute of `Measurements`, its argument and its column.
    logged : bool
        Whether it is taken from the log of a controller that is joined.
    log_first : bool
        Whether that of a log is taken in the place of the instrument's.
    unit : str or None
        Of its one column, where it has no methods for columns of its own; "": numbers without unit,
        None: names.
    blank : bool
        Whether cells of its one column may be empty: NaN then.
    named : bool
        Whether it has a column ``FIELD.NAME`` for every name that the user chooses.
    """

    name = ""
    logged = False
    log_first = False
    unit: str | None = ""
    blank = False
    named = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.columns is not Field.columns and cls.read is Field.read:
            raise TypeError(f"{cls.__name__}: has columns of its own, and no method read for them")
        if cls.kept is Field.kept:
            raise TypeError(f"{cls.__name__}: has no method kept, which checks what is given")
        watch(cls, Field)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def kept(self, given: Any, m: Any) -> Any:
        """Check what the caller gave, and make its array.

        Parameters
        ----------
        given : array_like
            Not None.
        m : Measurements
            With actuators, values, instrument and the fields that stand before this one.

        Raises
        ------
        ValueError, TypeError
            What does not fit; the message names the argument.
        """
        raise NotImplementedError

    def checked(self, given: Any, m: Any) -> Any:
        """What `kept` makes of what the caller gave, if it is an array with an entry for each row.

        Raises
        ------
        TypeError
            It is none.
        """
        if given is None:
            return None
        found = self.kept(given, m)
        if not isinstance(found, np.ndarray) or found.shape[:1] != (len(m),):
            seen = f"shape {found.shape}" if isinstance(found, np.ndarray) else kind(found)
            raise ArgumentTypeError(
                f"{self.name}: kept of the class {type(self).__name__} must return an array with an"
                f" entry for each of {len(m)} rows; found {seen}"
            )
        if hasattr(given, "__array__") and np.may_share_memory(found, np.asarray(given)):
            return found.copy()  # the caller may write to his
        return found

    def of(self, m: Any) -> Any:
        """The array of some measurements, or None."""
        return getattr(m, self.name)

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Names of its columns in a file of these actuators and components of readings."""
        return {self.name}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> Any:
        """Read the field of a table; None where it states nothing. `units` are the actuators'.

        By default its one column, of numbers or names.
        """
        if self.name not in table.columns:
            return None
        if self.unit is None:
            return np.array(table.texts(self.name))
        return table.numbers(self.name, self.unit or "1", blank=self.blank)[0]

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write the field's columns; by default one of the entries (N,), none where it is None."""
        if self.of(m) is not None:
            yield WrittenColumn(self.name, self.unit or "", self.of(m))

    def written(self, m: Any, units: Sequence[str]) -> list[WrittenColumn]:
        """The field's columns, if a file with them is read as one that has the field.

        Raises
        ------
        TypeError
            One of another name than the field's, of a class that has no `names`.
        """
        columns = list(self.columns(m, units))
        if self.named or type(self).names is not Field.names:
            return columns
        for name in (column.name for column in columns):
            if name != self.name:
                raise ArgumentTypeError(
                    f"{self.name}: columns of the class {type(self).__name__} writes {name!r}: the"
                    " class needs a method names that states it, or it would not be read back"
                )
        return columns

    def framed(self, m: Any) -> Iterator[WrittenColumn]:
        """Return the field's columns in a data frame."""
        return self.columns(m, m.actuator_units or ("mm",) * m.actuators.shape[1])

    def printed(self, m: Any) -> Iterator[WrittenColumn]:
        """Return the field's columns in the printed table."""
        return iter(())

    def said(self, m: Any) -> str:
        """Return the field's words in the title of the printed table, or nothing."""
        return ""


Fields = tuple[Field, ...]


def row_fields(measurements: type) -> Fields:
    """The fields that a class of measurements has, in the order of its attributes."""
    every = (each.default for each in dataclasses.fields(measurements))
    return read_back(tuple(each for each in every if isinstance(each, Field)))


@cache
def read_back(fields: Fields) -> Fields:
    """The fields, if each is read from the column that it writes.

    Raises
    ------
    TypeError
        One whose column files have as another name for something else.
    """
    for each in fields:
        if type(each).read is Field.read and (meant := known_as(each.name)) != each.name:
            raise TypeError(
                f"{type(each).__name__}: files have its column {each.name!r} as another name for"
                f" {meant!r}; give the field another name"
            )
    return fields


@cache
def require_other_columns(reading: type[Reading], fields: Fields) -> None:
    """Refuse a class of readings with a component or a label that is a column of other things.

    Raises
    ------
    ValueError
        Its name: that of a field of the rows, of an actuator or of a column of the table; or one
        that a file's heading would be read as another name for.
    """
    components = [name for name, _ in reading.components]
    taken = {"row", *(name for each in fields for name in each.names((), components))}
    for name in (*components, *reading.labels):
        if name in taken or re.fullmatch(r"q\d+", name):
            raise ArgumentError(
                f"kind: {reading.__name__} calls a column {name!r}, which measurements have for"
                " something else; give it another name"
            )
    plain = components if reading.value_columns is Reading.value_columns else []
    if reading.columns_in_file is Reading.columns_in_file and reading.columns is Reading.columns:
        plain += reading.labels
    for name in plain:
        if (meant := known_as(name)) != name:
            raise ArgumentError(
                f"kind: {reading.__name__} calls a column {name!r}, which files have as another"
                f" name for {meant!r}; give it another one"
            )


def declared(field: str) -> Any:
    """The default of an attribute of the class: the field itself, an object of "module:Class".

    Modules are those of `pkmcal.measurements`.
    """
    return resolve_name(f"pkmcal.measurements.{field}")()


def row_numbers(name: str, given: ArrayLike, rows: int, blank: bool = False) -> FloatArray:
    """A copy as finite doubles, one per row; of one row the number alone will do.

    `blank`: NaN is a number that is not there.
    """
    array = numbers(name, given, blank)
    array = array[None] if rows == 1 and array.ndim == 0 else array
    if array.shape != (rows,):
        raise ArgumentError(f"{name} must have shape ({rows},); found {array.shape}")
    return array


def integers(name: str, given: ArrayLike, rows: int) -> Int64Array:
    """A copy as whole numbers, one per row."""
    array = row_numbers(name, given, rows)
    if (array != np.round(array)).any():
        row = int(np.argmax(array != np.round(array)))
        raise ArgumentError(f"{name} must be whole numbers; found {array[row]} in row {row}")
    return array.astype(np.int64)


def one_or_each(name: str, units: Sequence[str], values: FloatArray) -> Iterator[WrittenColumn]:
    """A column for all actuators where they have the same unit and numbers, else one for each."""
    if len(set(units)) == 1 and (values == values[:, :1]).all():
        yield WrittenColumn(name, units[0], values[:, 0])
        return
    for i, (unit, column) in enumerate(zip(units, values.T, strict=True)):
        yield WrittenColumn(f"{name}.q{i + 1}", unit, column)


def values_array(
    given: ArrayLike | None, instrument: Reading, rows: tuple[int, ...], alone: bool
) -> FloatArray:
    """Return readings, (N, k) or (N,); NaN where nothing was read, of orientations as a whole."""
    kind, k = instrument.name, len(instrument.components)
    if given is None:
        if k:
            raise ArgumentError(
                f"values of kind {kind!r} must be given, found None: that goes with 'closure'"
            )
        return np.empty((rows[0], 0))
    values = numbers("values", given, blank=True)
    if alone:
        if values.shape != ((k,) if k != 1 else ()):
            what = f"have shape ({k},)" if k != 1 else "be a number"
            raise ArgumentError(
                f"values of kind {kind!r} must {what} for one row of actuators {rows[1:]}, or"
                f" actuators have shape (N, n); found {values.shape}"
            )
        values = values[None]
    expected = (rows[0], k) if k != 1 else rows[:1]
    if values.shape != expected:
        raise ArgumentError(
            f"values of kind {kind!r} must have shape {expected} for {rows[0]} rows of"
            f" actuators; found {values.shape}"
        )
    if (first := instrument.turning) is not None:
        angles = np.isnan(values[:, first:])
        part = angles.any(axis=1) & ~angles.all(axis=1)
        if part.any():
            raise ArgumentError(
                "values: an orientation has three angles or none; found one left out in row"
                f" {int(np.argmax(part))}"
            )
    return values


def units_of_actuators(given: str | Sequence[str] | None, count: int) -> tuple[str, ...] | None:
    """Return a unit per actuator, "mm" or "rad"; None where none is given."""
    if given is None:
        return None
    units = words("actuator_units", given)
    units = units * count if isinstance(given, str) else units
    if len(units) != count or any(unit not in ("mm", "rad") for unit in units):
        raise ArgumentError(
            f'actuator_units must be "mm" or "rad" for {count} actuators; found {given!r}'
        )
    return units
