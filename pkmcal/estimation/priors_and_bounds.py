"""Priors and bounds of the parameters, by the names that the user states.

Where rows are held out, `strict` is False: a name that the fit has may not be among theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pkmcal.arguments import did_you_mean, shown
from pkmcal.arrays import FloatArray
from pkmcal.estimation.parameters import Asked, Bounds
from pkmcal.estimation.prior_functions import is_function
from pkmcal.estimation.sessions import matches
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.geometry.stated_uncertainty import LEAST, MOST


def prior_deviations(
    asked: Asked, names: Sequence[str], scale: FloatArray, of_machine: int, strict: bool
) -> FloatArray:
    """Return the prior of each parameter: as effects state it, unless `prior` names it."""
    prior = asked.prior
    sigma = np.full(len(names), np.inf)
    own = asked.of_effects
    of_effects = [own.get(name.partition("@")[0], np.inf) if own else np.inf for name in names]
    if isinstance(prior, Mapping):
        sigma[:] = of_effects
        for pattern, value in prior.items():
            if is_function(pattern, value):
                continue
            hits = _matching("prior", pattern, names, strict)
            sigma[hits] = _positive(f"prior of {pattern}", value)
        return sigma
    if prior is not None:
        sigma[:of_machine] = _positive("prior", prior) * scale[:of_machine]
        sigma[[not is_kinematic(name) for name in names]] = np.inf  # forces are no lengths
    return np.where(np.isfinite(of_effects), of_effects, sigma)


def bounds_by_name(
    bounds: Bounds, names: Sequence[str], start: FloatArray, strict: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bound of each parameter (n,), infinite where none is stated."""
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    if bounds is None:
        return lower, upper
    if not isinstance(bounds, Mapping):
        raise ArgumentTypeError(
            f"bounds must map names to (lower, upper); found {type(bounds).__name__}"
        )
    for pattern, pair in bounds.items():
        try:
            low, high = (float(end) for end in pair)
        except (TypeError, ValueError, OverflowError):
            raise ArgumentError(
                f"bounds of {pattern} must be (lower, upper); found {pair!r}"
            ) from None
        for i in _matching("bounds", pattern, names, strict):
            if not low <= start[i] <= high or not low < high:
                raise ArgumentError(
                    f"bounds of {names[i]} must enclose its present value {start[i]:.9g};"
                    f" found {low:g} to {high:g}"
                )
            lower[i], upper[i] = low, high
    return lower, upper


def _matching(argument: str, pattern: object, names: Sequence[str], strict: bool) -> list[int]:
    if not isinstance(pattern, str):
        raise ArgumentTypeError(f"{argument}: names must be str, found {pattern!r}")
    hits = [i for i, name in enumerate(names) if name and matches(pattern, name)]
    if strict and not hits:
        known = did_you_mean(pattern, filter(None, names))
        raise ArgumentError(f"{argument}: no free parameter matches {pattern!r}{known}")
    return hits


def _positive(what: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ArgumentTypeError(f"{what} must be a number, a standard deviation; found {value!r}")
    if not value > 0:
        raise ArgumentError(f"{what} must be positive; found {value}")
    if not (LEAST <= value <= MOST or value == np.inf):
        raise ArgumentError(
            f"{what} must lie between {LEAST:g} and {MOST:g}, or be inf; found {shown(value)}"
        )
    return float(value)
