"""Check whether what readings and effects return has the shapes that their classes promise.

A user's class may return anything: here it is named, before an array does not fit another one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np

from pkmcal.arguments import kind
from pkmcal.arrays import IntArray
from pkmcal.effects.effect import Effect, EffectOfRows, Moved
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.predicted import Predicted, require_shape
from pkmcal.readings.reading import Reading


def require_derivatives(
    reading: Reading, found: Predicted, numbers: Mapping[str, IntArray]
) -> None:
    """Refuse a prediction that does not say how it follows the arguments that are estimated."""
    for name, columns in numbers.items():
        if name not in found.by:
            known = ", ".join(map(repr, found.by)) or "none"
            raise ArgumentError(
                f"kind: {name!r} is estimated, but predict of {reading.name!r}, or moved of an"
                f" effect, gives no derivative by it (by has {known})"
            )
        rows, k = found.values.shape
        require_shape(
            f"kind: {reading.name!r}: by[{name!r}]", found.by[name], (rows, k, columns.shape[1])
        )


def effect_of_rows(effect: Effect, measured: Measurements) -> EffectOfRows:
    """The effect in these rows; refuses an object without the method `moved`."""
    found: object = effect.of_rows(measured)
    if not hasattr(found, "moved"):
        raise ArgumentTypeError(
            f"effects: of_rows of {type(effect).__name__} must return an object with a method"
            f" moved, such as the effect itself; found {kind(found)}"
        )
    return cast(EffectOfRows, found)


def require_moved(effect: EffectOfRows, rows: int, found: object) -> None:
    """Refuse a motion without a twist (N, 6)."""
    what = f"effects: moved of {type(effect).__name__}"
    if not isinstance(found, Moved):
        raise ArgumentTypeError(f"{what} must return Moved(…); found {kind(found)}")
    require_shape(f"{what}: twist", found.twist, (rows, 6))
    for name, rates in found.by.items():
        width = np.shape(rates)[-1] if np.ndim(rates) else 1
        require_shape(f"{what}: by[{name!r}]", rates, (rows, 6, width))
    if found.growth is not None:
        require_shape(f"{what}: growth", found.growth, (rows,))
