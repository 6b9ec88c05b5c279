"""Arrays of callers that results are written to: large new ones take time of their own."""

from __future__ import annotations

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arrays import FloatArray
from pkmcal.core.core_machine import Found
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.kinematics.forward import Forward


def reused_rows(out: FloatArray, shape: tuple[int, ...], *read: FloatArray | None) -> FloatArray:
    """`out` of this shape as rows (N, width).

    Raises
    ------
    ValueError, TypeError
        No such array, or one of `read`, which are still needed, is in its place.
    """
    instance("out", out, np.ndarray)
    if isinstance(out, np.ma.MaskedArray):  # what is masked would stay so
        raise ArgumentTypeError("out must be an array without a mask, found a MaskedArray")
    if out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise ArgumentError(
            f"out must be an array of float64 that can be written to, {shape}, row by row without"
            f" gaps; found {out.dtype}, {out.shape}"
        )
    if any(each is not None and np.may_share_memory(out, each) for each in read):
        raise ArgumentError("out must not be where the call's own input is")
    return out.reshape(-1, shape[-1])


def reused_forward(out: Forward, shape: tuple[int, ...], framed: bool, *read: FloatArray) -> Found:
    """The arrays of a result of this leading shape, as rows.

    Parameters
    ----------
    out : Forward
        An earlier result.
    shape : tuple of int
        Of the rows that are asked for.
    framed : bool
        Whether the robot's poses are in other frames than the machine's own, and so beside them.
    *read : ndarray
        What is still needed.

    Raises
    ------
    ValueError, TypeError
        It is none, has another shape, is of a robot with frames where this one has none or the
        other way round, cannot be written to, or one of `read` is in its place.
    """
    instance("out", out, Forward)
    if out.status.shape != shape:
        raise ArgumentError(
            f"out must be a result of as many rows as q, {shape}, found {out.status.shape}"
        )
    if (out.pose is not out._own) != framed:
        raise ArgumentError(
            "out must be a result of a robot that has base or tool frames if this one has, and"
            " none if not"
        )
    if not all(each.flags.carray for each in (out.status, out.iterations, out.residual)):
        raise ArgumentError("out must be a result that can be written to")
    own, _ = (reused_rows(each, (*shape, 6), *read) for each in (out._own, out.pose))
    return own, out.status.reshape(-1), out.iterations.reshape(-1), out.residual.reshape(-1)
