"""Check whether points that were held out contradict the fit.

Their mean square is compared with what noise and covariance let expect, by an F test whose degrees
of freedom are Satterthwaite's: equations of one pose share errors, and poses may be unlike (F. E.
Satterthwaite, An approximate distribution of estimates of variance components, Biometrics Bulletin
2 (1946)). Errors of parameters that points share make the mean square skew: of its upper tail the
third moment counts as well, and the F distribution there is that of a chi-square variable with as
much skewness, shifted and scaled (P. Hall, Chi squared approximations to the distribution of a sum
of independent random variables, Annals of Probability 11 (1983)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import f_limit, f_tail, skew_f_tail
from pkmcal.statistics.linear_fit import numbered, sums
from pkmcal.statistics.noise import Noise

CHANCE = 0.005  # below which points contradict the fit …
RATIO = 1.2  # … if their rms and their median are also so much larger than expected
_FAR, _CLOSE = 1e6, 1e-9  # of the search for a limit: how far it begins, and ends
NEARER = 1e-3  # chance below which they are nearer than expected, of a ratio below 1 / RATIO


@dataclass(frozen=True)
class HoldoutTest:
    """Comparison of held-out rows with what a fit lets expect.

    Attributes
    ----------
    ratio : float
        Rms of the points held out over what is expected.
    median_ratio : float
        The same of their median length.
    chance : float
        How likely a ratio as large would be if fit, noise and covariance were right.
    freedom : (float, float)
        Degrees of freedom of the F test.
    of : int
        How many such tests are made of the points.
    skewness : float
        Degrees of freedom of a chi-square variable as skew as the sum of squares; by default of one
        with those of the F test.
    """

    ratio: float
    median_ratio: float
    chance: float
    freedom: tuple[float, float]
    of: int = 1
    skewness: float = np.inf

    @property
    def contradicts(self) -> bool:
        """True if the points contradict the fit: by chance, rms and median."""
        return self.few_off and self.median_ratio > RATIO

    @property
    def least_ratio(self) -> float:
        """Ratio of rms to what is expected from which the points can contradict the fit."""
        first, second = self.freedom
        low, high = 0.0, f_limit(CHANCE / self.of / _FAR, first, second)
        while high - low > _CLOSE * high:
            middle = (low + high) / 2.0
            above = skew_f_tail(middle, first, second, self.skewness) > CHANCE / self.of
            low, high = (middle, high) if above else (low, middle)
        return max(RATIO, float(np.sqrt(high)))

    @property
    def chance_nearer(self) -> float:
        """Chance of a ratio as small if fit, noise and covariance were right."""
        first, second = self.freedom
        return f_tail(self.ratio**-2, second, first) if self.ratio > 0.0 else 0.0

    @property
    def nearer(self) -> bool:
        """True if the points are nearer than noise and covariance let expect."""
        return self.ratio < 1.0 / RATIO and self.chance_nearer < NEARER / self.of

    @property
    def few_off(self) -> bool:
        """True if the rms alone contradicts the fit, which a few points can cause."""
        return self.chance < CHANCE / self.of and self.ratio > RATIO


@dataclass(frozen=True, eq=False)
class Lengths:
    """Equations of lengths, in units of the deviation of one.

    Attributes
    ----------
    residual : ndarray (M,)
        Of fitted rows adjusted for leverage.
    design : ndarray (M, p)
        Derivative to the parameters in the basis of the fit; of fitted rows as there, whitened.
    row, pose, component : ndarray of int (M,)
        Which measured point, pose and component each belongs to.
    """

    residual: FloatArray
    design: FloatArray
    row: IntArray
    pose: IntArray
    component: IntArray

    @property
    def median(self) -> float:
        """Median length of the residual of a point, per equation."""
        counts = np.bincount(self.row)
        return float(np.median(np.sqrt(np.bincount(self.row, self.residual**2) / counts)))


def holdout_test(
    fitted: Lengths,
    held: Lengths,
    split: Noise,
    covariance: FloatArray,
    in_common: FloatArray | None = None,
    taken: float = 0.0,
    most: float = np.inf,
) -> HoldoutTest:
    """Compare held-out rows with what a fit lets expect.

    Parameters
    ----------
    fitted, held : Lengths
        Rows that were fitted, and not.
    split : (float, float)
        Variance of the errors of both, and what those of a pose share of it: see `noise`.
    covariance : ndarray (p, p)
        Of the parameters in the basis of the fit, in the unit of `held`.
    in_common : ndarray (M, n), optional
        What errors that all equations of a pose have in common, such as those of n actuators, add
        to each of `held`, in standard deviations with their signs.
    taken : float
        Share of the equations of `held` that numbers found from these took.
    most : float
        Degrees of freedom of the variance of the errors, where these are fewer than the residuals'.
    """
    expected = split[0] + float(
        np.einsum("ij,jk,ik->", held.design, covariance, held.design)
    ) / len(held.residual)
    ratio = float(np.sqrt(np.mean(held.residual**2) / expected))
    whole = _of_sum(held, split, covariance, in_common)
    first, skewness = whole * (1.0 - taken), _of_skewness(held, split[0], covariance)
    second = min(_of_residuals(fitted, split), most)
    poses = np.bincount(fitted.pose)
    squares = np.bincount(fitted.pose, fitted.residual**2)[poses > 0] / poses[poses > 0]
    if len(squares) > 2 and (spread := float(squares.var(ddof=1))) > 0:
        each = 2.0 * float(squares.mean()) ** 2 / spread
        first = min(first, each * len(np.unique(held.pose)))
        left = 1.0 - fitted.design.shape[1] / len(fitted.residual)
        second = min(second, each * len(squares) * left)
    usual = fitted.median * np.sqrt(expected / split[0])
    median = held.median / usual if usual > 0 else float("nan")  # most readings are met exactly
    own = min(skewness * first / whole, first)
    chance = skew_f_tail(ratio**2, first, second, own)
    return HoldoutTest(ratio, median, chance, (first, second), skewness=own)


def _of_skewness(held: Lengths, total: float, covariance: FloatArray) -> float:
    """Degrees of freedom of a chi-square variable as skew as the sum of squares of the points.

    With as much variance of noise in all equations, which is not skew beside errors of parameters.
    """
    size, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(size, 0.0))
    moved = root.T @ (held.design.T @ held.design) @ root
    twice, m = moved @ moved, len(held.residual)
    one, two = float(np.trace(moved)), float(np.trace(twice))
    three = float((twice * moved).sum())
    square = m * total**2 + 2.0 * total * one + two
    cube = m * total**3 + 3.0 * total**2 * one + 3.0 * total * two + three
    return square**3 / cube**2


def _of_sum(
    held: Lengths, split: Noise, covariance: FloatArray, in_common: FloatArray | None
) -> float:
    """Degrees of freedom of the sum of squares of the points held out."""
    if in_common is not None and in_common.any():
        return _of_sum_in_common(held, split[0], covariance, in_common)
    key = numbered(held.pose, held.component)
    counts = np.bincount(key).astype(np.float64)
    design, pulls = held.design, sums(held.design, key)
    inner, m = design.T @ design, len(held.residual)
    total, shared = split
    single = total - shared
    mixed = single * inner + shared * (pulls.T @ pulls)
    trace = m * total + float(np.trace(covariance @ inner))
    square = (
        m * single**2
        + 2.0 * single * shared * m
        + shared**2 * float((counts**2).sum())
        + 2.0 * float(np.trace(covariance @ mixed))
        + float(np.trace(covariance @ inner @ covariance @ inner))
    )
    return trace**2 / square


def _of_sum_in_common(
    held: Lengths, total: float, covariance: FloatArray, in_common: FloatArray
) -> float:
    """`_of_sum` where all equations of a pose have errors in common, of which each has its part."""
    own = np.maximum(1.0 - (in_common**2).sum(axis=1), 0.0)
    shape = int(held.pose.max()) + 1, in_common.shape[1]
    squares = np.zeros((*shape, shape[1]))
    np.add.at(squares, held.pose, in_common[:, :, None] * in_common[:, None, :])
    pulls = np.zeros((*shape, held.design.shape[1]))
    np.add.at(pulls, held.pose, in_common[:, :, None] * held.design[:, None, :])
    inner, m = held.design.T @ held.design, len(held.residual)
    mixed = held.design.T @ (own[:, None] * held.design) + np.einsum("pni,pnj->ij", pulls, pulls)
    noise = float((own**2).sum() + 2.0 * (own @ (in_common**2).sum(axis=1)) + (squares**2).sum())
    moved = covariance @ inner
    trace = m * total + float(np.trace(moved))
    square = total**2 * noise + 2.0 * total * float(np.trace(covariance @ mixed))
    return trace**2 / (square + float(np.trace(moved @ moved)))


def _of_residuals(fitted: Lengths, split: Noise) -> float:
    """Degrees of freedom of the sum of squares of the residuals of the fit."""
    key = numbered(fitted.pose, fitted.component)
    counts = np.bincount(key).astype(np.float64)
    design, pulls = fitted.design, sums(fitted.design, key)
    inner, of_keys = design.T @ design, pulls.T @ pulls
    (total, shared), m = split, len(fitted.residual)
    single = total - shared
    once = single * inner + shared * of_keys
    twice = (
        single**2 * inner
        + 2.0 * single * shared * of_keys
        + shared**2 * ((pulls * counts[:, None]).T @ pulls)
    )
    trace = m * total - float(np.trace(once))
    square = (
        m * single**2
        + 2.0 * single * shared * m
        + shared**2 * float((counts**2).sum())
        - 2.0 * float(np.trace(twice))
        + float((once**2).sum())
    )
    return trace**2 / square if square > 0 else 0.0
