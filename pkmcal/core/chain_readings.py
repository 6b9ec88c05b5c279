"""Closures of chains in units of what actuators read, for machines with more of them than needed.

Of each actuator the coordinate that its chains need at a pose less the one that was read, and then
what chains hold whatever is read: combinations of their rows across the gradients by the
coordinates. Numbers of the geometry act on rows by central differences of these, at the pose and
the coordinates needed: the residual is exact to 1e-13 of the size and its steps are 1e-5 of it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.core.machine import Closure

_STEPS = 4  # of Newton, to the coordinates that chains need


def readings(
    closure: Callable[[FloatArray, FloatArray], Closure],
    slots: FloatArray,
    q: FloatArray,
    arcs: FloatArray,
    columns: Int32Array | None,
    sizes: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Compute readings as `pkmcal.core.machine.Machine.readings`; actuators' rows come first.

    Parameters
    ----------
    closure : callable
        Geometry and coordinates (N, n) to the closure rows at the poses.
    slots, q : ndarray
        Geometry (1, numbers), and what was read (N, n).
    arcs : ndarray (m,)
        Of the steps of the pose map: the characteristic length of angles, else 1.
    columns : ndarray of int or None
        Numbers to derive by.
    sizes : ndarray (numbers,)
        Steps of the numbers for differences.
    """
    n, needed = q.shape[1], q.copy()
    for _ in range(_STEPS):
        at = closure(slots, needed)
        needed -= (_back(at.by_q) @ at.residual[..., None])[..., 0]
    at = closure(slots, needed)
    back, across = _back(at.by_q), _across(at.by_q, n)
    by_step = at.by_step * arcs
    residual = np.hstack([needed - q, (across @ at.residual[..., None])[..., 0]])
    slopes = np.concatenate([-back @ by_step, across @ by_step], axis=1)
    if columns is None:
        return residual, slopes, None
    by_number = np.empty((*residual.shape, len(columns)))
    for c, column in enumerate(columns):
        ends = []
        for side in (1.0, -1.0):
            other = slots.copy()
            other.flat[column] += side * sizes[column]
            ends.append(closure(other, needed).residual)
        change = ((ends[0] - ends[1]) / (2.0 * sizes[column]))[..., None]
        by_number[..., c] = np.concatenate([-back @ change, across @ change], axis=1)[..., 0]
    return residual, slopes, by_number


def _back(by_q: FloatArray) -> FloatArray:
    """Least squares of coordinates from rows, (N, n, rows); NaN where a row is."""
    out = np.full(by_q.transpose(0, 2, 1).shape, np.nan)
    good = np.isfinite(by_q).all(axis=(1, 2))
    out[good] = np.linalg.pinv(by_q[good])
    return out


def _across(by_q: FloatArray, n: int) -> FloatArray:
    """Combinations of rows that no coordinate moves, (N, rows - n, rows)."""
    rows = by_q.shape[1]
    out = np.full((len(by_q), rows - n, rows), np.nan)
    good = np.isfinite(by_q).all(axis=(1, 2))
    out[good] = np.linalg.qr(by_q[good], mode="complete")[0][..., n:].transpose(0, 2, 1)
    return out
