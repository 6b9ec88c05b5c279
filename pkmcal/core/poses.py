"""Poses in the compiled core: composed, inverted, their rates; eq. 8 and 12 in closed form."""

from __future__ import annotations

import numpy as np

from pkmcal._core import lib
from pkmcal.arrays import FloatArray
from pkmcal.core.library import ISA, pointer


def tpr2tps_lengths(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 8 in closed form: `free` (N, 4) to lengths `out` (N, 4)."""
    lib.pkm_tpr2tps_lengths(ISA, len(free), pointer(size), pointer(free), pointer(out))


def tpr2tps_jacobian(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 12 in closed form: `free` (N, 4) to derivatives `out` (N, 4, 4)."""
    lib.pkm_tpr2tps_jacobian(ISA, len(free), pointer(size), pointer(free), pointer(out))


def compose(a: FloatArray, b: FloatArray) -> FloatArray:
    """Pose A followed by pose B: (6,) and (N, 6), or (N, 6) and (6,), to (N, 6)."""
    n = len(b) if b.ndim == 2 else len(a)
    out = np.empty((n, 6))
    if n:
        strides = (6 if a.ndim == 2 else 0, 6 if b.ndim == 2 else 0)
        lib.pkm_compose(ISA, n, pointer(a), strides[0], pointer(b), strides[1], pointer(out))
    return out


def invert(a: FloatArray) -> FloatArray:
    """The inverse of a pose (6,)."""
    out = np.empty(6)
    lib.pkm_invert(ISA, 1, pointer(a), pointer(out))
    return out


def compose_rates(
    a: FloatArray, pose: FloatArray, c: FloatArray, composed: FloatArray
) -> FloatArray:
    """Rates (N, 6, 6) of A T C by those of T, for T = `pose` and A T C = `composed`, (N, 6).

    A is (6,); C is (6,) or (N, 6).
    """
    n, out = len(pose), np.empty((len(pose), 6, 6))
    if n:
        lib.pkm_compose_rates(
            ISA,
            n,
            pointer(a),
            pointer(pose),
            pointer(c),
            6 if c.ndim == 2 else 0,
            pointer(composed),
            pointer(out),
        )
    return out


def compose_twists(a: FloatArray, pose: FloatArray, c: FloatArray) -> FloatArray:
    """Twists (N, 6, 6) of A T C by those of T, for T = `pose` (N, 6); A and C are (6,)."""
    n, out = len(pose), np.empty((len(pose), 6, 6))
    if n:
        lib.pkm_compose_twists(ISA, n, pointer(a), pointer(pose), pointer(c), pointer(out))
    return out
