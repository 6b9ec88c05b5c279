"""A row of the comparison, and how each tool is scored: the same rows left out, one clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pkmcal.arrays import FloatArray, IntArray

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"  # measurements that are not the project's, beside it
FOLDS = 4
Stated = tuple[FloatArray, FloatArray]  # numbers, and half widths of their 95 % intervals


@dataclass(frozen=True)
class Scored:
    """What one tool does with one set of measurements.

    Attributes
    ----------
    data, tool, unit : str
    held_out : float
        Root mean square error at rows that were left out in turn, in `unit`.
    seconds : float
        Processor time of one fit, the median of all.
    intervals : tuple of int, or None
        How many numbers lie in their 95 % intervals, of how many: of the true numbers where those
        are known, else of the difference between fits of two halves of the rows. None where the
        tool states no intervals.
    says : str
        What the tool says of its fit of all rows, where it judges it.
    """

    data: str
    tool: str
    held_out: float
    unit: str
    seconds: float
    intervals: tuple[int, int] | None = None
    says: str = ""


def folds(groups: IntArray, seed: int = 0) -> Iterator[IntArray]:
    """Yield masks of rows to leave out: a quarter of the groups each, drawn at random."""
    names = np.unique(groups)
    place = np.random.default_rng(seed).permutation(len(names)) % FOLDS
    for k in range(FOLDS):
        yield np.isin(groups, names[place == k])


def halves(groups: IntArray, seed: int = 1) -> IntArray:
    """Return a mask of rows: half of the groups, drawn at random."""
    names = np.unique(groups)
    return np.isin(groups, np.random.default_rng(seed).permutation(names)[: len(names) // 2])


def agreeing(first: Stated, second: Stated) -> tuple[int, int]:
    """Count numbers of two independent fits that differ by less than both intervals allow."""
    (values, half), (others, other_half) = first, second
    known = np.isfinite(half) & np.isfinite(other_half)
    near = np.abs(values - others)[known] <= np.hypot(half, other_half)[known]
    return int(near.sum()), int(known.sum())


def scored(
    data: str,
    tool: str,
    unit: str,
    groups: IntArray,
    errors: Callable[[IntArray], tuple[float, FloatArray]],
    intervals: tuple[int, int] | None = None,
    says: str = "",
) -> Scored:
    """Score a tool; `errors` of a mask gives seconds of the fit and errors of the rows left out."""
    seconds, off = [], []
    for left_out in folds(groups):
        spent, error = errors(left_out)
        seconds.append(spent)
        off.append(error)
    rms = float(np.sqrt(np.mean(np.concatenate(off) ** 2)))
    return Scored(data, tool, rms, unit, float(np.median(seconds)), intervals, says)


class Clock:
    """Processor time between `with` and its end."""

    def __enter__(self) -> Clock:
        self._start = time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.seconds = time.process_time() - self._start
