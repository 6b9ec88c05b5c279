"""Array types, and arrays of callers as float64 rows the core reads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal.arguments import shown
from pkmcal.exceptions import ArgumentError, ArgumentTypeError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]
Int32Array = NDArray[np.int32]  # what the core writes
Int64Array = NDArray[np.int64]
TextArray = NDArray[np.str_]
Held = TypeVar("Held", bound=NDArray[Any])

Unit = Literal[
    "mm", "rad", "1", "1/mm", "1/rad", "1/mm2", "1/N", "N",
    "N mm", "N/mm", "mm/N", "rad/(N mm)", "kg",
]  # fmt: skip

_LONG = 8  # rows in a row that have a matrix in common, on the average, to be one product
# By less, or a smaller share, numbers are equal of which the largest is chosen: rounding that
# another processor or order of sums makes is up to some 1e-7 where they are differences, and no
# choice may hang on it. The first of equal ones is taken.
TIED = 1e-6
# The share for numbers that are no differences of larger ones, such as distances.
TIED_CLOSELY = 1e-9


def as_numbers(name: str, array: ArrayLike, last: str | int) -> NDArray[Any]:
    """Numbers of any kind as an array; `last` axes are for the message of a ragged list.

    What is masked is not there: NaN.

    Raises
    ------
    TypeError
        Not numbers.
    ValueError
        A ragged list.
    """
    try:
        given = np.asarray(array)
    except ValueError:
        raise ArgumentError(f"{name} must have shape (..., {last}), found a ragged list") from None
    if given.dtype.kind not in "iuf":
        alone = not isinstance(array, np.ndarray | list | tuple)
        found = shown(array) if alone else f"dtype {given.dtype}"
        raise ArgumentTypeError(f"{name} must be an array of numbers, found {found}")
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        return np.asarray(
            np.ma.filled(array.astype(np.float64), np.nan)
        )  # not what lies under the mask
    return given


def as_rows(name: str, array: ArrayLike, width: int) -> tuple[FloatArray, tuple[int, ...]]:
    """Numbers (..., width) as contiguous float64 rows (N, width), and the leading shape.

    Raises
    ------
    TypeError
        Not numbers.
    ValueError
        Another last axis.
    """
    given = as_numbers(name, array, width)
    if given.ndim == 0 or given.shape[-1] != width:
        raise ArgumentError(f"{name} must have shape (..., {width}), found {given.shape}")
    return as_doubles(given).reshape(-1, width), given.shape[:-1]


def as_doubles(given: NDArray[Any]) -> FloatArray:
    """Return numbers as the core reads them: float64, contiguous, aligned."""
    doubles = np.ascontiguousarray(given, dtype=np.float64)
    return doubles if doubles.flags.aligned else doubles.copy()


def mm_per_unit(units: Sequence[str], length: float) -> FloatArray:
    """Factors (n,) to mm of numbers in these units: a rotation counts as its arc at `length`.

    Examples
    --------
    >>> mm_per_unit(("mm", "rad"), 250.0)
    array([  1., 250.])
    """
    return np.array([length if unit == "rad" else 1.0 for unit in units])


def wrapped(angles: FloatArray) -> FloatArray:
    """Angles in rad the short way round, from -π to π; NaN for infinite ones.

    Examples
    --------
    >>> wrapped(np.array([0.5, 2 * np.pi - 0.5])).round(12)
    array([ 0.5, -0.5])
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(angles - 2 * np.pi * np.rint(angles / (2 * np.pi)))


def first_largest(values: FloatArray, alike: float) -> int:
    """Index of the largest value; of those within `alike` of it, the first.

    Rounding then decides nothing: values that differ by less count as equal, whatever the
    processor or the linear algebra library made of their last digits.

    Examples
    --------
    >>> first_largest(np.array([0.0, 1.0, 1.0 + 1e-15]), 1e-9)
    1
    """
    return int(np.argmax(values >= values.max() - alike))


def largest_first(values: FloatArray, alike: float) -> IntArray:
    """Order of values, the largest first; of those within `alike` of the next, as they come.

    Examples
    --------
    >>> largest_first(np.array([1.0, 3.0, 1.0 + 1e-15]), 1e-9)
    array([1, 0, 2])
    """
    order = np.argsort(-values, kind="stable")
    step = np.diff(values[order], prepend=values[order[:1]]) < -alike
    group = np.empty(len(values), dtype=np.intp)
    group[order] = np.cumsum(step)
    return np.argsort(group, kind="stable")


def furthest_axis(direction: FloatArray) -> int:
    """Coordinate axis, 0 to 2, that is furthest from a direction; of those alike, the first.

    Examples
    --------
    >>> furthest_axis(np.array([1e-17, 0.0, 1.0])), furthest_axis(np.ones(3))
    (0, 0)
    """
    along = np.abs(direction)
    return first_largest(-along, TIED * float(along.max()))


def lots(count: int, most: int = 16384, first: int = 0) -> Iterator[slice]:
    """Slices of so many rows, one after another, to bound the memory of what is made of them.

    They begin at row `first`.

    Examples
    --------
    >>> list(lots(5, 3))
    [slice(0, 3, None), slice(3, 6, None)]
    """
    for start in range(first, count, most):
        yield slice(start, start + most)


def held_once(rows: Held) -> Held:
    """Return rows (N, ...), which are in memory once, and cannot be written, where all are alike.

    Examples
    --------
    >>> held_once(np.zeros((1000, 3))).strides
    (0, 8)
    """
    if len(rows) < 2 or not (rows == rows[:1]).all():
        return rows
    first = rows[:1].copy()
    found = np.ndarray(rows.shape, rows.dtype, first, strides=(0, *first.strides[1:]))
    found.flags.writeable = False
    return cast(Held, found)  # as `np.broadcast_to` gives it, in a tenth of its time


def first_of_equal(rows: FloatArray) -> IntArray:
    """Return the first row of each run of equal rows (N, k)."""
    changed = np.any(rows[1:] != rows[:-1], axis=1)
    return np.flatnonzero(np.concatenate([np.ones(len(rows[:1]), dtype=bool), changed]))


def chained(rows: FloatArray, matrices: FloatArray, place: IntArray) -> FloatArray:
    """Derivatives (N, k, w) times the matrix (w, m) of each row, (N, k, m).

    `matrices` are (P, w, m), `place` (N,) which of them a row has. Where many rows in a row have
    one in common, as the corners of a picture, each is one product: copies would take most time.
    """
    if len(place) == len(matrices) and (place == np.arange(len(place))).all():
        return rows @ matrices
    changed = place[1:] != place[:-1]
    if (np.count_nonzero(changed) + 1) * _LONG >= len(rows):
        return rows @ matrices[place]
    starts = np.flatnonzero(np.append(True, changed))
    (_, k, w), m = rows.shape, matrices.shape[2]
    found = np.empty((len(rows), k, m))
    ends = [*starts[1:].tolist(), len(rows)]
    for first, last in zip(starts.tolist(), ends, strict=True):
        count = (last - first) * k
        flat, into = rows[first:last].reshape(count, w), found[first:last].reshape(count, m)
        np.matmul(flat, matrices[place[first]], out=into)
    return found


def rms(values: FloatArray) -> float:
    """Root mean square; NaN without values."""
    count = np.size(values)
    return float(np.sqrt(np.square(values).sum() / count)) if count else float("nan")


def propagate(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """Variances trace(J C Jᵀ) (N,) of points whose derivatives J are (N, k, n), for C (n, n).

    Not finite where a number is not determined.
    """
    with np.errstate(invalid="ignore"):  # of infinite variances
        variance: FloatArray = np.einsum(
            "nij,jk,nik->n", jacobian, covariance, jacobian, optimize=True
        )
    return variance
