"""Derivatives of predicted readings by the parameters of a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, chained, lots
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.prediction import LOT, Prediction
from pkmcal.estimation.sessions import NONE, by_parameters
from pkmcal.readings.predicted import Predicted

_BATCH = 1024  # rows whose derivatives are made at once, as many as caches hold

Part = tuple[int, slice, FloatArray]  # a set, rows of it, and their derivative (b, k, n)
Seen = tuple[slice, Predicted, FloatArray | None]  # rows, readings, and by the geometry directly


def derivatives(
    prediction: Prediction, evaluation: Evaluation
) -> Iterator[tuple[slice, list[Part]]]:
    """Derivatives of the predicted values by the parameters, batch by batch.

    A batch is rows through all sets, and for each set that has some of these its rows and their
    derivative (b, k, n). There is one batch where poses have unknowns.

    Where there are few rows the evaluation has them for the next who asks.
    """
    owner, known = evaluation.cache.pop("derivatives", (None, []))
    if owner is prediction:
        yield slice(0, len(prediction.table.rows)), known
        return
    count, place = len(prediction.table.rows), np.full(len(evaluation.pose), NONE)
    numbers = [prediction.arguments_at(i, evaluation) for i in range(len(prediction.table.sets))]
    at_once = bool(evaluation.machines.unknowns)
    for lot in lots(count, count if at_once else LOT):
        seen = {
            i: (
                rows,
                prediction.some_at(i, rows, evaluation, numbers[i]),
                prediction.by_geometry(i, evaluation, rows),
            )
            for i, rows in _in_sets(prediction, lot)
        }
        last = min(lot.stop, count)
        for batch in lots(last, count if at_once else _BATCH, lot.start):
            found = _of_batch(prediction, batch, seen, evaluation, place)
            if count <= _BATCH:
                again = [(i, rows, part.copy()) for i, rows, part in found]
                evaluation.cache["derivatives"] = prediction, again
            yield batch, found


def _of_batch(
    prediction: Prediction,
    batch: slice,
    seen: Mapping[int, Seen],
    evaluation: Evaluation,
    place: IntArray,
) -> list[Part]:
    """Derivatives of a batch of rows through all sets, of the rows `seen`; `place` is NONE."""
    table, machines, misfits = prediction.table, evaluation.machines, prediction.misfits(evaluation)
    places = [*_in_sets(prediction, batch)]
    some = [_of(seen[i], rows) for i, rows in places]
    wide = table.columns.shape[1]
    parts = [np.zeros((*known.values.shape, wide)) for _, known, _ in some]
    for poses, twists in machines.twists_by_numbers(
        evaluation.states, prediction.parameters.places, _poses_of(prediction, places)
    ):
        place[poses] = np.arange(len(poses))
        for (i, rows), (_, known, _), part in zip(places, some, parts, strict=True):
            other = table.other_of[i]
            _add_motion(part, known.by_twist, twists, place[table.pose_of[i][rows]])
            if known.by_other is not None and other is not None:
                _add_motion(part, known.by_other, twists, place[other[rows]])
        place[poses] = NONE
    found = list[Part]()
    for (i, rows), each, part in zip(places, some, parts, strict=True):
        _add_direct(prediction, part, i, each)
        by = by_parameters(part, table.columns, table.part_of[i][rows], len(prediction.parameters))
        found.append((i, rows, table.sets[i].instrument.by_difference(by, misfits[i][rows])))
    return found


def jacobian(prediction: Prediction, evaluation: Evaluation) -> list[FloatArray]:
    """Derivative of the predicted values of each set to the parameters, (N, k, n).

    With the opposite sign that of the residuals.
    """
    n = len(prediction.parameters)
    found = [np.empty((*each.shape, n)) for each in prediction.misfits(evaluation)]
    for _, parts in derivatives(prediction, evaluation):
        for i, rows, part in parts:
            found[i][rows] = part
    return found


def _add_direct(prediction: Prediction, part: FloatArray, i: int, seen: Seen) -> None:
    """Add how readings follow numbers beside the pose to their derivatives (b, k, m)."""
    rows, predicted, direct = seen
    places, named = prediction.parameters.places, prediction.datasets[i].frame
    if direct is not None:
        part[:, :, : len(places)] += direct
    if predicted.by_frame is not None and named is not None:
        frame = prediction.parameters.nuisance[named]
        part[:, :, frame : frame + 6] = predicted.by_frame
    for name, numbers in prediction.numbers[i].items():
        own = numbers[rows]
        row, slot = np.nonzero(own != NONE)
        part[row, :, own[row, slot]] += predicted.by[name][row, :, slot]


def _in_sets(prediction: Prediction, batch: slice) -> Iterator[tuple[int, slice]]:
    """Rows of each set that has some of these, which count through all sets."""
    first = 0
    for i, place in enumerate(prediction.table.pose_of):
        last = first + len(place)
        if batch.start < last and first < batch.stop:
            yield i, slice(max(batch.start - first, 0), min(batch.stop, last) - first)
        first = last


def _poses_of(prediction: Prediction, places: Sequence[tuple[int, slice]]) -> IntArray:
    """Distinct poses of rows of sets: in the order of the rows, unless some have one."""
    table = prediction.table
    if sum(rows.stop - rows.start for _, rows in places) == len(table.rows):
        return np.arange(len(table.actuators))
    pairs = [((table.pose_of[i], table.other_of[i]), rows) for i, rows in places]
    ends = [end[rows] for both, rows in pairs for end in both if end is not None]
    whole = np.concatenate(ends)
    count, last = np.arange(len(whole)), np.empty(len(table.actuators), dtype=np.intp)
    last[whole] = count
    return whole if np.array_equal(last[whole], count) else np.unique(whole)


def _of(seen: Seen, rows: slice) -> Seen:
    """Return what was seen of some of its rows, which are places in the set."""
    lot, predicted, direct = seen
    if rows == lot:
        return seen
    mine = slice(rows.start - lot.start, rows.stop - lot.start)
    return rows, predicted.some(mine), None if direct is None else direct[mine]


def _add_motion(
    part: FloatArray, by_twist: FloatArray, twists: FloatArray, place: IntArray
) -> None:
    """Add how readings follow the twists (b, 6, g) to their derivatives (N, k, m), g ≤ m.

    `by_twist` is (N, k, 6), `place` (N,) which of the twists moves each row; `NONE`: none of them.
    """
    into = part[:, :, : twists.shape[2]]
    moved = np.flatnonzero(place != NONE)
    if len(moved) == len(place):
        into += chained(by_twist, twists, place)
    else:
        into[moved] += chained(by_twist[moved], twists, place[moved])
