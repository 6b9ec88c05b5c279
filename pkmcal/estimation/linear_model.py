"""The linear model at an estimate: whitened equations in the basis of what is determined."""

from __future__ import annotations

from dataclasses import replace

from pkmcal.arrays import FloatArray
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.labels import Labels, labels
from pkmcal.statistics.linear_fit import LinearFit, in_unit_basis, unit_basis
from pkmcal.statistics.pseudo_residuals import pseudo_residuals

LinearModel = tuple[Labels, LinearFit]  # what equations belong to, and the fit as a linear one


def solved(estimator: Estimator, estimate: Estimate) -> LinearModel:
    """The linear model at an estimate."""
    named, state = labels(estimator.equations), estimate.state
    residual = estimate.residual
    if estimator.loss != "linear":
        residual, _, _ = pseudo_residuals(
            residual,
            estimator.equations.blocks.components,
            estimate.weights,
            state.loss.decline(residual),
            state.determined.rank,
        )
    back, design = estimate.half, estimate.design[:, : state.determined.rank]
    if estimator.loss != "linear":  # equations count alike, their residuals are other ones
        back = unit_basis(estimate.triangle, estimate.prior, state.determined.identifiable)
        design = estimate.change(back)
    fit = in_unit_basis(design, residual, estimate.prior, back, named.pose, named.component)
    return named, replace(fit, exact=estimate.exact_freedom)


def prior_residual(estimator: Estimator, estimate: Estimate) -> FloatArray:
    """Residuals (q,) of the prior's rows."""
    return estimator.equations.parameters.prior_left(estimate.evaluation.theta)
