"""Rows that were not fitted: which of their parameters the fit has found, which are their own.

A session that no fitted row is of has numbers of its own (`per_session`): they are found from its
rows, all others held as they were fitted, before the rows are compared with the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import Estimate
from pkmcal.calibration.evaluation import Evaluation
from pkmcal.calibration.fit_data import FitData
from pkmcal.calibration.least_squares import Search
from pkmcal.calibration.loss import Loss
from pkmcal.calibration.mode_slips import in_their_modes
from pkmcal.calibration.parameters import Parameters, parameters
from pkmcal.calibration.sessions import NONE
from pkmcal.calibration.uncertainty import Uncertainty
from pkmcal.statistics.linear_fit import ROUNDING


@dataclass(frozen=True, eq=False)
class Later:
    """Rows that were not fitted.

    Attributes
    ----------
    data : tuple of FitData
        The sets of measurements.
    like : tuple of int
        The fitted set of each, whose noise it has.
    parameters : Parameters
        Of these rows.
    fitted : ndarray of int (n,)
        Which parameter of the fit each of them is; `NONE` if it is their own.
    """

    data: tuple[FitData, ...]
    like: tuple[int, ...]
    parameters: Parameters
    fitted: IntArray

    @property
    def own(self) -> BoolArray:
        """Which parameters the fit has not (n,)."""
        own: BoolArray = self.fitted == NONE
        return own

    def at(self, theta: FloatArray) -> FloatArray:
        """Parameters (n,) at those of the fit; their own ones where they start."""
        return np.where(self.own, self.parameters.start, theta[self.fitted])

    def by_fitted(self, derivative: FloatArray, size: int) -> FloatArray:
        """Columns (M, size) of the parameters of the fit, of a derivative (M, n)."""
        columns = np.zeros((len(derivative), size))
        columns[:, self.fitted[~self.own]] = derivative[:, ~self.own]
        return columns

    def equations(self, fitted: Equations) -> Equations:
        """Their equations, weighted as those of the fit."""
        deviations = [
            np.ones(len(data.measured.components))
            if differs(fitted, data, i)
            else fitted.deviations[i]
            for data, i in zip(self.data, self.like, strict=True)
        ]
        return Equations(self.data, self.parameters).reweighted(deviations)


def later(fitted: Parameters, held: Sequence[tuple[FitData, int]]) -> Later:
    """Rows that were not fitted, each set with the fitted one that it is like."""
    data = tuple(each for each, _ in held)
    mine = parameters(fitted.robot, data, fitted.asked, like=fitted)
    place = {name: column for column, name in enumerate(fitted.names)}
    columns = np.array([place.get(name, NONE) for name in mine.names], dtype=np.intp)
    known = {first: columns[first] for first in mine.frames if columns[first] != NONE}
    origin = dict(mine.origin) | {first: fitted.origin[there] for first, there in known.items()}
    return Later(data, tuple(like for _, like in held), replace(mine, origin=origin), columns)


def differs(fitted: Equations, data: FitData, like: int) -> bool:
    """Whether kind or stated sigma of a set are not those of the fitted set."""
    own, of_fit = data.measured, fitted.sets[like]
    return own.kind != of_fit.kind or (own.sigma is None) != (of_fit.sigma is None)


def noise_factors(rows: Later, equations: Equations, sure: Uncertainty) -> FloatArray:
    """What multiplies the deviations of each group of their equations."""
    factors = []
    for data, i in zip(rows.data, rows.like, strict=True):
        if not differs(sure.equations, data, i):
            factors.append(float(sure.factors[i]))
        else:
            stated = data.measured.sigma is not None
            factors.append(1.0 if stated else float(np.sqrt(sure.noises[i].total)))
    if len(equations.unstated) > len(rows.data):  # the actuators: stated or estimated alike
        of_fit = sure.factors[len(sure.equations.sets) :]
        factors += [float(of_fit[0])] if equations.unstated[-1] and len(of_fit) else [1.0]
    return np.array(factors)


@dataclass(frozen=True, eq=False)
class OwnNumbers:
    """What rows say of their own parameters, and what is left of them to be compared.

    Attributes
    ----------
    taken : ndarray (M, r)
        Orthonormal columns: what the parameters took of the whitened equations.
    half : ndarray (d, r)
        Scaled parameters by these: their covariance from the rows alone is half halfᵀ.
    noise : ndarray (G,)
        By which the equations are whitened.
    """

    taken: FloatArray
    half: FloatArray
    noise: FloatArray

    @property
    def leverage(self) -> FloatArray:
        """Share (M,) of each equation that the parameters took."""
        share: FloatArray = (self.taken**2).sum(axis=1)
        return share

    def left(self, whitened: FloatArray) -> FloatArray:
        """What is left of whitened columns (M, p) beside them."""
        rest: FloatArray = whitened - self.taken @ (self.taken.T @ whitened)
        return rest


def compared(
    rows: Later, equations: Equations, estimate: Estimate, sure: Uncertainty
) -> tuple[Evaluation, OwnNumbers | None]:
    """The rows at the fit, and what they said of their own parameters; None where they have none.

    `equations` are theirs, poses following from the actuators.
    """
    theta = rows.at(estimate.evaluation.theta)
    if not rows.own.any():
        return in_their_modes(equations, equations.at(theta)), None
    noise, columns = noise_factors(rows, equations, sure), np.flatnonzero(rows.own)
    start = equations.start(theta, rows.own)
    if in_their_modes(equations, start) is not start:
        start = equations.start(theta, rows.own)
    loss = estimate.state.loss
    width = np.full(len(equations.components), float(np.median(loss.width)))
    search = Search(equations, start, columns)
    best = search.best(
        np.zeros(len(columns)),
        noise,
        Loss(loss.name, equations.components, width),
        np.zeros((0, len(columns))),
    )
    found = search.at(best, noise)
    jacobian = np.vstack([search.jacobian(found, noise), search.prior])
    left, singular, right = np.linalg.svd(jacobian, full_matrices=False)
    kept = singular > ROUNDING * singular[0]
    taken = left[: len(jacobian) - len(search.prior), kept]
    return found, OwnNumbers(taken, right[kept].T / singular[kept], noise)
