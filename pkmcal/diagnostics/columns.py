"""Columns beside the design of a fit: what something that it holds would do to the readings.

Where poses have unknowns the equations are what is left of closures and readings when the poses
have taken their part: so are the columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.fitted.fit import Fit
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.score_test import Columns, columns_of

_TOGETHER = 4096  # rows

Change = Callable[[int, slice, Predicted], FloatArray]  # as `of_rows` takes it


def of_rows(fit: Fit, change: Change) -> Columns:
    """Whitened columns of changes of what is read.

    Parameters
    ----------
    fit : Fit
        The fit.
    change : callable (set, rows, predicted) -> ndarray (b, k, d)
        How what is read in some rows of a set follows the numbers, given the prediction of these.
    """
    sure = fit.uncertainty

    def made() -> Iterator[tuple[slice, FloatArray]]:
        system, equations = sure.equations.system, slice(0, 0)
        if system is not None:
            whole = np.concatenate([*_whitened(fit, change)])
            reduced = system.reduced(fit.estimate.evaluation, sure.factors, None, whole)
            yield slice(0, len(reduced)), reduced
            return
        for whole in _whitened(fit, change):
            equations = slice(equations.stop, equations.stop + len(whole))
            yield equations, whole

    return made


def _whitened(fit: Fit, change: Change) -> Iterator[FloatArray]:
    """The changes of all readings, whitened, lot by lot."""
    equations, factors = fit.uncertainty.equations, fit.uncertainty.factors
    for i in range(len(equations.table.sets)):
        for rows, seen in equations.prediction.lots_of(i, fit.estimate.evaluation, _TOGETHER):
            part = np.array(change(i, rows, seen))
            yield equations.whitening.whiten_rows(part, i, rows, factors)


def of_actuators(fit: Fit, lengths: Callable[[IntArray], FloatArray]) -> Columns | None:
    """Whitened columns of actuators that are longer by `lengths` (b, n, d) at poses (b,).

    None where poses have unknowns and not every actuator has an offset by name.
    """
    sure, end = fit.uncertainty, fit.estimate.evaluation
    system = sure.equations.system
    if system is None:

        def twists(poses: IntArray) -> FloatArray:
            return end.machines.actuator_twists(end.states, poses) @ lengths(poses)

        return of_poses(fit, twists)
    names, count = end.robot.geometry.names, end.actuators.shape[1]
    offsets = [f"offset{i}" for i in range(1, count + 1)]
    if not set(offsets) <= set(names):
        return None
    places = np.array([names.index(name) for name in offsets], dtype=np.intp)
    own = np.tile(np.arange(count), (len(end.machines.robots), 1))
    closures = end.machines.by_numbers(end.states, places, own, count)
    poses = np.arange(len(closures))
    by_offset = np.zeros((len(poses), 6, count))  # of machines whose unknowns are the actuators
    for mine, found in end.machines.twists_by_numbers(end.states, places, poses):
        by_offset[mine] = found
    read = _whitened(fit, _moved(fit, lambda some: by_offset[some] @ lengths(some)))
    readings = [*read] if sure.equations.whitening.any_read else []
    longer = closures @ lengths(poses)
    return columns_of(
        system.reduced(end, sure.factors, longer, np.concatenate(readings) if readings else None)
    )


def of_poses(fit: Fit, twists: Callable[[IntArray], FloatArray]) -> Columns:
    """Whitened columns of a platform that moves by the twists (b, 6, d) of some poses (b,)."""
    return of_rows(fit, _moved(fit, twists))


def _moved(fit: Fit, twists: Callable[[IntArray], FloatArray]) -> Change:
    """Changes of what is read where the platform moves."""
    table = fit.uncertainty.equations.table

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        found = seen.by_twist @ twists(table.pose_of[i][rows])
        other = table.other_of[i]
        if seen.by_other is not None and other is not None:
            found = found + seen.by_other @ twists(other[rows])
        return found

    return change
