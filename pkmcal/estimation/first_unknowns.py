"""All that readings depend on, fitted together at the poses of the machine before its calibration.

Frames, targets, artefacts and mountings that are found one after the other, each in closed form,
are not what fits best together: a tip and the sockets that it touches, both ends of a wire. Here
they are fitted together, by Gauss-Newton steps at poses that are held. The misfit that remains is
that of the machine alone: what a calibration calls the misfit before it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.prediction import Prediction
from pkmcal.estimation.sessions import NONE
from pkmcal.readings.alignment import inverse_above
from pkmcal.readings.dependences import yielded
from pkmcal.readings.predicted import Predicted

_GROSS = 6.0  # times the median misfit of its set, beyond which a row counts by its length alone
_GAIN = 0.05  # share of the squares; unknowns that would lower them by less stay where they are
_LEAST = 1e-6  # mm by 1 mm, rms: what readings show less of an unknown leaves it where it is
_ROUNDS = 50  # of linear steps
_HALVED = 6  # times that a step is halved which does not lower the cost

Misfits = list[FloatArray]  # of each set, (N, k), mm


def fitted_together(
    prediction: Prediction,
    evaluation: Evaluation,
    mm: Sequence[FloatArray],
    own: BoolArray | None = None,
) -> FloatArray:
    """Return the parameters (n,) with all that readings depend on where it fits best.

    Where little would be gained, those of `evaluation`: the same array.

    Parameters
    ----------
    prediction : Prediction
        What was read, and should be.
    evaluation : Evaluation
        Where the machine is, which is held, and where the unknowns are so far.
    mm : sequence of ndarray (N, k)
        One unit of each component of each row of each set in mm, in which misfits are said.
    own : ndarray of bool (n,), optional
        Which parameters may be changed; by default all that are not known but for an uncertainty.
    """
    theta, columns = evaluation.theta, _unknowns(prediction, own)
    if not len(columns):
        return theta
    scale = prediction.parameters.scale[columns]
    lower, upper = (end[columns] for end in prediction.parameters.bounds)
    predicted = prediction.predicted(evaluation)
    off = _misfits(prediction, predicted, mm)
    floor = _LEAST * np.sqrt(sum(map(len, off)))
    for _ in range(_ROUNDS):
        limits = _limits(off)
        weights = _weights(off, limits)
        residual = weights * np.concatenate([each.ravel() for each in off])
        lever = _by_unknowns(prediction, predicted, mm, columns)
        lever *= weights[:, None] * scale
        step = inverse_above(lever, floor) @ residual
        squares, least = (float(each @ each) for each in (residual, residual - lever @ step))
        if not least < (1.0 - _GAIN) * squares:
            break
        cost = _cost(off, limits)
        for _ in range(_HALVED):
            trial = theta.copy()
            trial[columns] = np.clip(theta[columns] + scale * step, lower, upper)
            there = prediction.at(evaluation.pose, trial)
            off = _misfits(prediction, there, mm)
            if _cost(off, limits) < cost:
                break
            step = 0.5 * step
        else:
            break
        theta, predicted = trial, there
    return theta


def _unknowns(prediction: Prediction, own: BoolArray | None) -> IntArray:
    """Parameters that readings depend on, and of which nothing is stated."""
    chosen = prediction.parameters
    found = np.zeros(len(chosen), dtype=bool)
    for first in prediction.frames:
        found[first : first + 6] = True
    for i in range(len(prediction.datasets)):
        for columns in _of_readings(prediction, i).values():
            found[columns[columns != NONE]] = True
    found &= ~chosen.uncertain & ~np.isfinite(chosen.prior)
    return np.flatnonzero(found if own is None else found & own)


def _of_readings(prediction: Prediction, i: int) -> dict[str, IntArray]:
    """Parameters (N, w) of the arguments of the readings of set `i`, without those of effects."""
    data = prediction.datasets[i]
    beside = {each.argument for effect in data.effects for each in yielded(effect, data.measured)}
    return {name: own for name, own in prediction.columns[i].items() if name not in beside}


def _misfits(
    prediction: Prediction, predicted: Sequence[Predicted], mm: Sequence[FloatArray]
) -> Misfits:
    """Measured less predicted of each set (N, k), mm; 0 where nothing was read or reached."""
    residuals = prediction.residuals(predicted)
    return [
        np.where(np.isfinite(residual), residual, 0.0) * each
        for residual, each in zip(residuals, mm, strict=True)
    ]


def _limits(off: Misfits) -> list[float]:
    """Return the length from which a row of each set is gross, mm."""
    found = []
    for each in off:
        lengths = np.linalg.norm(each, axis=1)
        some = lengths[lengths > 0.0]
        found.append(_GROSS * float(np.median(some)) if len(some) else np.inf)
    return found


def _weights(off: Misfits, limits: Sequence[float]) -> FloatArray:
    """Factor on each number (M,), with which squares of gross rows grow by their length alone."""
    found = [np.empty(0)]
    for each, limit in zip(off, limits, strict=True):
        lengths = np.maximum(np.linalg.norm(each, axis=1), max(limit, np.finfo(float).tiny))
        found.append(np.repeat(np.sqrt(limit / lengths), each.shape[1]))
    return np.concatenate(found)


def _cost(off: Misfits, limits: Sequence[float]) -> float:
    """Squares, mm², but of gross rows what has their slope at the limit and grows by the length."""
    total = 0.0
    for each, limit in zip(off, limits, strict=True):
        lengths = np.linalg.norm(each, axis=1)
        near = np.minimum(lengths, limit)
        total += float((near * (2.0 * lengths - near)).sum())
    return total


def _by_unknowns(
    prediction: Prediction,
    predicted: Sequence[Predicted],
    mm: Sequence[FloatArray],
    columns: IntArray,
) -> FloatArray:
    """Derivative (M, u) of what is predicted by the unknowns, mm; 0 where nothing was read."""
    place = np.full(len(prediction.parameters) + 1, NONE)  # one beyond them, for `NONE`
    place[columns] = np.arange(len(columns))
    found = [np.empty((0, len(columns)))]
    for i, (seen, each) in enumerate(zip(predicted, mm, strict=True)):
        residual = prediction.residual(i, seen)
        part = np.zeros((*residual.shape, len(columns)))
        for first, of_sets in prediction.frames.items():
            if i in of_sets and seen.by_frame is not None:
                own = np.broadcast_to(first + np.arange(6), (len(of_sets[i]), 6))
                _add(part, of_sets[i], place[own], seen.by_frame[of_sets[i]])
        for name, own in _of_readings(prediction, i).items():
            _add(part, np.arange(len(part)), place[own], seen.by[name])
        part = prediction.table.sets[i].instrument.by_difference(part, residual)
        part *= np.broadcast_to(each, residual.shape)[:, :, None]
        part[~np.isfinite(residual)] = 0.0
        found.append(part.reshape(-1, len(columns)))
    return np.concatenate(found)


def _add(part: FloatArray, rows: IntArray, at: IntArray, by: FloatArray) -> None:
    """Add a derivative (n, k, w) of rows (n,) to that by the unknowns, which `at` (n, w) are."""
    row, slot = np.nonzero(at != NONE)
    part[rows[row], :, at[row, slot]] += by[row, :, slot]
