"""Check whether what readings and effects return has the shapes that their classes promise.

A user's class may return anything: here it is named, before an array does not fit another one.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from pkmcal.arguments import kind, shown
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.effects.effect import Effect, EffectOfRows, Moved
from pkmcal.estimation.fit_data import FitData
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, named_failures, of_the_package
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.dependences import yielded
from pkmcal.readings.predicted import Predicted, require_by, require_shape


def require_derivatives(data: FitData, found: Predicted, numbers: Mapping[str, IntArray]) -> None:
    """Refuse a prediction that does not say how it follows the arguments that are estimated."""
    rows, k = found.values.shape
    for name, columns in numbers.items():
        if name not in found.by or found.by[name].shape[2] != columns.shape[1]:
            effect = _effect_with(name, data)
            argument, method = "kind", f"predict of {data.measured.kind!r}"
            if effect is not None:
                argument, method = "effects", f"moved of {effect.name!r}"
            if name in found.by:
                what = f"{argument}: {method}: by[{name!r}]"
                require_shape(what, found.by[name], (rows, k, columns.shape[1]))
            known = ", ".join(map(repr, found.by)) or "none"
            raise ArgumentError(
                f"{argument}: {name!r} is estimated, but {method} gives no derivative by it (by has"
                f" {known})"
            )


def require_members(measured: Measurements, length: float) -> None:
    """Refuse a worth of units in mm that is none, or numbers of rows that are not of all.

    Those are `mm`, `arcs`, `lots` and `subject` of a reading of the user's own.
    """
    reading = measured.instrument
    if of_the_package(reading):
        return
    k, rows = len(reading.components), len(measured)
    for member, shapes in (("mm", ((k,), (rows, k))), ("arcs", ((k,),))):
        what = f"kind: {member} of the class {type(reading).__name__}"
        with named_failures(
            reading, what, "it is given measurements and the length of the machine"
        ):
            found: object = getattr(reading, member)(measured, length)
        require_shape(what, found, shapes[-1] if np.ndim(found) > 1 else shapes[0])  # type: ignore[arg-type]
        numbers = np.asarray(found, dtype=np.float64)
        if not (np.isfinite(numbers) & (numbers > 0.0)).all():
            raise ArgumentError(f"{what} must be positive: found {shown(found)}")
    for member, given in (("lots", reading.lots(measured)), ("subject", reading.subject(rows))):
        if given is not None:
            require_shape(f"kind: {member} of the class {type(reading).__name__}", given, (rows,))


def _effect_with(argument: str, data: FitData) -> Effect | None:
    """The effect that has an argument; None: it is one of the reading."""
    for effect in data.effects:
        if any(each.argument == argument for each in yielded(effect, data.measured)):
            return effect
    return None


def effect_of_rows(effect: Effect, measured: Measurements) -> EffectOfRows:
    """The effect in these rows; refuses an object without the method `moved`.

    One of the user's own is given a copy of the rows, and refused if it alters that: what it wrote
    there would be no measurement.
    """
    what = f"effects: of_rows of {type(effect).__name__}"
    given = measured if of_the_package(effect) else copy.deepcopy(measured)
    with named_failures(effect, what):
        found: object = effect.of_rows(given)
    for name, array in vars(measured).items() if given is not measured else ():
        if isinstance(array, np.ndarray):
            after = vars(given).get(name)
            if not isinstance(after, np.ndarray) or after.tobytes() != array.tobytes():
                raise ArgumentError(
                    f"{what} alters {name} of the measurements: what it makes of them has to be in"
                    " an array of its own"
                )
    if not hasattr(found, "moved"):
        raise ArgumentTypeError(
            f"effects: of_rows of {type(effect).__name__} must return an object with a method"
            f" moved, such as the effect itself; found {kind(found)}"
        )
    return cast(EffectOfRows, found)


def moved_by(
    effect: EffectOfRows,
    machine: Any,
    pose: FloatArray,
    actuators: FloatArray,
    rows: IntArray,
    numbers: Mapping[str, FloatArray],
) -> Moved:
    """Return how an effect moves the platform in some rows; refuses what is no such motion."""
    what = f"effects: moved of {type(effect).__name__}"
    given = ", ".join(numbers) or "none"
    with named_failures(
        effect,
        what,
        f"it is given machine, pose, actuators, rows and numbers (by name: {given}) and has to"
        " return Moved(twist, by)",
    ):
        found: object = effect.moved(machine, pose, actuators, rows, numbers)
    if not isinstance(found, Moved):
        raise ArgumentTypeError(f"{what} must return Moved(…); found {kind(found)}")
    n = len(rows)
    require_shape(f"{what}: twist", found.twist, (n, 6))
    require_by(f"{what}: by", found.by, (n, 6))
    if found.growth is not None:
        require_shape(f"{what}: growth", found.growth, (n,))
        require_by(f"{what}: growth_by", found.growth_by, (n,))
    return found
