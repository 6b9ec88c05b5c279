"""Covariance and degrees of freedom of fitted parameters, by the rule that the residuals call for.

Where nothing shows that equations of one pose share an error, the classical covariance holds, with
the residuals' own variance where no deviation is stated, and where a stated one is refuted: the
Birge ratio (R. T. Birge, The calculation of errors by the method of least squares, Physical Review
40 (1932)). Where they share one, or the loss is robust, the cluster sandwich holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.statistics.clusters import Sandwich, shared_error_score
from pkmcal.statistics.distributions import chi2_tail
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.prior_test import LEAST_FREEDOM, data_alone
from pkmcal.statistics.variance_components import VarianceComponents

CovarianceRule = Literal["auto", "classical", "cluster"]
RULES: tuple[CovarianceRule, ...] = ("auto", "classical", "cluster")

SHARED = 1.0  # score above which equations of a pose are taken to share an error
REFUTED = 0.10  # chance of the residuals below which stated deviations are scaled


@dataclass(frozen=True, eq=False)
class Covariance:
    """The covariance of a fit.

    Attributes
    ----------
    fit : LinearFit
        Of which.
    rule : {"classical", "cluster"}
        How it was computed.
    score : float
        `shared_error_score`.
    scale : float
        Factor on the stated deviations, or 1; where none are stated, deviation of the residuals.
    scale_freedom : float
        Degrees of freedom of `scale`; inf where it is stated.
    components : VarianceComponents or None
        Of classes of equations whose variances were estimated apart.
    widening : float
        By how much deviations are wider than all that: readings in coarse steps show too little.
    """

    fit: LinearFit
    rule: Literal["classical", "cluster"]
    score: float
    scale: float
    scale_freedom: float
    components: VarianceComponents | None = None
    widening: float = 1.0

    @cached_property
    def sandwich(self) -> Sandwich:
        """The cluster sandwich, also where the rule is another."""
        return Sandwich(self.fit)

    @cached_property
    def by_cluster(self) -> FloatArray:
        """Covariance (p, p) in the basis by the sandwich, as far as the data's errors make it."""
        return self.widening**2 * self.sandwich.data

    @cached_property
    def _data(self) -> FloatArray:
        """Covariance (p, p) in the basis as far as the data's errors make it."""
        if self.rule == "cluster":
            return self.by_cluster
        if self.components is not None:
            return self.widening**2 * (self.components.covariance - self._prior)
        return (self.widening * self.scale) ** 2 * (np.eye(self.fit.design.shape[1]) - self._prior)

    @cached_property
    def _prior(self) -> FloatArray:
        """Return the matrix with the prior's part of it."""
        known: FloatArray = self.fit.prior.T @ self.fit.prior
        return known

    def of(self, contrasts: FloatArray) -> FloatArray:
        """Covariance (k, k) of contrasts (k, p)."""
        found: FloatArray = contrasts @ (self._data + self._prior) @ contrasts.T
        return found

    def freedom(self, contrasts: FloatArray) -> FloatArray:
        """Degrees of freedom (k,) of the variances in `of`; 0 where there are none.

        The prior's part is known: where it is most of the variance they are many.
        """
        if self.rule == "cluster":
            own = self.sandwich.freedom(contrasts)
        elif self.components is not None:
            own = self.components.freedom(contrasts)
        else:
            own = np.full(len(contrasts), max(self.scale_freedom, 0.0))
        data = np.einsum("ij,jk,ik->i", contrasts, self._data, contrasts)
        prior = ((contrasts @ self.fit.prior.T) ** 2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(prior > 0, (1.0 + prior / data) ** 2, 1.0)
            mixed = own * factor
        found: FloatArray = np.where(data > 0, mixed, np.where(prior > 0, np.inf, own))
        return found


def covariance(
    fit: LinearFit,
    rule: CovarianceRule,
    *,
    stated: bool,
    robust: bool,
    components: VarianceComponents | None = None,
) -> Covariance:
    """Choose the rule and its scale.

    Parameters
    ----------
    fit : LinearFit
        What was fitted.
    rule : {"auto", "classical", "cluster"}
        "auto": see the module.
    stated : bool
        Whether all deviations are stated.
    robust : bool
        Whether the residuals are pseudo-residuals of a robust loss.
    components : VarianceComponents, optional
        Of classes of equations, for the classical covariance.
    """
    score, (squares, freedom) = shared_error_score(fit), spare(fit, robust)
    scale, of_scale = 1.0, np.inf
    if not stated or robust or chi2_tail(squares, freedom) < REFUTED:
        of_scale = max(freedom, 0.0)
        scale = float(np.sqrt(squares / freedom)) if freedom > 0 else float("nan")
    chosen: Literal["classical", "cluster"] = "classical"
    if rule == "cluster" or (rule == "auto" and (robust or score > SHARED)):
        chosen = "cluster"
    return Covariance(fit, chosen, score, scale, of_scale, components)


def spare(fit: LinearFit, robust: bool = False) -> tuple[float, float]:
    """Sum of squares that shows the noise, and its degrees of freedom.

    With a prior that of the data alone: a prior that they contradict is no noise.
    """
    if len(fit.prior) and not robust:
        squares, freedom = data_alone(fit.design, fit.residual)
        if freedom >= LEAST_FREEDOM:
            return squares, freedom
    return fit.squares, fit.freedom
