"""Whether what readings and effects return has the shapes that their classes promise.

A user's class may return anything: here it is named, before an array does not fit another one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal.arguments import kind
from pkmcal.arrays import IntArray
from pkmcal.effects.effect import EffectOfRows, Moved
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.readings.predicted import Predicted
from pkmcal.readings.reading import Reading


def require_predicted(reading: Reading, rows: int, found: object) -> None:
    """Refuse a prediction without values (N, k) or derivatives (N, k, 6)."""
    what = f"kind: predict of {reading.name!r}"
    if not isinstance(found, Predicted):
        raise ArgumentTypeError(f"{what} must return Predicted(…); found {kind(found)}")
    k = len(reading.components)
    _require_shape(f"{what}: values", found.values, (rows, k))
    _require_shape(f"{what}: by_twist", found.by_twist, (rows, k, 6))
    for name in ("by_frame", "by_other"):
        if getattr(found, name) is not None:
            _require_shape(f"{what}: {name}", getattr(found, name), (rows, k, 6))


def require_derivatives(
    reading: Reading, found: Predicted, numbers: Mapping[str, IntArray]
) -> None:
    """Refuse a prediction that does not say how it follows the arguments that are estimated."""
    for name, columns in numbers.items():
        if name not in found.by:
            raise ArgumentError(
                f"kind: {name!r} is estimated, but predict of {reading.name!r}, or moved of an"
                " effect, gives no derivative by it (by)"
            )
        rows, k = found.values.shape
        _require_shape(
            f"kind: {reading.name!r}: by[{name!r}]", found.by[name], (rows, k, columns.shape[1])
        )


def require_moved(effect: EffectOfRows, rows: int, found: object) -> None:
    """Refuse a motion without a twist (N, 6)."""
    what = f"effects: moved of {type(effect).__name__}"
    if not isinstance(found, Moved):
        raise ArgumentTypeError(f"{what} must return Moved(…); found {kind(found)}")
    _require_shape(f"{what}: twist", found.twist, (rows, 6))
    for name, rates in found.by.items():
        width = np.shape(rates)[-1] if np.ndim(rates) else 1
        _require_shape(f"{what}: by[{name!r}]", rates, (rows, 6, width))
    if found.growth is not None:
        _require_shape(f"{what}: growth", found.growth, (rows,))


def _require_shape(what: str, found: object, shape: tuple[int, ...]) -> None:
    if not isinstance(found, np.ndarray) or found.shape != shape:
        seen = found.shape if isinstance(found, np.ndarray) else kind(found)
        raise ArgumentError(f"{what} must be an array of shape {shape}; found {seen}")
