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
from pkmcal.exceptions import ArgumentError
from pkmcal.readings import orientation
from pkmcal.readings.predicted import At, of_the_package, require_arguments
from pkmcal.readings.reading import Reading
from pkmcal.readings.unknowns import Dependence

_LENGTH, _TURN = 1e-3, 1e-5  # mm and rad: changes of which differences are taken
_OFF = 1e-3  # of the largest derivative by a number: what is off by more is wrong
_ROUNDING = 1e-13  # of the largest value
_ORDER = 1e-9  # of the largest value: by which a prediction may follow the order of the rows
_TWIST = ("omega x", "omega y", "omega z", "v x", "v y", "v z")
_PLACE = ("x", "y", "z", "alpha", "beta", "gamma")

Values = Callable[[float], FloatArray]  # (N, k), where one number has changed by so much
Difference = Callable[[FloatArray, FloatArray], FloatArray]


def require_true(prediction: Prediction, evaluation: Evaluation) -> None:
    """Compare derivatives with differences, and rows with the same rows in another order.

    Raises
    ------
    ValueError
        A derivative that is not that of the values; rows whose prediction depends on their order.
    """
    for i, data in enumerate(prediction.datasets):
        reading, steps = data.measured.instrument, _steps(data.dependences())
        effects = [
            of_rows
            for effect, of_rows in zip(data.effects, prediction.effects[i], strict=True)
            if not of_the_package(effect)
        ]
        own = bool(reading.components) and not of_the_package(reading)
        if own:
            _compare_reading(prediction, i, evaluation, steps)
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
        named = {name: own for name, own in numbers.items() if name != "tool_origin"}
        require_arguments(reading, at, named, "dependences")
        seen = reading.predict(at, **numbers)
        for k, step in enumerate(of_twist):
            by = f"by_twist, by {_TWIST[k]}"
            compare(
                seen.by_twist[:, :, k], _turned(reading, at, numbers, "pose", k), step, by, rows
            )
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
        moved = partial(effect.moved, machine, evaluation.pose[at], table.actuators[at], rows)
        seen = moved(numbers)
        for name in seen.by.keys() & prediction.numbers[i].keys():
            for k in np.flatnonzero(steps[name]).tolist():
                names = what, _TWIST, f"by[{name!r}], by number {k}"
                twists = partial(_twists, moved, numbers, name, k)
                stated, step = seen.by[name][:, :, k], float(steps[name][k])
                _compare(stated, twists, step, np.subtract, names, rows)


def _twists(
    moved: Callable[[Mapping[str, FloatArray]], Moved],
    numbers: Mapping[str, FloatArray],
    name: str,
    k: int,
    change: float,
) -> FloatArray:
    """The twists where one number of an argument has changed in all rows."""
    return moved(_with(numbers, name, k, change)).twist


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
            every = (data.measured.instrument, *data.effects)
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
) -> None:
    """Refuse a derivative (N, k) that differences to both sides contradict alike."""
    here = values(0.0)
    ahead = difference(values(step), here) / step
    behind = difference(here, values(-step)) / step
    central = (ahead + behind) / 2
    largest = np.abs(here).max(axis=0, initial=0.0)
    sizes = np.nan_to_num(np.fmax(np.abs(stated), np.abs(central))).max(axis=0, initial=0.0)
    unsure = np.abs(ahead - behind) + _ROUNDING * largest / step  # at a kink they differ
    off = np.abs(stated - central) - _OFF * sizes - unsure
    off = np.where(np.isfinite(off), off, 0.0)
    if (off > 0.0).any():
        row, k = np.unravel_index(np.argmax(off), off.shape)
        what, components, by = names
        raise ArgumentError(
            f"{what}: {by}: in row {rows[row]} it states {stated[row, k]:.4g} of"
            f" {list(components)[k]}, and central differences of the values are"
            f" {central[row, k]:.4g}: the derivative is wrong, or the values are"
        )
