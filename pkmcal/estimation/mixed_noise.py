"""Noises of groups whose equations are mixed with each other, by restricted maximum likelihood.

Where poses have unknowns, an equation that is left of a pose mixes readings and actuators. If one
of their deviations is stated wrongly, the equations of a pose are neither equally uncertain nor
independent of each other, and tests that take them to be so find what is not there. The covariance
of what is left of a pose is known up to a variance of each group,

    Σ_g θ_g Q₂gᵀ Q₂g,

with the rows Q₂g of Q₂ (`elimination`) that are of a group. The variances θ are those where the
squares of each group are as many as its degrees of freedom (Fisher's scoring of the restricted
likelihood; D. A. Harville, Maximum likelihood approaches to variance component estimation and to
related problems, Journal of the American Statistical Association 72 (1977)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.pose_system import PoseSystem
from pkmcal.statistics.linear_fit import LinearFit, solved_again

_ROUNDS, _SETTLED, _STEP = 40, 1e-3, 1.5  # of the logarithms of the variances
_LEAST, _MOST = 1e-8, 1e8  # of a variance, in units of the stated one
_ROUNDING = 1e-9  # share of the largest singular value of what is told, below which one is zero
_POSES = 2000  # that tell the variances


@dataclass(frozen=True, eq=False)
class _Alike:
    """Poses with equally many equations left.

    Attributes
    ----------
    left : ndarray of int (n, m)
        Their equations.
    parts : ndarray (G, n, m, m)
        Share of each group in their covariance.
    """

    left: IntArray
    parts: FloatArray

    def halves(self, theta: FloatArray) -> FloatArray:
        """Matrices (n, m, m) that make the noise of these variances (G,) one."""
        halves: FloatArray = np.linalg.inv(np.linalg.cholesky(np.tensordot(theta, self.parts, 1)))
        return halves


def of_own_noises(
    fit: LinearFit,
    prior_residual: FloatArray,
    system: PoseSystem,
    evaluation: Evaluation,
    factors: FloatArray,
    use: BoolArray,
) -> LinearFit:
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
    poses = [_Alike(*each) for each in system.parts_of_groups(evaluation, factors)]
    every = max(1, -(-sum(len(each.left) for each in poses) // _POSES))
    some = [_some(each, use, every) for each in poses]
    theta = _variances(fit, prior_residual, [each for each in some if len(each.left)])
    return _solved(fit, prior_residual, poses, theta)


def _some(alike: _Alike, use: BoolArray, every: int) -> _Alike:
    """Return each so manieth of the poses whose equations are used."""
    chosen = np.flatnonzero(use[alike.left].all(axis=1))[::every]
    return _Alike(alike.left[chosen], alike.parts[:, chosen])


def _solved(
    fit: LinearFit, prior_residual: FloatArray, poses: Sequence[_Alike], theta: FloatArray
) -> LinearFit:
    """Solve the fit with these variances (G,) of the groups."""
    design, residual = fit.design.copy(), fit.residual.copy()
    for alike in poses:
        half = alike.halves(theta)
        design[alike.left] = half @ design[alike.left]
        residual[alike.left] = (half @ residual[alike.left][:, :, None])[:, :, 0]
    normal = design.T @ design + fit.prior.T @ fit.prior
    back = np.linalg.inv(np.linalg.cholesky(normal)).T
    return solved_again(fit, design, residual, prior_residual, back)[0]


def _variances(fit: LinearFit, prior_residual: FloatArray, poses: Sequence[_Alike]) -> FloatArray:
    """The variances (G,) of groups, in units of those by which they are whitened."""
    places = np.concatenate([alike.left.ravel() for alike in poses])
    named = np.empty(len(fit.residual), dtype=np.intp)
    named[places] = np.arange(len(places))
    poses = [replace(alike, left=named[alike.left]) for alike in poses]
    fit = replace(
        fit,
        design=fit.design[places],
        residual=fit.residual[places],
        cluster=fit.cluster[places],
        component=fit.component[places],
    )
    groups = len(poses[0].parts)
    present = np.array([any(alike.parts[g].any() for alike in poses) for g in range(groups)])
    theta = np.ones(groups)
    for _ in range(_ROUNDS):
        squares, freedom, information = _shares(
            _solved(fit, prior_residual, poses, theta), poses, theta
        )
        own = np.ix_(present, present)
        step = np.zeros(groups)
        slope = (squares - freedom)[present]
        step[present] = np.linalg.lstsq(information[own], slope, rcond=_ROUNDING)[0]
        after = np.clip(theta * np.exp(np.clip(step, -_STEP, _STEP)), _LEAST, _MOST)
        settled = np.abs(np.log(after / theta)).max() < _SETTLED
        theta = after
        if settled:
            break
    return theta


def _shares(
    fit: LinearFit, poses: Sequence[_Alike], theta: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`elimination.Shares` of a fit with these variances of the groups."""
    groups, p = len(theta), fit.design.shape[1]
    squares, freedom, information = np.zeros(groups), np.zeros(groups), np.zeros((groups, groups))
    inner = np.zeros((groups, p, p))
    for alike in poses:
        half, every = alike.halves(theta), alike.left.ravel()
        design, residual = fit.design[alike.left], fit.residual[alike.left][:, :, None]
        part = half @ (theta[:, None, None, None] * alike.parts) @ half.transpose(0, 2, 1)
        taken = part @ design
        squares += (residual * (part @ residual)).sum(axis=(1, 2, 3))
        freedom += np.trace(part, axis1=2, axis2=3).sum(axis=1)
        inner += fit.design[every].T @ taken.reshape(groups, len(every), p)
        flat, along = part.reshape(groups, -1), taken.reshape(groups, -1)
        information += flat @ flat.T - 2.0 * along @ along.T
    freedom -= np.trace(inner, axis1=1, axis2=2)
    information += inner.reshape(groups, -1) @ inner.transpose(0, 2, 1).reshape(groups, -1).T
    return squares, freedom, information
