"""Noises of groups that equations of a cluster share, by restricted maximum likelihood.

The covariance of the equations of a cluster is known up to a variance θ_g of each group. These are
where the squares of each group are as many as its degrees of freedom (Fisher's scoring of the
restricted likelihood; D. A. Harville, Maximum likelihood approaches to variance component
estimation and to related problems, Journal of the American Statistical Association 72 (1977)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.linear_fit import LinearFit, solved_again
from pkmcal.statistics.weighed import Weighed, multiplied

_ROUNDS, _SETTLED, _STEP = 40, 1e-3, 1.5  # of the logarithms of the variances
_LEAST, _MOST = 1e-8, 1e8  # of a variance, in units of the stated one
_ROUNDING = 1e-9  # share of the largest singular value of what is told, below which one is zero


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters with equally many equations.

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


def weighed_by(
    fit: LinearFit, prior_residual: FloatArray, clusters: Sequence[Clusters], theta: FloatArray
) -> Weighed:
    """Solve the fit with these variances (G,) of the groups.

    Parameters of which the clusters do not tell everything, as where outliers are left out, move
    along the combinations that they tell.
    """
    halves = tuple((each.left, each.halves(theta)) for each in clusters)
    design = multiplied(fit.design, halves)
    residual = multiplied(fit.residual[:, None], halves)[:, 0]
    normal = design.T @ design + fit.prior.T @ fit.prior
    found = solved_again(fit, design, residual, prior_residual, _whitening(normal))[0]
    return Weighed(found, halves=halves)


def _whitening(normal: FloatArray) -> FloatArray:
    """Combinations (p, r) in which a normal matrix (p, p) of rank r is the identity."""
    try:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(normal)).T)
    except np.linalg.LinAlgError:
        values, ways = np.linalg.eigh(normal)
        told = values > _ROUNDING * values.max(initial=0.0)
        return np.asarray(ways[:, told] / np.sqrt(values[told]))


def variances(
    fit: LinearFit, prior_residual: FloatArray, clusters: Sequence[Clusters]
) -> FloatArray:
    """The variances (G,) of groups, in units of those by which they are whitened."""
    places = np.concatenate([each.left.ravel() for each in clusters])
    named = np.empty(len(fit.residual), dtype=np.intp)
    named[places] = np.arange(len(places))
    clusters = [replace(each, left=named[each.left]) for each in clusters]
    fit = replace(
        fit,
        design=fit.design[places],
        residual=fit.residual[places],
        cluster=fit.cluster[places],
        component=fit.component[places],
    )
    groups = len(clusters[0].parts)
    present = np.array([any(each.parts[g].any() for each in clusters) for g in range(groups)])
    theta = np.ones(groups)
    for _ in range(_ROUNDS):
        squares, freedom, information = _shares(
            weighed_by(fit, prior_residual, clusters, theta).fit, clusters, theta
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
    fit: LinearFit, clusters: Sequence[Clusters], theta: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`pose_system.Shares` of a fit with these variances of the groups."""
    groups, p = len(theta), fit.design.shape[1]
    squares, freedom, information = np.zeros(groups), np.zeros(groups), np.zeros((groups, groups))
    inner = np.zeros((groups, p, p))
    for each in clusters:
        half, every = each.halves(theta), each.left.ravel()
        design, residual = fit.design[each.left], fit.residual[each.left][:, :, None]
        part = half @ (theta[:, None, None, None] * each.parts) @ half.transpose(0, 2, 1)
        taken = part @ design
        squares += (residual * (part @ residual)).sum(axis=(1, 2, 3))
        freedom += np.trace(part, axis1=2, axis2=3).sum(axis=1)
        inner += fit.design[every].T @ taken.reshape(groups, len(every), p)
        flat, along = part.reshape(groups, -1), taken.reshape(groups, -1)
        information += flat @ flat.T - 2.0 * along @ along.T
    freedom -= np.trace(inner, axis1=1, axis2=2)
    information += inner.reshape(groups, -1) @ inner.transpose(0, 2, 1).reshape(groups, -1).T
    return squares, freedom, information
