"""Statistics of a fit, part by part: parameters, rank, misfit."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, rms
from pkmcal.estimation import misfits
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.gauges import gauges
from pkmcal.estimation.identifiability import (
    as_sum,
    held_errors,
    sparse_basis,
)
from pkmcal.estimation.mirror import MIRROR, mirror_fits
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.distances import rms_reached
from pkmcal.fitted.dropped import outlying
from pkmcal.fitted.nuisances import CHECKED, in_result, nuisances
from pkmcal.statistics.distributions import t_factor
from pkmcal.statistics.linear_fit import triangle
from pkmcal.statistics.prior_test import LEAST_FREEDOM, PriorTest, left_alone, prior_test

INVOLVED = 1e-6  # share of a parameter in unidentifiable combinations from which it is one


def parameter_table(
    estimator: Estimator, estimate: Estimate, uncertainty: Uncertainty, start: FloatArray
) -> dict[str, Any]:
    """The parameters, their uncertainty, and what they were before the calibration: `start`."""
    chosen, theta = estimator.equations.parameters, estimate.evaluation.theta
    rates = chosen.reported_rates(theta) * chosen.scale
    along = rates @ estimate.state.determined.unidentifiable
    unknown = np.linalg.norm(along, axis=1) > INVOLVED * chosen.scale
    unknown |= uncertainty.freedom <= 0  # nothing shows the deviation
    rank, size = estimate.state.determined.rank, estimator.size
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
        if np.isfinite(bound).any():
            at_bound |= np.isclose(theta, bound, rtol=1e-9, atol=1e-9)
    by_design = rates @ estimate.covariance @ rates.T
    beside = nuisances(chosen, theta, values, by_design)
    mine = np.flatnonzero(in_result(chosen, beside))
    known = np.isfinite(stderr[mine])
    return {
        "free": tuple(chosen.names[i] for i in mine),
        "units": tuple(chosen.units[i] for i in mine),
        "columns": mine,
        "values": values[mine],
        "start": chosen.reported(start)[mine],
        "stderr": stderr[mine],
        "parameter_dof": freedom[mine],
        "interval95": np.column_stack([values - half, values + half])[mine],
        "covariance": shown[np.ix_(mine, mine)],
        "correlation_matrix": _correlation(by_design[np.ix_(mine, mine)], known),
        "nuisances": beside,
        "at_bounds": tuple(name for name, at in zip(chosen.names, at_bound, strict=True) if at),
        "covariance_rule": uncertainty.covariance.rule,
    }


def _correlation(covariance: FloatArray, known: BoolArray) -> FloatArray:
    """Correlations (n, n) of a covariance; NaN beside parameters that are not determined."""
    deviation = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale = np.where(known & (deviation > 0), deviation, np.nan)
    matrix: FloatArray = covariance / np.outer(scale, scale)
    return matrix


def identifiability(estimator: Estimator, estimate: Estimate, hidden: int) -> dict[str, Any]:
    """Return what measurements alone determine, without `hidden` parameters."""
    equations, measured = estimator.equations, estimate.state.measured
    chosen = equations.parameters
    names: tuple[str, ...] = ()
    rest = measured.unidentifiable
    yields = chosen.robot.model.elastic is not None
    if equations.machines.unknowns or yields:
        names, rest = gauges(chosen, rest)
        if len(estimate.prior):  # a tape on two anchors ends the scale, say
            names, _ = gauges(chosen, estimate.state.determined.unidentifiable)
    if mirror_fits(equations, estimate.evaluation, estimate.state.noise):
        names = (*names, MIRROR)
    open_ones = sparse_basis(rest, chosen.families).T
    return {
        "rank": measured.rank - hidden,
        "gap": measured.gap,
        "unidentifiable": tuple(
            as_sum(combination, chosen.names, chosen.units, chosen.scale)
            for combination in open_ones
        ),
        "gauges": names,
    }


def misfit(
    estimator: Estimator,
    estimate: Estimate,
    uncertainty: Uncertainty,
    commanded: tuple[Evaluation, Evaluation],
    begun: Evaluation,
) -> dict[str, Any]:
    """Residuals before and after, χ² per degree of freedom, noise and outliers.

    `commanded` are the equations before and after with poses that follow from the actuators;
    `begun` are the fitted ones before.
    """
    start, end = commanded
    equations, state = estimator.equations, estimate.state
    prior = equations.parameters.prior_left(estimate.evaluation.theta)
    dof = float(estimate.weights @ equations.blocks.components) + len(prior) - state.fitted.rank
    squares = np.repeat(estimate.weights, equations.blocks.components) @ estimate.residual**2
    stated = equations.sigma_stated and dof > 0
    shown = np.where(estimator.unstated & ~uncertainty.unknown, state.noise, np.nan)
    deviations = equations.whitening.deviations
    sets = equations.table.sets
    groups, set_of_group = equations.whitening.groups, equations.whitening.set_of_group
    arcs = [relative * shown[group] for relative, group in zip(deviations, groups, strict=True)]
    left = np.bincount(set_of_group, estimate.freedom[: len(set_of_group)], len(sets))
    beside = estimate.freedom[len(set_of_group) :]
    by_component = tuple(
        tuple((arc / own).tolist()) for own, arc in zip(equations.arcs, arcs, strict=True)
    )
    named = outlying(estimator, estimate)
    before, after = (rms_reached(misfits.distances(equations, each)) for each in (start, end))
    return {
        "rms": after,
        "rms_before": before,
        "closure_rms": misfits.closure_rms(equations, estimate.evaluation),
        "closure_rms_before": misfits.closure_rms(equations, begun),
        "history": (misfits.progress(equations, begun), *estimate.history[1:]),
        "closures": misfits.worst_closures(equations, estimate.evaluation),
        "actuator_noise": float(shown[-1]) if equations.machines.unknowns else float("nan"),
        "tension_noise": float(shown[-2]) if equations.machines.cells else float("nan"),
        "tension_rms": misfits.cell_rms(equations, estimate.evaluation),
        "redundancy": (*left.tolist(), *beside.tolist()),
        "idle": equations.blocks.uninformative,
        "chi2_per_dof": float((squares + prior @ prior) / dof) if stated else float("nan"),
        "dof": dof,
        "noise": tuple(rms(arc[:3]) for arc in arcs),
        "component_noise": by_component,
        "components": tuple(m.components for m in sets),
        "component_units": tuple(m.units for m in sets),
        "told_apart": any((relative != 1.0).any() for relative in deviations),
        "residuals": end.residuals,
        "rows": equations.table.rows,
        "outliers": tuple(equations.table.rows[named].tolist()),
    }


def tested_prior(
    estimator: Estimator, estimate: Estimate, *, of_uncertain: bool = False
) -> PriorTest | None:
    """Test measurements against the prior; None without one, or where nothing can tell.

    Or, `of_uncertain`, the stated uncertainty of numbers that were fitted along. What is known
    otherwise is an equation like the measurements. A robust fit's prior is not tested.
    """
    chosen = estimator.equations.parameters
    mine = np.zeros(len(estimate.prior), dtype=bool)
    mine[chosen.prior_of_uncertain] = True
    mine = mine if of_uncertain else ~mine
    rows, others = estimate.prior[mine], estimate.prior[~mine]
    if not len(rows) or np.linalg.matrix_rank(rows) < len(rows) or estimator.loss != "linear":
        return None
    # parameters as what the prior says of them, in its deviations, and the rest
    known = np.asarray(np.linalg.pinv(rows), dtype=np.float64)
    rest = np.linalg.svd(rows)[2][len(rows) :].T
    left = chosen.prior_left(estimate.evaluation.theta)
    centre = known @ left[mine]
    data = estimate.residual - estimate.change(centre)
    few = triangle([estimate.design, data])  # turned rows, which say what all of them say
    variance, freedom = 1.0, np.inf
    if estimator.unstated.any():
        squares, freedom = left_alone(few, len(data))
        if freedom < LEAST_FREEDOM:
            return None
        variance = squares / freedom
    design, left_over = few[:, :-1], few[:, -1]
    columns = [estimate.change(known, design), estimate.change(rest, design), left_over]
    if len(others):
        beside = [others @ known, others @ rest, left[~mine] - others @ centre]
        sigma = np.sqrt(variance)
        columns = [
            np.concatenate([own, sigma * more]) for own, more in zip(columns, beside, strict=True)
        ]
    factor = triangle(columns)
    k = len(rows)
    least = CHECKED if of_uncertain else 0.0
    return prior_test(factor[:, :k], factor[:, k:-1], factor[:, -1], variance, freedom, least)
