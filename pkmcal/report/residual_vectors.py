"""Residuals of a calibration as vectors in space, and the places that they are of."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import instruments
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation


def residual_vectors(equations: Equations, at: Evaluation) -> FloatArray:
    """Residuals of all rows as vectors in the robot's base frame, mm (N, 3).

    Of the components that were read; NaN where none was, and of readings that are angles alone.
    A reading changes with the platform's velocity by the last three columns of its derivative by
    the twist: unit vectors of the instrument's axes, of a height's axis or along a distance.
    """
    parts = []
    every = zip(equations.table.sets, at.residuals, equations.prediction.predicted(at), strict=True)
    for measured, residual, seen in every:
        lengths = [k for k, unit in enumerate(measured.units) if unit == "mm"]
        along, off = seen.by_twist[:, lengths, 3:], residual[:, lengths]
        vectors = np.einsum("nk,nki->ni", np.nan_to_num(off), along)
        vectors[~np.isfinite(off).any(axis=1)] = np.nan
        parts.append(vectors)
    return np.concatenate(parts)


def measured_places(equations: Equations, end: Evaluation) -> FloatArray:
    """Return the measured points of all rows in the robot's base frame, mm (N, 3)."""
    parts = []
    for i in range(len(equations.table.sets)):
        point = next(iter(equations.prediction.points[i]), "")
        target = equations.prediction.arguments_of(i, end.theta).get(point)
        if target is None:
            parts.append(end.pose[equations.table.pose_of[i], :3])
        else:
            parts.append(instruments.points(end.pose[equations.table.pose_of[i]], target)[0])
    return np.concatenate(parts)
