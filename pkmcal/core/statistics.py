"""Moments and quantiles of values that come batch by batch and are not kept.

Mean and spread are combined batch by batch (Chan, Golub, LeVeque 1979), quantiles read from counts
in bins. What comes out depends on the batches and their order alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal._core import lib
from pkmcal.arrays import FloatArray
from pkmcal.core.library import pointer

BINS = 2048
REACH = 8.0  # standard deviations, to either side of the mean, that the bins cover


@dataclass(frozen=True, eq=False)
class Bins:
    """Where the bins of k quantities are; beyond them one more bin on either side.

    Attributes
    ----------
    low, width : ndarray (k,)
        Lower end of the first bin, and the width of all.
    """

    low: FloatArray
    width: FloatArray

    @staticmethod
    def around(values: FloatArray) -> Bins:
        """Bins for values like these (k, n): their mean ± `REACH` standard deviations.

        A quantity that does not vary gets bins of any width: its extremes are kept exactly.
        """
        if not values.shape[1]:
            values = np.zeros((len(values), 1))
        spread = values.std(axis=1)
        spread[spread == 0] = 1.0
        return Bins(values.mean(axis=1) - REACH * spread, 2 * REACH / BINS * spread)


class Stream:
    """What is kept of values (k, n): count, mean, spread, extremes, and counts in bins.

    Parameters
    ----------
    bins : Bins
        For k quantities.
    """

    def __init__(self, bins: Bins) -> None:
        k = len(bins.low)
        self.bins = bins
        self.count = 0
        self.n_failed = 0
        self._mean = np.zeros(k)
        self._squares = np.zeros(k)  # sum of squares about the mean
        self._least, self._most = np.full(k, np.inf), np.full(k, -np.inf)
        self._in_bin = np.zeros((k, BINS + 2), dtype=np.int64)

    def add(self, values: FloatArray) -> None:
        """Take a batch (k, n); columns with NaN count as failed and no more."""
        good = np.isfinite(values).all(axis=0)
        if not good.all():
            self.n_failed += int((~good).sum())
            values = values[:, good]
        k, n = values.shape
        if not n:
            return
        mean = values.mean(axis=1)
        off = values - mean[:, None]
        squares = np.einsum("ij,ij->i", off, off)
        self._combine(n, mean, squares, values.min(axis=1), values.max(axis=1))
        values = np.ascontiguousarray(values)
        bins, count = (self.bins.low, self.bins.width), self._in_bin
        lib.pkm_count(k, n, pointer(values), *map(pointer, bins), BINS, pointer(count))

    def merge(self, other: Stream) -> None:
        """Take what another stream with the same bins has taken."""
        self.n_failed += other.n_failed
        self._in_bin += other._in_bin
        if other.count:
            self._combine(other.count, other._mean, other._squares, other._least, other._most)

    def _combine(
        self, count: int, mean: FloatArray, squares: FloatArray, least: FloatArray, most: FloatArray
    ) -> None:
        total = self.count + count
        step = mean - self._mean
        self._squares = self._squares + squares + step**2 * (self.count * count / total)
        self._mean = self._mean + step * (count / total)
        self.count = total
        self._least = np.minimum(self._least, least)
        self._most = np.maximum(self._most, most)

    @property
    def mean(self) -> FloatArray:
        """Mean (k,); NaN without values."""
        return self._mean if self.count else np.full(len(self._mean), np.nan)

    @property
    def std(self) -> FloatArray:
        """Standard deviation (k,), with n - 1; NaN for fewer than two values."""
        if self.count < 2:
            return np.full(len(self._mean), np.nan)
        return np.asarray(np.sqrt(self._squares / (self.count - 1)))

    @property
    def mean_square(self) -> FloatArray:
        """Mean of the squares (k,)."""
        if not self.count:
            return np.full(len(self._mean), np.nan)
        return np.asarray(self._squares / self.count + self._mean**2)

    def quantile(self, share: float, failed_below: float = 0.0) -> FloatArray:
        """Value (k,) that `share` of all columns do not exceed, the failed ones among them.

        A failed column is beyond every value: `failed_below` of them count as -inf, the others as
        inf, and so does a quantile that lies among them. Otherwise it lies in the bin of the order
        statistic: off by less than a bin's width, which is 1/128 of the standard deviation that
        made the bins; beyond the bins, between their end and the extreme value.
        """
        rank = share * (self.count + self.n_failed - 1) - failed_below * self.n_failed
        if not self.count and not self.n_failed:
            return np.full(len(self._mean), np.nan)
        if rank < 0 or rank > self.count - 1:
            return np.full(len(self._mean), -np.inf if rank < 0 else np.inf)
        below = np.cumsum(self._in_bin, axis=1)
        found = np.empty(len(self._mean))
        for i, (ends, inside) in enumerate(zip(below, self._in_bin, strict=True)):
            at = int(np.searchsorted(ends, rank, side="right"))
            edge = self.bins.low[i] + self.bins.width[i] * np.arange(at - 1, at + 1)
            low = self._least[i] if at == 0 else max(edge[0], self._least[i])
            high = self._most[i] if at == BINS + 1 else min(edge[1], self._most[i])
            part = (rank - (ends[at] - inside[at]) + 0.5) / inside[at]
            found[i] = low + (high - low) * min(part, 1.0)
        return found
