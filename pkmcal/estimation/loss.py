"""Robust losses by row: what counts is how far off the whole measured vector is.

A row of k whitened residuals r with length s = ‖r‖ costs ρ(s²) in place of s². Least squares
minimises sums of squares, so the row is handed over as r·√ρ/s: its square is ρ, exactly.

=======  ============================  ===============  =====
loss     ρ(s²)                         weight ∂ρ/∂s²    c/√k
=======  ============================  ===============  =====
linear   s²                            1
huber    s² up to c, then 2cs - c²     min(1, c/s)      1.345
cauchy   c² ln(1 + s²/c²)              1/(1 + s²/c²)    2.385
=======  ============================  ===============  =====

With k = 1 and Gaussian noise both keep 95 % of the efficiency of least squares (Z. Zhang, Parameter
estimation techniques, Image and Vision Computing 15 (1997) 59-76).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray

LossName = Literal["linear", "huber", "cauchy"]

LIMITS: dict[LossName, float] = {"linear": np.inf, "huber": 1.345, "cauchy": 2.385}


@dataclass(frozen=True, eq=False)
class Loss:
    """A loss for rows of several equations.

    Attributes
    ----------
    name : {"linear", "huber", "cauchy"}
        Which loss.
    components : ndarray of int (N,)
        Equations of each row.
    width : ndarray (N,)
        Factor on the limit c of each row.
    stands_for : ndarray of int (N,), optional
        How many equations each counts as, k: more than it has where they are compressed.
    """

    name: LossName
    components: IntArray
    width: FloatArray
    stands_for: IntArray | None = None

    def of(self, units: slice) -> Loss:
        """Return the loss for some of the rows."""
        many = None if self.stands_for is None else self.stands_for[units]
        return Loss(self.name, self.components[units], self.width[units], many)

    def _lengths(self, residual: FloatArray) -> FloatArray:
        first = np.cumsum(self.components) - self.components
        lengths: FloatArray = np.sqrt(np.add.reduceat(residual**2, first))
        return lengths

    @property
    def _limit(self) -> FloatArray:
        many = self.components if self.stands_for is None else self.stands_for
        limit: FloatArray = LIMITS[self.name] * np.sqrt(many) * self.width
        return limit

    def weights(self, residual: FloatArray) -> FloatArray:
        """∂ρ/∂s² of each row (N,) at whitened residuals (M,)."""
        if self.name == "linear":
            return np.ones(len(self.components))
        ratio = self._lengths(residual) / self._limit
        return 1.0 / np.maximum(ratio, 1.0) if self.name == "huber" else 1.0 / (1.0 + ratio**2)

    def decline(self, residual: FloatArray) -> FloatArray:
        """Return the weights' fall s ∂w/∂s for each row (N,), s its residual's length (M,)."""
        ratio = self._lengths(residual) / self._limit
        if self.name == "linear":
            return np.zeros(len(self.components))
        if self.name == "huber":
            return np.where(ratio > 1.0, -1.0 / np.maximum(ratio, 1.0), 0.0)
        falling: FloatArray = -2.0 * ratio**2 / (1.0 + ratio**2) ** 2
        return falling

    def residual(self, residual: FloatArray) -> FloatArray:
        """Whitened residuals (M,) scaled so that the square of each row is its ρ."""
        if self.name == "linear":
            return residual
        factor, _ = self._factors(residual)
        return residual * np.repeat(factor, self.components)

    def jacobian(self, residual: FloatArray, jacobian: FloatArray) -> FloatArray:
        """Derivative (M, n) of what `residual` returns, from that of the residuals."""
        if self.name == "linear":
            return jacobian
        factor, slope = self._factors(residual)
        first = np.cumsum(self.components) - self.components
        along = np.add.reduceat(residual[:, None] * jacobian, first)  # s ∂s
        turned = np.repeat(slope[:, None] * along, self.components, axis=0)
        scaled: FloatArray = np.repeat(factor, self.components)[:, None] * jacobian
        return scaled + residual[:, None] * turned

    def _factors(self, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Factor g = √ρ/s of each row, and (∂g/∂s)/s."""
        limit = self._limit
        t = np.maximum(self._lengths(residual) / limit, 1e-3)  # below, g is its own series
        if self.name == "huber":
            outside = t > 1.0
            root = np.sqrt(np.where(outside, 2.0 * t - 1.0, t * t))
            half_slope = np.where(outside, 1.0, t)  # of ρ
        else:
            root = np.sqrt(np.log1p(t * t))
            half_slope = t / (1.0 + t * t)
        return root / t, (half_slope * t / root - root) / t**3 / limit**2
