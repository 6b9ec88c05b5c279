"""Residuals of blocks of equations that are left out, without fitting again.

Of a linear fit with hat matrix H the equations B, predicted by all others, are off by
(1 - H_BB)⁻¹ r_B. Combinations of parameters that (almost) only the block determines cannot be
predicted from the others; they are found from the block itself, as those of a session of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit, alike

_OWN = 0.99  # of what is known of a combination, from which it is the block's own
_TOGETHER = 4096  # equations of small blocks


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Blocks, each left out.

    Attributes
    ----------
    residual : ndarray (M,)
        Of each equation, whitened, its block left out.
    variance : ndarray (M,)
        Of it, if noise and model are right, in units of the noise's.
    ratio : float
        Rms of the residuals over what is expected.
    chance : float
        How likely as large a ratio is if noise and model are right.
    """

    residual: FloatArray
    variance: FloatArray
    ratio: float
    chance: float


def left_out(fit: LinearFit, block: IntArray) -> LeftOut:
    """Compute residuals of each block by a fit without it.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    block : ndarray of int (M,)
        Number of the block of each equation. Equations that may share an error are in one.
    """
    p = fit.design.shape[1]
    residual, variance = np.empty(len(block)), np.empty(len(block))
    squares, whole = 0.0, np.zeros((p, p))  # of the covariance of the residuals left out
    for b in np.unique(block):
        mine = np.flatnonzero(block == b)
        size, axes = _normal(fit, mine)
        known = _known(size)
        factor = np.where(known, 1.0 / np.where(known, 1.0 - size, 1.0), 0.0)
        change = axes * np.where(known, factor, -1.0 / np.where(known, 1.0, size))
        every = list(lots(len(mine)))
        pulls = sum(fit.design[mine[lot]].T @ fit.residual[mine[lot]] for lot in every)
        step = change @ (axes.T @ pulls)
        for lot in every:
            rows = mine[lot]
            part = fit.design[rows]
            residual[rows] = fit.residual[rows] + part @ step
            variance[rows] = 1.0 + np.einsum("ij,ij->i", part @ change, part @ axes)
        follow = factor**2 * size
        squares += float((factor**2).sum()) + len(mine) - p - float((follow**2).sum())
        whole += (axes * follow) @ axes.T
    squares += float((whole**2).sum())
    noise = fit.squares / fit.freedom
    total = float(variance.sum())
    # equations of a pose may share an error: as many are independent as there are poses
    shared = max(1.0, len(block) / (fit.clusters * len(np.unique(fit.component))))
    ratio = float(residual @ residual) / (total * noise)
    chance = f_tail(ratio, max(total**2 / squares / shared, 1.0), fit.freedom / shared)
    return LeftOut(residual, variance * noise, float(np.sqrt(ratio)), chance)


def residuals_left_out(fit: LinearFit, block: IntArray) -> FloatArray:
    """Residuals (M,) of `left_out` alone, quick where blocks are many and small."""
    residual = np.empty(len(block))
    for rows in alike(block, _TOGETHER):
        part, own = fit.design[rows], fit.residual[rows][:, :, None]
        wide = rows.shape[1] <= part.shape[2]
        turned = part if wide else part.transpose(0, 2, 1)
        size, axes = np.linalg.eigh(turned @ turned.transpose(0, 2, 1))
        known = _known(size)
        factor = np.where(known, 1.0 / np.where(known, 1.0 - size, 1.0), 0.0)[:, :, None]
        back = axes.transpose(0, 2, 1)
        if wide:
            found = axes @ (factor * (back @ own))
        else:
            change = np.where(known, factor[:, :, 0], -1.0 / np.where(known, 1.0, size))
            found = own + part @ (axes @ (change[:, :, None] * (back @ (turned @ own))))
        residual[rows] = found[:, :, 0]
    return residual


def _known(size: FloatArray) -> BoolArray:
    """Return combinations that the other blocks determine, by a block's squared singular values."""
    known: BoolArray = size < _OWN
    return known


def _normal(fit: LinearFit, mine: IntArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (p,) and vectors (p, p) of the normal matrix of some equations."""
    parts = (fit.design[mine[lot]] for lot in lots(len(mine)))
    size, axes = np.linalg.eigh(sum(part.T @ part for part in parts))
    return size, axes
