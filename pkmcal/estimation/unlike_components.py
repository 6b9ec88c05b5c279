"""Components of readings whose variances are unlike though nobody stated it."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.coarse_readings import component_of
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.linear_model import prior_residual
from pkmcal.estimation.row_blocks import component_classes
from pkmcal.statistics.clusters import shared_error_score
from pkmcal.statistics.covariance import SHARED
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.variance_components import told_apart


def unlike_components(
    estimator: Estimator, estimate: Estimate, fit: LinearFit
) -> tuple[IntArray, list[FloatArray]] | None:
    """Test sets without sigma for components of unlike variance.

    Tried in turn as `component_classes` says.

    Returns
    -------
    classes : ndarray of int (M,)
        Of the equations.
    deviations : list of ndarray (k,)
        Relative deviation of each component of each set.

    None where nothing speaks for it; where sigma is stated; for robust losses; where rows of a pose
    share errors, which are the model's more than the instrument's and no ground for weights; and
    where equations are mixtures.
    """
    equations = estimator.equations
    several = any(len(m.components) > 1 for m in equations.table.sets)
    if equations.machines.unknowns:
        return None
    if estimator.loss != "linear" or not estimator.unstated.all() or not several:
        return None
    if shared_error_score(fit) > SHARED:
        return None
    blocks, place = equations.blocks, component_of(equations)
    found = told_apart(fit, component_classes(blocks, place), prior_residual(estimator, estimate))
    if found is None:
        return None
    deviations = [np.ones(len(m.components)) for m in equations.table.sets]
    of_equation = np.sqrt(found.variances)[found.classes]
    for i, k, deviation in zip(blocks.set_of, place, of_equation, strict=True):
        deviations[i][k] = deviation
    return found.classes, deviations
