"""Moments and quantiles of values that come batch by batch and are not kept.

Mean and spread are combined batch by batch (Chan, Golub, LeVeque 1979), quantiles read from counts
in bins. What comes out depends on the batches and their order alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import call

BINS = 2048
REACH = 8.0  # standard deviations, to either side of the mean, that the bins cover


@dataclass(frozen=True, eq=False)
class Bins:
    """The edges of bins of k quantities; beyond them is one more bin on either side.

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


def pose_errors(poses: FloatArray, meant: FloatArray) -> FloatArray:
    """Return errors of poses (N, 6) in (6,) coordinates, and the distance: (7, N).

    Eq. 16; angles the short way round.
    """
    off = np.empty((7, len(poses)))
    call("pose_errors", len(poses), poses, meant, off)
    return off


class Stream:
    """Statistics of values (k, n): count, mean, spread, extremes, counts in bins.

    Parameters
    ----------
    bins : Bins
        For k quantities.
    """

    def __init__(self, bins: Bins) -> None:
        k = len(bins.low)
        self.bins = bins
        self._moments = np.zeros((4, k))  # mean, squares about the mean, least, most
        self._moments[2], self._moments[3] = np.inf, -np.inf
        self._taken = np.zeros(2, dtype=np.int64)  # columns, and those that failed
        self._in_bin = np.zeros((k, BINS + 2), dtype=np.int64)

    @property
    def count(self) -> int:
        """Number of columns that were taken, without those that failed."""
        return int(self._taken[0])

    @property
    def n_failed(self) -> int:
        """Number of columns with a number that is not finite."""
        return int(self._taken[1])

    def add(self, values: FloatArray) -> None:
        """Take a batch (k, n); columns with NaN count as failed and no more."""
        k, n = values.shape
        given = k, n, np.ascontiguousarray(values), self.bins.low, self.bins.width, BINS
        call("stream", *given, self._moments, self._taken, self._in_bin)

    def merge(self, other: Stream) -> None:
        """Take what another stream with the same bins has taken."""
        self._in_bin += other._in_bin
        total = max(self.count + other.count, 1)
        mean, squares, least, most = other._moments
        step, share = mean - self._moments[0], other.count / total
        self._moments[1] += squares + step**2 * (self.count * share)
        self._moments[0] += share * step
        self._moments[2] = np.minimum(self._moments[2], least)
        self._moments[3] = np.maximum(self._moments[3], most)
        self._taken += other._taken

    @property
    def mean(self) -> FloatArray:
        """Mean (k,); NaN without values."""
        return self._moments[0].copy() if self.count else np.full(len(self._in_bin), np.nan)

    @property
    def std(self) -> FloatArray:
        """Standard deviation (k,), with n - 1; NaN for fewer than two values."""
        if self.count < 2:
            return np.full(len(self._in_bin), np.nan)
        return np.asarray(np.sqrt(self._moments[1] / (self.count - 1)))

    @property
    def mean_square(self) -> FloatArray:
        """Mean of the squares (k,)."""
        if not self.count:
            return np.full(len(self._in_bin), np.nan)
        return np.asarray(self._moments[1] / self.count + self._moments[0] ** 2)

    def quantile(self, share: float, failed_below: float = 0.0) -> FloatArray:
        """Value (k,) that `share` of all columns do not exceed, the failed ones among them.

        A failed column is beyond every value: `failed_below` of them count as -inf, the others as
        inf, and so does a quantile that lies among them. Otherwise it lies in the bin of the order
        statistic: off by less than a bin's width, which is 1/128 of the standard deviation that
        made the bins; beyond the bins, between their end and the extreme value.
        """
        rank = share * (self.count + self.n_failed - 1) - failed_below * self.n_failed
        if not self.count and not self.n_failed:
            return np.full(len(self._in_bin), np.nan)
        if rank < 0 or rank > self.count - 1:
            return np.full(len(self._in_bin), -np.inf if rank < 0 else np.inf)
        below = np.cumsum(self._in_bin, axis=1)
        found = np.empty(len(self._in_bin))
        _, _, least, most = self._moments
        for i, (ends, inside) in enumerate(zip(below, self._in_bin, strict=True)):
            at = int(np.searchsorted(ends, rank, side="right"))
            edge = self.bins.low[i] + self.bins.width[i] * np.arange(at - 1, at + 1)
            low = least[i] if at == 0 else max(edge[0], least[i])
            high = most[i] if at == BINS + 1 else min(edge[1], most[i])
            part = (rank - (ends[at] - inside[at]) + 0.5) / inside[at]
            found[i] = low + (high - low) * min(part, 1.0)
        return found
