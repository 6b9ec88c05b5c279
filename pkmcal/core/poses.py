"""Poses in the compiled core: composed, inverted, their rates; eq. 8 and 12 in closed form."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import call, rows

NOWHERE = np.zeros(6)  # the pose of a frame that is not displaced


def tpr2tps_lengths(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 8 in closed form: `free` (N, 4) to lengths `out` (N, 4)."""
    call("tpr2tps_lengths", len(free), size, free, out)


def tpr2tps_jacobian(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 12 in closed form: `free` (N, 4) to derivatives `out` (N, 4, 4)."""
    call("tpr2tps_jacobian", len(free), size, free, out)


def compose(a: FloatArray, b: FloatArray) -> FloatArray:
    """Pose A followed by pose B: (6,) and (N, 6), or (N, 6) and (6,), to (N, 6)."""
    return rows("compose", a, b)[0]


def invert(a: FloatArray) -> FloatArray:
    """The inverse of a pose (6,)."""
    inverse: FloatArray = rows("invert", a)[0][0]
    return inverse


def compose_rates(
    a: FloatArray, pose: FloatArray, c: FloatArray, composed: FloatArray
) -> FloatArray:
    """Rates (N, 6, 6) of A T C by those of T, for T = `pose` and A T C = `composed`, (N, 6).

    A is (6,); C is (6,) or (N, 6).
    """
    return rows("compose_rates", a, pose, c, composed)[0]


def compose_twists(a: FloatArray, pose: FloatArray, c: FloatArray) -> FloatArray:
    """Twists (N, 6, 6) of A T C by those of T, for T = `pose` (N, 6); A and C are (6,)."""
    return rows("compose_twists", a, pose, c)[0]


def rates_of_twists(pose: FloatArray, twists: FloatArray) -> FloatArray:
    """Rates (N, 6, k) of x y z α β γ of poses (N, 6) that move with twists (ω, v), (N, 6, k)."""
    level = np.zeros_like(pose)  # turns about the axes are rates of its angles
    rates = compose_rates(NOWHERE, level, NOWHERE, pose)
    moved: FloatArray = rates @ np.concatenate([twists[:, 3:], twists[:, :3]], axis=1)
    return moved
