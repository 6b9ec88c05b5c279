"""The linear model at an estimate: whitened equations in the basis of what is determined."""

from __future__ import annotations

from dataclasses import replace

from pkmcal.arrays import FloatArray
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.loss import decline, limits
from pkmcal.statistics.linear_fit import LinearFit, in_unit_basis, unit_basis
from pkmcal.statistics.pseudo_residuals import pseudo_residuals


def solved(estimator: Estimator, estimate: Estimate) -> LinearFit:
    """The linear model at an estimate."""
    blocks, state = estimator.equations.blocks, estimate.state
    residual = estimate.residual
    if estimator.loss != "linear":
        limit = limits(state.loss, blocks.stands_for, state.width)
        residual, _, _ = pseudo_residuals(
            residual,
            blocks.components,
            estimate.weights,
            decline(state.loss, residual, blocks.components, limit),
            state.determined.rank,
        )
    back, design = estimate.half, estimate.design[:, : state.determined.rank]
    if estimator.loss != "linear":  # equations count alike, their residuals are other ones
        back = unit_basis(estimate.triangle, estimate.prior, state.determined.identifiable)
        design = estimate.change(back)
    fit = in_unit_basis(design, residual, estimate.prior, back, blocks.pose, blocks.component)
    return replace(fit, exact=estimate.exact_freedom)


def prior_residual(estimator: Estimator, estimate: Estimate) -> FloatArray:
    """Residuals (q,) of the prior's rows."""
    return estimator.equations.parameters.prior_left(estimate.evaluation.theta)
