"""Check whether data contradict a prior, and the noise as the data alone show it.

The prior predictive check: what the data say of the parameters, less the prior's centre, is
compared with what prior and noise let expect (G. E. P. Box, Sampling and Bayes' inference in
scientific modelling and robustness, Journal of the Royal Statistical Society A 143 (1980)). The
noise enters as the data alone show it: with the prior's help each would excuse the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.statistics.distributions import f_tail, t_tail
from pkmcal.statistics.linear_fit import ROUNDING, triangle
from pkmcal.statistics.singular_values import svd

CONTRADICTED = 0.01  # chance below which the data contradict the prior
LEAST_FREEDOM = 5.0  # of the data alone, from which they show the noise
_INFORMED = 0.1  # share of its deviation by which the data must move a parameter to be judged
_WIDEST = 1e6  # factor on the prior beyond which none is looked for


@dataclass(frozen=True, eq=False)
class PriorTest:
    """Comparison of a prior with what measurements say.

    Attributes
    ----------
    ratio, chance : float
        Mean square of what the data say over what is expected, and how likely that is; NaN and 1
        where they say nothing.
    pulls : ndarray (k,)
        Each parameter's change over its expected deviation; NaN where the data hardly move it.
    pull_chance : float
        How likely the largest would be, among so many.
    factor : float
        On the prior's deviations, with which the ratio would be 1.
    freedom : float
        Of the noise with which they were compared; inf where it is stated.
    """

    ratio: float
    chance: float
    pulls: FloatArray
    pull_chance: float
    factor: float
    freedom: float = np.inf

    @property
    def chance_of_either(self) -> float:
        """Chance of a mean square or a largest pull as large."""
        return min(1.0, 2.0 * min(self.chance, self.pull_chance))

    @property
    def contradicted(self) -> bool:
        """True if the data contradict the prior."""
        return self.chance_of_either < CONTRADICTED


def data_alone(jacobian: FloatArray, data: FloatArray) -> tuple[float, float]:
    """Sum of squares that no parameters explain, and its degrees of freedom.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        Of all parameters.
    data : ndarray (M,)
        Residuals at the expansion point.
    """
    return left_alone(triangle([jacobian, data]), len(data))


def left_alone(factor: FloatArray, count: int) -> tuple[float, float]:
    """`data_alone` of `count` rows by the triangular factor of Jacobian and data, side by side."""
    n = factor.shape[1] - 1
    basis, singular, _ = svd(factor[:, :n])
    basis = basis[:, singular > ROUNDING * singular[0]]
    rest = factor[:, n] - basis @ (basis.T @ factor[:, n])
    return float(rest @ rest), float(count - basis.shape[1])


def prior_test(
    with_prior: FloatArray,
    without: FloatArray,
    data: FloatArray,
    variance: float,
    freedom: float,
    least: float = 0.0,
) -> PriorTest:
    """Test a prior.

    Parameters
    ----------
    with_prior : ndarray (M, k)
        Derivatives to the parameters with a prior, in units of its deviation.
    without : ndarray (M, n - k)
        Those to the others.
    data : ndarray (M,)
        What is measured less what is predicted at the prior's centre.
    variance, freedom : float
        Of the noise; inf degrees of freedom where it is stated.
    least : float
        Share of its deviation by which data have to move a combination of parameters for it to be
        tested.
    """
    basis = np.zeros((len(data), 0))
    if without.shape[1]:
        basis, singular, _ = svd(without)
        basis = basis[:, singular > ROUNDING * singular[0]]
    own = with_prior - basis @ (basis.T @ with_prior)
    left = data - basis @ (basis.T @ data)
    turn, singular, rows = svd(own)
    shown = singular > ROUNDING * float(np.linalg.norm(with_prior))
    shown &= singular**2 > least**2 * (singular**2 + variance)
    if not shown.any():  # the data say nothing of them, or the other parameters take it up
        nothing = np.full(with_prior.shape[1], np.nan)
        return PriorTest(float("nan"), 1.0, nothing, 1.0, float("nan"))
    singular, rows = singular[shown], rows[shown]
    along = turn[:, shown].T @ left
    expected = singular**2 + variance
    share = variance / expected
    count = len(singular)
    ratio = float((along**2 / expected).mean())
    spread = share.sum()
    second = freedom * (count / spread) ** 2 if spread > 0 else np.inf
    moved = rows.T @ (singular * along / expected)
    allowed = np.sqrt(((rows**2) * (singular**2 / expected)[:, None]).sum(axis=0))
    judged = allowed > _INFORMED
    pulls = np.where(judged, moved / np.where(judged, allowed, 1.0), np.nan)
    largest = float(np.nanmax(np.abs(pulls))) if judged.any() else 0.0
    chances = max(1, int(judged.sum()))  # without any the largest is 0, which is certain
    return PriorTest(
        ratio=ratio,
        chance=f_tail(ratio, count, second),
        pulls=pulls,
        pull_chance=min(1.0, chances * t_tail(largest, freedom)),
        factor=_fitting(along, singular, variance),
        freedom=freedom,
    )


def _fitting(along: FloatArray, singular: FloatArray, variance: float) -> float:
    """Factor on the prior's deviations that makes the mean ratio one."""
    low, high = 1.0 / _WIDEST, _WIDEST
    for _ in range(60):
        middle = np.sqrt(low * high)
        if (along**2 / (middle**2 * singular**2 + variance)).mean() > 1.0:
            low = middle
        else:
            high = middle
    return float(np.sqrt(low * high))
