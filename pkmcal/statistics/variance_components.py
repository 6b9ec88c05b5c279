"""Variances of classes of equations that no one has stated, by restricted maximum likelihood.

The variances of lengths and angles, or of x, y and z, differ where nobody said so; which classes to
tell apart is decided by likelihood ratios (D. A. Harville, Maximum likelihood approaches to
variance component estimation and to related problems, Journal of the American Statistical
Association 72 (1977)). The covariance of the parameters allows for the variances being estimates,
and so do its degrees of freedom (M. G. Kenward and J. H. Roger, Small sample inference for fixed
effects from restricted maximum likelihood, Biometrics 53 (1997) 983-997).

statsmodels' mixed models have random effects, but no classes of residual variances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.statistics.distributions import chi2_limit, chi2_tail
from pkmcal.statistics.linear_fit import LinearFit

_LEAST_FREEDOM = 15.0  # degrees of freedom for each class that is told apart
_DIFFERENT = 0.10  # chance of the likelihood ratio below which classes are told apart
_NO_SLOPE = 0.3  # of a score test, above which the likelihoods of both are too much alike to look
_ROUNDS, _SETTLED, _STEP, _HALVINGS = 50, 1e-6, 1.0, 12  # of the logarithms of the variances
_SPENT = 1e-6  # share of the equations of a class that must be left
_TINY = 1e-8  # of the mean variance: least of a class, as of one that the fit meets exactly


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
        with np.errstate(divide="ignore", invalid="ignore"):  # 0 / 0 of what is held
            found: FloatArray = 2.0 * variance**2 / spread
        return found


def variance_components(
    fit: LinearFit, classes: IntArray, prior_residual: FloatArray
) -> VarianceComponents | None:
    """Estimate the variances of classes (M,); None where the fit meets one of them exactly.

    Parameters
    ----------
    fit : LinearFit
        The fit; its parameters follow the variances.
    classes : ndarray of int (M,)
        The class of each equation, from 0.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    """
    model = _Model(fit, classes, prior_residual)
    best = model.highest(fit.freedom)
    return None if best is None else _at_best(classes, best)


def _at_best(classes: IntArray, best: _Point) -> VarianceComponents | None:
    """The variances and what they imply; None where that is none."""
    theta, plain, slopes = best.theta, best.plain, best.slopes
    of_variances = np.asarray(np.linalg.inv(best.information), dtype=np.float64)
    excess = np.tensordot(np.diagonal(of_variances) / theta, slopes, 1)
    excess -= (slopes @ plain @ np.tensordot(of_variances, slopes, 1)).sum(axis=0)
    matrix = plain + 2.0 * plain @ excess @ plain
    if not (np.isfinite(matrix).all() and (np.diagonal(matrix) > 0).all()):
        return None
    return VarianceComponents(classes, theta, matrix, best.likelihood, plain, slopes, of_variances)


@dataclass(frozen=True, eq=False)
class _Point:
    """The restricted likelihood at variances theta, and its derivatives to their logarithms.

    `curvature` is less the second one, `by_logarithms` what is expected of it, `information` the
    same to the variances.
    """

    theta: FloatArray
    likelihood: float
    slope: FloatArray
    curvature: FloatArray
    information: FloatArray
    by_logarithms: FloatArray
    plain: FloatArray
    slopes: FloatArray


def _solved(matrix: FloatArray, slope: FloatArray) -> FloatArray:
    """Newton's step; the shortest where a class of nothing but zeros leaves a direction open."""
    try:
        step = np.linalg.solve(matrix, slope)
    except np.linalg.LinAlgError:
        step = np.linalg.lstsq(matrix, slope, rcond=None)[0]
    return np.asarray(step, dtype=np.float64)


class _Model:
    """The restricted likelihood of a fit whose classes of equations have their own variances."""

    def __init__(self, fit: LinearFit, classes: IntArray, prior_residual: FloatArray) -> None:
        self.classes = classes
        self.count = np.bincount(classes).astype(np.float64)
        p = fit.design.shape[1]
        self._inner, self._pulls = np.zeros((len(self.count), p, p)), np.zeros((len(self.count), p))
        for some in lots(len(classes)):
            design, residual, of = fit.design[some], fit.residual[some], classes[some]
            for c in range(len(self.count)):
                mine = of == c
                part = design[mine]
                self._inner[c] += part.T @ part
                self._pulls[c] += part.T @ residual[mine]
        self._prior, self._missed = fit.prior, prior_residual
        self._known, self._drawn = fit.prior.T @ fit.prior, fit.prior.T @ prior_residual
        self.square = np.bincount(classes, fit.residual**2)
        self.floor = _TINY * float(self.square.sum() / self.count.sum())

    def at(self, theta: FloatArray) -> _Point | None:
        """Evaluate at variances (c,); None where a class has no freedom left, or all are met."""
        if not (theta > 0.0).all():
            return None
        weighted = self._inner / theta[:, None, None]
        normal = weighted.sum(axis=0) + self._known
        plain = np.linalg.inv(normal)
        shift = plain @ (self._pulls.T @ (1.0 / theta) + self._drawn)
        moved = self._inner @ shift
        left = self.square - (2.0 * self._pulls - moved) @ shift
        slopes = weighted / theta[:, None, None]
        turned = (plain @ slopes).reshape(len(theta), -1)
        spent = slopes.reshape(len(theta), -1) @ plain.reshape(-1) * theta
        if (self.count - spent < _SPENT * self.count).any():
            return None
        crossed = turned.reshape(slopes.shape).transpose(0, 2, 1).reshape(len(theta), -1)
        information = 0.5 * turned @ crossed.T
        every = np.arange(len(theta))
        information[every, every] += 0.5 * (self.count - 2.0 * spent) / theta**2
        rest = self._missed - self._prior @ shift
        likelihood = -0.5 * (
            float(self.count @ np.log(theta))
            + float(np.linalg.slogdet(normal)[1])
            + float((left / theta).sum() + rest @ rest)
        )
        slope = 0.5 * (left / theta - (self.count - spent))
        pulled = (self._pulls - moved) / theta[:, None]
        by_logarithms = information * np.outer(theta, theta)
        curvature = -(pulled @ plain @ pulled.T) - by_logarithms
        curvature[every, every] += left / theta - slope
        return _Point(
            theta, likelihood, slope, curvature, information, by_logarithms, plain, slopes
        )

    def highest(self, freedom: float) -> _Point | None:
        """Maximise the likelihood from equal degrees of freedom on; None as `at`."""
        factor = len(self.classes) / max(freedom, 1.0)
        here = self.at(np.maximum(self.square / self.count * factor, self.floor))
        for _ in range(_ROUNDS):
            if here is None:
                return None
            # Newton's step of the logarithms, or Fisher's far from the top, halved until it climbs
            matrix = here.curvature
            if not np.linalg.eigvalsh(matrix)[0] > 0:
                matrix = here.by_logarithms
            step = np.clip(_solved(matrix, here.slope), -_STEP, _STEP)
            if np.abs(step).max() < _SETTLED:
                break
            further = None
            for _ in range(_HALVINGS):
                further = self.at(np.maximum(here.theta * np.exp(step), self.floor))
                if further is not None and further.likelihood >= here.likelihood:
                    break
                step, further = step / 2.0, None
            if further is None:
                break
            here = further
        return here

    def among(self, coarse: IntArray, theta: FloatArray) -> _Point | None:
        """Estimate variances theta of coarser classes (M,); None as `at`."""
        return self.at(theta[self._containing(coarse)])

    def score_chance(self, here: _Point, classes: IntArray, coarse: int) -> float:
        """Chance of a slope as steep if variances of so many coarse classes were right.

        Rao's score test of `classes` (M,), which are parts of the coarse ones and have those of the
        model as parts; `here` is where they are.
        """
        mine = np.eye(int(classes.max()) + 1)[self._containing(classes)]
        slope, information = here.slope @ mine, mine.T @ here.by_logarithms @ mine
        steep = float(slope @ np.linalg.solve(information, slope))
        return chi2_tail(max(steep, 0.0), mine.shape[1] - coarse)

    def _containing(self, coarse: IntArray) -> IntArray:
        """Return the coarse class (M,) of each class of the model."""
        found = np.empty(len(self.count), dtype=np.intp)
        found[self.classes] = coarse
        return found


def told_apart(
    fit: LinearFit, candidates: Sequence[IntArray], prior_residual: FloatArray
) -> VarianceComponents | None:
    """The finest classes that the residuals call for; None where the first will do.

    Parameters
    ----------
    fit : LinearFit
        The fit with the variances of the first classes.
    candidates : sequence of ndarray of int (M,)
        Classes, coarse ones first; each are parts of those before.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    """
    enough = fit.freedom / _LEAST_FREEDOM
    shown = [classes for classes in candidates[1:] if int(classes.max()) + 1 <= enough]
    if not shown:
        return None
    finest = _Model(fit, shown[-1], prior_residual)
    present = _Model(fit, candidates[0], prior_residual).highest(fit.freedom)
    if present is None:
        return None
    here, found = finest.among(candidates[0], present.theta), None
    for classes in shown:
        many, few = int(classes.max()) + 1, len(present.theta)
        if many <= few:
            continue
        if here is not None and finest.score_chance(here, classes, few) > _NO_SLOPE:
            continue
        own = finest if classes is shown[-1] else _Model(fit, classes, prior_residual)
        least = present.likelihood + 0.5 * chi2_limit(_DIFFERENT, many - few)
        other = own.highest(fit.freedom)
        if other is not None and other.likelihood > least:
            better = _at_best(classes, other)
            if better is not None:
                present, found = other, better
                here = finest.among(classes, present.theta)
    return found
