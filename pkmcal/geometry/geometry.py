"""The geometry of a robot: named numbers, and the named parameters that tie some of them.

Every number of every limb has a name (``base1.x``, ``rod2``, ``slider3.tilt1``). A tied number
follows from named parameters (``radius``); it can be read but not replaced.
"""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pkmcal.arguments import did_you_mean, number, words
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, Unit, as_numbers
from pkmcal.core.library import SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.ties import LimbNumber, Term, Tie

__all__ = ["SLOTS", "Geometry", "LimbNumber", "Term", "Tie"]

Array = TypeVar("Array", bound=NDArray[Any])


class _Layout:
    """The layout that stays when values are replaced: names, units, ties, places in slots."""

    def __init__(
        self,
        numbers: Sequence[LimbNumber],
        parameters: Mapping[str, Unit],
        blank: FloatArray | None = None,
    ) -> None:
        self.numbers = tuple(numbers)
        self.parameters = tuple(parameters)
        self.names = tuple(number.name for number in numbers) + self.parameters
        self.units = tuple(number.unit for number in numbers) + tuple(parameters.values())
        self.index = {name: i for i, name in enumerate(self.names)}
        self.ties = tuple((i, n.tie) for i, n in enumerate(self.numbers) if n.tie is not None)
        tied = np.zeros(len(self.names), dtype=bool)
        tied[[i for i, _ in self.ties]] = True
        self.tied = _frozen(tied)
        own = np.eye(len(self.numbers), len(self.names))
        own[[i for i, _ in self.ties]] = 0.0
        self.own = _frozen(own)  # derivative of the numbers that are not tied
        self.n_limbs = 1 + max((number.limb for number in numbers), default=-1)
        if blank is None:
            blank = np.zeros((self.n_limbs, len(SLOTS)))
            blank[:, SLOTS.index("gain")] = 1.0
        self.blank = _frozen(blank)
        places = [
            n.limb * blank.shape[1] + SLOTS.index(n.slot) if n.place is None else n.place
            for n in self.numbers
        ]
        self.slot_index = _frozen(np.array(places, dtype=np.intp))
        self.driven: dict[bytes, tuple[Int32Array, FloatArray | None]] = {}  # without ties
        if len(self.index) != len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise ArgumentError(f"the name {twice!r} stands for two numbers of the geometry")


def _frozen(array: Array) -> Array:
    array.flags.writeable = False
    return array


class Geometry:
    """The named numbers of a robot: immutable, and read like a mapping.

    Robot files make geometries; `replace` makes a changed one.

    Parameters
    ----------
    numbers : sequence of LimbNumber
        The numbers of the limbs, limb 1 first, each limb in the order of `SLOTS`.
    parameters : mapping of str to str
        The named parameters and their units.
    values : mapping of str to float
        The value of every parameter and of every number that is not tied; mm and rad.
    blank : ndarray, optional
        What the core takes where no number is; by default (limbs, SLOTS), gains 1 and the rest 0.

    Attributes
    ----------
    names : tuple of str, p
        Every number of every limb, limb 1 first, then the named parameters.
    values : ndarray (p,)
        Read-only; mm and rad.
    units : tuple of str, p
        "mm", "rad" or "1" (a ratio).
    tied : ndarray of bool (p,)
        True where a named parameter drives a limb's number.
    slots : ndarray (n_limbs, len(SLOTS)), or (1, numbers) of a machine of chains
        The same numbers as the core takes them; an unused gain is 1, other unused slots are 0.
        Those of drive laws are behind them, in as many columns as the longest law needs.
    slot_index : ndarray of int (k,)
        Places in the flattened `slots` of the k limb numbers, which are the first k names.
    chain : ndarray (k, p)
        Derivative of each limb number to each name that can be replaced; mm/mm, mm/rad, ...

    Examples
    --------
    >>> geometry = Geometry([LimbNumber("offset1", "mm", 0, "offset")], {}, {"offset1": 20.0})
    >>> geometry["offset1"], geometry.replace({"offset1": 20.5})["offset1"]
    (20.0, 20.5)
    """

    def __init__(
        self,
        numbers: Sequence[LimbNumber],
        parameters: Mapping[str, Unit],
        values: Mapping[str, float],
        blank: FloatArray | None = None,
    ) -> None:
        layout = _Layout(numbers, parameters, blank)
        array = np.zeros(len(layout.names))
        for i in np.flatnonzero(~layout.tied):
            array[i] = values[layout.names[i]]
        self._set(layout, array)

    def _set(self, layout: _Layout, values: FloatArray) -> None:
        """Take own numbers and parameters from `values`; the tied numbers follow."""
        k = len(layout.numbers)
        if layout.ties:
            parameters = dict(zip(layout.parameters, values[k:].tolist(), strict=True))
            for i, tie in layout.ties:
                values[i] = tie.value(parameters)
        slots: FloatArray = layout.blank.copy()
        slots.flat[layout.slot_index] = values[:k]
        self._layout = layout
        self._values = _frozen(values)
        self._slots = _frozen(slots)

    @classmethod
    def _make(cls, layout: _Layout, values: NDArray[np.generic]) -> Geometry:
        geometry = cls.__new__(cls)
        geometry._set(layout, np.array(values, dtype=np.float64))
        return geometry

    def __reduce__(self) -> tuple[object, ...]:
        return Geometry._make, (self._layout, self._values)

    # reading ----------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Every number of every limb, then the named parameters."""
        return self._layout.names

    @property
    def values(self) -> FloatArray:
        """Values in the order of `names`, (p,), read-only; mm and rad."""
        return self._values

    @property
    def units(self) -> tuple[Unit, ...]:
        """Units in the order of `names`: "mm", "rad" or "1"."""
        return self._layout.units

    @property
    def parameters(self) -> tuple[str, ...]:
        """The named parameters, the last of `names`."""
        return self._layout.parameters

    @property
    def numbers(self) -> tuple[LimbNumber, ...]:
        """The limb, slot and tie of each limb number."""
        return self._layout.numbers

    @property
    def tied(self) -> BoolArray:
        """Names that parameters drive, (p,)."""
        return self._layout.tied

    @property
    def slots(self) -> FloatArray:
        """The limb numbers as the core takes them, (n_limbs, len(SLOTS)), or (1, numbers)."""
        return self._slots

    @property
    def slot_index(self) -> IntArray:
        """Places of the limb numbers in the flattened `slots`, (k,)."""
        return self._layout.slot_index

    @property
    def blank(self) -> FloatArray:
        """The slots' content where no number is, (n_limbs, columns)."""
        return self._layout.blank

    @cached_property
    def chain(self) -> FloatArray:
        """Derivative of each limb number to each name that can be replaced, (k, p)."""
        layout = self._layout
        if not layout.ties:
            return layout.own
        chain, parameters = layout.own.copy(), {name: self[name] for name in layout.parameters}
        for i, tie in layout.ties:
            for name, slope in tie.derivatives(parameters):
                chain[i, layout.index[name]] += slope
        return _frozen(chain)

    def driven(self, places: IntArray) -> tuple[Int32Array, FloatArray | None]:
        """Return the slots driven by numbers at `places` (k,): c places in `slots`, factors (c, k).

        None: each drives one, in the same order.
        """
        layout, key = self._layout, places.tobytes()
        if key not in layout.driven:
            part = self.chain[:, places]
            moving = np.flatnonzero(part.any(axis=1))
            alone = np.array_equal(part[moving], np.eye(len(places)))
            columns = layout.slot_index[moving].astype(np.int32)
            found = columns, None if alone else part[moving]
            if layout.ties:  # they may bend
                return found
            layout.driven[key] = found
        return layout.driven[key]

    def __getitem__(self, name: str) -> float:
        try:
            return float(self._values[self._layout.index[name]])
        except KeyError:
            raise KeyError(f"no number {name!r}{did_you_mean(name, self.names)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self._layout.index

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def keys(self) -> tuple[str, ...]:
        """The names, so that ``dict(geometry)`` works."""
        return self.names

    def items(self) -> ItemsView[str, float]:
        """Pairs of name and value."""
        return dict(zip(self.names, self._values.tolist(), strict=True)).items()

    def __repr__(self) -> str:
        k = len(self.numbers)
        return (
            f"Geometry({k} numbers of {self._layout.n_limbs} limbs, {len(self) - k} parameters, "
            f"{int(self.tied.sum())} numbers tied)"
        )

    # changing ---------------------------------------------------------------------------------

    def replace(self, changes: Mapping[str, float] | FloatArray) -> Geometry:
        """Give some numbers new values.

        Parameters
        ----------
        changes : mapping of str to float, or array (p,)
            New values by name, or all values in the order of `names`; mm and rad. An array may
            repeat a tied number as it is, or as the parameters in the same array make it.

        Returns
        -------
        Geometry
            A new geometry with the same names and ties.

        Raises
        ------
        ValueError
            An unknown name, a tied number, a value that is not finite, a wrong shape.
        TypeError
            A value that is no number.
        """
        if not isinstance(changes, Mapping):
            return self._replace_all(as_numbers("changes", changes, len(self)))
        values = self._values.copy()
        for name, value in changes.items():
            self.require_own(name)
            values[self._layout.index[name]] = number(name, value)
        return Geometry._make(self._layout, values)

    def _replace_all(self, values: NDArray[np.generic]) -> Geometry:
        if values.shape != (len(self),):
            raise ArgumentError(f"changes must have shape ({len(self)},), found {values.shape}")
        if not np.isfinite(values).all():
            name = self.names[int(np.flatnonzero(~np.isfinite(values))[0])]
            raise ArgumentError(f"changes: {name} must be finite, found {values[self._at(name)]}")
        changed = Geometry._make(self._layout, values)
        if self._layout.ties:
            wrong = self.tied & (values != self._values) & (values != changed._values)
            if wrong.any():
                self.require_own(self.names[int(np.flatnonzero(wrong)[0])])
        return changed

    def without(self, dropped: Callable[[str], bool]) -> Geometry:
        """The geometry without the last numbers of the core, those with a name that is `dropped`.

        Parameters that no other number follows go with them.
        """
        width = self.slots.shape[1] - sum(dropped(each.name) for each in self.numbers)
        kept = []
        for each, place in zip(self.numbers, self.slot_index.tolist(), strict=True):
            row, column = divmod(place, self.slots.shape[1])
            if not dropped(each.name):
                kept.append(replace(each, place=row * width + column))
        used = {name for each in kept if each.tie is not None for name in each.tie.drivers}
        drivers = {name for n in self.numbers if n.tie is not None for name in n.tie.drivers}
        units = dict(zip(self.names, self.units, strict=True))
        parameters = {n: units[n] for n in self.parameters if n in used or n not in drivers}
        return Geometry(kept, parameters, dict(self.items()), self.blank[:, :width].copy())

    def _at(self, name: str) -> int:
        try:
            return self._layout.index[name]
        except (KeyError, TypeError):
            known = did_you_mean(name, self.names)
            raise ArgumentError(f"the geometry has no number {name!r}{known}") from None

    def require_own(self, name: str) -> None:
        """Raise ValueError unless `name` can be replaced: a known name, and not tied."""
        i = self._at(name)
        if self.tied[i]:
            tie = self.numbers[i].tie
            assert tie is not None
            drivers = tuple(dict.fromkeys(tie.drivers))
            one = len(drivers) == 1
            raise ArgumentError(
                f"{name} is driven by the parameter{'' if one else 's'} {' and '.join(drivers)} "
                f"(replace {'that' if one else 'those'} instead)"
            )

    def match(self, patterns: str | Iterable[str], argument: str = "") -> list[str]:
        """Find the names that can be replaced and match one of the patterns.

        Parameters
        ----------
        patterns : sequence of str
            Names, or wildcards: ``*`` any characters, ``?`` one, ``[12]`` one of these.
        argument : str, optional
            What messages call them.

        Returns
        -------
        list of str
            In the order of the patterns, each name once. Wildcards pass over tied numbers.

        Raises
        ------
        ValueError, TypeError
            A pattern that matches nothing, or tied numbers only; no string.

        Examples
        --------
        >>> geometry = Geometry([LimbNumber("rod1", "mm", 0, "rod")], {}, {"rod1": 340.0})
        >>> geometry.match(["rod*"])
        ['rod1']
        """
        found: dict[str, None] = {}
        for pattern in words(argument or "patterns", patterns):
            if pattern in self:
                self.require_own(pattern)
                found[pattern] = None
                continue
            hits = [name for name in self.names if fnmatchcase(name, pattern)]
            if not hits:
                known = did_you_mean(pattern, self.names)
                lead = f"{argument}: " if argument else ""
                raise ArgumentError(f"{lead}no number of the geometry matches {pattern!r}{known}")
            own = [name for name in hits if not self.tied[self._layout.index[name]]]
            if not own:
                self.require_own(hits[0])
            found.update(dict.fromkeys(own))
        return list(found)
