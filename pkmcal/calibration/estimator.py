"""The estimator: noise, rank and covariance around the least squares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, mm_per_unit
from pkmcal.calibration.equations import Equations, Evaluation
from pkmcal.calibration.identifiability import (
    ROUNDING,
    Decomposed,
    Directions,
    decompose,
    directions,
)
from pkmcal.calibration.least_squares import Search
from pkmcal.calibration.loss import Loss, LossName
from pkmcal.exceptions import ArgumentError
from pkmcal.statistics import prior_test
from pkmcal.statistics.linear_fit import triangle
from pkmcal.statistics.robust_scale import median_ratio

_ROUNDS = 20  # of estimating noise and unidentifiable combinations anew
_LEAST_NOISE = 1e-9  # mm; what is left of measurements without noise
LEAST_FREEDOM = 0.5  # degrees of freedom from which the noise can be estimated


@dataclass(frozen=True, eq=False)
class IterationState:
    """What one least-squares solve takes as given, and what is revised before the next.

    Attributes
    ----------
    noise : ndarray (sets,)
        Factor on the stated deviations of each set; where none is stated, the deviation in mm.
    loss : Loss
        How rows count.
    measured : Directions
        Identifiable from the measurements alone.
    determined : Directions
        Identifiable from measurements and prior.
    fitted : Directions
        Determined to the machine's size or better; the rest is kept at its start.
    """

    noise: FloatArray
    loss: Loss
    measured: Directions
    determined: Directions
    fitted: Directions


@dataclass(frozen=True, eq=False)
class Estimate:
    """The equations and their statistics at the solution.

    Attributes
    ----------
    evaluation : Evaluation
        The equations there.
    state : IterationState
        Noise, loss and identifiable directions.
    residual : ndarray (M,)
        Measured less predicted, whitened.
    jacobian : ndarray (M, n)
        Scaled and whitened.
    weights : ndarray (N,)
        Of each row; 1 unless the loss is robust.
    covariance : ndarray (n, n)
        Scaled; nothing along combinations that are not determined.
    freedom : ndarray (sets,)
        Equations of each set less the parameters they went into.
    """

    evaluation: Evaluation
    state: IterationState
    residual: FloatArray
    jacobian: FloatArray
    weights: FloatArray
    covariance: FloatArray
    freedom: FloatArray


class Estimator:
    """Weighted least squares, iterated with the noise and rank that they imply.

    Parameters
    ----------
    equations : Equations
        What is fitted.
    start : Evaluation
        Where the search starts, and what unidentifiable combinations keep.
    loss : str
        A name in `loss.LIMITS`.
    """

    def __init__(self, equations: Equations, start: Evaluation, loss: LossName) -> None:
        self.equations, self.start, self.loss = equations, start, loss
        self.search = Search(equations, start)
        self.scale, self.prior = self.search.scale, self.search.prior
        self.unstated = np.array([m.sigma is None for m in equations.sets])
        set_of = np.repeat(equations.set_of, equations.components)
        self._equations_of = [set_of == i for i in range(len(self.unstated))]
        self._at_start = self.search.jacobian(start, np.ones(len(self.unstated)))
        self._first: tuple[FloatArray, tuple[Decomposed, Decomposed]] | None = None

    def solve(self, near: Evaluation | None = None) -> Estimate:
        """Estimate the parameters and, where no sigma is stated, the noise of each set.

        The search begins at `near`, or else at the start.
        """
        state = self._state(self._first_noise(), self._first_loss(), None)
        if not state.fitted.rank:
            names = ", ".join(self.equations.parameters.names)
            raise ArgumentError(f"they depend on none of {names}")
        u = np.zeros(len(self.scale))
        if near is not None:
            self.equations.warm_start(near)
            u = (near.theta - self.start.theta) / self.scale
        for _ in range(_ROUNDS):
            # rows that nothing contradicts pin what is not determined
            kept = state.fitted.unidentifiable
            pins = state.fitted.singular[0] * kept.T
            u = self.search.best(u, state.noise, state.loss, pins)
            u = u - kept @ (kept.T @ u)
            estimate = self._estimate(u, state)
            revised = self._revised(estimate)
            settled = self._settled(state, revised)
            state = revised
            if settled:
                break
        if self.loss == "linear" and not self.unstated.any():
            return replace(estimate, state=state)  # nothing that it was made with has changed
        return self._estimate(u, state)

    # between the least squares ------------------------------------------------------------------

    def _loss(self, name: LossName, width: FloatArray) -> Loss:
        of_rows = width[self.equations.set_of]
        return Loss(name, self.equations.components, of_rows)

    def _first_noise(self) -> FloatArray:
        """1 mm where it is not stated; with a prior what the data alone show at the start.

        Noise and prior could else excuse each other: much of one leaves little of the other.
        """
        ones = np.ones(len(self.unstated))
        if not len(self.prior) or self.loss != "linear":
            return ones
        residual = self.equations.whitened(self.start.residuals, ones)
        alone = self._alone(self._at_start, residual)
        return ones if alone is None else self._kept(ones * alone, ones)

    def _alone(self, jacobian: FloatArray, residual: FloatArray) -> FloatArray | None:
        """Deviation of what no parameters explain in each set, without the prior's help.

        None where too few equations are left to show it.
        """
        _, singular, rows = np.linalg.svd(triangle(jacobian), full_matrices=False)
        told = singular > ROUNDING * singular[0]
        basis = jacobian @ (rows[told].T / singular[told])
        left = residual - basis @ (basis.T @ residual)
        squares = np.array([left[mine] @ left[mine] for mine in self._equations_of])
        freedom = np.array([mine.sum() - (basis[mine] ** 2).sum() for mine in self._equations_of])
        if freedom.sum() < prior_test.LEAST_FREEDOM or (freedom < LEAST_FREEDOM).any():
            return None
        deviation: FloatArray = np.sqrt(squares / freedom)
        return deviation

    def _kept(self, noise: FloatArray, stated: FloatArray) -> FloatArray:
        """Estimated noise of sets where none is stated, else what multiplies the stated one."""
        return np.where(self.unstated, np.maximum(noise, _LEAST_NOISE), stated)

    def _first_loss(self) -> Loss:
        """Limits wide enough for the nominal machine, and no wider than gross errors allow."""
        ones = np.ones(len(self.unstated))
        if self.loss == "linear":
            return self._loss("linear", ones)
        squares = self._squares(self.equations.whitened(self.start.residuals, ones))
        set_of, components = self.equations.set_of, self.equations.components
        medians = [
            median_ratio(squares[set_of == i], components[set_of == i]) for i in range(len(ones))
        ]
        return self._loss(self.loss, np.maximum(np.sqrt(medians), 1.0))

    def _squares(self, residual: FloatArray) -> FloatArray:
        """Squared length of each row, (N,)."""
        components = self.equations.components
        squares: FloatArray = np.add.reduceat(residual**2, np.cumsum(components) - components)
        return squares

    def _state(
        self, noise: FloatArray, loss: Loss, evaluation: Evaluation | None
    ) -> IterationState:
        """Split the directions for this noise, before (`evaluation` None) or after a fit."""
        size = self.start.robot.length
        noise_known = evaluation is not None or not self.unstated.any()
        worst = size if noise_known else np.inf
        if self._first is None or (noise != self._first[0]).any():
            at_start = self._at_start / (noise @ np.array(self._equations_of))[:, None]
            self._first = noise, self._decomposed(at_start)
        _, first = self._first
        now = (
            (None, None)
            if evaluation is None
            else self._decomposed(self.search.jacobian(evaluation, noise))
        )
        measured = directions(first[0], now[0], size)
        determined = directions(first[1], now[1], size)
        return IterationState(
            noise, loss, measured, determined, directions(first[1], now[1], size, worst)
        )

    def _decomposed(self, jacobian: FloatArray) -> tuple[Decomposed, Decomposed]:
        """Decompose without and with the prior."""
        data = decompose(jacobian)
        return data, decompose(np.vstack([jacobian, self.prior])) if len(self.prior) else data

    def _revised(self, estimate: Estimate) -> IterationState:
        """Estimate unstated noise and limits of the loss, and split the directions anew."""
        factor = self._spread(estimate)
        noise = self._kept(estimate.state.noise * factor, estimate.state.noise)
        # while the model is still far off, outliers are rows further off than most
        width = np.where(self.unstated, 1.0, np.maximum(factor, 1.0))
        return self._state(noise, self._loss(self.loss, width), estimate.evaluation)

    def _spread(self, estimate: Estimate) -> FloatArray:
        """Deviation of the whitened residuals of each set, (sets,); 1 without freedom."""
        rows, components = self.equations.set_of, self.equations.components
        squares = self._squares(estimate.residual)
        if len(self.prior) and self.loss == "linear":
            alone = self._alone(estimate.jacobian, estimate.residual)
            if alone is not None:
                return alone
        factor = np.ones(len(self.unstated))
        for i in np.flatnonzero(estimate.freedom >= LEAST_FREEDOM):
            mine, k = squares[rows == i], components[rows == i]
            if self.loss == "linear":
                variance = mine.sum() / estimate.freedom[i]
            else:
                variance = median_ratio(mine, k) * k.sum() / estimate.freedom[i]
            factor[i] = np.sqrt(variance)
        return factor

    def _settled(self, old: IterationState, new: IterationState) -> bool:
        if old.fitted.rank != new.fitted.rank:
            return False
        if self.loss == "linear" and not len(self.prior) and len(self.unstated) == 1:
            return True  # the noise does not move the solution
        return np.allclose(old.noise, new.noise, rtol=1e-3, atol=_LEAST_NOISE) and np.allclose(
            old.loss.width, new.loss.width, rtol=1e-3
        )

    def scaled_jacobian(self, evaluation: Evaluation) -> FloatArray:
        """Scaled Jacobian (M, n), not whitened: mm per mm, angles as their arc."""
        parts = []
        for part, measured in zip(
            self.equations.jacobian(evaluation), self.equations.sets, strict=True
        ):
            arcs = mm_per_unit(measured.units, self.start.robot.length)
            parts.append((part * arcs[:, None]).reshape(-1, part.shape[2]))
        jacobian: FloatArray = np.concatenate(parts) * self.scale
        return jacobian

    def _estimate(self, u: FloatArray, state: IterationState) -> Estimate:
        evaluation = self.search.at(u)
        jacobian = self.search.jacobian(evaluation, state.noise)
        residual = self.equations.whitened(evaluation.residuals, state.noise)
        weights = state.loss.weights(residual)
        every = np.repeat(weights, self.equations.components)
        parts = [np.sqrt(every[mine, None]) * jacobian[mine] for mine in self._equations_of]
        factors = [triangle(part) for part in parts]
        basis = state.determined.identifiable
        _, singular, rows = np.linalg.svd(
            triangle(np.vstack([*factors, self.prior])) @ basis, full_matrices=False
        )
        half = basis @ (rows.T / singular)
        fitted = half[:, : state.fitted.rank]
        leverage = [float(((factor @ fitted) ** 2).sum()) for factor in factors]
        count = [float(every[mine].sum()) for mine in self._equations_of]
        freedom = np.array(count) - np.array(leverage)
        return Estimate(evaluation, state, residual, jacobian, weights, half @ half.T, freedom)
