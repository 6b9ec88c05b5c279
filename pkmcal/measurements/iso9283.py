"""Pose accuracy, repeatability and distance accuracy of measured positions, after ISO 9283:1998.

What was commanded is where the geometry says the machine is: that of the drawing before the
calibration, the identified one after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, IntArray, as_rows
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.result import Result

SIGMAS = 3.0  # of the spread, which the standard adds to the mean
_PAIRED = 300  # poses between which distances are taken, at most


@dataclass(frozen=True, eq=False, repr=False)
class Performance(Result):
    """Performance of a machine at its commanded poses; mm, one entry for each of G poses.

    Attributes
    ----------
    repeats : ndarray of int (G,)
        How often each pose was measured.
    accuracy : ndarray (G,)
        AP: distance from the commanded point to the mean of the measured ones.
    repeatability : ndarray (G,)
        RP: mean distance of the measured points from their mean, and three standard deviations of
        it; NaN where a pose was measured once.
    distance_accuracy : ndarray (P,)
        AD: mean distance between the points of two poses, the first of the one to the first of the
        other and so on, less the commanded distance; for every pair of them, of 300 poses at most.
        Where one was measured more often, its further points are left out. It does not depend on
        where the instrument stands.
    """

    repeats: IntArray
    accuracy: FloatArray
    repeatability: FloatArray
    distance_accuracy: FloatArray

    def _parts(self) -> Iterator[str | Table]:
        few, many = int(self.repeats.min()), int(self.repeats.max())
        count = f"{few}" if few == many else f"{few} to {many}"
        yield f"{len(self.repeats)} poses, each measured {count} times"
        scores = {
            "accuracy AP": self.accuracy,
            "repeatability RP": self.repeatability,
            "distance accuracy AD": np.abs(self.distance_accuracy),
        }
        rows = [[name, *_mean_and_largest(values)] for name, values in scores.items()]
        yield Table(["[mm]", "mean", "largest"], rows, left=1)


def _mean_and_largest(values: FloatArray) -> list[str]:
    finite = values[np.isfinite(values)]
    return [f"{finite.mean():.3g}", f"{finite.max():.3g}"] if len(finite) else ["", ""]


def performance(measured: ArrayLike, commanded: ArrayLike, pose: ArrayLike) -> Performance:
    """Score measured points against commanded ones.

    Parameters
    ----------
    measured, commanded : array_like (N, 3)
        In one frame, mm.
    pose : array_like of int (N,)
        Rows with the same number repeat one pose; their commanded points are averaged too.

    Returns
    -------
    Performance
        In the order of the numbers.

    Raises
    ------
    ValueError, TypeError
        Wrong shapes, or no rows.

    Notes
    -----
    ISO 9283:1998, 7.2.1 (AP = ‖barycentre − command‖), 7.2.2 (RP = l̄ + 3 S_l with l_j the distance
    from the barycentre) and 7.3.2 (AD = D̄ − D_c with D̄ the mean of the distances D_j between the
    j-th points of both poses, in the order measured). The standard asks for 30 repeats of five
    poses at rated load and speed; here they are what the measurements have.

    Examples
    --------
    >>> scored = performance([[1.0, 0, 0], [3, 0, 0]], [[0, 0, 0], [0, 0, 0]], [7, 7])
    >>> scored.accuracy, scored.repeatability, scored.repeats
    (array([2.]), array([1.]), array([2]))
    """
    from scipy.spatial.distance import pdist

    points, shape = as_rows("measured", measured, 3)
    wanted, _ = as_rows("commanded", commanded, 3)
    number = np.asarray(pose)
    if len(shape) != 1 or not len(points) or wanted.shape != points.shape:
        raise ArgumentError(
            f"measured and commanded must be (N, 3); found {points.shape} and {wanted.shape}"
        )
    if number.shape != shape:
        raise ArgumentError(f"pose must have shape {shape}; found {number.shape}")
    _, group, repeats = np.unique(number, return_inverse=True, return_counts=True)

    def mean(rows: FloatArray) -> FloatArray:
        total = np.zeros((len(repeats), *rows.shape[1:]))
        np.add.at(total, group, rows)
        averaged: FloatArray = total / repeats.reshape(-1, *[1] * (rows.ndim - 1))
        return averaged

    centre, sent = mean(points), mean(wanted)
    away = np.linalg.norm(points - centre[group], axis=1)
    once = np.where(repeats > 1, repeats - 1.0, np.nan)
    spread = np.sqrt(mean((away - mean(away)[group]) ** 2) * repeats / once)
    some = np.unique(np.linspace(0, len(centre) - 1, min(len(centre), _PAIRED)).astype(np.intp))
    return Performance(
        repeats=repeats,
        accuracy=np.linalg.norm(centre - sent, axis=1),
        repeatability=mean(away) + SIGMAS * spread,
        distance_accuracy=_paired_distances(points, group, some) - pdist(sent[some]),
    )


def _paired_distances(points: FloatArray, group: IntArray, some: IntArray) -> FloatArray:
    """Mean distance between the j-th points of two poses, for every pair of `some`."""
    from scipy.spatial.distance import pdist

    rows = [np.flatnonzero(group == pose) for pose in some]
    total, count = (np.zeros(len(some) * (len(some) - 1) // 2) for _ in range(2))
    for repeat in range(max(map(len, rows))):
        own = np.full((len(some), 3), np.nan)
        for k, row in enumerate(rows):
            if repeat < len(row):
                own[k] = points[row[repeat]]
        distance = pdist(own)
        both = np.isfinite(distance)
        total[both] += distance[both]
        count += both
    mean: FloatArray = total / count
    return mean
