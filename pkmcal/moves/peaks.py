"""Extremes of a quantity along a move, between the samples too.

Own code, since optimisers of one variable look for one extremum in a bracket, and here every peak
of every actuator must be found before it can be bracketed. By the mean value theorem a speed
between two times is at least the mean there, what the position changes by over the time it takes;
an acceleration likewise from the speeds. Where that is more than any sample shows, a peak hides
between two samples and the step is halved. Then every local maximum is closed in on. What a
position or a speed changes by is known to its rounding alone, and over ever shorter steps that is
any mean: it is taken off, and the halvings end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from pkmcal.arrays import FloatArray

STEPS = 2000  # along a move
_HALVINGS = 20  # of a step: to 5e-10 of the duration
_PLACES = 2000  # that are halved at once, those of the largest means
_CUTS = 64  # of two steps around a local maximum, in the golden section: to 4e-14 of them
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
_RISE = 4.0  # times what a size rises by in a step: no peak between samples is higher
_HIDDEN = 1e-9  # relative: by so much a mean must exceed all samples
_ROUNDING = 1e-11  # of the largest position or speed: what a completed pose leaves open of it


class Sample(Protocol):
    """A machine at times of a move; `MoveSample` describes each."""

    @property
    def actuators(self) -> FloatArray:
        """Actuator coordinates (N, n)."""

    @property
    def velocities(self) -> FloatArray:
        """Return speeds of the actuators, (N, n)."""

    @property
    def accelerations(self) -> FloatArray:
        """Return accelerations of the actuators, (N, n)."""


def peaks(sample: Callable[[FloatArray], Sample], duration: float) -> tuple[FloatArray, FloatArray]:
    """Largest speed and acceleration (n,) of each actuator on the way; NaN where one is not finite.

    What can be missed between two of 2001 samples changes the position (of a speed), or the speed
    (of an acceleration), there by less than the largest sample of it would in a step, or by less
    than 1e-11 of the largest position or speed, or is shorter than 5e-10 of the duration.
    """
    times = np.linspace(0.0, duration, STEPS + 1)
    at = sample(times)
    q, v, a = at.actuators, at.velocities, at.accelerations
    for _ in range(_HALVINGS):
        steps = np.diff(times)
        hidden = np.maximum(_hides(q, v, steps), _hides(v, a, steps))
        places = np.flatnonzero(hidden > 1 + _HIDDEN)
        if not places.size:
            break
        if places.size > _PLACES:
            places = np.sort(places[np.argsort(-hidden[places], kind="stable")[:_PLACES]])
        middle = 0.5 * (times[places] + times[places + 1])
        more = sample(middle)
        q, v, a = (
            np.insert(old, places + 1, new, axis=0)
            for old, new in ((q, more.actuators), (v, more.velocities), (a, more.accelerations))
        )
        times = np.insert(times, places + 1, middle)

    def sizes(t: FloatArray) -> FloatArray:
        at = sample(t)
        return np.abs(np.hstack([at.velocities, at.accelerations]))

    speed, acceleration = np.split(largest(sizes, times, np.abs(np.hstack([v, a]))), 2)
    return speed, acceleration


def _hides(values: FloatArray, rates: FloatArray, steps: FloatArray) -> FloatArray:
    """Mean rate in each step (N - 1,), by the largest sampled: above 1 where a larger one hides."""
    change = np.abs(np.diff(values, axis=0)) - _ROUNDING * np.abs(values).max(axis=0)
    mean, most = change / steps[:, None], np.abs(rates).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: FloatArray = np.where(mean > 0.0, mean / most, 0.0).max(axis=1)
    return found


def largest(
    function: Callable[[FloatArray], FloatArray], times: FloatArray, values: FloatArray
) -> FloatArray:
    """The largest of each column of a function of time, (k,).

    Parameters
    ----------
    function : callable
        Times (N,) to values (N, k).
    times : ndarray (N,)
        Increasing.
    values : ndarray (N, k)
        Of the function, there.

    Returns
    -------
    ndarray (k,)
        NaN where a value is NaN. Between samples a maximum is found that rises above them by no
        more than four times the change to its neighbours.
    """
    most = values.max(axis=0)
    before, here, after = values[:-2], values[1:-1], values[2:]
    with np.errstate(invalid="ignore"):
        rise = np.maximum(here - before, here - after)
        top = (here >= before) & (here >= after) & (here + _RISE * rise > most)
    rows, columns = np.nonzero(top)
    if not len(rows):
        return np.asarray(most)
    own = np.arange(len(rows)), columns
    low, high = times[rows], times[rows + 2]
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    first, second = function(left)[own], function(right)[own]
    for _ in range(_CUTS):
        np.maximum.at(most, columns, np.maximum(first, second))
        rises = first < second
        low, high = np.where(rises, left, low), np.where(rises, high, right)
        way = _GOLDEN * (high - low)
        new = np.where(rises, low + way, high - way)
        found = function(new)[own]
        left, right = np.where(rises, right, new), np.where(rises, new, left)
        first, second = np.where(rises, second, found), np.where(rises, found, first)
    np.maximum.at(most, columns, np.maximum(first, second))
    return np.asarray(most)
