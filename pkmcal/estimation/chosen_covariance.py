"""The covariance of a fit by the rule that its residuals call for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.coarse_readings import component_of
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.row_blocks import RowBlocks, component_classes
from pkmcal.statistics.covariance import Covariance, CovarianceRule, covariance
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.variance_components import told_apart, variance_components


def chosen_covariance(
    estimator: Estimator,
    fit: LinearFit,
    rule: CovarianceRule,
    beyond: FloatArray,
    slips: FloatArray,
    classes: IntArray | None = None,
) -> Covariance:
    """Choose the covariance of a linear model, by the rule that was asked for.

    `beyond` (q,) are the residuals of the prior's rows, `slips` those of `slipped`. `classes` (M,)
    are those of equations whose variances were estimated apart: see `unlike_components`.
    """
    equations, blocks = estimator.equations, estimator.equations.blocks
    mixed, stated = bool(equations.machines.unknowns), not estimator.unstated.any()
    if rule == "auto" and mixed and fit.clusters < len(blocks.components):
        rule = "cluster"  # no two mixtures can be compared to see whether they share an error
    if rule == "auto" and (slips != 1.0).any():
        rule = "cluster"  # which holds whatever the weights
    found = covariance(
        fit,
        rule,
        stated=stated,
        robust=estimator.loss != "linear",
        components=None if classes is None else variance_components(fit, classes, beyond),
    )
    if mixed or rule != "auto" or found.rule == "cluster":
        return found
    refuted = stated and np.isfinite(found.scale_freedom)
    if refuted and own_deviations(fit, beyond, blocks, component_of(equations)) is not None:
        return replace(found, rule="cluster")  # sigma is wrong of some components alone
    return found


def own_deviations(
    fit: LinearFit, beyond: FloatArray, blocks: RowBlocks, place: IntArray
) -> FloatArray | None:
    """Return deviations (M,) of components that differ from those that they have; else None.

    `beyond` are the residuals of the prior's rows.
    """
    if not blocks.component.any():
        return None  # a single component
    found = told_apart(fit, component_classes(blocks, place), beyond)
    return None if found is None else np.sqrt(found.variances)[found.classes]
