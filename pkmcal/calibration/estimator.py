"""The estimator: noise, rank and covariance around the least squares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.equations import Equations, Point
from pkmcal.calibration.identifiability import (
    Decomposed,
    Directions,
    decompose,
    directions,
    triangle,
)
from pkmcal.calibration.least_squares import Search
from pkmcal.calibration.loss import Loss
from pkmcal.calibration.outliers import median_ratio
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.lack_of_fit import SIGNIFICANT, Split, groups, split

_ROUNDS = 20  # of estimating noise and unidentifiable combinations anew
_LEAST_NOISE = 1e-9  # mm; what is left of measurements without noise
_LEAST_FREEDOM = 0.5  # equations that must be left over for residuals to tell the noise


@dataclass(frozen=True, eq=False)
class Setting:
    """What the least squares take as given, and what is revised between them.

    Attributes
    ----------
    noise : ndarray (sets,)
        Factor on the stated deviations of each set; where none is stated, the deviation in mm.
    loss : Loss
        How rows count.
    told : Directions
        What the measurements tell.
    determined : Directions
        What measurements and prior tell.
    searched : Directions
        What they tell to the machine's size or better; the rest is kept where it started.
    """

    noise: FloatArray
    loss: Loss
    told: Directions
    determined: Directions
    searched: Directions


@dataclass(frozen=True, eq=False)
class Estimate:
    """The equations and their statistics at the solution.

    Attributes
    ----------
    point : Point
        The equations there.
    setting : Setting
        Noise, loss and what can be told.
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

    point: Point
    setting: Setting
    residual: FloatArray
    jacobian: FloatArray
    weights: FloatArray
    covariance: FloatArray
    freedom: FloatArray


class Estimator:
    """Weighted least squares, and what follows from them.

    Parameters
    ----------
    equations : Equations
        What is fitted.
    start : Point
        Where the search starts and what the smallest change counts from.
    loss : str
        A name of `pkmcal.calibration.loss.LIMITS`.
    """

    def __init__(self, equations: Equations, start: Point, loss: str) -> None:
        self.equations, self.start, self.loss = equations, start, loss
        self.search = Search(equations, start)
        self.scale, self.prior = self.search.scale, self.search.prior
        self.unstated = np.array([m.sigma is None for m in equations.sets])
        set_of = np.repeat(equations.set_of, equations.components)
        self._equations_of = [set_of == i for i in range(len(self.unstated))]
        self._groups = [groups(measured) for measured in equations.sets]
        self._at_start = self.search.jacobian(start, np.ones(len(self.unstated)))
        self._first: tuple[FloatArray, tuple[Decomposed, Decomposed]] | None = None

    def solve(self) -> Estimate:
        """The estimate; noise that is not stated is estimated along, set by set."""
        ones = np.ones(len(self.unstated))
        setting = self._setting(ones, self._first_loss(), None)
        if not setting.searched.rank:
            names = ", ".join(self.equations.parameters.names)
            raise ArgumentError(f"they tell nothing about {names}")
        u = np.zeros(len(self.scale))
        for _ in range(_ROUNDS):
            # what is not told is held by rows that nothing contradicts
            kept = setting.searched.untold
            pins = setting.searched.singular[0] * kept.T
            u = self.search.best(u, setting.noise, setting.loss, pins)
            u = u - kept @ (kept.T @ u)
            estimate = self._estimate(u, setting)
            revised = self._revised(estimate)
            steady = self._steady(setting, revised)
            setting = revised
            if steady:
                break
        if self.loss == "linear" and not self.unstated.any():
            return replace(estimate, setting=setting)  # nothing that it was made with has changed
        return self._estimate(u, setting)

    # between the least squares ------------------------------------------------------------------

    def _loss(self, name: str, width: FloatArray) -> Loss:
        of_rows = width[self.equations.set_of]
        return Loss(name, self.equations.components, of_rows)

    def _first_loss(self) -> Loss:
        """Wide enough for the machine as drawn, and not so wide that gross errors lead astray."""
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

    def _setting(self, noise: FloatArray, loss: Loss, point: Point | None) -> Setting:
        """What can be told with this noise, before (`point` None) or after a fit."""
        size = self.start.robot.length
        noise_known = point is not None or not self.unstated.any()
        faint = size if noise_known else np.inf
        if self._first is None or (noise != self._first[0]).any():
            at_start = self._at_start / (noise @ np.array(self._equations_of))[:, None]
            self._first = noise, self._decomposed(at_start)
        _, first = self._first
        now = (
            (None, None) if point is None else self._decomposed(self.search.jacobian(point, noise))
        )
        told = directions(first[0], now[0], size)
        determined = directions(first[1], now[1], size)
        return Setting(noise, loss, told, determined, directions(first[1], now[1], size, faint))

    def _decomposed(self, jacobian: FloatArray) -> tuple[Decomposed, Decomposed]:
        """Without and with the prior."""
        data = decompose(jacobian)
        return data, decompose(np.vstack([jacobian, self.prior])) if len(self.prior) else data

    def _revised(self, estimate: Estimate) -> Setting:
        """Noise where it is not stated, limits of the loss, and what can be told with them."""
        factor = self._spread(estimate)
        noise = np.where(
            self.unstated,
            np.maximum(estimate.setting.noise * factor, _LEAST_NOISE),
            estimate.setting.noise,
        )
        # while the model is still far off, rows are odd only if they are further off than most
        width = np.where(self.unstated, 1.0, np.maximum(factor, 1.0))
        return self._setting(noise, self._loss(self.loss, width), estimate.point)

    def _spread(self, estimate: Estimate) -> FloatArray:
        """Deviation of the whitened residuals of each set, (sets,); 1 where nothing tells it."""
        rows, components = self.equations.set_of, self.equations.components
        squares = self._squares(estimate.residual)
        factor = np.ones(len(self.unstated))
        for i in np.flatnonzero(estimate.freedom >= _LEAST_FREEDOM):
            mine, k = squares[rows == i], components[rows == i]
            if self.loss == "linear":
                variance = mine.sum() / estimate.freedom[i]
            else:
                variance = median_ratio(mine, k) * k.sum() / estimate.freedom[i]
            if self.unstated[i]:
                variance *= self._inflation(estimate, int(i))
            factor[i] = np.sqrt(variance)
        return factor

    def _inflation(self, estimate: Estimate, i: int) -> float:
        """Where the model misses more than repeats scatter, they tell that once, not each time."""
        repeated = self._repeats(estimate, i)
        if not repeated.chance < SIGNIFICANT:
            return 1.0
        of_poses = repeated.missed / repeated.missed_freedom
        return of_poses / ((repeated.pure + repeated.missed) / float(estimate.freedom[i]))

    def repeats(self, estimate: Estimate, plain: bool = False) -> list[Split]:
        """Pure error and lack of fit of each set, whitened; `plain`: of their lengths in mm."""
        return [self._repeats(estimate, i, plain) for i in range(len(self._groups))]

    def _repeats(self, estimate: Estimate, i: int, plain: bool = False) -> Split:
        group, residual = self._groups[i], estimate.point.residuals[i]
        k = residual.shape[1]
        leverage = len(residual) * k - float(estimate.freedom[i])
        if plain:
            lengths = min(k, 3)
            white = np.tile(np.eye(lengths), (len(residual), 1, 1))
            return split(residual[:, :lengths], white, group, leverage * lengths / k)
        weights = estimate.weights[self.equations.set_of == i]
        white = self.equations.white(i) * np.sqrt(weights)[:, None, None]
        return split(residual, white / estimate.setting.noise[i], group, leverage)

    def _steady(self, old: Setting, new: Setting) -> bool:
        if old.searched.rank != new.searched.rank:
            return False
        if self.loss == "linear" and not len(self.prior) and len(self.unstated) == 1:
            return True  # the noise does not move the solution
        return np.allclose(old.noise, new.noise, rtol=1e-3, atol=_LEAST_NOISE) and np.allclose(
            old.loss.width, new.loss.width, rtol=1e-3
        )

    def plain(self, point: Point) -> FloatArray:
        """Scaled Jacobian (M, n), not whitened: mm per mm, angles as their arc."""
        parts = []
        for part, measured in zip(self.equations.jacobian(point), self.equations.sets, strict=True):
            arc = np.where(np.array(measured.units) == "rad", self.start.robot.length, 1.0)
            parts.append((part * arc[:, None]).reshape(-1, part.shape[2]))
        jacobian: FloatArray = np.concatenate(parts) * self.scale
        return jacobian

    def _estimate(self, u: FloatArray, setting: Setting) -> Estimate:
        point = self.search.at(u)
        jacobian = self.search.jacobian(point, setting.noise)
        residual = self.equations.whitened(point.residuals, setting.noise)
        weights = setting.loss.weights(residual)
        every = np.repeat(weights, self.equations.components)
        parts = [np.sqrt(every[mine, None]) * jacobian[mine] for mine in self._equations_of]
        factors = [triangle(part) for part in parts]
        told = setting.determined.told
        _, singular, rows = np.linalg.svd(
            triangle(np.vstack([*factors, self.prior])) @ told, full_matrices=False
        )
        half = told @ (rows.T / singular)
        fitted = half[:, : setting.searched.rank]
        leverage = [float(((factor @ fitted) ** 2).sum()) for factor in factors]
        count = [float(every[mine].sum()) for mine in self._equations_of]
        freedom = np.array(count) - np.array(leverage)
        return Estimate(point, setting, residual, jacobian, weights, half @ half.T, freedom)
