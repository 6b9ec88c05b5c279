"""How sure an estimate is: the linear fit at the solution, its covariance and its noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import FEW, Estimator
from pkmcal.estimation.labels import Labels, labels, poses_of_rows
from pkmcal.estimation.misfits import rounding
from pkmcal.estimation.set_noise import slipped
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.clusters import shared_error_score
from pkmcal.statistics.covariance import SHARED, Covariance, CovarianceRule, covariance
from pkmcal.statistics.linear_fit import LinearFit, in_unit_basis, numbered, unit_basis
from pkmcal.statistics.noise import Noise, Split, joined, noise, split
from pkmcal.statistics.pseudo_residuals import pseudo_residuals
from pkmcal.statistics.variance_components import told_apart, variance_components

_ROUNDED = 1e3  # times rounding errors, below which residuals are nothing else


def stated_variances(measured: Measurements) -> FloatArray | None:
    """Mean variance of the lengths of each row (N,), mm², as sigma says; None where it does not.

    Where angles alone were read theirs, rad².
    """
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
    covariance : Covariance
        By the rule that was asked for or that the residuals call for.
    reported : ndarray (n, p)
        The reported parameters, mm and rad, by the basis of the fit.
    unknown : ndarray of bool (G,)
        Groups of equations whose noise is neither stated nor shown by spare equations.
    equations : Equations
        What was fitted.
    factors : ndarray (G,)
        `IterationState.noise`.
    slips : ndarray
        Of each set, `slipped`.
    """

    labels: Labels
    fit: LinearFit
    covariance: Covariance
    reported: FloatArray
    unknown: BoolArray
    equations: Equations
    factors: FloatArray
    slips: FloatArray

    @property
    def known(self) -> bool:
        """Whether there is noise to state the uncertainty: stated, or shown by spare equations."""
        return not self.unknown.any()

    @cached_property
    def rounded(self) -> bool:
        """Whether the residuals are nothing but rounding errors."""
        limit = _ROUNDED * rounding(self.equations, self.factors)
        return bool(np.linalg.norm(self.fit.residual) < limit)

    @property
    def mixed(self) -> bool:
        """Whether equations are mixtures of readings and closures; see `labels`."""
        return bool(self.equations.closures.unknowns)

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
        return poses_of_rows(self.equations)

    @cached_property
    def by_cluster(self) -> FloatArray:
        """Covariance (p, p) in the basis that allows for whatever rows of a pose share."""
        prior = self.fit.prior.T @ self.fit.prior
        matrix: FloatArray = self.covariance.sandwich.data + prior
        return matrix

    def in_units(self, whitened: FloatArray) -> FloatArray:
        """Whitened values (M,) in mm and rad; where angles alone were read, their arcs in mm."""
        parts = self.equations.whitening.unwhiten(whitened, self.factors)
        arcs = self.equations.arcs
        every = [arc * part.ravel() for arc, part in zip(arcs, parts, strict=True)]
        return np.concatenate(every)[self.equations.whitening.present]

    @cached_property
    def adjusted(self) -> FloatArray:
        """Residuals (M,) with the variance of the errors, mm and rad."""
        return self.in_units(self.covariance.sandwich.residual)

    def lengths_of(self, i: int) -> BoolArray:
        """Equations (M,) of set `i` that are lengths."""
        chosen: BoolArray = self.labels.length & (self.labels.set_of == i)
        return chosen

    @cached_property
    def noises(self) -> tuple[Noise, ...]:
        """Variances in mm² of a length of each set; NaN where nothing shows them."""
        return tuple(self._noise(i) for i in range(len(self.equations.table.sets)))

    @cached_property
    def excess(self) -> Noise:
        """Variances of an equation in units of what it was whitened by."""
        if self.equations.blocks.unstated.any() or self.fit.freedom >= FEW:
            sandwich = self.covariance.sandwich
            return noise(sandwich.residual, sandwich.retained, self.fit.key)
        return 1.0, 0.0

    def _noise(self, i: int) -> Noise:
        stated = self.stated_variances(i)
        if self.mixed:
            own = float(self.factors[i] ** 2 if stated is None else stated.mean())
            shown = self.equations.table.sets[i].components and not self.unknown[i]
            return own * self.excess[0] if shown else float("nan"), 0.0
        if stated is not None and self.fit.freedom < FEW:
            return float(stated.mean()), 0.0
        mine = self.lengths_of(i)
        retained = self.covariance.sandwich.retained[mine]
        return noise(self.adjusted[mine], retained, numbered(self.fit.key[mine]))

    def stated_variances(self, i: int) -> FloatArray | None:
        """`stated_variances` of set `i`, of angles that were read alone as arcs."""
        stated = stated_variances(self.equations.table.sets[i])
        return None if stated is None else self.equations.arcs[i] ** 2 * stated

    @cached_property
    def _repeated(self) -> IntArray:
        """Number of the reading of each equation (M,): repeats of it have the same."""
        key = self.fit.key
        alone = int(key.max()) + 1 == len(key)
        return key if alone else numbered(key, self.labels.target)

    def repeats(self, plain: bool = False) -> Split:
        """Pure error and lack of fit, whitened; `plain`: of lengths in mm.

        None of mixtures: poses take part in what their repeats scatter.
        """
        if self.mixed:
            return joined([])
        key = self._repeated
        if int(key.max()) + 1 == len(key):
            return joined([])
        values = self.in_units(self.fit.residual) if plain else self.fit.residual
        parts = []
        for i in range(len(self.equations.table.sets)):
            mine = self.lengths_of(i) if plain else self.labels.set_of == i
            leverage = float(self.fit.leverage[mine].sum())
            if mine.any():
                parts.append(split(values[mine], numbered(key[mine]), leverage))
        return joined(parts)


LinearModel = tuple[Labels, LinearFit]  # what equations belong to, and the fit as a linear one


def uncertainty(
    estimator: Estimator,
    estimate: Estimate,
    solution: LinearModel,
    rule: CovarianceRule,
    classes: IntArray | None = None,
) -> Uncertainty:
    """Say how sure an estimate is, of which `solved` made the linear model `solution`.

    `classes` (M,) are those of equations whose variances were estimated apart: see
    `unlike_components`.
    """
    equations, state = estimator.equations, estimate.state
    named, fit = solution
    chosen = equations.parameters
    rates = chosen.reported_rates(estimate.evaluation.theta) * chosen.scale
    if (
        rule == "auto"
        and equations.closures.unknowns
        and fit.clusters < len(equations.blocks.components)
    ):
        rule = "cluster"  # no two mixtures can be compared to see whether they share an error
    slips = slipped(estimator, estimate)
    if rule == "auto" and (slips != 1.0).any():
        rule = "cluster"  # which holds whatever the weights
    apart = None
    if classes is not None:
        apart = variance_components(fit, classes, _prior_residual(estimator, estimate))
    return Uncertainty(
        labels=named,
        fit=fit,
        covariance=covariance(
            fit,
            rule,
            stated=not estimator.unstated.any(),
            robust=estimator.loss != "linear",
            components=apart,
        ),
        reported=rates @ fit.back,
        unknown=estimator.unknown_noise(estimate),
        equations=equations,
        factors=state.noise,
        slips=slips,
    )


def solved(estimator: Estimator, estimate: Estimate) -> LinearModel:
    """The linear model at an estimate."""
    named, state = labels(estimator.equations), estimate.state
    residual = estimate.residual
    if estimator.loss != "linear":
        residual, _, _ = pseudo_residuals(
            residual,
            estimator.equations.blocks.components,
            estimate.weights,
            state.loss.decline(residual),
            state.determined.rank,
        )
    back, design = estimate.half, estimate.design[:, : state.determined.rank]
    if estimator.loss != "linear":  # equations count alike, their residuals are other ones
        back = unit_basis(estimate.triangle, estimate.prior, state.determined.identifiable)
        design = estimate.change(back)
    fit = in_unit_basis(design, residual, estimate.prior, back, named.pose, named.component)
    return named, fit


def _prior_residual(estimator: Estimator, estimate: Estimate) -> FloatArray:
    return estimator.equations.parameters.prior_left(estimate.evaluation.theta)


def unlike_components(
    estimator: Estimator, estimate: Estimate, solution: LinearModel
) -> tuple[IntArray, list[FloatArray]] | None:
    """Whether components of a set without sigma have unlike variances.

    Tried in turn: lengths and angles, x y and z and angles, each component.

    Returns
    -------
    classes : ndarray of int (M,)
        Of the equations.
    deviations : list of ndarray (k,)
        Relative deviation of each component of each set.

    None where nothing speaks for it; where sigma is stated; for robust losses; where rows of a pose
    share errors, which are the model's more than the instrument's and no ground for weights; and
    where equations are mixtures.
    """
    equations = estimator.equations
    several = any(len(m.components) > 1 for m in equations.table.sets)
    if equations.closures.unknowns:
        return None
    if estimator.loss != "linear" or not estimator.unstated.all() or not several:
        return None
    named, fit = solution
    if shared_error_score(fit) > SHARED:
        return None
    every = [np.tile(np.arange(len(m.components)), len(m)) for m in equations.table.sets]
    place = np.concatenate(every)[equations.whitening.present]
    schemes = (np.zeros(6), [0, 0, 0, 1, 1, 1], [0, 0, 1, 2, 2, 2], np.arange(6))
    candidates = [
        numbered(named.set_of, np.asarray(scheme, dtype=np.intp)[place]) for scheme in schemes
    ]
    found = told_apart(fit, candidates, _prior_residual(estimator, estimate))
    if found is None:
        return None
    deviations = [np.ones(len(m.components)) for m in equations.table.sets]
    of_equation = np.sqrt(found.variances)[found.classes]
    for i, k, deviation in zip(named.set_of, place, of_equation, strict=True):
        deviations[i][k] = deviation
    return found.classes, deviations
