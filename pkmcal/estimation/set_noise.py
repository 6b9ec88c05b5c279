"""Check whether sets of measurements have the noise that was stated for each of them.

A common slip is a matter of scale; sets that slipped apart are weighted wrongly against each other,
and the classical covariance, which trusts the weights, is then wrong too.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.solving import FEW
from pkmcal.statistics.distributions import chi2_tail
from pkmcal.statistics.robust_scale import median_ratio

_CHANCE = 0.01  # of residuals as far from what was stated, on either side
_APART = 1.2  # ratio of deviations from which it matters


def slipped(estimator: Estimator, estimate: Estimate) -> FloatArray:
    """Deviation of the residuals of each set in units of its stated sigma; 1 where that holds.

    1 where fewer than `FEW` degrees of freedom show it. All 1 where sigma is nowhere stated, where
    all sets slipped alike, for robust losses, and where equations are mixtures of readings.
    """
    equations = estimator.equations
    ratios = np.ones(len(equations.table.sets))
    if len(ratios) == 1 or equations.machines.unknowns or estimator.loss != "linear":
        return ratios
    squares, freedom = (part[: len(ratios)] for part in estimate.shares[:2])
    unstated = estimator.unstated[: len(ratios)]
    common = 1.0 if unstated.any() else float(squares.sum() / max(freedom.sum(), 1e-9))
    if not common > 0.0:
        return ratios  # no residual at all
    rows, set_of = equations.blocks.squares(estimate.residual), equations.table.set_of
    for i in np.flatnonzero(~unstated & (freedom >= FEW)):
        above = chi2_tail(float(squares[i]) / common, float(freedom[i]))
        components = equations.blocks.components[set_of == i]
        median = median_ratio(rows[set_of == i], components) * components.sum() / freedom[i]
        half = float(np.sqrt(median / common))  # of the rows: outliers are no slip
        if min(above, 1.0 - above) < _CHANCE / 2.0 and apart(half):
            ratios[i] = np.sqrt(squares[i] / freedom[i])
    return ratios if ratios.max() > _APART * ratios.min() else np.ones_like(ratios)


def apart(ratio: float) -> bool:
    """Return the ratio of deviations where it matters; 0 where a set has no residual at all."""
    return ratio > _APART or ratio * _APART < 1.0
