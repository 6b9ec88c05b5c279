"""The step of which readings are multiples: what a dial, a display or a file shows of them.

A reading that was rounded to steps s is off by up to s/2. Where readings go through many steps
these errors are as good as independent, with the standard deviation s/√12 (W. R. Bennett, Spectra
of quantized signals, Bell System Technical Journal 27 (1948) 446-472), and no noise estimated from
them is less.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray

LEAST_ROWS = 5  # readings that show a step
_EXACT = 1e-6  # of a step, by which multiples of it may be off
_ROUNDING = 8.0 * np.finfo(float).eps  # of the largest value
_SURE = 1e-3  # of a step, above which rounding errors hide whether a value is a multiple of it
_FIRST = 16  # differences that are tried first
_PARTS = 6  # into which the smallest difference is divided
_DECIMALS = np.array([factor * 10.0**power for power in range(3, -10, -1) for factor in (5, 2, 1)])
_UNITS = {"mm": (1.0, 25.4), "rad": (1.0, np.pi / 180.0)}  # inches and degrees beside mm and rad


def deviation(step: float) -> float:
    """Standard deviation of what is rounded to a step."""
    return step / float(np.sqrt(12.0))


def step_of(values: FloatArray, unit: str, least: float = 0.0) -> float:
    """The largest step of which all differences of readings (N,) are multiples; 0 without one.

    Parameters
    ----------
    values : ndarray (N,)
        Readings of one component; NaN where nothing was read.
    unit : str
        Theirs; of lengths steps in inches are tried as well, of angles those in degrees.
    least : float
        Smaller steps are not looked for.

    Examples
    --------
    >>> step_of(np.array([0.3, 0.1, 0.5, 0.2, 0.9]), "mm")
    0.1
    >>> step_of(np.array([0.3, 0.1, 0.5, 0.2, 0.9]) + 1e-3 * np.sqrt(np.arange(5)), "mm")
    0.0
    """
    read = values[np.isfinite(values)]
    if len(read) < LEAST_ROWS:
        return 0.0
    rounding = _ROUNDING * float(np.abs(read).max())
    differences = np.sort(np.abs(read - read[0]))
    differences = differences[differences > rounding]
    if not len(differences):
        return 0.0
    steps = _candidates(differences, unit, max(least, rounding / _SURE))
    sample = differences[:: -(-len(differences) // _FIRST)]
    for step in steps[_multiples(sample, steps[:, None], rounding)].tolist():
        if _multiples(differences, step, rounding):
            return float(step)
    return 0.0


def smallest_gaps(values: FloatArray) -> FloatArray:
    """The smallest difference of two readings (N, k) of each component that is no rounding, (k,).

    A step is no larger, but for rounding; inf where nothing was read in some row.

    Examples
    --------
    >>> smallest_gaps(np.array([[0.3, 1.0], [0.1, 1.0], [0.4, 1.5], [0.9, 1.0]])).round(9)
    array([0.1, 0.5])
    """
    ordered = np.sort(values, axis=0)
    gaps = ordered[1:] - ordered[:-1]
    largest = np.maximum(np.abs(ordered[0]), np.abs(ordered[-1]))
    rounding = 2.0 * np.maximum(_EXACT * (ordered[-1] - ordered[0]), _ROUNDING * largest)
    found: FloatArray = np.where(gaps > rounding, gaps, np.inf).min(axis=0, initial=np.inf)
    return found


def _candidates(differences: FloatArray, unit: str, least: float) -> FloatArray:
    """Steps that may be, the largest first."""
    gaps = differences[1:] - differences[:-1]
    smallest = float(gaps[gaps > _EXACT * differences[-1]].min(initial=differences[0]))
    if smallest * (1.0 + _EXACT) < least:
        return np.empty(0)
    steps = np.concatenate([_decimals(unit), smallest / np.arange(1, _PARTS + 1)])
    possible = (steps >= least) & (steps <= smallest * (1.0 + _EXACT))
    found: FloatArray = np.sort(steps[possible])[::-1]
    return found


@cache
def _decimals(unit: str) -> FloatArray:
    """Steps that dials, displays and files of a unit have."""
    return np.concatenate([_DECIMALS * size for size in _UNITS.get(unit, (1.0,))])


def _multiples(
    differences: FloatArray, step: FloatArray | float, rounding: float
) -> BoolArray | np.bool_:
    """Return whether all differences (N,) are multiples of a step, or of each of several (s, 1)."""
    counts = np.round(differences / step)
    off = np.abs(differences - counts * step)
    return (off <= np.maximum(_EXACT * step, rounding)).all(axis=-1)
