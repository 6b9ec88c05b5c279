"""Check the statements of readings and effects that are no part of the package.

Their derivatives are compared with differences of their values, and every row has to be predicted
alike wherever it stands among the others. Readings and effects of the package are tested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.effects.effect import EffectOfRows, Moved
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.prediction import Prediction
from pkmcal.estimation.shapes import moved_by
from pkmcal.exceptions import ArgumentError, of_the_package
from pkmcal.readings import orientation
from pkmcal.readings.predicted import At, Predicted, require_arguments, require_shape
from pkmcal.readings.reading import Reading
from pkmcal.readings.unknowns import ORIGIN, Dependence

_LENGTH, _TURN = 1e-3, 1e-5  # mm and rad: changes of which differences are taken
_OFF = 1e-3  # of the largest derivative by a number: what is off by more is wrong
_ROUNDING = 1e-13  # of the largest value
_ORDER = 1e-9  # of the largest value: by which a prediction may follow the order of the rows
_TWIST = ("omega x", "omega y", "omega z", "v x", "v y", "v z")
_PLACE = ("x", "y", "z", "alpha", "beta", "gamma")

Values = Callable[[float], FloatArray]  # (N, k), where one number has changed by so much
_Part = Callable[[Moved], FloatArray]  # of a motion
Difference = Callable[[FloatArray, FloatArray], FloatArray]


def require_true(
    prediction: Prediction,
    evaluation: Evaluation,
    trusted: Callable[[object], bool] = of_the_package,
) -> None:
    """Compare derivatives with differences, and rows with the same rows in another order.

    Parameters
    ----------
    prediction : Prediction
        The readings and effects.
    evaluation : Evaluation
        Where they are compared.
    trusted : callable (reading or effect) -> bool, optional
        Which are not: by default those of the package.

    Raises
    ------
    ValueError
        A derivative that is not that of the values; rows whose prediction depends on their order.
    """
    for i, data in enumerate(prediction.datasets):
        reading, steps = data.measured.instrument, _steps(data.dependences())
        effects = [each for each in prediction.effects[i] if not trusted(each)]
        own = bool(reading.components) and not trusted(reading)
        if own:
            _compare_reading(prediction, i, evaluation, steps)
            _compare_geometry(prediction, i, evaluation)
        for effect in effects:
            _compare_effect(prediction, i, evaluation, effect, steps)
        if own or effects:
            _compare_order(prediction, i, evaluation)


def _steps(dependences: Iterable[Dependence]) -> dict[str, FloatArray]:
    """The change (w,) of each number of an argument; 0 of one that is never estimated."""
    found = {}
    for each in dependences:
        steps = np.zeros(each.given.shape[1])
        for numbers in each.estimated.values():
            plain = np.array([_TURN if unit == "rad" else _LENGTH for unit in numbers.units])
            steps[numbers.slots] = plain if numbers.scale is None else _LENGTH * numbers.scale
        found[each.argument] = steps
    return found


def _compare_reading(
    prediction: Prediction, i: int, evaluation: Evaluation, steps: Mapping[str, FloatArray]
) -> None:
    """Compare all derivatives that `predict` states, and whether those by the geometry are."""
    reading = prediction.table.sets[i].instrument
    what, names = f"kind: predict of {reading.name!r}", [name for name, _ in reading.components]
    of_twist = [_TURN] * 3 + [_LENGTH] * 3
    of_place = [_LENGTH] * 3 + [_TURN] * 3

    def compare(stated: FloatArray, values: Values, step: float, by: str, rows: IntArray) -> None:
        _compare(stated, values, step, reading.difference, (what, names, by), rows)

    for at, numbers, rows in prediction.in_frames(i, evaluation.pose, evaluation.theta):
        named = {name: own for name, own in numbers.items() if not name.endswith(ORIGIN)}
        require_arguments(reading, at, named, "dependences")
        seen = reading.predict(at, **numbers)
        for side, place in (("frame", at.frame), ("other", at.other)):
            if place is None and getattr(seen, f"by_{side}") is not None:
                raise ArgumentError(f"{what}: by_{side} is given where `at` has no {side}")
        read = prediction.table.sets[i].values[rows]
        _require_inverse(reading, read, seen)
        for k, step in enumerate(of_twist):
            moved = _turned(reading, at, numbers, "pose", k)
            compare(seen.by_twist[:, :, k], moved, step, f"by_twist, by {_TWIST[k]}", rows)
            _compare_difference(reading, read, seen, moved, k, rows)
            if seen.by_other is not None:
                moved = _turned(reading, at, numbers, "other", k)
                compare(seen.by_other[:, :, k], moved, step, f"by_other, by {_TWIST[k]}", rows)
        if seen.by_frame is not None:
            for k, step in enumerate(of_place):
                placed = _placed(reading, at, numbers, k)
                compare(seen.by_frame[:, :, k], placed, step, f"by_frame, by {_PLACE[k]}", rows)
        for name in numbers.keys() & prediction.numbers[i].keys():
            for k in np.flatnonzero(steps[name]).tolist():
                changed = _changed(reading, at, numbers, name, k)
                by = f"by[{name!r}], by number {k}"
                compare(seen.by[name][:, :, k], changed, steps[name][k], by, rows)


def _turned(
    reading: Reading, at: At, numbers: Mapping[str, FloatArray], end: str, k: int
) -> Values:
    """The values where the platform has moved along a number of a twist, at one end."""
    pose = getattr(at, end)

    def values(change: float) -> FloatArray:
        vector, place = np.zeros((len(pose), 3)), pose[:, :3].copy()
        if k < 3:
            vector[:, k] = change
        else:
            place[:, k - 3] += change
        moved = np.hstack([place, orientation.turned(pose[:, 3:], vector)])
        there = replace(at, pose=moved) if end == "pose" else replace(at, other=moved)
        return reading.predict(there, **numbers).values

    return values


def _placed(reading: Reading, at: At, numbers: Mapping[str, FloatArray], k: int) -> Values:
    """The values where the base stands elsewhere in the frame by one of its numbers."""
    assert at.frame is not None
    frame = at.frame
    return lambda change: (
        reading.predict(replace(at, frame=frame + change * np.eye(6)[k]), **numbers).values
    )


def _changed(
    reading: Reading, at: At, numbers: Mapping[str, FloatArray], name: str, k: int
) -> Values:
    """The values where one number of an argument has changed in all rows."""
    return lambda change: reading.predict(at, **_with(numbers, name, k, change)).values


def _with(
    numbers: Mapping[str, FloatArray], name: str, k: int, change: float
) -> dict[str, FloatArray]:
    return {**numbers, name: numbers[name] + change * np.eye(numbers[name].shape[1])[k]}


def _compare_effect(
    prediction: Prediction,
    i: int,
    evaluation: Evaluation,
    effect: EffectOfRows,
    steps: Mapping[str, FloatArray],
) -> None:
    """Compare the derivatives by coefficients that `moved` states."""
    what = f"effects: moved of {type(effect).__name__}"
    table, theta = prediction.table, evaluation.theta
    numbers = prediction.arguments_of(i, theta)
    for machine, rows in prediction.machines_of(i, theta):
        at = table.pose_of[i][rows]
        place = machine, evaluation.pose[at], table.actuators[at], rows
        moved = partial(moved_by, effect, *place)
        seen = moved(numbers)
        sides: list[tuple[str, Mapping[str, FloatArray], _Part, tuple[str, ...]]]
        sides = [("by", seen.by, _twist, _TWIST)]
        if seen.growth is not None or seen.growth_by:
            rates = {name: each[:, None] for name, each in seen.growth_by.items()}
            sides.append(("growth_by", rates, _growth, ("growth",)))
        for name in (seen.by.keys() | seen.growth_by.keys()) & prediction.numbers[i].keys():
            for k in np.flatnonzero(steps[name]).tolist():
                for side, stated, part, components in sides:
                    names = what, components, f"{side}[{name!r}], by number {k}"
                    found = stated.get(name, np.zeros((len(rows), len(components), k + 1)))
                    values = partial(_of_changed, moved, part, numbers, name, k)
                    _compare(
                        found[:, :, k], values, float(steps[name][k]), np.subtract, names, rows
                    )


def _twist(found: Moved) -> FloatArray:
    return found.twist


def _growth(found: Moved) -> FloatArray:
    return np.zeros((len(found.twist), 1)) if found.growth is None else found.growth[:, None]


def _of_changed(
    moved: Callable[[Mapping[str, FloatArray]], Moved],
    part: _Part,
    numbers: Mapping[str, FloatArray],
    name: str,
    k: int,
    change: float,
) -> FloatArray:
    """A part of the motion where one number of an argument has changed in all rows."""
    return part(moved(_with(numbers, name, k, change)))


def _compare_geometry(prediction: Prediction, i: int, evaluation: Evaluation) -> None:
    """Compare what `by_geometry` states at held poses; where it states nothing, it has to be 0."""
    table, theta = prediction.table, evaluation.theta
    reading, scale = table.sets[i].instrument, prediction.parameters.scale
    stated = prediction.by_geometry(i, evaluation)
    what, rows = f"kind: by_geometry of {reading.name!r}", np.arange(len(table.sets[i]))
    names = [name for name, _ in reading.components]

    def compare(found: FloatArray, columns: IntArray, by: str) -> None:
        direction = np.zeros(len(theta))
        direction[columns] = scale[columns]

        def values(change: float) -> FloatArray:
            return prediction.unmoved(i, evaluation.pose, theta + change * direction).values

        _compare(found, values, _LENGTH, reading.difference, (what, names, by), rows)

    of_rows = len(rows), len(names)
    if stated is None:
        every = np.unique(table.machine_columns)
        compare(np.zeros(of_rows), every, "None, by all numbers of the geometry together")
        return
    require_shape(what, stated, (*of_rows, table.machine_columns.shape[1]))
    for j, columns in enumerate(table.machine_columns.T):
        one = np.unique(columns)
        own = scale[columns[table.machine_of_pose[table.pose_of[i]]]]
        name = prediction.parameters.names[one[0]].partition("@")[0]
        compare(stated[:, :, j] * own[:, None], one, f"by {name}, times its scale")


def _compare_difference(
    reading: Reading, measured: FloatArray, seen: Predicted, moved: Values, k: int, rows: IntArray
) -> None:
    """Compare `by_difference` with how the residual follows the twist's number `k`."""

    def values(change: float) -> FloatArray:
        return -reading.difference(measured, moved(change))

    shrinks = reading.by_difference(seen.by_twist.copy(), values(0.0) * -1.0)
    what = f"kind: by_difference or difference of {reading.name!r}"
    names = what, [name for name, _ in reading.components], f"by {_TWIST[k]}"
    step = _TURN if k < 3 else _LENGTH
    made_of = float(np.abs(np.nan_to_num(seen.values)).max(initial=0.0))
    _compare(shrinks[:, :, k], values, step, np.subtract, names, rows, made_of)


def _require_inverse(reading: Reading, measured: FloatArray, seen: Predicted) -> None:
    """Refuse a method `corrected` that is not the inverse of `difference`."""
    residual = reading.difference(measured, seen.values)
    left = reading.difference(measured, reading.corrected(seen.values, residual.copy()))
    size = np.nan_to_num(np.abs(np.hstack([residual, seen.values]))).max(initial=0.0)
    if (np.nan_to_num(np.abs(left)) > _OFF * np.abs(residual) + _ORDER * size).any():
        raise ArgumentError(
            f"kind: corrected of {reading.name!r} is not the inverse of its difference: a predicted"
            " value that is corrected by measured less predicted has to be the measured one"
        )


def _compare_order(prediction: Prediction, i: int, evaluation: Evaluation) -> None:
    """Refuse predictions of rows that follow from where they stand among the others."""
    order = np.arange(len(prediction.table.sets[i]))[::-1]
    turned = Prediction.of([prediction.datasets[i].select(order)], prediction.parameters)
    pose = np.full((len(turned.table.actuators), 6), np.nan)
    for ends, others in (
        (prediction.table.pose_of, turned.table.pose_of),
        (prediction.table.other_of, turned.table.other_of),
    ):
        if (end := ends[i]) is not None and (other := others[0]) is not None:
            pose[other] = evaluation.pose[end[order]]
    one = prediction.of_set(i, evaluation.pose, evaluation.theta)
    other_way = turned.of_set(0, pose, evaluation.theta)
    pairs = [(one.values, other_way.values)]
    pairs += [(by, other_way.by[name]) for name, by in one.by.items()]
    for there, here in pairs:
        off = np.abs(there[order] - here).reshape(len(order), -1).max(axis=1, initial=0.0)
        if (off > _ORDER * np.abs(there).max(initial=0.0)).any():
            data = prediction.datasets[i]
            every = (data.measured.instrument, *prediction.effects[i])
            mine = [type(each).__name__ for each in every if not of_the_package(each)]
            raise ArgumentError(
                f"{' or '.join(mine)}: row {order[np.argmax(off)]} is predicted otherwise where the"
                " rows stand in another order, as they do where some are left out: numbers of rows"
                " belong to the measurements, Measurements(…, beside={'current': …}), where of_rows"
                " of an effect takes them, or in fields that the class of a reading lists in"
                " per_row"
            )


def _compare(
    stated: FloatArray,
    values: Values,
    step: float,
    difference: Difference,
    names: tuple[str, Iterable[str], str],
    rows: IntArray,
    made_of: float = 0.0,
) -> None:
    """Refuse a derivative (N, k) that differences to both sides contradict alike.

    `made_of` is how large the numbers are whose differences the values are, if they are any.
    """
    here = values(0.0)
    ahead = difference(values(step), here) / step
    behind = difference(here, values(-step)) / step
    what, components, by = names
    lost = ~np.isfinite(stated) & np.isfinite(here) & np.isfinite(ahead) & np.isfinite(behind)
    if lost.any():
        row, k = np.unravel_index(np.argmax(lost), lost.shape)
        raise ArgumentError(
            f"{what}: {by}: in row {rows[row]} it states {stated[row, k]} of {list(components)[k]},"
            " where the values are finite"
        )
    central = (ahead + behind) / 2
    made_of = max(made_of, np.abs(np.nan_to_num(stated)).max(initial=0.0))  # if values cancel
    largest = np.maximum(np.abs(here).max(axis=0, initial=0.0), made_of)
    sizes = np.nan_to_num(np.fmax(np.abs(stated), np.abs(central))).max(axis=0, initial=0.0)
    unsure = np.abs(ahead - behind) + _ROUNDING * largest / step  # at a kink they differ
    off = np.abs(stated - central) - _OFF * sizes - unsure
    off = np.where(np.isfinite(off), off, 0.0)
    if (off > 0.0).any():
        row, k = np.unravel_index(np.argmax(off), off.shape)
        raise ArgumentError(
            f"{what}: {by}: in row {rows[row]} it states {stated[row, k]:.4g} of"
            f" {list(components)[k]}, and central differences of the values are"
            f" {central[row, k]:.4g}: the derivative is wrong, or the values are"
        )
