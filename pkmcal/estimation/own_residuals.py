"""Residuals that a user states as functions of named numbers, beside those of measurements.

They are told in standard deviations and are expected to be 0: what else is known of the machine,
as of anything that was measured otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.readings.unknowns import Numbers

Residual = Callable[[Mapping[str, float]], Any]
ROLE = "residual"  # of numbers that a residual brings
_STEP = 1e-3  # of what moves the machine by about 1 mm, by which parameters are varied
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
    if brought is not None:
        return values, _by_rates(residual, brought, rates(theta), len(values))
    slopes = np.zeros((len(values), len(theta)))
    for i, step in enumerate(_STEP * scale):
        high, low = theta.copy(), theta.copy()
        high[i] += step
        low[i] -= step
        ends = [_called(residual, named(end))[0] for end in (high, low)]
        if any(end.shape != values.shape for end in ends):
            raise ArgumentError(
                f"residuals: {residual_name(residual)} does not always give as many numbers"
            )
        slopes[:, i] = (ends[0] - ends[1]) / (2.0 * step)
    return values, slopes


def _by_rates(
    residual: Residual,
    brought: Mapping[str, Any],
    rates: Mapping[str, FloatArray],
    count: int,
) -> FloatArray:
    """Derivative (k, n) by the parameters, of derivatives by name."""
    found = np.zeros((count, len(next(iter(rates.values())))))
    for name, given in brought.items():
        slope = np.asarray(given, dtype=float).reshape(-1)
        if name not in rates or slope.size != count or not np.isfinite(slope).all():
            raise ArgumentError(
                f"residuals: {residual_name(residual)}: its derivative by {name!r} must be by the"
                f" name of a number, {count} finite values"
            )
        found += slope[:, None] * rates[name]
    return found


def _called(
    residual: Residual, numbers: Mapping[str, float]
) -> tuple[FloatArray, Mapping[str, Any] | None]:
    """Values, and derivatives by name where the residual brings them."""
    who, brought = f"residuals: {residual_name(residual)}", None
    try:
        given = residual(numbers)
    except KeyError as error:
        raise ArgumentError(f"{who}: no number {error}, or no common one") from None
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping):
        given, brought = given
    try:
        values = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise ArgumentError(
            f"{who}: expected one finite number or a list of them, in standard deviations; found"
            f" {given!r}"
        )
    return values, brought
