"""Errors that the equations of a cluster share: a test for them, and a covariance that allows them.

The covariance is the cluster sandwich with residuals adjusted for their leverage (CR2) and its
degrees of freedom are Satterthwaite's under equal independent errors, parameter by parameter:
R. M. Bell and D. F. McCaffrey, Bias reduction in standard errors for linear regression with
multi-stage samples, Survey Methodology 28 (2002), no. 2; G. W. Imbens and M. Kolesár, Robust
standard errors in small samples: some practical advice, Review of Economics and Statistics 98
(2016); J. E. Pustejovsky and E. Tipton, Small-sample methods for cluster-robust variance estimation
and hypothesis testing in fixed effects models, Journal of Business and Economic Statistics 36
(2018), doi:10.1080/07350015.2016.1247004.

statsmodels has CR1 and CR3, neither CR2 nor its degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.linear_fit import LinearFit, sums

_SPENT = 1e-8  # share of a residual's variance below which the fit follows it wherever it lies


def shared_error_score(fit: LinearFit) -> float:
    """Score test for an error that equations of one cluster and component share.

    About standard normal where errors are independent; -inf where no two equations could share
    one, or the fit has used up what they could show.
    """
    counts = np.bincount(fit.key).astype(np.float64)
    freedom = fit.freedom
    if counts.max() < 2 or freedom <= 0:
        return float("-inf")
    z = sums(fit.design, fit.key)
    inner = z.T @ z
    mean = len(fit.residual) - np.trace(inner)
    second = (counts**2).sum() - 2.0 * (counts @ (z**2).sum(axis=1)) + (inner**2).sum()
    spread = 2.0 * (second - mean**2 / freedom) * freedom / (freedom + 2.0)
    variance = fit.squares / freedom
    if spread <= _SPENT * second or variance <= 0:
        return float("-inf")
    together = float((sums(fit.residual, fit.key) ** 2).sum())
    return float((together / variance - mean) / np.sqrt(spread))


@dataclass(frozen=True, eq=False)
class Sandwich:
    """The cluster sandwich of a fit, adjusted for leverage."""

    fit: LinearFit

    @cached_property
    def _blocks(self) -> list[tuple[IntArray, FloatArray, FloatArray]]:
        """Rows (g, m) of clusters of the same size, what adjusts and what is retained of them."""
        order = np.argsort(self.fit.cluster, kind="stable")
        sizes = np.bincount(self.fit.cluster)
        first = np.cumsum(sizes) - sizes
        blocks = []
        for size in np.unique(sizes):
            rows = order[first[sizes == size, None] + np.arange(size)]
            part = self.fit.design[rows]
            wide = size <= part.shape[2]
            inner = part @ part.transpose(0, 2, 1) if wide else part.transpose(0, 2, 1) @ part
            values, vectors = np.linalg.eigh(inner)
            left = 1.0 - values > _SPENT
            root = np.where(left, np.sqrt(np.maximum(1.0 - values, 0.0)), 1.0)
            if wide:  # (1 - H)^(-1/2) itself
                factor, spent = np.where(left, 1.0 / root, 0.0), vectors
            else:  # 1 + A W Aᵀ, by the smaller AᵀA
                factor, spent = np.where(left, 1.0 / (root * (1.0 + root)), -1.0), part @ vectors
            matrix = (vectors * factor[:, None, :]) @ vectors.transpose(0, 2, 1)
            blocks.append((rows, matrix, 1.0 - (spent**2 @ ~left[:, :, None])[:, :, 0]))
        return blocks

    def adjusted(self, values: FloatArray) -> FloatArray:
        """Multiply the part of each cluster by (1 - H)^(-1/2): values (M, k).

        H is the cluster's block of the hat matrix. Residuals then have the variance of the errors.
        """
        out = np.empty_like(values)
        for rows, matrix, _ in self._blocks:
            mine = values[rows]
            if rows.shape[1] <= self.fit.design.shape[1]:
                out[rows] = matrix @ mine
            else:
                part = self.fit.design[rows]
                out[rows] = mine + part @ (matrix @ (part.transpose(0, 2, 1) @ mine))
        return out

    @cached_property
    def residual(self) -> FloatArray:
        """Adjusted residuals (M,)."""
        return self.adjusted(self.fit.residual[:, None])[:, 0]

    @cached_property
    def retained(self) -> FloatArray:
        """Variance of each adjusted residual (M,), in that of its error.

        1, or less where the fit has used up what the cluster could show.
        """
        kept = np.empty(len(self.fit.residual))
        for rows, _, share in self._blocks:
            kept[rows] = share
        return kept

    @cached_property
    def data(self) -> FloatArray:
        """Covariance (p, p) in the basis as far as the data's errors make it."""
        pulls = sums(self.fit.design * self.residual[:, None], self.fit.cluster)
        covariance: FloatArray = pulls.T @ pulls
        return covariance

    def freedom(self, contrasts: FloatArray) -> FloatArray:
        """Degrees of freedom of the variances of contrasts (k, p) in `data`; 0 where none."""
        fit = self.fit
        found = np.zeros(len(contrasts))
        alpha = self.adjusted(fit.design @ contrasts.T)
        own = sums(alpha**2, fit.cluster)
        for i in range(len(contrasts)):
            pulls = sums(fit.design * alpha[:, i, None], fit.cluster)
            lengths = (pulls**2).sum(axis=1)
            trace = float(own[:, i].sum() - lengths.sum())
            square = float((own[:, i] ** 2).sum() - 2.0 * own[:, i] @ lengths)
            square += float(((pulls.T @ pulls) ** 2).sum())
            if square > 0 and trace > _SPENT * own[:, i].sum():
                found[i] = trace**2 / square
        return found

    def joint_freedom(self, contrasts: FloatArray) -> float:
        """Degrees of freedom of the covariance of contrasts (k, p) in `data`, taken together.

        Those of the Wishart distribution with as much variance in all, under equal independent
        errors (Pustejovsky and Tipton's approximation of Hotelling's T²); 0 where there are none.
        """
        fit, k = self.fit, len(contrasts)
        size, axes = np.linalg.eigh(contrasts @ contrasts.T)
        if not size[0] > _SPENT * size[-1]:
            return 0.0
        alpha = self.adjusted(fit.design @ (contrasts.T @ axes / np.sqrt(size)))
        pulls = [sums(fit.design * alpha[:, i, None], fit.cluster) for i in range(k)]
        spread = 0.0
        for s in range(k):
            for t in range(s, k):
                own = [sums(alpha[:, i] * alpha[:, j], fit.cluster) for i, j in _pairs(s, t)]
                lengths = [(pulls[i] * pulls[j]).sum(axis=1) for i, j in _pairs(s, t)]
                cross = pulls[s].T @ pulls[t]
                square = own[0] @ own[1] - own[0] @ lengths[1] - own[1] @ lengths[0]
                square += own[2] @ own[2] - 2.0 * own[2] @ lengths[2]
                square += float((cross**2).sum() + (cross * cross.T).sum())
                spread += float(square) * (1.0 if s == t else 2.0)
        return k * (k + 1.0) / spread if spread > 0 else 0.0


def _pairs(s: int, t: int) -> tuple[tuple[int, int], ...]:
    return (s, s), (t, t), (s, t)
