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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.statistics.linear_fit import LinearFit, alike, grouped, sums

_FEW = 4096  # equations of which what adjusts them is there at once
_SPENT = 1e-8  # share of a residual's variance below which the fit follows it wherever it lies


def shared_error_score(fit: LinearFit) -> float:
    """Score test for an error that equations of one cluster and component share.

    About standard normal where errors are independent; -inf where no two equations could share
    one, or the fit has used up what they could show.
    """
    keys = fit.key()
    counts = np.bincount(keys).astype(np.float64)
    freedom = fit.freedom
    if counts.max() < 2 or freedom <= 0:
        return float("-inf")
    inner, by_count, together = np.zeros((fit.design.shape[1],) * 2), 0.0, 0.0
    for rows in grouped(keys):
        key = keys[rows]
        z = sums(fit.design[rows], key)
        inner += z.T @ z
        by_count += float(counts[key[0] : key[-1] + 1] @ (z**2).sum(axis=1))
        together += float((sums(fit.residual[rows], key) ** 2).sum())
    mean = len(fit.residual) - np.trace(inner)
    second = (counts**2).sum() - 2.0 * by_count + (inner**2).sum()
    spread = 2.0 * (second - mean**2 / freedom) * freedom / (freedom + 2.0)
    variance = fit.squares / freedom
    if spread <= _SPENT * second or variance <= 0:
        return float("-inf")
    return float((together / variance - mean) / np.sqrt(spread))


# Clusters of the same size: their equations (g, m), what adjusts them, and what is retained of each
_Block = tuple[IntArray, FloatArray, FloatArray]


def _adjusted(matrix: FloatArray, values: FloatArray, part: FloatArray) -> FloatArray:
    """Values (g, m, k) of clusters whose part of the design is (g, m, p), times (1 - H)^(-1/2)."""
    if part.shape[1] <= part.shape[2]:
        return matrix @ values
    found: FloatArray = values + part @ (matrix @ (part.transpose(0, 2, 1) @ values))
    return found


def _block(rows: IntArray, part: FloatArray) -> _Block:
    """Compute clusters of equations (g, m) with designs (g, m, p)."""
    wide = rows.shape[1] <= part.shape[2]
    inner = part @ part.transpose(0, 2, 1) if wide else part.transpose(0, 2, 1) @ part
    values, vectors = np.linalg.eigh(inner)
    left = 1.0 - values > _SPENT
    root = np.where(left, np.sqrt(np.maximum(1.0 - values, 0.0)), 1.0)
    if wide:  # (1 - H)^(-1/2) itself
        factor, spent = np.where(left, 1.0 / root, 0.0), vectors
    else:  # 1 + A W Aᵀ, by the smaller AᵀA
        factor, spent = np.where(left, 1.0 / (root * (1.0 + root)), -1.0), part @ vectors
    matrix = (vectors * factor[:, None, :]) @ vectors.transpose(0, 2, 1)
    return rows, matrix, 1.0 - (spent**2 @ ~left[:, :, None])[:, :, 0]


@dataclass(frozen=True, eq=False)
class Sandwich:
    """The cluster sandwich of a fit, adjusted for leverage.

    Attributes
    ----------
    fit : LinearFit
        The fit.
    beside : ndarray (M, k) or None
        Further columns of its design, orthonormal beside it; p below counts them.
    """

    fit: LinearFit
    beside: FloatArray | None = None

    @property
    def _width(self) -> int:
        beside = 0 if self.beside is None else self.beside.shape[1]
        return int(self.fit.design.shape[1] + beside)

    def _design(self, rows: IntArray | slice) -> FloatArray:
        """Design of the equations of a lot, in the order of its clusters."""
        own = self.fit.design[rows]
        return own if self.beside is None else np.concatenate([own, self.beside[rows]], axis=-1)

    def _blocks(self) -> Iterable[_Block]:
        """Lots of clusters of the same size; of few equations they are kept."""
        return self._made() if self._kept is None else self._kept

    @cached_property
    def _kept(self) -> list[_Block] | None:
        return list(self._made()) if len(self.fit.residual) <= _FEW else None

    def _made(self) -> Iterator[_Block]:
        for rows in alike(self.fit.cluster, _FEW):
            yield _block(rows, self._design(rows))

    def adjusted(self, values: FloatArray) -> FloatArray:
        """Multiply the part of each cluster by (1 - H)^(-1/2): values (M, k).

        H is the cluster's block of the hat matrix. Residuals then have the variance of the errors.
        """
        out = np.empty_like(values)
        for rows, matrix, _ in self._blocks():
            out[rows] = _adjusted(matrix, values[rows], self._design(rows))
        return out

    @cached_property
    def _residual(self) -> tuple[FloatArray, FloatArray]:
        left, kept = np.empty((2, len(self.fit.residual)))
        for rows, matrix, retained in self._blocks():
            mine = self.fit.residual[rows][:, :, None]
            left[rows] = _adjusted(matrix, mine, self._design(rows))[:, :, 0]
            kept[rows] = retained
        return left, kept

    @property
    def residual(self) -> FloatArray:
        """Adjusted residuals (M,)."""
        return self._residual[0]

    @property
    def retained(self) -> FloatArray:
        """Variance of each adjusted residual (M,), in that of its error.

        1, or less where the fit has used up what the cluster could show.
        """
        return self._residual[1]

    @cached_property
    def data(self) -> FloatArray:
        """Covariance (p, p) in the basis as far as the data's errors make it."""
        covariance = np.zeros((self._width,) * 2)
        for rows in grouped(self.fit.cluster):
            weighted = self._design(rows) * self.residual[rows, None]
            pulls = sums(weighted, self.fit.cluster[rows])
            covariance += pulls.T @ pulls
        return covariance

    def freedom(self, contrasts: FloatArray) -> FloatArray:
        """Degrees of freedom of the variances of contrasts (k, p) in `data`; 0 where none."""
        k, p = contrasts.shape
        every, trace, square, inner = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros((k, p, p))
        for rows, matrix, _ in self._blocks():
            part = self._design(rows)
            alpha = _adjusted(matrix, part @ contrasts.T, part)
            own = (alpha**2).sum(axis=1)
            every += own.sum(axis=0)
            for i in range(k):
                pulls = (part * alpha[:, :, i, None]).sum(axis=1)
                lengths = (pulls**2).sum(axis=1)
                trace[i] += own[:, i].sum() - lengths.sum()
                square[i] += own[:, i] @ (own[:, i] - 2.0 * lengths)
                inner[i] += pulls.T @ pulls
        square += (inner**2).sum(axis=(1, 2))
        found = np.zeros(k)
        shown = (square > 0) & (trace > _SPENT * every)
        found[shown] = trace[shown] ** 2 / square[shown]
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
        turned = contrasts.T @ axes / np.sqrt(size)
        count = len(fit.residual)
        alpha = self.adjusted(np.concatenate([self._design(r) @ turned for r in lots(count)]))
        square, cross = np.zeros((k, k)), np.zeros((k, k, *(self._width,) * 2))
        for rows in grouped(fit.cluster):
            a, of, design = alpha[rows], fit.cluster[rows], self._design(rows)
            pulls = [sums(design * a[:, i, None], of) for i in range(k)]
            for s in range(k):
                for t in range(s, k):
                    own = [sums(a[:, i] * a[:, j], of) for i, j in _pairs(s, t)]
                    lengths = [(pulls[i] * pulls[j]).sum(axis=1) for i, j in _pairs(s, t)]
                    square[s, t] += own[0] @ own[1] - own[0] @ lengths[1] - own[1] @ lengths[0]
                    square[s, t] += own[2] @ own[2] - 2.0 * own[2] @ lengths[2]
                    cross[s, t] += pulls[s].T @ pulls[t]
        square += (cross**2 + cross * cross.transpose(0, 1, 3, 2)).sum(axis=(2, 3))
        spread = float(np.triu(square).sum() + np.triu(square, 1).sum())
        return k * (k + 1.0) / spread if spread > 0 else 0.0


def _pairs(s: int, t: int) -> tuple[tuple[int, int], ...]:
    return (s, s), (t, t), (s, t)
