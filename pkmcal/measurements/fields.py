"""The fields of `Measurements`: arrays of the right shape, or an error that names the argument."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import shown, words
from pkmcal.arrays import FloatArray, Int64Array, TextArray, as_numbers
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.components import KINDS, Kind, noun
from pkmcal.measurements.tracker import Tracker

_LEAST_SIGMA, _MOST_SIGMA = 1e-100, 1e100  # whose squares are numbers
_COLDEST = -273.15  # °C
_ROUNDED = 1e-9  # share by which a covariance may miss symmetry, as what was computed or typed does


def numbers(name: str, given: ArrayLike, blank: bool = False) -> FloatArray:
    """A copy as finite doubles; `blank`: NaN is a number that is not there."""
    array = np.array(as_numbers(name, given, "n"), dtype=np.float64, order="C")
    wrong = np.isinf(array) if blank else ~np.isfinite(array)
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f" at index {', '.join(map(str, first))}" if first else ""
        raise ArgumentError(f"{name} must be finite; found {array[first]}{where}")
    return array


def is_name(text: str) -> bool:
    """Whether a name can be written and read: on one line, not empty, not too long."""
    return 0 < len(text) <= LONGEST_NAME and text == " ".join(text.split())


def integers(name: str, given: ArrayLike, rows: int) -> Int64Array:
    """A copy as whole numbers, one per row."""
    array = numbers(name, given)
    if array.shape != (rows,):
        raise ArgumentError(f"{name} must have shape ({rows},); found {array.shape}")
    if (array != np.round(array)).any():
        row = int(np.argmax(array != np.round(array)))
        raise ArgumentError(f"{name} must be whole numbers; found {array[row]} in row {row}")
    return array.astype(np.int64)


def row_numbers(name: str, given: ArrayLike, rows: int) -> FloatArray:
    """A copy as finite doubles, one per row."""
    array = numbers(name, given)
    if array.shape != (rows,):
        raise ArgumentError(f"{name} must have shape ({rows},); found {array.shape}")
    return array


def temperature_array(given: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray | None:
    """Temperatures (N, 2 + n) of base, platform and what each actuator drives, °C."""
    if given is None:
        return None
    found = numbers("temperature", given, blank=True)
    rows, parts = shape[0], shape[1] + 2
    if found.shape not in ((), (rows,), (rows, parts)):
        raise ArgumentError(
            f"temperature must be a number or have shape ({rows},) or ({rows}, {parts}): of base,"
            f" platform and {shape[1]} actuators; found {found.shape}"
        )
    if (found < _COLDEST).any():
        raise ArgumentError(f"temperature in °C is above {_COLDEST}; found {np.nanmin(found):g}")
    of_rows = found[:, None] if found.ndim == 1 else found
    return np.array(np.broadcast_to(of_rows, (rows, parts)))


def sigma_array(
    given: ArrayLike | Tracker, kind: str, shape: tuple[int, int], values: FloatArray
) -> FloatArray:
    """Standard deviations (N, k) or covariances (N, k, k)."""
    rows, k = shape
    if not k:
        raise ArgumentError(f"sigma: nothing was read of kind {kind!r}; see actuator_sigma")
    if isinstance(given, Tracker):
        if kind != "position":
            raise ArgumentError(f"sigma: a tracker measures positions, not values of kind {kind!r}")
        covariance = given.covariance(values)
        return np.asarray(0.5 * (covariance + covariance.transpose(0, 2, 1)))
    sigma = numbers("sigma", given)
    if sigma.ndim == 3 and sigma.shape == (rows, k, k):
        mirrored = sigma.transpose(0, 2, 1)
        odd = np.abs(sigma - mirrored).max(axis=(1, 2)) > _ROUNDED * np.abs(sigma).max(axis=(1, 2))
        sigma = np.asarray(0.5 * (sigma + mirrored))
        for row, matrix in enumerate(sigma):
            if odd[row] or np.linalg.eigvalsh(matrix)[0] <= 0:
                raise ArgumentError(
                    f"sigma: row {row} is not a covariance matrix (symmetric, positive)"
                )
        return sigma
    if k == 1 and sigma.shape == (rows,):
        sigma = sigma[:, None]
    if sigma.shape not in ((), (k,), (rows, 1), (rows, k)):
        raise ArgumentError(
            f"sigma for {rows} measurements of kind {kind!r} must be a number or have shape ({k},),"
            f" ({rows}, 1), ({rows}, {k}) or ({rows}, {k}, {k}); found {sigma.shape}"
        )
    if not (sigma > 0).all():
        raise ArgumentError(f"sigma must be positive; found {sigma.min()} (None means not known)")
    if sigma.min(initial=1.0) < _LEAST_SIGMA or sigma.max(initial=1.0) > _MOST_SIGMA:
        raise ArgumentError(
            f"sigma must lie between {_LEAST_SIGMA:g} and {_MOST_SIGMA:g}; found"
            f" {sigma.min():g} to {sigma.max():g}"
        )
    return np.array(np.broadcast_to(sigma, shape))


def value_of_row(
    given: ArrayLike | None, kind: Kind, k: int, q: tuple[int, ...]
) -> FloatArray | None:
    """What was read in one row, (k,) or a number, as that of (1,) rows."""
    if given is None:
        return None
    value = numbers("values", given, blank=True)
    if kind == "touch" and value.shape[:1] == (1,):
        return value  # of names that are touched
    if value.shape != ((k,) if k != 1 else ()):
        what = f"have shape ({k},)" if k != 1 else "be a number"
        raise ArgumentError(
            f"values of kind {kind!r} must {what} for one row of actuators {q}, or actuators have"
            f" shape (N, n); found {value.shape}"
        )
    return value[None]


def number_of_row(given: ArrayLike | None) -> ArrayLike | None:
    """What has one entry a row, of one row."""
    return None if given is None else np.atleast_1d(np.asarray(given))


def values_array(given: ArrayLike | None, kind: Kind, shape: tuple[int, int]) -> FloatArray:
    """What was read, (N, k) or (N,); NaN where nothing was, of orientations as a whole."""
    if given is None:
        if shape[1]:
            raise ArgumentError(
                f"values of kind {kind!r} must be given, found None: that goes with 'closure'"
            )
        return np.empty(shape)
    values = numbers("values", given, blank=True)
    expected = shape if shape[1] != 1 else shape[:1]
    if values.shape != expected:
        raise ArgumentError(
            f"values of kind {kind!r} must have shape {expected} for {shape[0]} rows of"
            f" actuators; found {values.shape}"
        )
    first = KINDS[kind].turning
    if first is not None:
        angles = np.isnan(values[:, first:])
        part = angles.any(axis=1) & ~angles.all(axis=1)
        if part.any():
            raise ArgumentError(
                "values: an orientation has three angles or none; found one left out in row"
                f" {int(np.argmax(part))}"
            )
    return values


def actuator_sigma_array(given: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray | None:
    """Standard deviations of the actuators (N, n), of which some may be 0 in all rows."""
    if given is None:
        return None
    whole = _of_actuators("actuator_sigma", given, shape)
    if (whole < 0).any() or ((whole == 0).any(axis=0) & (whole > 0).any(axis=0)).any():
        raise ArgumentError(
            "actuator_sigma must be positive, or 0 for an actuator in all rows; found"
            f" {whole.min():g} (None means not known)"
        )
    return whole


def target_array(
    given: ArrayLike | None, kind: Kind, index: Int64Array | None, rows: int
) -> FloatArray | None:
    """One target, one per row, or several that an index chooses from; None where none is given."""
    if not KINDS[kind].point and (given is not None or index is not None):
        raise ArgumentError(f"target: {noun(kind)} are not of a point, and take no target")
    if index is not None and index.min() < 0:
        raise ArgumentError(f"target_index counts from 0; found {index.min()}")
    if given is None:
        if KINDS[kind].point == "base":
            raise ArgumentError(
                "target: a distance needs the fixed point it is measured to, (x, y, z) in mm in"
                " the base frame"
            )
        return None
    target = numbers("target", given)
    if index is not None:
        if target.ndim != 2 or target.shape[1] != 3:
            raise ArgumentError(
                f"target must have shape (k, 3) with target_index; found {target.shape}"
            )
        if index.max() >= len(target):
            raise ArgumentError(
                f"target_index must be below {len(target)}, the number of targets;"
                f" found {index.max()}"
            )
    elif target.shape not in ((3,), (rows, 3)):
        raise ArgumentError(
            f"target must have shape (3,) or ({rows}, 3), or (k, 3) with target_index;"
            f" found {target.shape}"
        )
    return target


def attachment_array(
    given: ArrayLike | None, kind: Kind, targets: int | None, rows: int
) -> FloatArray | None:
    """One attachment, one per row, or one for each of the several targets; None without."""
    if given is None:
        return None
    if KINDS[kind].point != "base":
        raise ArgumentError(
            f"attachment: distances alone have one, values of kind {kind!r} a target"
        )
    attachment = numbers("attachment", given)
    if attachment.shape not in ((3,), (rows if targets is None else targets, 3)):
        several = rows if targets is None else targets
        raise ArgumentError(
            f"attachment must have shape (3,) or ({several}, 3); found {attachment.shape}"
        )
    return attachment


def names_of_targets(
    given: Sequence[str] | None,
    index: Int64Array | None,
    target: FloatArray | None,
) -> tuple[str, ...] | None:
    """Names of the several targets, "1", "2", … unless given; None where there is no index."""
    if index is None:
        if given is not None:
            raise ArgumentError("target_names need target_index, which says where each is measured")
        return None
    if given is None:
        count = int(index.max()) + 1 if target is None else len(target)
        return tuple(str(i + 1) for i in range(count))
    names = words("target_names", given)
    if not all(map(is_name, names)) or len(set(names)) < len(names):
        raise ArgumentError(
            f"target_names must be different names on one line, of at most {LONGEST_NAME}"
            f" characters; found {shown(names)}"
        )
    if len(names) <= index.max() or (target is not None and len(names) != len(target)):
        wanted = int(index.max()) + 1 if target is None else len(target)
        raise ArgumentError(f"target_names must name {wanted} targets; found {len(names)}")
    return names


def approach_array(given: ArrayLike | None, actuators: FloatArray) -> FloatArray | None:
    """From where each actuator came (N, n): 1, -1 or 0; "order": by the order of the rows."""
    if given is None:
        return None
    if isinstance(given, str):
        if given != "order":
            raise ArgumentError(f"approach must be 'order' or numbers; found {given!r}")
        moved = np.sign(np.diff(actuators, axis=0, prepend=actuators[:1]))
        for row, before in zip(moved[1:], moved[:-1], strict=True):
            row[row == 0.0] = before[row == 0.0]  # it stood still since
        return np.asarray(moved)
    found = _of_actuators("approach", given, actuators.shape)
    if not np.isin(found, (-1.0, 0.0, 1.0)).all():
        raise ArgumentError("approach must be 1, -1 or 0 for each actuator")
    return found


def tension_array(given: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray | None:
    """Tension of what each actuator drives (N, n), N; NaN where it was not read."""
    return None if given is None else _of_actuators("tension", given, shape, blank=True)


def tension_sigma_array(
    given: ArrayLike | None, tension: ArrayLike | None, shape: tuple[int, ...]
) -> FloatArray | None:
    """Standard deviations of tensions (N, n), N."""
    if given is None:
        return None
    if tension is None:
        raise ArgumentError("tension_sigma: no tension was read that it could be of")
    found = _of_actuators("tension_sigma", given, shape)
    if not (found > 0.0).all():
        raise ArgumentError(
            f"tension_sigma must be positive, found {found.min():g}; without it tensions are exact"
        )
    return found


def filled_tension(tension: FloatArray) -> FloatArray:
    """Tensions (N, n), those that were not read (NaN) at the mean of their row, else at 0.

    Examples
    --------
    >>> filled_tension(np.array([[10.0, np.nan, 30.0]]))
    array([[10., 20., 30.]])
    """
    read = np.isfinite(tension)
    if read.all():
        return tension
    count = np.maximum(read.sum(axis=1, keepdims=True), 1)
    mean = np.nansum(tension, axis=1, keepdims=True) / count
    return np.where(read, tension, mean)


def _of_actuators(
    name: str, given: ArrayLike, shape: tuple[int, ...], blank: bool = False
) -> FloatArray:
    """Numbers of each actuator (N, n), given for all, for each or for each row."""
    found = numbers(name, given, blank)
    if found.shape not in ((), shape[1:], shape):
        raise ArgumentError(
            f"{name} must be one number or have shape {shape[1:]} or {shape}; found {found.shape}"
        )
    return np.array(np.broadcast_to(found, shape))


def sessions_array(given: str | Sequence[str] | TextArray | None, rows: int) -> TextArray | None:
    """One name per row; None where none is given."""
    if given is None:
        return None
    named = given.tolist() if isinstance(given, np.ndarray) else given
    names = words("session", named)
    if isinstance(named, str):
        names = names * rows
    if len(names) != rows:
        raise ArgumentError(
            f"session must be one name, or one for each of {rows} rows; found {len(names)}"
        )
    for name in dict.fromkeys(names):
        if not is_name(name) or "@" in name:
            raise ArgumentError(
                "session must be a name on one line, of at most"
                f" {LONGEST_NAME} characters and without '@'; found {shown(name)}"
            )
    return np.array(names)


def units_of_actuators(given: str | Sequence[str] | None, count: int) -> tuple[str, ...] | None:
    """One unit per actuator, "mm" or "rad"; None where none is given."""
    if given is None:
        return None
    units = words("actuator_units", given)
    units = units * count if isinstance(given, str) else units
    if len(units) != count or any(unit not in ("mm", "rad") for unit in units):
        raise ArgumentError(
            f'actuator_units must be "mm" or "rad" for {count} actuators; found {given!r}'
        )
    return units
