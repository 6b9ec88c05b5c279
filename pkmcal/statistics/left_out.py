"""Residuals of blocks of equations that are left out, without fitting again.

Of a linear fit with hat matrix H the equations B, predicted by all others, are off by
(1 - H_BB)⁻¹ r_B. Combinations of parameters that (almost) only the block determines cannot be
predicted from the others; they are found from the block itself, as those of a session of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.singular_values import svd

_OWN = 0.99  # of what is known of a combination, from which it is the block's own


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
    """Leave each block out.

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
        turn, singular, rows = svd(fit.design[mine])
        kept = 1.0 - singular**2
        known = kept > 1.0 - _OWN
        factor = np.where(known, 1.0 / np.where(known, kept, 1.0), 0.0)
        own = fit.residual[mine]
        residual[mine] = own + turn @ ((factor - 1.0) * (turn.T @ own))
        variance[mine] = 1.0 + turn**2 @ (factor - 1.0)
        follow = rows.T @ ((factor * singular)[:, None] ** 2 * rows)
        squares += float((factor**2).sum()) + len(mine) - len(factor) - float((follow**2).sum())
        whole += follow
    squares += float((whole**2).sum())
    noise = fit.squares / fit.freedom
    total = float(variance.sum())
    # equations of a pose may share an error: as many are independent as there are poses
    shared = max(1.0, len(block) / (fit.clusters * len(np.unique(fit.component))))
    ratio = float(residual @ residual) / (total * noise)
    chance = f_tail(ratio, max(total**2 / squares / shared, 1.0), fit.freedom / shared)
    return LeftOut(residual, variance * noise, float(np.sqrt(ratio)), chance)
