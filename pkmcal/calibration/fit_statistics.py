"""What a fit says of itself, part by part: parameters, rank, misfit, repeats, search."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.equations import Evaluation
from pkmcal.calibration.estimator import Estimate, Estimator
from pkmcal.calibration.gauges import MIRROR, Gauges, gauges, mirror_fits
from pkmcal.calibration.identifiability import as_sum, observability, sparse_basis
from pkmcal.calibration.outliers import outliers
from pkmcal.measurements.lack_of_fit import joined

_INVOLVED = 1e-6  # share of a parameter in unidentifiable combinations from which it is one


@dataclass(frozen=True, eq=False)
class ParameterTable:
    """The parameters before and after, with their uncertainty; see `Identification`."""

    free: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    start: FloatArray
    stderr: FloatArray
    covariance: FloatArray
    at_bounds: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Rank of the measurements' Jacobian, what it leaves open, and how well it is conditioned."""

    rank: int
    gap: float
    unidentifiable: tuple[str, ...]
    gauges: tuple[str, ...]
    observability: dict[str, float]


@dataclass(frozen=True, eq=False)
class Misfit:
    """Residuals of the fitted rows, and what they say of noise and outliers."""

    rms: float
    rms_before: float
    closure_rms: float
    closure_rms_before: float
    closures: FloatArray
    actuator_noise: float
    redundancy: tuple[float, ...]
    idle: int
    chi2_per_dof: float
    dof: float
    noise: tuple[float, ...]
    residuals: tuple[FloatArray, ...]
    rows: IntArray
    outliers: tuple[int, ...]


@dataclass(frozen=True)
class Repeats:
    """Pure error and lack of fit, mm per coordinate; NaN without repeated poses."""

    repeatability: float
    lack_of_fit: float
    lack_of_fit_chance: float


@dataclass(frozen=True)
class SearchRecord:
    """How the least squares went."""

    converged: bool
    evaluations: int
    history: tuple[float, ...]


def reported_covariance(estimator: Estimator, estimate: Estimate) -> FloatArray:
    """Covariance (n, n) of the reported parameters, mm and rad; inf where noise is not known."""
    rates = _reported_by_scaled(estimator, estimate)
    if (estimator.unstated & (estimate.freedom < estimator.least_freedom)).any():
        return np.full((len(rates), len(rates)), np.inf)
    covariance: FloatArray = rates @ estimate.covariance @ rates.T
    return covariance


def _reported_by_scaled(estimator: Estimator, estimate: Estimate) -> FloatArray:
    """Derivative (n, n) of the reported parameters to the scaled ones."""
    chosen = estimator.equations.parameters
    rates: FloatArray = chosen.reported_rates(estimate.evaluation.theta) * chosen.scale
    return rates


def parameter_table(
    estimator: Estimator, estimate: Estimate, covariance: FloatArray
) -> ParameterTable:
    """The parameters; `covariance` is `reported_covariance`."""
    chosen, theta = estimator.equations.parameters, estimate.evaluation.theta
    along = _reported_by_scaled(estimator, estimate) @ estimate.state.determined.unidentifiable
    unknown = np.linalg.norm(along, axis=1) > _INVOLVED * chosen.scale
    shown = covariance.copy()
    shown[unknown] = shown[:, unknown] = np.nan
    shown[unknown, unknown] = np.inf
    at_bound = np.zeros(len(chosen), dtype=bool)
    for bound in chosen.bounds:
        at_bound |= np.isclose(theta, bound, rtol=1e-9, atol=1e-9)
    return ParameterTable(
        free=chosen.names,
        units=chosen.units,
        values=chosen.reported(theta),
        start=chosen.reported(estimator.start.theta),
        stderr=np.sqrt(np.diagonal(shown)),
        covariance=shown,
        at_bounds=tuple(name for name, at in zip(chosen.names, at_bound, strict=True) if at),
    )


def identifiability(estimator: Estimator, estimate: Estimate) -> Identifiability:
    """What the measurements alone determine."""
    equations, measured = estimator.equations, estimate.state.measured
    names = equations.parameters.names
    told = Gauges((), measured.unidentifiable)
    if equations.closures.unknowns:
        told = gauges(equations.parameters, measured.unidentifiable)
    if mirror_fits(equations, estimate.evaluation, estimate.state.noise):
        told = replace(told, texts=(*told.texts, MIRROR))
    open_ones = sparse_basis(told.rest, names).T
    jacobian = estimator.scaled_jacobian(estimate.evaluation)
    return Identifiability(
        rank=measured.rank,
        gap=measured.gap,
        unidentifiable=tuple(as_sum(combination, names) for combination in open_ones),
        gauges=told.texts,
        observability=observability(jacobian, len(equations.actuators), measured.rank),
    )


def misfit(estimator: Estimator, estimate: Estimate, start: Evaluation, end: Evaluation) -> Misfit:
    """Residuals before and after, χ² per degree of freedom, noise and outliers.

    `start` and `end` are the equations with poses that follow from the actuators.
    """
    equations, state = estimator.equations, estimate.state
    chosen, fitted = equations.parameters, state.fitted.identifiable
    moved = (estimate.evaluation.theta - chosen.start) / chosen.scale
    prior = estimator.prior @ moved
    dof = float(estimate.weights @ equations.components) + len(prior) - state.fitted.rank
    squares = np.repeat(estimate.weights, equations.components) @ estimate.residual**2
    involved = estimate.freedom != 0.0  # sets of which nothing was read are not
    no_sigma = bool(estimator.unstated[involved].all()) or dof <= 0
    odd = outliers(
        estimate.residual,
        estimate.jacobian @ fitted,
        equations.components,
        estimate.weights,
        estimator.prior @ fitted,
    )
    sets = len(equations.sets)
    unknown_noise = np.where(estimator.unstated, state.noise, np.nan)
    return Misfit(
        rms=equations.rms(end),
        rms_before=equations.rms(start),
        closure_rms=equations.closure_rms(estimate.evaluation),
        closure_rms_before=equations.closure_rms(estimator.start),
        closures=equations.worst_closures(estimate.evaluation),
        actuator_noise=float(np.append(unknown_noise, np.nan)[sets]),
        redundancy=tuple(estimate.freedom.tolist()),
        idle=equations.idle,
        chi2_per_dof=float("nan") if no_sigma else float((squares + prior @ prior) / dof),
        dof=dof,
        noise=tuple(unknown_noise[:sets].tolist()),
        residuals=end.residuals,
        rows=equations.rows,
        outliers=tuple(equations.rows[np.isin(equations.unit_of_row, odd)].tolist()),
    )


def repeats(estimator: Estimator, estimate: Estimate) -> Repeats:
    """Scatter of repeated poses and what the model misses beyond it."""
    whitened = joined(estimator.repeats(estimate))
    lengths = joined(estimator.repeats(estimate, plain=True))
    return Repeats(lengths.scatter, lengths.beyond, whitened.chance)
