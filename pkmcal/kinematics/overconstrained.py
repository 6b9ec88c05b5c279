"""Derivatives of machines with more closures than free coordinates, by solving again.

With inexact geometry no pose meets all closures, and the one that misses them least moves with
their second derivatives, too: -M Φ_u⁺ Φ_θ leaves these out. At 0.3 mm missed it is wrong by some
thousandths, enough to keep a calibration from converging.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.core.driven import CompiledMachine
from pkmcal.screw import from_pose, log

# Of the size, to each side. The step's square is what differences of third order leave out, the
# rounding of a pose over the step what they add: 1e-10 of a derivative, both.
_STEP = 5e-6


def error_jacobian(
    machine: CompiledMachine,
    slots: FloatArray,
    pose: FloatArray,
    q: FloatArray,
    columns: Int32Array,
    units: Sequence[str],
) -> FloatArray:
    """Twist (ω, v) of the platform by numbers at `columns` of the flattened slots: (N, 6, columns).

    Parameters
    ----------
    machine : Machine or ChainMachine
        In the core.
    slots : ndarray (limbs, SLOTS)
        Geometry.
    pose, q : ndarray (N, 6), (N, n)
        Where it is, and its actuators.
    columns : ndarray of int (k,)
        Which numbers.
    units : sequence of str, k
        Theirs.
    """
    size = machine.struct.size
    steps = {"mm": _STEP * size, "rad": _STEP, "1": _STEP}
    out = np.empty((len(pose), 6, len(columns)))
    columns, units, factor = machine.as_offsets(slots, q, columns, units)
    unit_of = dict(zip(columns.tolist(), units, strict=True))
    for column in np.unique(columns).tolist():
        step = steps[unit_of[column]]
        start, end = (
            machine.forward(_changed(slots, column, change), q, pose, threads=None)[0]
            for change in (-step, step)
        )
        alike = columns == column
        out[:, :, alike] = (_between(start, end) / (2.0 * step))[:, :, None]
    out *= factor[:, None]
    return out


def actuator_twists(
    machine: CompiledMachine,
    slots: FloatArray,
    pose: FloatArray,
    q: FloatArray,
    units: Sequence[str],
) -> FloatArray:
    """Twist (ω, v) of the platform by actuators in these units, as `error_jacobian`: (N, 6, n)."""
    out = np.empty((len(pose), 6, q.shape[1]))
    for a, unit in enumerate(units):
        step = _STEP * (machine.struct.size if unit == "mm" else 1.0)
        change = np.where(np.arange(q.shape[1]) == a, step, 0.0)
        start, end = (
            machine.forward(slots, q + way, pose, threads=None)[0] for way in (-change, change)
        )
        out[:, :, a] = _between(start, end) / (2.0 * step)
    return out


def _changed(slots: FloatArray, column: int, change: float) -> FloatArray:
    changed: FloatArray = slots.copy()
    changed.flat[column] += change
    return changed


def _between(start: FloatArray, end: FloatArray) -> FloatArray:
    """How poses (N, 6) turn and move to others near them, (N, 6)."""
    turned = log(from_pose(end) @ np.linalg.inv(from_pose(start)))[:, :3]
    return np.concatenate([turned, end[:, :3] - start[:, :3]], axis=1)
