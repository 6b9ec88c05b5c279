"""Columns beside the design of a fit: what something that it holds would do to the readings."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.fitted.fit import Fit
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.score_test import Columns

_TOGETHER = 4096  # rows


def of_rows(fit: Fit, change: Callable[[int, slice, Predicted], FloatArray]) -> Columns:
    """Whitened columns of changes of what is read.

    Parameters
    ----------
    fit : Fit
        The fit.
    change : callable (set, rows, predicted) -> ndarray (b, k, d)
        How what is read in some rows of a set follows the numbers, given what is predicted of it.
    """
    sure = fit.uncertainty

    def made() -> Iterator[tuple[slice, FloatArray]]:
        whitening, equations = sure.equations.whitening, slice(0, 0)
        for i, seen in enumerate(fit.equations.prediction.predicted(fit.end)):
            for rows in lots(len(seen.values), _TOGETHER):
                part = np.array(change(i, rows, seen))
                whole = whitening.whiten_rows(part, i, rows, sure.factors)
                equations = slice(equations.stop, equations.stop + len(whole))
                yield equations, whole

    return made


def of_poses(fit: Fit, twists: Callable[[IntArray], FloatArray]) -> Columns:
    """Whitened columns of a platform that moves by the twists (b, 6, d) of some poses (b,)."""
    table = fit.equations.table

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        found = seen.by_twist[rows] @ twists(table.pose_of[i][rows])
        other = table.other_of[i]
        if seen.by_other is not None and other is not None:
            found = found + seen.by_other[rows] @ twists(other[rows])
        return found

    return of_rows(fit, change)
