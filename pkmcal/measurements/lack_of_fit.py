"""Pure error and lack of fit of repeated measurements, and the F test between them.

Residuals of rows that repeat a pose are split into what they scatter about their common mean, the
pure error, which the model has no part in, and the mean, which is what the model misses there. If
the model is right the two differ by chance alone: the F test of lack of fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.measurements.measurements import Measurements

SIGNIFICANT = 0.01  # chance below which the model is said to miss more than scatter explains


@dataclass(frozen=True)
class Split:
    """Sums of squares of whitened residuals.

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
        """How likely a ratio as large would be if the model were right; NaN without a ratio."""
        from scipy.special import fdtrc

        return float(fdtrc(self.missed_freedom, self.pure_freedom, self.ratio))

    @property
    def beyond(self) -> float:
        """Deviation of what the model misses at a pose beyond the scatter of its repeats."""
        if not np.isfinite(self.ratio):
            return float("nan")
        return self.scatter * float(np.sqrt(max(self.ratio - 1.0, 0.0) / self.repeats))


def groups(measured: Measurements) -> IntArray:
    """Which pose and target each row measured, (N,), counted from 0."""
    target = measured.target_index
    of = np.zeros(len(measured), dtype=np.intp) if target is None else target
    return np.unique(np.column_stack([measured.pose_index, of]), axis=0, return_inverse=True)[
        1
    ].reshape(-1)


def split(residual: FloatArray, white: FloatArray, group: IntArray, leverage: float) -> Split:
    """Split the residuals of one set.

    Parameters
    ----------
    residual : ndarray (N, k)
        Measured less predicted.
    white : ndarray (N, k, k)
        What makes the noise of a row one.
    group : ndarray of int (N,)
        See `groups`.
    leverage : float
        How many parameters went into them.
    """
    count, k = int(group.max()) + 1, residual.shape[1]
    if count == len(group):
        return Split(0.0, 0.0, 0.0, 0.0, 1.0)
    weight = white.transpose(0, 2, 1) @ white
    total, pulled = np.zeros((count, k, k)), np.zeros((count, k))
    np.add.at(total, group, weight)
    np.add.at(pulled, group, (weight @ residual[:, :, None])[:, :, 0])
    mean = np.linalg.solve(total, pulled[:, :, None])[:, :, 0]
    about = (white @ (residual - mean[group])[:, :, None])[:, :, 0]
    every = (white @ residual[:, :, None])[:, :, 0]
    pure = float((about**2).sum())
    return Split(
        pure=pure,
        pure_freedom=float((len(group) - count) * k),
        missed=float((every**2).sum()) - pure,
        missed_freedom=count * k - leverage,
        repeats=len(group) / count,
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
