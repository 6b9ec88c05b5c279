"""Corners of a board that a camera can see: in the picture, and not too slanting."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray

_SLANT = np.cos(np.radians(60.0))  # between the line of sight and the board's normal, at most


def visible(
    board: FloatArray,
    corner: FloatArray,
    seen: FloatArray,
    lens: FloatArray,
    size: tuple[int, int],
    margin: float = 0.0,
) -> BoolArray:
    """Mark corners (N,) that a camera sees.

    Those before it and in its picture, of a board that it sees from the front and not too slanting,
    where its distortion does not fold: farther out, points come back into the picture that no lens
    brings there.

    Parameters
    ----------
    board : ndarray (N, 4, 4)
        The board of each in axes of the camera; its z points into it.
    corner : ndarray (N, 3)
        In axes of the board, mm.
    seen : ndarray (N, 2)
        Where it would be, px.
    lens : ndarray (9,)
        fx fy cx cy k1 k2 p1 p2 k3.
    size : (int, int)
        Of the picture, px; 0: not known.
    margin : float
        From its edges, px.
    """
    at = (board[:, :3, :3] @ corner[:, :, None])[:, :, 0] + board[:, :3, 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        facing = (board[:, :3, 2] * at).sum(axis=1) / np.linalg.norm(at, axis=1)
        radius = (at[:, 0] ** 2 + at[:, 1] ** 2) / at[:, 2] ** 2
        k1, k2, k3 = lens[[4, 5, 8]]
        able = (
            (at[:, 2] > 0) & (facing > _SLANT) & (radius < _fold(float(k1), float(k2), float(k3)))
        )
        for k, end in enumerate(size):
            if end:
                able &= (seen[:, k] >= margin) & (seen[:, k] <= end - 1 - margin)
    found: BoolArray = able
    return found


def _fold(k1: float, k2: float, k3: float) -> float:
    """Least x²/z² + y²/z² at which the distance from the middle ceases to grow."""
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    ahead = roots[(np.abs(roots.imag) < 1e-12) & (roots.real > 0)].real
    return float(ahead.min(initial=np.inf))
