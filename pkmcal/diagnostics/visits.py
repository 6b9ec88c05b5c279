"""In which order the rows were measured, those that are held out among them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, held_once
from pkmcal.estimation.fit_data import FitData
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.linear_fit import numbered


@dataclass(frozen=True, eq=False)
class Visits:
    """The place of each fitted row (N,) in its series: the rows of a set and session.

    Rows at the same actuators, one after the other, are one visit.

    Attributes
    ----------
    series : ndarray of int (N,)
        Which.
    visit, visits : ndarray of int (N,)
        Which visit of it each row is, from 0, and how many it has.
    actuators : ndarray (K, n)
        Where the actuators were, of all rows, fitted and held out.
    before, after : ndarray of int (N,)
        Which of these were at the visit before, and at the next; at the first and at the last they
        are those of the visit itself.
    """

    series: IntArray
    visit: IntArray
    visits: IntArray
    actuators: FloatArray
    before: IntArray
    after: IntArray


def visits_of(found: Solution) -> Visits:
    """Order the fitted rows by time, or as they stand."""
    known = list(_known(found))
    sets = [data for data, _ in known]
    series = numbered(
        np.concatenate([np.full(len(data.rows), like) for data, like in known]),
        np.concatenate([_sessions(data) for data in sets]),
    )
    time = np.concatenate([
        data.rows.astype(float) if data.measured.time is None else data.measured.time
        for data in sets
    ])  # fmt: skip
    row = np.concatenate([data.rows for data in sets])
    every = [data.measured.actuators for data in sets]
    actuators = every[0] if len(every) == 1 else np.concatenate(every)
    order = np.lexsort((row, time, series))
    of = series[order]
    first = np.diff(of, prepend=-1) != 0
    new = first.copy()
    for each in actuators.T:
        q = each[order]
        new[1:] |= q[1:] != q[:-1]
    number = np.cumsum(new) - 1  # of all visits
    begins = np.flatnonzero(new)
    start = number[first][of]  # the first visit of each series
    previous = order[begins[np.maximum(number - 1, start)]]
    count = np.bincount(of[new])[of]
    coming = order[begins[np.minimum(number + 1, start + count - 1)]]
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    fitted = back[: len(found.rows)]
    return Visits(
        held_once(of[fitted]),
        (number - start)[fitted],
        held_once(count[fitted]),
        actuators,
        previous[fitted],
        coming[fitted],
    )


def _known(found: Solution) -> Iterator[tuple[FitData, int]]:
    """The sets that are fitted, then what of the same ones is held out, each with its number."""
    yield from ((data, i) for i, data in enumerate(found.fit.equations.prediction.datasets))
    later = found.holdout_later
    if later is not None and found.holdout_drawn:
        yield from zip(later.data, later.like, strict=True)


def _sessions(data: FitData) -> IntArray:
    names = data.measured.session
    if names is None:
        return np.zeros(len(data.rows), dtype=np.intp)
    return np.unique(names, return_inverse=True)[1].reshape(-1)
