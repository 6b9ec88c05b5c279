"""Poses and orientations that were measured the other way round: the base in the platform's frame.

A camera on the platform that sees a board on the base gives such poses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal import screw
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements

_STEP = 1e-6  # mm and rad, of the derivative that takes a sigma along


def inverted(measured: Measurements) -> Measurements:
    """Turn measured poses, or orientations, round; a stated sigma with them.

    Parameters
    ----------
    measured : Measurements
        Of a kind that states an orientation. Of rows that were not read in full nothing follows:
        they become NaN.

    Returns
    -------
    Measurements
        A sigma becomes a covariance of each row.

    Raises
    ------
    ValueError
        Of a kind without orientations.
    """
    first = measured.instrument.turning
    if first is None:
        raise ArgumentError(
            f"invert_poses: values of kind {measured.kind!r} have no orientation that could be"
            " turned round"
        )
    values = turned_round(measured.values, first)
    if measured.sigma is None:
        return replace(measured, values=values)
    sigma = measured.sigma
    spread = sigma if sigma.ndim == 3 else np.einsum("ni,ij->nij", sigma**2, np.eye(sigma.shape[1]))
    by = _derivative(measured.values, first)
    covariance = by @ spread @ by.transpose(0, 2, 1)
    good = np.isfinite(covariance).all(axis=(1, 2))
    covariance[~good] = spread[~good]  # of rows without values
    return replace(
        measured, values=values, sigma=0.5 * (covariance + covariance.transpose(0, 2, 1))
    )


def turned_round(values: FloatArray, first: int) -> FloatArray:
    """The inverse of poses (N, 6), or of orientations (N, 3), whose angles begin at `first`."""
    poses = np.zeros((len(values), 6))
    poses[:, 3 - first :] = np.nan_to_num(values)
    motion = screw.from_pose(poses)
    turn = motion[:, :3, :3].transpose(0, 2, 1)
    motion[:, :3, 3] = -np.einsum("nij,nj->ni", turn, motion[:, :3, 3])
    motion[:, :3, :3] = turn
    found: FloatArray = screw.to_pose(motion)[:, 3 - first :]
    found[~np.isfinite(values).all(axis=1)] = np.nan
    return found


def _derivative(values: FloatArray, first: int) -> FloatArray:
    """Derivative (N, k, k) of the inverse by what was measured."""
    columns = []
    for step in _STEP * np.eye(values.shape[1]):
        change = turned_round(values + step, first) - turned_round(values - step, first)
        turned = change[:, first:]
        change[:, first:] = np.arctan2(np.sin(turned), np.cos(turned))
        columns.append(change / (2.0 * _STEP))
    return np.stack(columns, axis=2)
