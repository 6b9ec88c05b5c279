"""Variances of classes of equations that no one has stated, by restricted maximum likelihood.

The variances of lengths and angles, or of x, y and z, differ where nobody said so; which classes to
tell apart is decided by likelihood ratios (D. A. Harville, Maximum likelihood approaches to
variance component estimation and to related problems, Journal of the American Statistical
Association 72 (1977)). The covariance of the parameters allows for the variances being estimates,
and so do its degrees of freedom (M. G. Kenward and J. H. Roger, Small sample inference for fixed
effects from restricted maximum likelihood, Biometrics 53 (1997)).

statsmodels' mixed models have random effects, but no classes of residual variances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import chi2_tail
from pkmcal.statistics.linear_fit import LinearFit

_LEAST_FREEDOM = 15.0  # degrees of freedom for each class that is told apart
_DIFFERENT = 0.01  # chance of the likelihood ratio below which classes are told apart
_ROUNDS, _SETTLED, _STEP = 50, 1e-6, 1.0  # of the logarithms of the variances
_TINY = 1e-18  # of the mean variance: a class that the fit meets exactly


@dataclass(frozen=True, eq=False)
class VarianceComponents:
    """Variances of classes of equations, and the covariance of the parameters that they imply.

    Attributes
    ----------
    classes : ndarray of int (M,)
        The class of each equation, from 0.
    variances : ndarray (c,)
        Of each class; equations are weighted by them.
    covariance : ndarray (p, p)
        Of the parameters in the basis of the fit.
    likelihood : float
        Logarithm of the restricted likelihood, up to a constant.
    """

    classes: IntArray
    variances: FloatArray
    covariance: FloatArray
    likelihood: float
    _plain: FloatArray
    _slopes: FloatArray
    _of_variances: FloatArray

    def freedom(self, contrasts: FloatArray) -> FloatArray:
        """Degrees of freedom (k,) of the variances of contrasts (k, p)."""
        along = contrasts @ self._plain
        variance = np.einsum("ki,ki->k", along, contrasts)
        slopes = np.einsum("ki,cij,kj->kc", along, self._slopes, along)
        spread = np.einsum("ka,ab,kb->k", slopes, self._of_variances, slopes)
        with np.errstate(divide="ignore"):
            found: FloatArray = 2.0 * variance**2 / spread
        return found


def variance_components(
    fit: LinearFit, classes: IntArray, prior_residual: FloatArray
) -> VarianceComponents | None:
    """Estimate the variances of classes (M,); None where that does not settle.

    Parameters
    ----------
    fit : LinearFit
        The fit; its parameters follow the variances.
    classes : ndarray of int (M,)
        The class of each equation, from 0.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    """
    count = np.bincount(classes).astype(np.float64)
    k = len(count)
    inner = np.array([fit.design[classes == c].T @ fit.design[classes == c] for c in range(k)])
    pulls = np.array([fit.design[classes == c].T @ fit.residual[classes == c] for c in range(k)])
    of_prior, pull = fit.prior.T @ fit.prior, fit.prior.T @ prior_residual
    square = np.bincount(classes, fit.residual**2)
    floor = _TINY * square.sum() / count.sum()
    theta = np.maximum(square / count, floor)
    for _ in range(_ROUNDS):
        normal = np.tensordot(1.0 / theta, inner, 1) + of_prior
        plain = np.linalg.inv(normal)
        shift = plain @ (pulls.T @ (1.0 / theta) + pull)
        left = square - 2.0 * pulls @ shift + (inner @ shift) @ shift
        slopes = inner / theta[:, None, None] ** 2
        turned = plain @ slopes
        spent = np.trace(turned, axis1=1, axis2=2) * theta
        if (count - spent < 1e-6 * count).any():
            return None
        information = 0.5 * np.tensordot(turned, turned, ((1, 2), (2, 1)))
        information[np.arange(k), np.arange(k)] += 0.5 * (count - 2.0 * spent) / theta**2
        # Fisher scoring of the logarithms
        slope = 0.5 * (left / theta - (count - spent))
        step = np.linalg.solve(information * np.outer(theta, theta), slope)
        theta = np.maximum(theta * np.exp(np.clip(step, -_STEP, _STEP)), floor)
        if np.abs(step).max() < _SETTLED:
            break
    of_variances = np.asarray(np.linalg.inv(information), dtype=np.float64)
    excess = np.einsum("c,cij->ij", np.diagonal(of_variances) / theta, slopes)
    excess -= np.einsum("ab,aij,jk,bkl->il", of_variances, slopes, plain, slopes, optimize=True)
    rest = prior_residual - fit.prior @ shift
    likelihood = -0.5 * (
        float(count @ np.log(theta))
        + float(np.linalg.slogdet(normal)[1])
        + float((left / theta).sum() + rest @ rest)
    )
    matrix = plain + 2.0 * plain @ excess @ plain
    if not (np.isfinite(matrix).all() and (np.diagonal(matrix) > 0).all()):
        return None
    return VarianceComponents(classes, theta, matrix, likelihood, plain, slopes, of_variances)


def told_apart(
    fit: LinearFit, candidates: Sequence[IntArray], prior_residual: FloatArray
) -> VarianceComponents | None:
    """The finest classes that the residuals call for; None where the first will do.

    Parameters
    ----------
    fit : LinearFit
        The fit with the variances of the first classes.
    candidates : sequence of ndarray of int (M,)
        Classes, coarse ones first.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    """
    present = variance_components(fit, candidates[0], prior_residual)
    found = None
    for classes in candidates[1:]:
        many = int(classes.max()) + 1
        if present is None or fit.freedom < _LEAST_FREEDOM * many:
            continue
        other = variance_components(fit, classes, prior_residual)
        more = many - len(present.variances)
        if other is None or more <= 0:
            continue
        gained = 2.0 * (other.likelihood - present.likelihood)
        if chi2_tail(gained, more) < _DIFFERENT:
            present = found = other
    return found
