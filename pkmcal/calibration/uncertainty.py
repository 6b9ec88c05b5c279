"""How sure an estimate is: the linear fit at the solution, its covariance and its noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import LEAST_FREEDOM, Estimate, Estimator
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import Covariance, CovarianceRule, covariance
from pkmcal.statistics.linear_fit import LinearFit, linear_fit, numbered
from pkmcal.statistics.noise import Noise, Split, joined, noise, split
from pkmcal.statistics.pseudo_residuals import PseudoResiduals, pseudo_residuals

FEW = 5.0  # degrees of freedom below which residuals hardly show the noise


@dataclass(frozen=True, eq=False)
class Labels:
    """What each of M equations belongs to, by number.

    Attributes
    ----------
    set_of, row, pose, target, component : ndarray of int (M,)
        Rows count through all sets; a pose is that of `poses_of_rows`; components of the same name
        have the same number.
    length : ndarray of bool (M,)
        Whether it is in mm; of a pose the position.
    """

    set_of: IntArray
    row: IntArray
    pose: IntArray
    target: IntArray
    component: IntArray
    length: BoolArray


def poses_of_rows(equations: Equations) -> IntArray:
    """Number of the pose of each row (N,): by `Measurements.group`, else by actuators.

    Rows at the same actuators are one pose in all sets.
    """
    pose = np.concatenate(equations.pose_of)
    for k, measured in enumerate(equations.sets):
        if measured.group is not None:
            pose[equations.set_of == k] = measured.pose_index + pose.max() + 1
    return numbered(pose)


def labels(equations: Equations) -> Labels:
    """Label the equations."""
    names: dict[str, int] = {}
    targets, components, lengths = [], [], []
    for m in equations.sets:
        index = np.zeros(len(m), dtype=np.intp) if m.target_index is None else m.target_index
        targets.append(np.repeat(index, len(m.components)))
        numbers = [names.setdefault(name, len(names)) for name in m.components]
        components.append(np.tile(numbers, len(m)))
        lengths.append(np.tile([unit == "mm" for unit in m.units], len(m)))
    row = np.repeat(np.arange(len(equations.rows)), equations.components)
    return Labels(
        set_of=equations.set_of[row],
        row=row,
        pose=poses_of_rows(equations)[row],
        target=np.concatenate(targets),
        component=np.concatenate(components),
        length=np.concatenate(lengths),
    )


def stated_variances(measured: Measurements) -> FloatArray | None:
    """Mean variance of the lengths of each row (N,), mm², as sigma says; None where it does not."""
    sigma = measured.sigma
    if sigma is None:
        return None
    squares = sigma**2 if sigma.ndim == 2 else np.diagonal(sigma, axis1=1, axis2=2)
    means: FloatArray = squares[:, :3].mean(axis=1)
    return means


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance, degrees of freedom and noise of an estimate.

    Attributes
    ----------
    labels : Labels
        Of the equations.
    fit : LinearFit
        The linear fit at the solution, whitened.
    pseudo : PseudoResiduals
        Its residuals.
    covariance : Covariance
        By the rule that was asked for or that the residuals call for.
    reported : ndarray (n, p)
        The reported parameters, mm and rad, by the basis of the fit.
    known : bool
        Whether there is noise to tell the uncertainty: stated, or shown by spare equations.
    """

    labels: Labels
    fit: LinearFit
    pseudo: PseudoResiduals
    covariance: Covariance
    reported: FloatArray
    known: bool
    _equations: Equations
    _factors: FloatArray

    @cached_property
    def matrix(self) -> FloatArray:
        """Covariance (n, n) of the reported parameters; inf where the noise is not known."""
        if not self.known:
            return np.full((len(self.reported),) * 2, np.inf)
        return self.covariance.of(self.reported)

    @cached_property
    def scaled(self) -> FloatArray:
        """Covariance (n, n) of the scaled parameters."""
        return self.covariance.of(self.fit.back)

    @cached_property
    def freedom(self) -> FloatArray:
        """Degrees of freedom (n,) of the variances of the reported parameters."""
        if not self.known:
            return np.zeros(len(self.reported))
        return self.covariance.freedom(self.reported)

    @property
    def poses(self) -> IntArray:
        """Number of the pose of each row (N,)."""
        return poses_of_rows(self._equations)

    @cached_property
    def by_cluster(self) -> FloatArray:
        """Covariance (p, p) in the basis that allows for whatever rows of a pose share."""
        prior = self.fit.prior.T @ self.fit.prior
        matrix: FloatArray = self.covariance.sandwich.data + prior
        return matrix

    def in_units(self, whitened: FloatArray) -> FloatArray:
        """Whitened values (M,) in mm and rad."""
        return np.concatenate(
            [p.ravel() for p in self._equations.unwhiten(whitened, self._factors)]
        )

    @cached_property
    def adjusted(self) -> FloatArray:
        """Residuals (M,) with the variance of the errors, mm and rad."""
        return self.in_units(self.covariance.sandwich.residual)

    def lengths_of(self, i: int) -> BoolArray:
        """Equations (M,) of set `i` that are lengths."""
        chosen: BoolArray = self.labels.length & (self.labels.set_of == i)
        return chosen

    def noise(self, i: int) -> Noise:
        """Variances in mm² of a length of set `i`; NaN where nothing shows them."""
        stated = self.stated_variances(i)
        if stated is not None and self.fit.freedom < FEW:
            return Noise(float(stated.mean()), 0.0)
        mine = self.lengths_of(i)
        retained = self.covariance.sandwich.retained[mine]
        return noise(self.adjusted[mine], retained, numbered(self.fit.key[mine]))

    def stated_variances(self, i: int) -> FloatArray | None:
        """`stated_variances` of set `i`."""
        return stated_variances(self._equations.sets[i])

    def repeats(self, plain: bool = False) -> Split:
        """Pure error and lack of fit, whitened; `plain`: of lengths in mm."""
        values = self.in_units(self.fit.residual) if plain else self.fit.residual
        key = numbered(self.fit.key, self.labels.target)
        parts = []
        for i in range(len(self._equations.sets)):
            mine = self.lengths_of(i) if plain else self.labels.set_of == i
            leverage = float(self.fit.leverage[mine].sum())
            parts.append(split(values[mine], numbered(key[mine]), leverage))
        return joined(parts)


def uncertainty(estimator: Estimator, estimate: Estimate, rule: CovarianceRule) -> Uncertainty:
    """Say how sure an estimate is; `rule` is that of `identify`."""
    equations, state = estimator.equations, estimate.state
    named = labels(equations)
    robust = estimator.loss != "linear"
    pseudo = PseudoResiduals(estimate.residual, 1.0, 1.0)
    if robust:
        pseudo = pseudo_residuals(
            estimate.residual,
            equations.components,
            estimate.weights,
            state.loss.decline(estimate.residual),
            state.determined.rank,
        )
    fit = linear_fit(
        estimate.jacobian,
        pseudo.residual,
        estimator.prior,
        state.determined.identifiable,
        named.pose,
        named.component,
    )
    chosen = equations.parameters
    rates = chosen.reported_rates(estimate.evaluation.theta) * chosen.scale
    spare = bool((estimate.freedom >= LEAST_FREEDOM)[estimator.unstated].all())
    return Uncertainty(
        labels=named,
        fit=fit,
        pseudo=pseudo,
        covariance=covariance(fit, rule, stated=not estimator.unstated.any(), robust=robust),
        reported=rates @ fit.back,
        known=spare,
        _equations=equations,
        _factors=state.noise,
    )
