"""Axes, points and home of an arm from Denavit–Hartenberg numbers."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray, as_numbers
from pkmcal.exceptions import ArgumentError

Convention = Literal["standard", "modified"]


def screws_of(
    a: ArrayLike, alpha: ArrayLike, d: ArrayLike, theta: ArrayLike, convention: Convention
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes (n, 3), points (n, 3) and home (4, 4) at zero; the arguments are `from_dh`'s.

    A DH transform is two screws: one along x (a, α), one along the joint's axis z (d, θ).
    """
    word("convention", convention, get_args(Convention))
    given = {"a": a, "alpha": alpha, "d": d, "theta": theta}
    columns = {}
    for name, value in given.items():
        column = as_numbers(name, value, "n")
        if column.ndim > 1 or not np.isfinite(column).all():
            raise ArgumentError(f"{name} must be a number or finite numbers (n,), found {value!r}")
        columns[name] = column
    try:
        rows = np.stack(np.broadcast_arrays(*columns.values()), axis=-1, dtype=np.float64)
    except ValueError:
        shapes = ", ".join(f"{name} {column.shape}" for name, column in columns.items())
        raise ArgumentError(f"a, alpha, d and theta must have one length, found {shapes}") from None
    rows = np.atleast_2d(rows)
    twists = np.zeros((2, len(rows), 6))
    twists[0, :, [3, 0]] = rows[:, :2].T  # along x: α about it, a along it
    twists[1, :, [5, 2]] = rows[:, 2:].T  # along z: θ about it, d along it
    across, along = screw.exp(twists)
    frame = np.eye(4)
    axes, points = np.empty((len(rows), 3)), np.empty((len(rows), 3))
    for i in range(len(rows)):
        if convention == "modified":
            frame = frame @ across[i]
        axes[i], points[i] = frame[:3, 2], frame[:3, 3]
        frame = frame @ along[i]
        if convention == "standard":
            frame = frame @ across[i]
    return axes, points, frame
