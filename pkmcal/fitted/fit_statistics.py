"""What a fit says of itself, part by part: parameters, rank, misfit, repeats, search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, rms
from pkmcal.estimation import misfits
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.gauges import gauges
from pkmcal.estimation.identifiability import (
    as_sum,
    held_errors,
    observability,
    sparse_basis,
)
from pkmcal.estimation.mirror import MIRROR, mirror_fits
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.distances import Distances, distances
from pkmcal.fitted.dropped import outlying
from pkmcal.statistics.distributions import t_factor
from pkmcal.statistics.linear_fit import triangle
from pkmcal.statistics.prior_test import LEAST_FREEDOM, PriorTest, data_alone, prior_test

_INVOLVED = 1e-6  # share of a parameter in unidentifiable combinations from which it is one


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterTable:
    """The parameters before and after, with their uncertainty; see `Identification`.

    Attributes
    ----------
    free : tuple of str
        Names (n,): numbers of the geometry, then of an unknown frame and unknown targets.
    units : tuple of str
        Unit of each parameter: "mm", "rad" or "1" (a ratio).
    values : ndarray
        Identified values (n,).
    start : ndarray
        Values (n,) before the calibration.
    stderr : ndarray
        Standard deviations (n,); inf where neither measurements nor prior determine.

        They know no bounds: for numbers `at_bounds` they are those without the bound.
    parameter_dof : ndarray
        Degrees of freedom (n,) of each `stderr`; inf where sigma says all, 0 where nothing.
    interval95 : ndarray
        Ends (n, 2) of intervals that hold the true value in 95 % of calibrations.

        By Student's t with `parameter_dof`: with few degrees of freedom much wider than twice
        `stderr`.
    covariance : ndarray
        Covariance (n, n) with stderr² on its diagonal; NaN beside an infinite variance.

        By `covariance_rule`. Where it is "cluster", its rank is at most the number of poses: each
        number in it is right, its inverse is not.
    correlation_matrix : ndarray
        Correlations (n, n) by the design; NaN beside parameters that are not determined.

        Those of equal independent errors at the poses that were measured: few poses show what
        each parameter's error is, not how the errors of two go together.
    at_bounds : tuple of str
        Parameters that ended at a bound.
    covariance_rule : str
        How: "classical", or "cluster" where rows of a pose share errors or a loss is robust.
    """

    free: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    start: FloatArray
    stderr: FloatArray
    parameter_dof: FloatArray
    interval95: FloatArray
    covariance: FloatArray
    correlation_matrix: FloatArray
    at_bounds: tuple[str, ...]
    covariance_rule: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Identifiability:
    """Rank of the measurements' Jacobian, what it leaves open, and how well it is conditioned.

    Attributes
    ----------
    rank : int
        Number of combinations that the measurements alone determine, without prior.
    gap : float
        Singular value of the last identifiable combination over the next; inf if none.
    unidentifiable : tuple of str
        Combinations that change no measured quantity, as "base1.x − platform1.x".

        They keep what they had, or follow the prior. Coefficients are in mm at the machine: an
        angle counts as its arc.
    gauges : tuple of str
        What readings of actuators alone leave open by their nature, in words.

        Where the base stands, the common scale; these combinations are not in `unidentifiable`.
    observability : dict of str to float
        Indices O1 … O5 of the scaled Jacobian, over the identifiable combinations.
    """

    rank: int
    gap: float
    unidentifiable: tuple[str, ...]
    gauges: tuple[str, ...]
    observability: dict[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Misfit:
    """Residuals of the fitted rows, and what they say of noise and outliers.

    Attributes
    ----------
    rms : float
        √(Σ r²/N) over the N fitted points, mm.

        Unweighted; r is the distance of the measured from the predicted point, of a pose that of
        its position.
    rms_before : float
        `rms` of the nominal machine, unknown frame and targets aligned with the readings.
    closure_rms : float
        How far the machine's own closures disagree at the poses found, mm of the actuators.

        NaN where poses follow from the actuators exactly: as many closures as free coordinates, and
        no `Measurements.actuator_sigma`.
    closure_rms_before : float
        `closure_rms` of the nominal machine.
    closures : ndarray
        How far off the worst closure at each pose is (K,), mm; NaN where they hold.
    actuator_noise : float
        Estimated deviation of what the actuators read, mm; NaN where it was stated.
    tension_noise : float
        Estimated deviation of what load cells read, N; NaN where it was stated.
    tension_rms : float
        How far tensions are off what load cells read, N; NaN where they are no unknowns.
    redundancy : tuple of float
        Degrees of freedom left in each set, then in load cells and closures if fitted.

        Equations less what poses and parameters took of them; a deviation estimated from r of them
        is itself good to 1/√(2 r) of it.
    idle : int
        How many poses say nothing, for nothing is left when they are determined.
    chi2_per_dof : float
        χ² per degree of freedom: about 1 if the noise is as stated; NaN without sigma.
    dof : float
        Degrees of freedom: equations, those of the prior included, less parameters.
    noise : tuple of float
        Estimated deviation of each set of measurements, mm; NaN where sigma was given.

        That of residuals: what a reading has of its own and what its pose shares, the model's error
        included. NaN, too, where no equations are left to show it.
    component_noise : tuple of tuple of float
        `noise` of each component, mm and rad.

        Components are told apart where the residuals call for it: lengths and angles, x y and z.
    components : tuple of tuple of str
        What was read of each set: x, y, z.
    told_apart : bool
        Whether components differ in their noise.
    reading_noise : tuple of float
        What a single reading of each set has of its own, mm per coordinate.
    pose_noise : tuple of float
        What rows of one pose share beside it, mm per coordinate: pose and model errors.
    residuals : tuple of ndarray
        Measured less predicted (N, k) of the fitted rows of each set, mm and rad.
    rows : ndarray of int
        Numbers of the fitted rows, counted through all sets from 0.
    outliers : tuple of int
        Rows that the others contradict, numbered likewise.
    distances_before : Distances
        Rms, median and 95 % quantile of the nominal machine's distances to fitted points, mm.
    distances : Distances
        Those of the calibrated machine, and its rms without `outliers`.
    """

    rms: float
    rms_before: float
    closure_rms: float
    closure_rms_before: float
    closures: FloatArray
    actuator_noise: float
    tension_noise: float
    tension_rms: float
    redundancy: tuple[float, ...]
    idle: int
    chi2_per_dof: float
    dof: float
    noise: tuple[float, ...]
    component_noise: tuple[tuple[float, ...], ...]
    components: tuple[tuple[str, ...], ...]
    told_apart: bool
    reading_noise: tuple[float, ...]
    pose_noise: tuple[float, ...]
    residuals: tuple[FloatArray, ...]
    rows: IntArray
    outliers: tuple[int, ...]
    distances_before: Distances
    distances: Distances


@dataclass(frozen=True, eq=False, kw_only=True)
class Repeats:
    """Pure error and lack of fit, mm per coordinate; NaN without repeated poses.

    Attributes
    ----------
    repeatability : float
        Scatter of repeats about their mean, mm per coordinate; NaN without repeats.
    lack_of_fit : float
        What the model misses at a pose beyond that scatter, mm per coordinate.
    lack_of_fit_chance : float
        p-value of the F test of lack of fit: small where the model misses something.
    """

    repeatability: float
    lack_of_fit: float
    lack_of_fit_chance: float


def parameter_table(
    estimator: Estimator, estimate: Estimate, uncertainty: Uncertainty
) -> ParameterTable:
    """The parameters with their uncertainty."""
    chosen, theta = estimator.equations.parameters, estimate.evaluation.theta
    rates = chosen.reported_rates(theta) * chosen.scale
    along = rates @ estimate.state.determined.unidentifiable
    unknown = np.linalg.norm(along, axis=1) > _INVOLVED * chosen.scale
    unknown |= uncertainty.freedom <= 0  # nothing shows the deviation
    rank, size = estimate.state.determined.rank, chosen.robot.length
    held = rates @ held_errors(estimate.triangle, estimate.prior, rank, size)
    shown = uncertainty.matrix + held @ held.T
    shown[unknown] = shown[:, unknown] = np.nan
    shown[unknown, unknown] = np.inf
    stderr = np.sqrt(np.maximum(np.diagonal(shown), 0.0))
    freedom = np.where(np.isfinite(stderr), uncertainty.freedom, 0.0)
    values = chosen.reported(theta)
    half = t_factor(freedom) * np.where(np.isfinite(stderr), stderr, np.inf)
    at_bound = np.zeros(len(chosen), dtype=bool)
    for bound in chosen.bounds:
        at_bound |= np.isclose(theta, bound, rtol=1e-9, atol=1e-9)
    return ParameterTable(
        free=chosen.names,
        units=chosen.units,
        values=values,
        start=chosen.reported(estimator.start.theta),
        stderr=stderr,
        parameter_dof=freedom,
        interval95=np.column_stack([values - half, values + half]),
        covariance=shown,
        correlation_matrix=_correlation(rates @ estimate.covariance @ rates.T, np.isfinite(stderr)),
        at_bounds=tuple(name for name, at in zip(chosen.names, at_bound, strict=True) if at),
        covariance_rule=uncertainty.covariance.rule,
    )


def _correlation(covariance: FloatArray, known: BoolArray) -> FloatArray:
    """Correlations (n, n) of a covariance; NaN beside parameters that are not determined."""
    deviation = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale = np.where(known & (deviation > 0), deviation, np.nan)
    matrix: FloatArray = covariance / np.outer(scale, scale)
    return matrix


def identifiability(estimator: Estimator, estimate: Estimate) -> Identifiability:
    """What the measurements alone determine."""
    equations, measured = estimator.equations, estimate.state.measured
    chosen = equations.parameters
    names: tuple[str, ...] = ()
    rest = measured.unidentifiable
    if equations.closures.unknowns:
        names, rest = gauges(chosen, rest)
        if len(estimate.prior):  # a tape on two anchors ends the scale, say
            names, _ = gauges(chosen, estimate.state.determined.unidentifiable)
    if mirror_fits(equations, estimate.evaluation, estimate.state.noise):
        names = (*names, MIRROR)
    open_ones = sparse_basis(rest, chosen.names).T
    return Identifiability(
        rank=measured.rank,
        gap=measured.gap,
        unidentifiable=tuple(
            as_sum(combination, chosen.names, chosen.units, chosen.scale)
            for combination in open_ones
        ),
        gauges=names,
        observability=observability(
            estimator.scaled_triangle(estimate.evaluation), len(equations.actuators), measured.rank
        ),
    )


def misfit(
    estimator: Estimator,
    estimate: Estimate,
    uncertainty: Uncertainty,
    commanded: tuple[Evaluation, Evaluation],
) -> Misfit:
    """Residuals before and after, χ² per degree of freedom, noise and outliers.

    `commanded` are the equations before and after with poses that follow from the actuators.
    """
    start, end = commanded
    equations, state = estimator.equations, estimate.state
    prior = equations.parameters.prior_left(estimate.evaluation.theta)
    dof = float(estimate.weights @ equations.components) + len(prior) - state.fitted.rank
    squares = np.repeat(estimate.weights, equations.components) @ estimate.residual**2
    stated = equations.sigma_stated and dof > 0
    split = uncertainty.noises
    shown = np.where(estimator.unstated & ~uncertainty.unknown, state.noise, np.nan)
    deviations = equations.whitening.deviations
    by_component = tuple(
        tuple((sigma * relative / m.instrument.mm(m, estimator.start.robot.length)).tolist())
        for m, relative, sigma in zip(equations.sets, deviations, shown, strict=False)
    )
    named = outlying(estimator, estimate)
    before, after = (distances(misfits.distances(equations, each), named) for each in (start, end))
    return Misfit(
        rms=after.rms,
        rms_before=before.rms,
        closure_rms=misfits.closure_rms(equations, estimate.evaluation),
        closure_rms_before=misfits.closure_rms(equations, estimator.start),
        closures=misfits.worst_closures(equations, estimate.evaluation),
        actuator_noise=float(shown[-1]) if equations.closures.unknowns else float("nan"),
        tension_noise=float(shown[-2]) if equations.closures.cells else float("nan"),
        tension_rms=misfits.cell_rms(equations, estimate.evaluation),
        redundancy=tuple(estimate.freedom.tolist()),
        idle=equations.blocks.uninformative,
        chi2_per_dof=float((squares + prior @ prior) / dof) if stated else float("nan"),
        dof=dof,
        noise=tuple(rms(np.array(each[:3])) for each in by_component),
        component_noise=by_component,
        components=tuple(m.components for m in equations.sets),
        told_apart=any((relative != 1.0).any() for relative in deviations),
        reading_noise=tuple(float(np.sqrt(total - shared)) for total, shared in split),
        pose_noise=tuple(float(np.sqrt(shared)) for _, shared in split),
        residuals=end.residuals,
        rows=equations.rows,
        outliers=tuple(equations.rows[named].tolist()),
        distances_before=before,
        distances=after,
    )


def repeats(uncertainty: Uncertainty) -> Repeats:
    """Scatter of repeated poses and what the model misses beyond it."""
    whitened, lengths = uncertainty.repeats(), uncertainty.repeats(plain=True)
    return Repeats(
        repeatability=lengths.scatter,
        lack_of_fit=lengths.beyond,
        lack_of_fit_chance=whitened.chance,
    )


def tested_prior(estimator: Estimator, estimate: Estimate) -> PriorTest | None:
    """Whether the measurements contradict the prior; None without one, or where nothing can tell.

    A robust fit's prior is not tested.
    """
    chosen = estimator.equations.parameters
    rows = estimate.prior
    if not len(rows) or np.linalg.matrix_rank(rows) < len(rows) or estimator.loss != "linear":
        return None
    # parameters as what the prior says of them, in its deviations, and the rest
    known = np.asarray(np.linalg.pinv(rows), dtype=np.float64)
    rest = np.linalg.svd(rows)[2][len(rows) :].T
    data = estimate.residual - estimate.change(known @ chosen.prior_left(estimate.evaluation.theta))
    variance, freedom = 1.0, np.inf
    if estimator.unstated.any():
        squares, freedom = data_alone(estimate.design, data)
        if freedom < LEAST_FREEDOM:
            return None
        variance = squares / freedom
    columns = [estimate.change(known), estimate.change(rest), data]
    factor = triangle(columns)
    k = len(rows)
    return prior_test(factor[:, :k], factor[:, k:-1], factor[:, -1], variance, freedom)
