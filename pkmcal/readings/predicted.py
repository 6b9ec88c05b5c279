"""States of a machine when something is read, and the predicted readings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import kind
from pkmcal.arrays import FloatArray, IntArray, chained
from pkmcal.core.poses import NOWHERE
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.readings.measured import Measured

MOTION = 6  # numbers of the motion of a lot of rows: ω, then v


@dataclass(frozen=True, eq=False)
class At:
    """State of a machine when something is read.

    Attributes
    ----------
    pose : ndarray (N, 6)
        Of the platform in the base frame, mm and rad.
    other : ndarray (N, 6) or None
        At the second place.
    frame, origin : ndarray (6,)
        Pose of the base in the instrument's frame, counted from `origin`; None: they are one.
    axis : ndarray of int (N,) or None
        Of touched lines and planes, which axis of its own each row's has.
    machines : callable or None
        Gives pairs of a machine and its rows; for what the pose alone does not determine.
    measured : Measurements or None
        The rows.
    """

    pose: FloatArray
    other: FloatArray | None = None
    frame: FloatArray | None = None
    origin: FloatArray = field(default_factory=lambda: NOWHERE)
    axis: IntArray | None = None
    machines: Callable[[], Iterator[tuple[Any, IntArray]]] | None = None
    measured: Measured | None = None

    def of_rows(self) -> tuple[Measured, Iterator[tuple[Any, IntArray]]]:
        """The rows and their machines, for a reading that needs both."""
        assert self.measured is not None and self.machines is not None
        return self.measured, self.machines()


@dataclass(frozen=True)
class Predicted:
    """Readings of one kind and their derivatives.

    Attributes
    ----------
    values : ndarray (N, k)
        In the units of the components. Derivatives of the three angles of orientations are those
        of the turning in the instrument's axes.
    by_twist : ndarray (N, k, 6)
        Derivative to the twist of the platform: ω, then the velocity of its origin, in base axes.
    by : mapping of str to ndarray (N, k, w)
        Derivative to each argument of `predict` that the kind depends on, by its name.
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base, counted from the origin; None where there is no frame.
    by_other : ndarray (N, k, 6) or None
        Derivative to the twist of the platform at the second place; None where there is none.
    """

    values: FloatArray
    by_twist: FloatArray
    by: Mapping[str, FloatArray] = field(default_factory=dict)
    by_frame: FloatArray | None = None
    by_other: FloatArray | None = None

    def some(self, rows: slice) -> Predicted:
        """Return these of some of the rows."""
        return Predicted(
            self.values[rows],
            self.by_twist[rows],
            {name: part[rows] for name, part in self.by.items()},
            None if self.by_frame is None else self.by_frame[rows],
            None if self.by_other is None else self.by_other[rows],
        )


def require_shape(what: str, found: object, shape: tuple[int, ...]) -> None:
    """Refuse what a class of the user's own returned if it is no array of this shape."""
    if type(found) is not np.ndarray or found.shape != shape:
        seen = found.shape if type(found) is np.ndarray else kind(found)
        raise ArgumentError(f"{what} must be an array of shape {shape}; found {seen}")
    if found.dtype.kind not in "iuf" or (found.dtype.kind == "f" and found.dtype.itemsize < 8):
        raise ArgumentError(f"{what} must be doubles; found {found.dtype}")


def require_by(what: str, found: object, shape: tuple[int, ...]) -> None:
    """Refuse derivatives by arguments that are none of this shape, with numbers behind it."""
    if not isinstance(found, Mapping):
        raise ArgumentTypeError(
            f"{what} must have the derivative by each argument by its name, as in"
            f' {{"target": …}}; found {kind(found)}'
        )
    for name, each in found.items():
        width = np.shape(each)[-1] if np.ndim(each) > len(shape) else 1
        require_shape(f"{what}[{name!r}]", each, (*shape, width))


def require_predicted(reading: Any, rows: int, found: object, framed: bool = False) -> None:
    """Refuse what `predict` of a reading returned without values (N, k), derivatives (N, k, 6).

    `framed`: it was asked in a frame, by which it then has a derivative.
    """
    what, components = f"kind: predict of {reading.name!r}", len(reading.components)
    if not isinstance(found, Predicted):
        raise ArgumentTypeError(f"{what} must return Predicted(…); found {kind(found)}")
    require_shape(f"{what}: values", found.values, (rows, components))
    require_shape(f"{what}: by_twist", found.by_twist, (rows, components, 6))
    for side in ("by_frame", "by_other"):
        if getattr(found, side) is not None:
            require_shape(f"{what}: {side}", getattr(found, side), (rows, components, 6))
    if framed and found.by_frame is None:
        raise ArgumentError(
            f"{what}: by_frame is missing, the derivative by the pose of the base in the frame of"
            f" the instrument: the class {type(reading).__name__} states framed = True"
        )
    require_by(f"{what}: by", found.by, (rows, components))


def require_arguments(reading: Any, at: At, given: Mapping[str, Any], method: str) -> None:
    """Refuse an argument that `predict` of a reading swallows: a mistyped name.

    That is one which it neither lists nor hands on to what its values depend on.

    Raises
    ------
    ValueError
        Such a name.
    TypeError
        No mapping of names.
    """
    what = f"kind: {method} of {reading.name!r}"
    if not isinstance(given, Mapping):
        found = kind(given)
        raise ArgumentTypeError(f"{what} must return arguments of predict by name; found {found}")
    listed = inspect.signature(reading.predict).parameters
    for each in given.keys() - listed.keys():
        other = {**given, each: np.asarray(given[each]) + 1.0}
        one, two = (reading.predict(at, **numbers) for numbers in (given, other))
        if isinstance(one, Predicted) and np.array_equal(one.values, two.values, equal_nan=True):
            raise ArgumentError(f"{what}: {each!r} is no argument of predict, which ignores it")


class Lots(NamedTuple):
    """Rows in lots: those of a picture are one.

    Attributes
    ----------
    of : ndarray of int (N,)
        The lot of each row, 0 … L - 1.
    first : ndarray of int (L,)
        The first row of each.
    """

    of: IntArray
    first: IntArray


@dataclass(frozen=True, eq=False)
class Shared:
    """Readings in lots whose rows follow the machine through one motion that they share.

    As the corners of a picture do, through the motion of their board before the camera. However
    many they are, all that they tell is told by as many rows as that motion has numbers, and one
    more for each number that they depend on by themselves.

    Attributes
    ----------
    values : ndarray (N, k)
        As in `Predicted`.
    lots : Lots
        Of the rows.
    by_motion : ndarray (N, k, 6)
        Derivative to the motion, a twist.
    by_twist, by_frame : ndarray (L, 6, 6)
        How the motion follows the twist of the platform and the pose of the base; the latter is
        None where there is no frame.
    by : mapping of str to ndarray (L, 6, w)
        How it follows arguments of `Reading.predict`, by their names.
    own : mapping of str to ndarray (N, k, w)
        Derivative to arguments that rows depend on by themselves: `Reading.by_rows`.
    """

    values: FloatArray
    lots: Lots
    by_motion: FloatArray
    by_twist: FloatArray
    by: Mapping[str, FloatArray]
    own: Mapping[str, FloatArray]
    by_frame: FloatArray | None = None

    def of_rows(self) -> Predicted:
        """The derivatives of each row."""
        names, parts = list(self.by), [self.by_twist, *self.by.values()]
        if self.by_frame is not None:
            parts.append(self.by_frame)
        ends = np.cumsum([part.shape[2] for part in parts])[:-1]
        each = chained(self.by_motion, np.concatenate(parts, axis=2), self.lots.of)
        by_twist, *others = np.split(each, ends, axis=2)
        by_frame = None if self.by_frame is None else others.pop()
        by = dict(zip(names, others, strict=True))
        return Predicted(self.values, by_twist, {**by, **self.own}, by_frame=by_frame)


def joined(parts: Sequence[Predicted], rows_of: Sequence[IntArray]) -> Predicted:
    """Readings of one kind whose rows stand in several parts: in which rows each part's are."""
    if len(parts) == 1:
        return parts[0]
    count = sum(map(len, rows_of))

    def whole(of_parts: Sequence[FloatArray]) -> FloatArray:
        found = np.empty((count, *of_parts[0].shape[1:]))
        for values, mine in zip(of_parts, rows_of, strict=True):
            found[mine] = values
        return found

    numbers = {
        name: whole([vars(part)[name] for part in parts])
        for name, values in vars(parts[0]).items()
        if isinstance(values, np.ndarray)
    }
    by = {name: whole([part.by[name] for part in parts]) for name in parts[0].by}
    return Predicted(**numbers, by=by)
