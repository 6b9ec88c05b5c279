"""Noise of residuals: of a reading, shared by a pose, of repeats, and lack of fit.

Residuals of rows that repeat a pose are split into what they scatter about their common mean, the
pure error, which the model has no part in, and the mean, which is what the model misses there. If
the model is right the two differ by chance alone: the F test of lack of fit (N. R. Draper and H.
Smith, Applied Regression Analysis, Wiley 1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import sums

SIGNIFICANT = 0.01  # chance below which the model is said to miss more than scatter explains


Noise = tuple[float, float]  # variance of an equation, and what those of a pose share of it


def noise(adjusted: FloatArray, retained: FloatArray, key: IntArray) -> Noise:
    """Mean square of adjusted residuals, and what equations of one pose and component share of it.

    That is errors of the pose and of the model; the rest is a reading's own. NaN where the fit has
    used up all residuals.

    Parameters
    ----------
    adjusted, retained : ndarray (M,)
        Residuals adjusted for leverage, and the share of their variance that this could restore.
    key : ndarray of int (M,)
        Those with the same may share an error.

    Examples
    --------
    >>> noise(np.array([1.0, 1.0, -1.0, -1.0]), np.ones(4), np.array([0, 0, 1, 1]))
    (1.0, 1.0)
    """
    shown = float(retained.sum())
    total = float((adjusted**2).sum()) / shown if shown > 0 else float("nan")
    counts = np.bincount(key)
    pairs = float((counts.astype(np.float64) ** 2 - counts).sum())
    if not (pairs and shown > 0):
        return total, 0.0
    cross = float((sums(adjusted, key) ** 2).sum() - (adjusted**2).sum())
    return total, min(max(cross / pairs, 0.0), total)


@dataclass(frozen=True)
class Split:
    """Sums of squares of residuals.

    Attributes
    ----------
    pure, missed : float
        About the means of repeats, and of these means.
    pure_freedom, missed_freedom : float
        Their degrees of freedom.
    repeats : float
        Rows of a pose, on average.
    """

    pure: float
    pure_freedom: float
    missed: float
    missed_freedom: float
    repeats: float

    @property
    def scatter(self) -> float:
        """Deviation of repeats about their mean; NaN without repeats."""
        if self.pure_freedom <= 0:
            return float("nan")
        return float(np.sqrt(self.pure / self.pure_freedom))

    @property
    def ratio(self) -> float:
        """Mean square of what is missed over that of the scatter; NaN without freedom."""
        if self.pure_freedom <= 0 or self.missed_freedom < 1 or self.pure <= 0:
            return float("nan")
        return self.missed / self.missed_freedom / (self.pure / self.pure_freedom)

    @property
    def chance(self) -> float:
        """Chance of a ratio as large if the model were right; NaN without a ratio."""
        return f_tail(self.ratio, self.missed_freedom, self.pure_freedom)

    @property
    def beyond(self) -> float:
        """Deviation of what the model misses at a pose beyond the scatter of its repeats."""
        if not np.isfinite(self.ratio):
            return float("nan")
        return self.scatter * float(np.sqrt(max(self.ratio - 1.0, 0.0) / self.repeats))


def split(residual: FloatArray, key: IntArray, leverage: float) -> Split:
    """Split the residuals of one set.

    Parameters
    ----------
    residual : ndarray (M,)
        Measured less predicted in units of its deviation; of a robust loss pseudo-residuals.
    key : ndarray of int (M,)
        Which pose, target and component each belongs to, from 0.
    leverage : float
        How many parameters went into them.
    """
    counts = np.bincount(key)
    if len(counts) == len(key):
        return Split(0.0, 0.0, 0.0, 0.0, 1.0)
    mean = np.bincount(key, residual) / counts
    return Split(
        pure=float(((residual - mean[key]) ** 2).sum()),
        pure_freedom=float(len(key) - len(counts)),
        missed=float((counts * mean**2).sum()),
        missed_freedom=len(counts) - leverage,
        repeats=len(key) / len(counts),
    )


def joined(parts: Sequence[Split]) -> Split:
    """Several sets taken together, those without repeats left out."""
    repeated = [part for part in parts if part.pure_freedom > 0]
    return Split(
        pure=sum(part.pure for part in repeated),
        pure_freedom=sum(part.pure_freedom for part in repeated),
        missed=sum(part.missed for part in repeated),
        missed_freedom=sum(part.missed_freedom for part in repeated),
        repeats=sum(part.repeats for part in repeated) / max(len(repeated), 1),
    )
