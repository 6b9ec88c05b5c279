"""Paths of complex solutions in the core."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal._core import lib
from pkmcal.arrays import ComplexArray, FloatArray, Int32Array
from pkmcal.core.library import ensure, pointer
from pkmcal.core.machine import Machine

ARRIVED, LOST, FAR = lib.PKM_ARRIVED, lib.PKM_LOST, lib.PKM_FAR


class Paths(NamedTuple):
    """The ends of the paths of complex solutions.

    Attributes
    ----------
    state : ndarray of complex (N, k)
        Of the pose map.
    frame : ndarray of complex (N, 12)
        R row by row, and p.
    status : ndarray of int (N,)
        `ARRIVED`, `LOST` or `FAR` (so large that it is on its way to infinity).
    steps : ndarray of int (N,)
        How many were taken.
    reached : ndarray (N,)
        Where on the line the frames are, 1 at the target.
    """

    state: ComplexArray
    frame: ComplexArray
    status: Int32Array
    steps: Int32Array
    reached: FloatArray


def follow(
    machine: Machine,
    start: ComplexArray,
    target: ComplexArray,
    states: ComplexArray,
    accuracy: float,
) -> Paths:
    """Solutions of the closures of limbs `start` followed to limbs `target`, (limbs, 7 + 3 axes).

    `states` (N, k) are those of the pose map; `accuracy` is how far a prediction may be off.
    """
    n = len(states)
    x = np.zeros((n, lib.pkm_state_size()), dtype=np.complex128)
    x[:, : states.shape[1]] = states
    frame = np.empty((n, 12), dtype=np.complex128)
    status, steps = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    reached = np.empty(n)
    limbs = np.zeros((2, len(start), lib.PKM_SPHERE), dtype=np.complex128)
    for each, given in zip(limbs, (start, target), strict=True):
        each[:, : given.shape[1]] = given  # axes that a start system does not know are 0
    arrays = [pointer(each) for each in (*limbs, x, frame, status, steps, reached)]
    ensure(lib.pkm_paths(machine.struct, n, *arrays[:3], accuracy, *arrays[3:]))
    return Paths(x, frame, status, steps, reached)
