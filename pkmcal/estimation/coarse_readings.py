"""Components that were read in steps which matter beside the residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.statistics.covariance import Covariance
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.steps import deviation, smallest_gaps, step_of

DITHERED = 1.5  # times a step's deviation, from which residuals are noise that spreads the steps
_MATTERS = 0.6  # times the residuals, from which half a step in all rows is more than their mean's


@dataclass(frozen=True)
class Coarse:
    """A component that was read in steps, and what the fit shows of its noise.

    Attributes
    ----------
    set, component : int
        Which.
    step : float
        Of which all readings are multiples, mm or rad.
    residual, freedom : float
        Standard deviation of its residuals, and degrees of freedom of that.
    used : float
        Standard deviation that the covariance takes for it.
    """

    set: int
    component: int
    step: float
    residual: float
    freedom: float
    used: float

    @property
    def floor(self) -> float:
        """Standard deviation that rounding alone gives a reading."""
        return deviation(self.step)

    @property
    def widening(self) -> float:
        """Return the widening of ± that allows for rounding."""
        return max(self.floor / self.used, 1.0) if self.used > 0 else 1.0


def coarse_readings(
    equations: Equations,
    fit: LinearFit,
    factors: FloatArray,
    covariance: Covariance,
) -> tuple[Coarse, ...]:
    """Find them, for noise factors (G,); none of mixtures of readings and closures."""
    if equations.machines.unknowns:
        return ()
    component = component_of(equations)
    variances, retained = equations.whitening.variances(factors), 1.0 - fit.leverage()
    found = []
    for i, measured in enumerate(equations.table.sets):
        values = measured.values.reshape(len(measured), -1)
        gaps = smallest_gaps(values)
        for k, unit in enumerate(measured.units):
            mine = (equations.blocks.set_of == i) & (component == k)
            if not mine.any():
                continue
            weighted = float(variances[mine].mean())
            freedom = float(retained[mine].sum())
            squares = float((fit.residual[mine] ** 2 * variances[mine]).sum())
            residual = float(np.sqrt(squares / freedom)) if freedom > 0 else float("nan")
            used = covariance.scale * weighted**0.5
            used = residual if covariance.rule == "cluster" else used
            least = _least(residual, used)
            if gaps[k] < 0.5 * least:  # no step, and quicker than to look for one
                continue
            if step := step_of(values[:, k], unit, least=least):
                found.append(Coarse(i, k, step, residual, freedom, used))
    return tuple(found)


def component_of(equations: Equations) -> IntArray:
    """Number of the component of each equation (M,) in its set."""
    every = [np.tile(np.arange(len(m.components)), len(m)) for m in equations.table.sets]
    component: IntArray = np.concatenate(every)[equations.whitening.present]
    return component


def _least(*deviations: float) -> float:
    """The smallest step that matters beside the smaller of these deviations."""
    known = [each for each in deviations if np.isfinite(each)]
    return _MATTERS * min(known, default=0.0)
