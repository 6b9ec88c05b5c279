"""Noises of groups whose equations are mixed with each other.

Where poses have unknowns, an equation that is left of a pose mixes readings and actuators. If one
of their deviations is stated wrongly, the equations of a pose are neither equally uncertain nor
independent of each other, and tests that take them to be so find what is not there. The covariance
of what is left of a pose is known up to a variance of each group,

    Σ_g θ_g Q₂gᵀ Q₂g,

with the rows Q₂g of Q₂ (`pose_system`) that are of a group.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.pose_system import PoseSystem
from pkmcal.statistics.cluster_noise import Clusters, variances, weighed_by
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.weighed import Weighed

_POSES = 2000  # that tell the variances


def of_own_noises(
    fit: LinearFit,
    prior_residual: FloatArray,
    system: PoseSystem,
    evaluation: Evaluation,
    factors: FloatArray,
    use: BoolArray,
) -> Weighed:
    """Solve a fit of mixtures again, each group in units of its own deviation.

    Parameters
    ----------
    fit : LinearFit
        The fit, with the noise as stated or as it was estimated.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    system, evaluation, factors
        The equations, where they were solved, and the `noise` (G,) by which they are whitened.
    use : ndarray of bool (M,)
        Equations that tell the noise: outliers do not.
    """
    poses = [Clusters(*each) for each in system.parts_of_groups(evaluation, factors)]
    every = max(1, -(-sum(len(each.left) for each in poses) // _POSES))
    some = [_without_idle(fit, _some(each, use, every)) for each in poses]
    theta = variances(fit, prior_residual, [each for each in some if each.left.size])
    return weighed_by(fit, prior_residual, poses, theta)


def _some(alike: Clusters, use: BoolArray, every: int) -> Clusters:
    """Return each so manieth of the poses whose equations are used."""
    chosen = np.flatnonzero(use[alike.left].all(axis=1))[::every]
    return Clusters(alike.left[chosen], alike.parts[:, chosen])


def _without_idle(fit: LinearFit, alike: Clusters) -> Clusters:
    """The poses without equations that are 0 in each of them: what was read as exactly 0 and is.

    Of other components read by the same instrument they would say that these have no noise.
    """
    moving = (fit.residual[alike.left] != 0.0) | (fit.design[alike.left] != 0.0).any(axis=2)
    kept = np.flatnonzero(moving.any(axis=0))
    return Clusters(alike.left[:, kept], alike.parts[:, :, kept][:, :, :, kept])
