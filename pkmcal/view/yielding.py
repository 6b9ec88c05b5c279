"""Stiffness of a machine, as data for its page."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.stiffness import stiffness

_DIGITS = 3
WAYS = {"along x": (1.0, 0.0, 0.0), "along y": (0.0, 1.0, 0.0), "along z": (0.0, 0.0, 1.0)}


def data(robot: Robot, poses: FloatArray) -> dict[str, Any]:
    """Stiffness of a machine that yields at home and over poses (N, 6), N/mm.

    `rows`: along the axes of the base and along the softest direction, at home, the least and the
    median of the poses. `cloud`: along the softest direction at each pose, None where it gives way.
    """
    found = stiffness(robot, np.vstack([robot.home, poses]))
    along = {name: found.stiffness_along(way) for name, way in WAYS.items()}
    along["softest"] = found.softest[1]
    rows = []
    for name, values in along.items():
        known = values[1:][np.isfinite(found.softest[1][1:])]
        over = [np.min(known), np.median(known)] if len(known) else [np.nan, np.nan]
        rows.append([name, *(_rounded(float(value)) for value in (values[0], *over))])
    return {"rows": rows, "cloud": [_rounded(value) for value in along["softest"][1:].tolist()]}


def _rounded(value: float) -> float | None:
    """To a few figures; None for what JSON has no number for."""
    return float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None
