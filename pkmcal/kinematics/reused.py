"""Arrays of callers that results are written to: large new ones cost a tenth of the time."""

from __future__ import annotations

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arrays import FloatArray
from pkmcal.core.core_machine import Found
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.forward import Forward


def reused_rows(out: FloatArray, shape: tuple[int, ...], *read: FloatArray | None) -> FloatArray:
    """`out` of this shape as rows (N, width).

    Raises
    ------
    ValueError, TypeError
        No such array, or one of `read`, which are still needed, is in its place.
    """
    instance("out", out, np.ndarray)
    if out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise ArgumentError(
            f"out must be an array of float64 that can be written to, {shape}, row by row without"
            f" gaps; found {out.dtype}, {out.shape}"
        )
    if any(each is not None and np.may_share_memory(out, each) for each in read):
        raise ArgumentError("out must not be where the call's own input is")
    return out.reshape(-1, shape[-1])


def reused_forward(out: Forward, shape: tuple[int, ...], *read: FloatArray) -> Found:
    """The arrays of a result of this leading shape, as rows.

    Raises
    ------
    ValueError, TypeError
        It is none, or has another shape.
    """
    instance("out", out, Forward)
    if out.status.shape != shape:
        raise ArgumentError(
            f"out must be a result of as many rows as q, {shape}, found {out.status.shape}"
        )
    own = reused_rows(out._own, (*shape, 6), *read)
    return own, out.status.reshape(-1), out.iterations.reshape(-1), out.residual.reshape(-1)
