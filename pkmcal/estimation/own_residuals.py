"""Residuals that a user states as functions of named numbers, beside those of measurements.

They are told in standard deviations and are expected to be 0: what else is known of the machine,
as of anything that was measured otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal.arguments import shown
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, named_failures
from pkmcal.readings.unknowns import Numbers

Residual = Callable[[Mapping[str, float]], Any]
ROLE = "residual"  # of numbers that a residual brings
_STEP = 1e-3  # of what moves the machine by about 1 mm, by which parameters are varied
_OFF = 1e-3  # of a derivative: what is off by more is wrong
_ROUNDING = 1e-5  # of the largest derivative of a residual, for the same way of the machine
_MOST = 1e50  # of residuals and derivatives: sums of squares of more are no numbers
_UNITS = ("mm", "rad", "1")


def checked_residuals(residuals: object) -> tuple[Residual, ...]:
    """The functions among the arguments of `identify`.

    Raises
    ------
    TypeError
        What cannot be called.
    """
    given = [residuals] if callable(residuals) else residuals
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise ArgumentTypeError(f"residuals: expected a list of functions, found {residuals!r}")
    for each in given:
        if not callable(each):
            raise ArgumentTypeError(f"residuals: expected functions, found {each!r}")
    return tuple(given)


def residual_name(residual: Residual) -> str:
    """Name a residual for messages: its function or class."""
    return str(getattr(residual, "__name__", type(residual).__name__))


def brought_numbers(residual: Residual) -> Numbers | None:
    """The numbers that a residual brings: its attribute ``numbers``; None without.

    Raises
    ------
    ValueError, TypeError
        No mapping of names to values, or to values and units.
    """
    stated = getattr(residual, "numbers", None)
    if not stated:
        return None
    who = f"residuals: numbers of {residual_name(residual)}"
    if not isinstance(stated, Mapping):
        raise ArgumentTypeError(f"{who}: expected values by name, found {stated!r}")
    values, units = [], []
    for name, given in stated.items():
        value, unit = given if isinstance(given, tuple) and len(given) == 2 else (given, "mm")
        real = isinstance(value, int | float | np.number) and np.isfinite(value)
        if not isinstance(name, str) or not real:
            raise ArgumentTypeError(f"{who}: {name} starts at {value!r}, expected a number")
        if unit not in _UNITS:
            raise ArgumentError(f"{who}: unit {unit!r} of {name}, expected mm, rad or 1")
        values.append(float(value))
        units.append(str(unit))
    return Numbers(tuple(stated), tuple(units), np.arange(len(values)), np.array(values))


def at_parameters(
    residual: Residual,
    named: Callable[[FloatArray], Mapping[str, float]],
    rates: Callable[[FloatArray], Mapping[str, FloatArray]],
    theta: FloatArray,
    scale: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return a residual (k,) at parameters θ (n,), and its derivative (k, n).

    By central differences where it brings no derivatives. `named` and `rates` are the numbers by
    name and their derivatives (n,), `scale` (n,) what moves the machine by about 1 mm.

    Raises
    ------
    ValueError
        A name that there is not, no finite numbers, or now more of them than before.
    """
    values, brought = _called(residual, named(theta))
    if brought is None:
        return values, np.mean(_sides(residual, named, theta, scale, values), axis=0)
    return values, _by_rates(residual, brought, rates(theta), len(values))


def require_true(
    residual: Residual,
    named: Callable[[FloatArray], Mapping[str, float]],
    rates: Callable[[FloatArray], Mapping[str, FloatArray]],
    theta: FloatArray,
    scale: FloatArray,
    names: Sequence[str],
) -> None:
    """Compare the derivatives that a residual brings with differences of its values.

    Arguments are those of `at_parameters`, and the names (n,) of the parameters.

    Raises
    ------
    ValueError
        Other values of the same numbers; a derivative that is not that of the values.
    """
    who = f"residuals: {residual_name(residual)}"
    values, brought = _called(residual, named(theta))
    if not np.array_equal(values, _called(residual, named(theta))[0]):
        raise ArgumentError(f"{who} gives other values of the same numbers when it is called again")
    if brought is None:
        return
    stated = _by_rates(residual, brought, rates(theta), len(values))
    ahead, behind = _sides(residual, named, theta, scale, values)
    central = (ahead + behind) / 2.0
    sizes = np.maximum(np.abs(stated), np.abs(central))
    largest = (sizes * scale).max(axis=1, initial=0.0, keepdims=True) / scale
    unsure = np.abs(ahead - behind) + _ROUNDING * largest  # at a kink they differ
    off = np.abs(stated - central) - _OFF * sizes - unsure
    if (off > 0.0).any():
        k, i = divmod(int(np.argmax(off * scale)), len(scale))
        raise ArgumentError(
            f"{who}: its derivative by {names[i]} is stated as {stated[k, i]:.4g}, and central"
            f" differences of its values are {central[k, i]:.4g}: the derivative is wrong, or the"
            " values are"
        )


def _sides(
    residual: Residual,
    named: Callable[[FloatArray], Mapping[str, float]],
    theta: FloatArray,
    scale: FloatArray,
    values: FloatArray,
) -> FloatArray:
    """Differences (2, k, n) by each parameter: ahead, behind."""
    found = np.zeros((2, len(values), len(theta)))
    for i, step in enumerate(_STEP * scale):
        for side, change in enumerate((step, -step)):
            there = theta.copy()
            there[i] += change
            end = _called(residual, named(there))[0]
            if end.shape != values.shape:
                raise ArgumentError(
                    f"residuals: {residual_name(residual)} does not always give as many numbers"
                )
            found[side, :, i] = (end - values) / change
    return found


def _by_rates(
    residual: Residual,
    brought: Mapping[str, Any],
    rates: Mapping[str, FloatArray],
    count: int,
) -> FloatArray:
    """Derivative (k, n) by the parameters, of derivatives by name."""
    found = np.zeros((count, len(next(iter(rates.values())))))
    for name, given in brought.items():
        slope = _numbers(given).reshape(-1)
        if name not in rates or slope.size != count or not (np.abs(slope) < _MOST).all():
            raise ArgumentError(
                f"residuals: {residual_name(residual)}: its derivative by {name!r} must be by the"
                f" name of a number, {count} finite values below {_MOST:.0e}"
            )
        found += slope[:, None] * rates[name]
    return found


class _NumbersByName(dict[str, float]):
    """The numbers that a residual is given, and the errors where it asked for others."""

    def __init__(self, numbers: Mapping[str, float]) -> None:
        super().__init__(numbers)
        self.missed: list[KeyError] = []

    def __missing__(self, name: str) -> float:
        error = KeyError(name)
        self.missed.append(error)
        raise error


def _called(
    residual: Residual, numbers: Mapping[str, float]
) -> tuple[FloatArray, Mapping[str, Any] | None]:
    """Values, and derivatives by name where the residual brings them."""
    who, brought = f"residuals: {residual_name(residual)}", None
    by_name = _NumbersByName(numbers)
    with named_failures(residual, who, "it is given the numbers, by name"):
        try:
            given = residual(by_name)
        except KeyError as error:
            if error not in by_name.missed:
                raise
            raise ArgumentError(f"{who}: no number {error}, or no common one") from None
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping):
        given, brought = given
    values = _numbers(given)
    if values.ndim != 1 or not values.size or not (np.abs(values) < _MOST).all():
        raise ArgumentError(
            f"{who}: expected one finite number below {_MOST:.0e} or a list of them, in standard"
            f" deviations; found {shown(given)}"
        )
    return values, brought


def _numbers(given: object) -> FloatArray:
    """The numbers that were given, in an array; NaN where they are none."""
    try:
        return np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        return np.array([np.nan])
