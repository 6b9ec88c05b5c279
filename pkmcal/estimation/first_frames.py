"""Start of the search for unknown frames, points and what is carried: see `alignment`, `hand_eye`.

Points in known frames follow from the poses. Then frame by frame; what several frames have in
common is placed with the first of them. Frames in which points were read come first, then what the
platform carries, with its frame where that is not laid yet.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.core import instruments
from pkmcal.core.poses import compose, invert
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.prediction import Prediction
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.alignment import Sighting
from pkmcal.readings.hand_eye import of_frame_and_tool, of_tool
from pkmcal.readings.predicted import require_shape

Rows = dict[int, IntArray]  # of a frame, in each set


def aligned(
    prediction: Prediction, evaluation: Evaluation, own: BoolArray | None = None
) -> tuple[Parameters, FloatArray]:
    """Parameters whose frames lie nearest to the readings, and their values (n,).

    Parameters
    ----------
    prediction : Prediction
        What was read, and should be.
    evaluation : Evaluation
        Where the machine is with the present parameters.
    own : ndarray of bool (n,), optional
        Which parameters may be changed; by default all that are not known but for an uncertainty.
    """
    parameters, theta = prediction.parameters, evaluation.theta.copy()
    free = ~parameters.uncertain if own is None else own & ~parameters.uncertain
    frames, things = prediction.frames, prediction.carried_things
    _with_known_frame(prediction, evaluation, theta, free)
    by_points = [
        first
        for first, rows in frames.items()
        if any(_gives_points(prediction.table.sets[i]) for i in rows)
    ]
    for first in dict.fromkeys([*by_points, *things, *frames]):
        if not free[first]:
            continue
        if first in things:
            laid = _with_carried(prediction, evaluation, first, parameters, theta, free)
        else:
            laid = {first: _aligned(prediction, evaluation, frames[first], parameters, theta, free)}
        for each, motion in laid.items():
            parameters, theta = parameters.aligned(theta, each, motion)
            free[each : each + 6] = False
    return parameters, theta


def _gives_points(measured: Measurements) -> bool:
    """Return whether x, y and z of points were read, without an orientation."""
    return measured.instrument.is_place and measured.instrument.turning is None


def _with_known_frame(
    prediction: Prediction, evaluation: Evaluation, theta: FloatArray, free: BoolArray
) -> None:
    """Place targets that are free and were read in a known frame: they are then not free.

    At the medians, which a few rows that are solved in another assembly mode do not move.
    """
    framed = {i for rows in prediction.frames.values() for i in rows}
    seen = [i for i, m in enumerate(prediction.table.sets) if _gives_points(m) and i not in framed]
    every = {i: np.arange(len(prediction.table.sets[i])) for i in seen}
    columns = {i: _free_targets(prediction, i, rows, free)[:, 0] for i, rows in every.items()}
    for first in np.unique(np.concatenate([np.empty(0, np.intp), *columns.values()])).tolist():
        if first < 0:
            continue
        shifts = []
        for i, rows in every.items():
            mine = rows[columns[i] == first]
            places, turn = _points(prediction, evaluation, i, mine, theta)
            off = prediction.table.sets[i].values[mine] - places
            shifts.append((turn.transpose(0, 2, 1) @ off[:, :, None])[:, :, 0])
        read = np.concatenate(shifts)
        read = read[np.isfinite(read).all(axis=1)]
        if len(read):
            _shift(prediction, theta, free, first, np.median(read, axis=0))


def _shift(
    prediction: Prediction, theta: FloatArray, free: BoolArray, first: int, shift: FloatArray
) -> None:
    """Move a target within its bounds; it is then not free."""
    mine, (lower, upper) = slice(first, first + 3), prediction.parameters.bounds
    theta[mine] = np.clip(theta[mine] + shift, lower[mine], upper[mine])
    free[mine] = False


def _with_carried(
    prediction: Prediction,
    evaluation: Evaluation,
    thing: int,
    parameters: Parameters,
    theta: FloatArray,
    free: BoolArray,
) -> dict[int, FloatArray]:
    """A carried pose (6,) by its first parameter, and the frame of its readings if free."""
    groups: dict[int | None, list[tuple[int, IntArray]]] = {}
    for i, rows in prediction.carried_things[thing].items():
        framed = {f: own[i] for f, own in prediction.frames.items() if i in own}
        if not framed:
            groups.setdefault(None, []).append((i, rows))
        for f, own in framed.items():
            if len(some := np.intersect1d(rows, own)):
                groups.setdefault(f, []).append((i, some))
    known = [each for each in groups if each is None or not free[each]]
    frame = (known or list(groups))[0]
    parts = []
    for i, rows in groups[frame]:
        at = evaluation.pose[prediction.table.pose_of[i]]
        parts.append((_places_seen(prediction.table.sets[i], at, rows), at[rows]))
    values, pose = (np.concatenate(each) for each in zip(*parts, strict=True))
    if frame is None:
        return {thing: of_tool(values, pose)}
    if free[frame]:
        base, carried = of_frame_and_tool(values, pose)
        return {frame: base, thing: carried}
    base = _motion(parameters, theta, frame)
    return {thing: of_tool(compose(invert(base), np.ascontiguousarray(values)), pose)}


def _motion(parameters: Parameters, theta: FloatArray, first: int) -> FloatArray:
    """A frame or carried pose (6,) by its first parameter."""
    near = np.ascontiguousarray(theta[None, first : first + 6])
    motion: FloatArray = compose(parameters.origin[first], near)[0]
    return motion


def _seen(
    prediction: Prediction,
    evaluation: Evaluation,
    i: int,
    rows: IntArray,
    parameters: Parameters,
    theta: FloatArray,
) -> FloatArray:
    """Return readings of set `i` in the base frame, (N, k), with carried poses that are aligned."""
    columns = prediction.carried_columns(i)
    if columns is None:
        return prediction.values(evaluation)[i][rows]
    pose = evaluation.pose[prediction.table.pose_of[i][rows]]
    for first in np.unique(columns[rows, 0]).tolist():
        mine = columns[rows, 0] == first
        pose[mine] = compose(pose[mine], _motion(parameters, theta, first))
    return pose


def _read(prediction: Prediction, evaluation: Evaluation, i: int, rows: IntArray) -> FloatArray:
    """Values (N, k) of rows of set `i`; of readings of something carried its pose."""
    m = prediction.table.sets[i]
    if prediction.carried_columns(i) is None:
        return m.values[rows]
    return _places_seen(m, evaluation.pose[prediction.table.pose_of[i]], rows)


def _places_seen(m: Measurements, at: FloatArray, rows: IntArray) -> FloatArray:
    """Places by some rows alone, for others may be of another session; by all if they are few."""
    mine = m.select(rows)
    try:
        seen: FloatArray = mine.instrument.places_seen(mine, at[rows])
    except ArgumentError:
        if len(mine) == len(m):
            raise
        seen = m.instrument.places_seen(m, at)[rows]
    return seen


def _aligned(
    prediction: Prediction,
    evaluation: Evaluation,
    rows: Rows,
    parameters: Parameters,
    theta: FloatArray,
    free: BoolArray,
) -> FloatArray:
    """The frame (6,) nearest to the readings; targets that are free are moved and then not free."""
    of_sets = {i: prediction.table.sets[i].instrument for i in rows}
    instrument = min(of_sets.values(), key=lambda each: each.frame_order)
    mine = [i for i, each in of_sets.items() if each.name == instrument.name]
    columns = [_free_targets(prediction, i, rows[i], free) for i in mine]
    parts = [_points(prediction, evaluation, i, rows[i], theta) for i in mine]
    places, turns = (np.concatenate(each) for each in zip(*parts, strict=True))
    laid = instrument.frame(
        Sighting(
            values=np.concatenate([_read(prediction, evaluation, i, rows[i]) for i in mine]),
            predicted=np.concatenate(
                [_seen(prediction, evaluation, i, rows[i], parameters, theta) for i in mine]
            ),
            point=places,
            turn=turns,
            target=np.concatenate(columns)[:, 0],
        )
    )
    what = f"kind: frame of the class {type(instrument).__name__}"
    if len(laid) != 2 or not isinstance(laid[1], Mapping):
        raise ArgumentError(f"{what} must return a frame and a mapping of shifts; found {laid}")
    frame, shifts = laid
    require_shape(f"{what}: the frame", frame, (6,))
    for first, shift in shifts.items():
        _shift(prediction, theta, free, first, shift)
    return frame


def _free_targets(prediction: Prediction, i: int, rows: IntArray, free: BoolArray) -> IntArray:
    """Parameters (N, 3) of the target of each row of set `i`; -1 where it is not free."""
    columns = prediction.columns[i].get(_point(prediction, i))
    if columns is None:
        return np.full((len(rows), 3), -1)
    mine = columns[rows]
    return np.where(free[mine], mine, -1)


def _point(prediction: Prediction, i: int) -> str:
    """The argument of set `i` that is the point of the platform that was read; "" of others."""
    return next(iter(prediction.points[i]), "")


def _points(
    prediction: Prediction, evaluation: Evaluation, i: int, rows: IntArray, theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return targets of set `i` in the base frame (N, 3), and their orientations.

    Of readings without targets, the platform.
    """
    pose = evaluation.pose[prediction.table.pose_of[i][rows]]
    target = prediction.arguments_of(i, theta).get(_point(prediction, i))
    own = np.zeros((len(rows), 3)) if target is None else np.ascontiguousarray(target[rows])
    places, _, turn = instruments.points(pose, own)
    return places, turn
