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

from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray

LossName = Literal["linear", "huber", "cauchy"]

LIMITS: dict[LossName, float] = {"linear": np.inf, "huber": 1.345, "cauchy": 2.385}


def limits(name: LossName, components: IntArray, width: FloatArray) -> FloatArray:
    """Limit c of each row (N,) of so many equations, `width` (N,) times that of a sound row."""
    found: FloatArray = LIMITS[name] * np.sqrt(components) * width
    return found


def weights(
    name: LossName, residual: FloatArray, components: IntArray, limit: FloatArray
) -> FloatArray:
    """∂ρ/∂s² of each row (N,) of `components` (N,) equations at whitened residuals (M,)."""
    if name == "linear":
        return np.ones(len(components))
    ratio = _lengths(residual, components) / limit
    return 1.0 / np.maximum(ratio, 1.0) if name == "huber" else 1.0 / (1.0 + ratio**2)


def decline(
    name: LossName, residual: FloatArray, components: IntArray, limit: FloatArray
) -> FloatArray:
    """Return the weights' fall s ∂w/∂s for each row (N,), s its residual's length (M,)."""
    ratio = _lengths(residual, components) / limit
    if name == "linear":
        return np.zeros(len(components))
    if name == "huber":
        return np.where(ratio > 1.0, -1.0 / np.maximum(ratio, 1.0), 0.0)
    falling: FloatArray = -2.0 * ratio**2 / (1.0 + ratio**2) ** 2
    return falling


def scaled(
    name: LossName, residual: FloatArray, components: IntArray, limit: FloatArray
) -> FloatArray:
    """Whitened residuals (M,) scaled so that the square of each row is its ρ."""
    if name == "linear":
        return residual
    factor, _ = _factors(name, _lengths(residual, components), limit)
    return residual * np.repeat(factor, components)


def scaled_jacobian(
    name: LossName,
    residual: FloatArray,
    jacobian: FloatArray,
    components: IntArray,
    limit: FloatArray,
) -> FloatArray:
    """Derivative (M, n) of what `scaled` returns, from that of the residuals."""
    if name == "linear":
        return jacobian
    factor, slope = _factors(name, _lengths(residual, components), limit)
    first = np.cumsum(components) - components
    along = np.add.reduceat(residual[:, None] * jacobian, first)  # s ∂s
    turned = np.repeat(slope[:, None] * along, components, axis=0)
    whole: FloatArray = np.repeat(factor, components)[:, None] * jacobian
    return whole + residual[:, None] * turned


def _lengths(residual: FloatArray, components: IntArray) -> FloatArray:
    first = np.cumsum(components) - components
    lengths: FloatArray = np.sqrt(np.add.reduceat(residual**2, first))
    return lengths


def _factors(
    name: LossName, lengths: FloatArray, limit: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Factor g = √ρ/s of each row, and (∂g/∂s)/s."""
    t = np.maximum(lengths / limit, 1e-3)  # below, g is its own series
    if name == "huber":
        outside = t > 1.0
        root = np.sqrt(np.where(outside, 2.0 * t - 1.0, t * t))
        half_slope = np.where(outside, 1.0, t)  # of ρ
    else:
        root = np.sqrt(np.log1p(t * t))
        half_slope = t / (1.0 + t * t)
    return root / t, (half_slope * t / root - root) / t**3 / limit**2
