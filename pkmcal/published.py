"""The closed forms of the 2TPR&2TPS paper, compiled: eq. 8 and eq. 12.

They hold for the published structure only; `Robot` is general and gives the same numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, as_rows
from pkmcal.core.poses import tpr2tps_jacobian, tpr2tps_lengths
from pkmcal.exceptions import ArgumentError

# a b c d e f of the paper's joint table, mm (its structure table has d = 292.4)
SIZE = (140.0, 80.0, 200.0, 294.2, 384.7, 278.5)


def leg_lengths(free: ArrayLike, size: ArrayLike = SIZE) -> FloatArray:
    """Leg lengths in closed form (eq. 8).

    Parameters
    ----------
    free : array_like (..., 4)
        y, z in mm, α, β in rad; x = z tan β and γ = 0 follow (eq. 7).
    size : array_like (6,)
        a b c d e f, mm.

    Returns
    -------
    ndarray (..., 4)
        L1 … L4, mm.

    Examples
    --------
    >>> from pkmcal import published
    >>> published.leg_lengths([0, 400, 0, 0]).round(6)
    array([454.959517, 454.959517, 401.92109 , 401.92109 ])
    """
    rows, shape = as_rows("free", free, 4)
    out = np.empty((len(rows), 4))
    tpr2tps_lengths(_size(size), rows, out)
    return out.reshape(*shape, 4)


def jacobian(free: ArrayLike, size: ArrayLike = SIZE) -> FloatArray:
    """∂L/∂(y, z, α, β) in closed form (eq. 12, with J_44 as derived).

    Parameters
    ----------
    free : array_like (..., 4)
        y, z in mm, α, β in rad.
    size : array_like (6,)
        a b c d e f, mm.

    Returns
    -------
    ndarray (..., 4, 4)
        mm per mm and mm per rad.

    Examples
    --------
    >>> from pkmcal import published
    >>> published.jacobian([0, 400, 0, 0]).shape
    (4, 4)
    """
    rows, shape = as_rows("free", free, 4)
    out = np.empty((len(rows), 4, 4))
    tpr2tps_jacobian(_size(size), rows, out)
    return out.reshape(*shape, 4, 4)


def _size(size: ArrayLike) -> FloatArray:
    rows, shape = as_rows("size", size, 6)
    if shape:
        raise ArgumentError(f"size must have shape (6,), found {(*shape, 6)}")
    return rows
