"""Rows that were not fitted: which of their parameters the fit has found, which are their own.

A session that no fitted row is of has numbers of its own (`per_session`): they are found from its
rows, all others held as they were fitted, before the rows are compared with the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.mode_slips import in_their_modes, start_in_modes
from pkmcal.estimation.other_starts import elsewhere
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_minima import in_least_minima
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import NONE
from pkmcal.estimation.uncertainty import Uncertainty
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
        """Mask of parameters that the fit has not (n,)."""
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
        """The equations of the later rows, weighted as those of the fit."""
        deviations = [
            np.ones(len(data.measured.components))
            if differs(fitted, data, i)
            else fitted.whitening.deviations[i]
            for data, i in zip(self.data, self.like, strict=True)
        ]
        return Equations.of(self.data, self.parameters).reweighted(deviations)


def later(fitted: Parameters, held: Sequence[tuple[FitData, int]]) -> Later:
    """Rows that were not fitted, each set with the fitted one that it is like."""
    data = tuple(each for each, _ in held)
    mine = parameters(fitted.robot, data, fitted.asked, like=fitted)
    place = {name: column for column, name in enumerate(fitted.names)}
    columns = np.array([place.get(name, NONE) for name in mine.names], dtype=np.intp)
    known = {first: columns[first] for first in mine.motions if columns[first] != NONE}
    origin = dict(mine.origin) | {first: fitted.origin[there] for first, there in known.items()}
    return Later(data, tuple(like for _, like in held), replace(mine, origin=origin), columns)


def differs(fitted: Equations, data: FitData, like: int) -> bool:
    """Return whether kind or stated sigma of a set are not those of the fitted set."""
    own, of_fit = data.measured, fitted.table.sets[like]
    return own.kind != of_fit.kind or (own.sigma is None) != (of_fit.sigma is None)


def noise_factors(rows: Later, equations: Equations, sure: Uncertainty) -> FloatArray:
    """Return factors of the deviations of each group of these equations."""
    mine, theirs = equations.whitening, sure.equations.whitening
    factors = np.ones(len(mine.set_of_group))
    for data, i, groups in zip(rows.data, rows.like, mine.groups, strict=True):
        if not differs(sure.equations, data, i):
            first = np.unique(groups, return_index=True)
            factors[first[0]] = sure.factors[theirs.groups[i][first[1]]]
        elif data.measured.sigma is None:
            factors[groups] = float(np.sqrt(sure.noises[i][0]))
    unstated = equations.blocks.unstated[len(factors) :]  # load cells and actuators
    of_fit = sure.factors[len(theirs.set_of_group) :]
    alike = len(of_fit) == len(unstated)
    return np.concatenate([factors, np.where(unstated, of_fit if alike else 1.0, 1.0)])


@dataclass(frozen=True, eq=False)
class OwnNumbers:
    """The rows' d own parameters as functions of the rows, scaled.

    Attributes
    ----------
    half : ndarray (d, r)
        Their covariance for fitted parameters without error is half halfᵀ.
    follow : ndarray (d, n)
        By how much they answer errors of the fitted parameters.
    noise : ndarray (G,)
        That the equations were weighted by.
    """

    half: FloatArray
    follow: FloatArray
    noise: FloatArray


def compared(
    rows: Later, whole: Equations, estimate: Estimate, sure: Uncertainty, near: RowStates
) -> tuple[Equations, Evaluation, OwnNumbers | None]:
    """The rows at the fit, poses following from the actuators, and what they say of own parameters.

    None where they have none. Where poses have unknowns, closures speak of them as well as readings
    (`whole`). The search for the poses begins `near` where those of the start were found.
    """
    commanded, theta = whole.with_exact_actuators(), rows.at(estimate.evaluation.theta)
    if not rows.own.any():
        if whole.system is not None:
            noise = noise_factors(rows, whole, sure)
            near = in_least_minima(whole, whole.at(theta, noise, near), noise).onward
        return commanded, in_their_modes(commanded, commanded.at(theta, near=near)), None
    whole, start = whole.begin(start_in_modes(commanded, theta, rows.own, near))
    found, own, least = _own_numbers(rows, whole, start, estimate, sure)
    for _ in range(len(theta)):  # of a mounting that may be either side up the one that fits
        tried = [
            _own_numbers(rows, whole, there, estimate, sure)
            for there in elsewhere(whole, found, rows.own)
        ]
        better = min(tried, key=lambda each: each[2], default=(found, own, np.inf))
        if not better[2] < least:
            break
        found, own, least = better
    commanded = whole.with_exact_actuators()
    return commanded, commanded.at(found.theta, near=found), own


def _own_numbers(
    rows: Later, equations: Equations, start: Evaluation, estimate: Estimate, sure: Uncertainty
) -> tuple[Evaluation, OwnNumbers, float]:
    """The least squares of the rows' own parameters, all others held; and these squares."""
    noise, columns = noise_factors(rows, equations, sure), np.flatnonzero(rows.own)
    state, count = estimate.state, len(equations.blocks.components)
    search = Estimator.of(equations, start, state.loss, columns)
    found, jacobian = start, np.zeros((0, len(columns)))
    width = np.full(count, float(np.median(state.width)))
    if count:
        none = np.zeros((0, len(columns)))
        best = search.best(np.zeros(len(columns)), noise, width, none)
        found = best.at(best.u, noise).here
        jacobian = search.jacobian(found, noise)
    squares = search.cost(found, noise, width)
    left, singular, right = np.linalg.svd(
        np.vstack([jacobian, search.prior(found.theta)]), full_matrices=False
    )
    kept = singular > ROUNDING * singular.max(initial=0.0)
    half, taken = right[kept].T / singular[kept], left[: len(jacobian), kept]
    by_all = equations.by_parameters(found, noise) * equations.parameters.scale
    by_fitted = rows.by_fitted(by_all, len(sure.fit.back))
    return found, OwnNumbers(half, -half @ (taken.T @ by_fitted), noise), squares
