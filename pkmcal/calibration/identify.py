"""`identify`: the geometry of a machine from measurements."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal.arguments import word, words
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.plausibility import (
    beyond_strokes,
    contradicted_prior,
    distant_points,
    implausible_changes,
    insufficient_data,
    likely_unit_errors,
    shrunk,
)
from pkmcal.diagnostics.row_errors import likely_mistakes
from pkmcal.effects.expansion import Coefficients, expansion_of
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fit_data, as_fitted, by_set, informative
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import LEAST_FREEDOM, Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.loss import LIMITS, LossName
from pkmcal.estimation.mode_slips import in_other_modes
from pkmcal.estimation.parameters import Asked, Bounds, Known, Prior
from pkmcal.estimation.set_noise import unlike_noise
from pkmcal.estimation.starts import known_distances
from pkmcal.estimation.uncertainty import Uncertainty, solved, uncertainty, unlike_components
from pkmcal.exceptions import ArgumentError, CalibrationWarning
from pkmcal.fitted.datum import DATUMS, NO_DATUM, DatumRule
from pkmcal.fitted.datum import datum as choose_datum
from pkmcal.fitted.dropped import (
    OUTLIERS,
    Drop,
    held_without,
    named_rows,
    robust_outliers,
    without,
)
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.fit_statistics import (
    identifiability,
    misfit,
    parameter_table,
    repeats,
    tested_prior,
)
from pkmcal.fitted.holdout import HeldOut, draw, evaluate
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.slack import SLACK, Cell, Slack, said_slack, slack_cables, taut
from pkmcal.kinematics.calibratable import as_given, as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import RULES, CovarianceRule

_POOR = 0.1  # share of the misfit that a fit worth its name does not leave
_NOISY = 9.0  # chi²/dof that a slip in sigma does not explain


def identify(
    robot: Robot | SerialArm,
    measurements: Measurements | Sequence[Measurements],
    free: str | Sequence[str] | None = None,
    *,
    prior: Prior = None,
    loss: LossName = "linear",
    frame: Known | Sequence[Known] = "known",
    target: Known | Sequence[Known] = "known",
    holdout: float | Measurements | None = None,
    bounds: Bounds = None,
    attachment: Known | Sequence[Known] = "known",
    covariance: CovarianceRule = "auto",
    per_session: str | Sequence[str] = (),
    fix: str | Sequence[str] = (),
    datum: DatumRule = "none",
    drop: Drop = None,
    expansion: Coefficients = None,
    slack: Slack = "keep",
    effects: Sequence[Any] = (),
) -> Identification:
    """Find the geometry that agrees best with measurements.

    Weighted least squares on the measured quantities, through the forward kinematics and its
    exact derivatives.

    Parameters
    ----------
    robot : Robot or SerialArm
        The nominal machine, or as last calibrated. The numbers of an arm are its joint errors,
        ``joint1.dx`` … ``joint6.dpsi``.
    measurements : Measurements or sequence of Measurements
        Of any kinds.
    free : str or sequence of str, optional
        Names of numbers to find, or wildcards (``"base*.x"``). None: the robot's own default set.
    prior : float or mapping of str to float or (float, float), optional
        Standard deviation around the present value. A number, in mm, holds for all free numbers
        of the geometry (an angle as its arc at the machine's characteristic length) but those of a
        balanced load; a mapping gives it by name or wildcard in mm, rad and N, later entries before
        earlier ones. A key may also be a function of numbers: a sum, ``"gain1 - gain2"``, or the
        length of a sum of points, ``"|base1 - base2|"``; a pair is a value that was measured
        otherwise, and its deviation.
        None: no prior; unidentifiable combinations then move as little as possible.
    loss : {"linear", "huber", "cauchy"}
        Weight of rows with large residuals, by the length of the whole measured vector.
    frame : {"known", "unknown"} or a sequence of them
        Whether the instrument's frame is the robot's base frame or is to be found: six parameters
        ``frame.x`` … ``frame.gamma``, the pose of the base in the instrument's frame. Of several
        sets one word says that all have the same frame; one word each, that each unknown one is
        another, ``frame.x@2``. No start near it is needed.
    target : {"known", "unknown"} or a sequence of them
        Whether the measured points of the platform are known or to be found, from where
        `Measurements.target` puts them: ``target1.x`` …; for distances the fixed point,
        ``anchor1.x`` …; for orientations how the sensor is mounted, ``mounting.alpha`` …; for poses
        where on the platform what was measured is, ``tool.x`` … ``tool.gamma``, without a start.
        One word, or one each, as for frames.
    holdout : float or Measurements, optional
        A fraction of the poses of each set, drawn at random with repeats kept together, or other
        measurements: they are not fitted, only compared.
    bounds : mapping of str to (float, float), optional
        Lower and upper limit by name or wildcard, mm and rad.
    attachment : {"known", "unknown"} or a sequence of them
        Whether the points of the platform from which distances are measured are known or to be
        found, from where `Measurements.attachment` puts them: ``attachment1.x`` ….
    covariance : {"auto", "classical", "cluster"}
        How uncertain the parameters are. "cluster": rows of one pose may share an error, as
        several targets and repeats do. "classical": all errors are independent. "auto": cluster
        where the residuals show a shared error or the loss is robust, else classical. The values
        are the same.
    per_session : str or sequence of str
        Names or wildcards, ``"offset*"``, ``"frame*"``, of what is found anew in each
        `Measurements.session`: ``offset5@thursday``. A set without sessions is one, named after its
        file or counted from 1. All else is common. Priors and bounds hold for each session's
        number; of a session that is held out such numbers are found from its rows, before these
        are compared with the fit.
    fix : str or sequence of str
        Numbers of the geometry, by name or wildcard, that keep their present values though `free`
        or the robot's default set has them.
    datum : {"none", "auto"}
        "auto": also hold as many numbers as the measurements leave open of where the base frame and
        the platform frame lie, and of how the frames between an arm's joints are drawn: about
        3-2-1 of the joints of each. What is predicted of a measurement stays the same, and the
        other numbers have finite deviations, in the frames that the held ones define. They are
        `Identification.datum`. "none": such combinations move as little as possible.
    drop : sequence of int or "outliers", optional
        Rows that are left out, fitted or drawn to be held out: by their numbers, counted from 0
        through all sets, or those that the others contradict in a robust fit. They are
        `Identification.dropped`. Of other measurements that are held out the "outliers" are
        `Identification.holdout_dropped`; where most rows contradict the fit none is left out.
    expansion : float or mapping of str to float, optional
        Coefficients of thermal expansion in 1/K, of steel 11.5e-6: one for all, or of "base",
        "platform" (with the targets on it), "limbs" or single ones, "limb3"; parts that are not
        named do not grow. With `Measurements.temperature` the numbers are those at 20 °C.
    slack : {"keep", "drop"}
        What becomes of readings of cables that the others show to be slack, on a machine with more
        cables than needed: "keep" says so in a warning, "drop" leaves these readings out and keeps
        the rest of their rows. They are `Identification.slack`.

    Returns
    -------
    Identification
        The calibrated robot, the parameters with their uncertainty, and how good they are.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit, a name that is not known or tied; rows that the nominal
        machine cannot reach.

    Warns
    -----
    CalibrationWarning
        Units or columns that look mistaken, too few or repeated rows, no convergence. The texts
        are also in `Identification.warnings`.

    Examples
    --------
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> poses = np.array([0, 0, 850, 0, 0, 0]) + [[i * 20, 5 * i**2, 0, 0, 0, 0] for i in range(5)]
    >>> q = robot.inverse(poses)
    >>> true = robot.replace({"offset1": 0.3})
    >>> measured = pk.Measurements(q, true.forward(q).pose, "pose")
    >>> found = pk.identify(robot, measured, free="offset*")
    >>> round(found.robot.geometry["offset1"], 6)
    0.3
    """
    machine = as_machine(robot)
    unknown = {"frame": frame, "target": target, "attachment": attachment}
    anew = words("per_session", per_session)
    asked = Asked(free, prior, bounds, anew, by_set(unknown), words("fix", fix))
    grows = expansion_of(machine, expansion)
    given = as_fit_data(machine, measurements, unknown, bool(anew), grows, tuple(effects))
    dropped = named_rows(drop, sum(len(data.rows) for data in given))
    datasets, unread = informative(machine, given)
    held: list[tuple[FitData, int]] = []
    if isinstance(holdout, Measurements):
        held = [as_fitted(machine, holdout, datasets, sessions=bool(anew))]
    elif holdout is not None:
        pairs = [draw(data, holdout) for data in datasets]
        datasets, held = [kept for kept, _ in pairs], [(out, i) for i, (_, out) in enumerate(pairs)]
    datasets = without(datasets, dropped)
    datasets += known_distances(datasets)
    chosen = parameters(machine, datasets, asked)
    word("loss", loss, LIMITS)
    word("covariance", covariance, RULES)
    word("datum", datum, DATUMS)
    word("slack", slack, SLACK)
    equations, commanded, start = begun(datasets, chosen, unread)
    if held and equations.closures.cells:
        raise ArgumentError("holdout: rows whose tensions are unknown are all fitted: leave it out")
    cells: tuple[Cell, ...] = ()
    held_numbers = NO_DATUM
    try:
        if drop == OUTLIERS:
            dropped = robust_outliers(equations, commanded, start)
            datasets = without(datasets, dropped)
            equations, commanded, start = begun(datasets, chosen, unread)
        if slack == "drop":
            equations, cells = taut(equations, commanded, start)
            commanded = equations.with_exact_actuators() if cells else commanded
        estimator = estimator_at(equations, commanded, start, loss)
        estimate = estimator.solve()
        if datum == "auto":
            held_numbers = choose_datum(estimator, estimate)
        if held_numbers.names:
            chosen = parameters(machine, datasets, held_numbers.asked(asked))
            equations, commanded, start = begun(datasets, chosen, unread)
            if cells:
                keys = [(cell.pose, cell.closures[0]) for cell in cells]
                equations = equations.without_closures(keys, estimate.evaluation)
                commanded = equations.with_exact_actuators()
            estimator = estimator_at(equations, commanded, start, loss)
            estimate = estimator.solve()
    except ValueError as error:
        hint = likely_mistakes(datasets, chosen, start)
        if not hint and not start.ok:
            hint = ["check units, signs and columns of their actuators, or leave these rows out"]
        raise ArgumentError("; ".join([f"measurements: {error}", *hint])) from None
    solution = solved(estimator, estimate)
    unlike = unlike_components(estimator, estimate, solution)
    if unlike is not None:
        again = Estimator(equations.reweighted(unlike[1]), estimator.start, loss)
        try:
            estimate = again.solve(estimate.evaluation)
        except ArgumentError:  # grossly off: what there is says more than an error
            unlike = None
        else:
            estimator, commanded = again, again.equations
            solution = solved(estimator, estimate)
    classes = None if unlike is None else unlike[0]
    sure = uncertainty(estimator, estimate, solution, covariance, classes)
    drawn = not isinstance(holdout, Measurements)
    held = held_without(held, dropped) if drawn else held
    outside = evaluate(held, estimator, estimate, sure)
    if drop == OUTLIERS and outside.holdout_outliers and not outside.holdout_contradicts:
        odd = outside.holdout_outliers
        names = row_names(outside.holdout_data, odd)
        outside = evaluate(held_without(held, odd), estimator, estimate, sure)
        if drawn:
            dropped = tuple(sorted({*dropped, *odd}))
        else:
            outside = replace(outside, holdout_dropped=odd, holdout_dropped_names=names)
    result = _result(
        estimator, estimate, commanded, start, replace(outside, holdout_drawn=drawn), sure
    )
    result = replace(
        result,
        datum=held_numbers,
        dropped=dropped,
        dropped_names=row_names(given, dropped),
    )
    if slack == "keep" and result.outliers:
        with suppress(ArgumentError):  # a robust fit that does not come to an end says nothing
            _, cells = taut(equations, commanded, start)
    result = replace(result, slack=slack_cables(estimator.equations, estimate, cells))
    notes = _warnings(result, estimator, estimate, datasets)
    if slack == "keep" and result.slack:
        notes.append(said_slack(result.slack))
    for text in notes:
        warnings.warn(text, CalibrationWarning, stacklevel=2)
    return replace(result, warnings=tuple(notes))


def _warnings(
    result: Identification, estimator: Estimator, estimate: Estimate, datasets: Sequence[FitData]
) -> list[str]:
    """Say what looks wrong with the measurements or the fit."""
    fit = result.fit
    equations, size = fit.equations, estimator.start.robot.length
    notes = implausible_changes(estimator.start, estimate.evaluation, equations.parameters)
    if notes or result.rms > _POOR * result.rms_before or result.chi2_per_dof > _NOISY:
        notes = likely_unit_errors(datasets, equations.parameters, fit.start) or notes
    notes += insufficient_data(
        estimator.equations, result.rank, result.dof, bool(len(estimate.prior))
    )
    scale = float(np.sqrt(result.chi2_per_dof))
    if estimator.loss != "linear" and equations.sigma_stated:
        # of pseudo-residuals: rows that are weighed down say nothing about sigma
        scale = fit.uncertainty.covariance.scale
    if scale**2 > _NOISY:
        notes.append(f"residuals are {scale:.3g} times what sigma says: {_remedy(result)}")
    notes += in_other_modes(equations, fit.end)
    notes += contradicted_prior(result.prior_test, equations.parameters, bool(result.outliers))
    notes += distant_points(fit.end, equations.parameters)
    notes += shrunk(equations, fit.start, fit.end)
    notes += unlike_noise(equations, fit.uncertainty.slips, bool(result.outliers))
    notes += beyond_strokes(equations, fit.start, fit.end)
    unknown = fit.uncertainty.unknown
    if fit.uncertainty.mixed and unknown.any():
        names = [f"of measurements {i + 1}" for i in range(len(equations.sets))]
        names += ["of the load cells"] if equations.closures.cells else []
        names = [n for n, u in zip([*names, "of the actuators"], unknown, strict=True) if u]
        cells = equations.closures.cells
        sigmas = "sigma, actuator_sigma and tension_sigma" if cells else "sigma and actuator_sigma"
        notes.append(
            f"too little is left over to estimate the noise {' and '.join(names)}: state {sigmas}"
        )
    kept = estimate.state.determined.rank - estimate.state.fitted.rank
    if kept:
        which = "combinations of parameters are" if kept > 1 else "combination of parameters is"
        worst = estimate.state.worst
        why = "the machine's size" if worst == size else "and the search did not end with them"
        notes.append(
            f"{kept} {which} determined to no better than {worst:.3g} mm, {why}, and"
            " kept as before: state a prior or measure more poses"
        )
    if not result.converged:
        notes.append("the least squares did not converge: the result is not to be trusted")
    if result.holdout_unreached:
        notes.append(f"holdout: {result.holdout_unreached}; left out")
    if result.holdout_spare < LEAST_FREEDOM:
        notes.append(
            f"holdout: {len(result.holdout_own)} numbers of its own session take all of its"
            " readings, nothing is left to compare; hold out more rows of it"
        )
    return notes


def _remedy(result: Identification) -> str:
    """Advise on residuals far above sigma; repeats decide between its two causes."""
    scatter = result.fit.uncertainty.repeats().scatter
    if scatter**2 > _NOISY:
        cause = f"repeats of a pose scatter {scatter:.3g} times as much as it"
        first = ": look at the outliers; without any," if result.outliers else ","
        return f"{cause}{first} state the true sigma"
    cure = "free more parameters"
    if not np.isfinite(scatter):
        cure += ", or state the true sigma"
    if result.outliers:
        robust = "" if result.loss == "cauchy" else " fit with --loss cauchy (loss='cauchy'),"
        cure = f"look at the outliers,{robust} or {cure}"
    return cure


def _result(
    estimator: Estimator,
    estimate: Estimate,
    commanded: Equations,
    start: Evaluation,
    held: HeldOut,
    sure: Uncertainty,
) -> Identification:
    chosen, search = estimator.equations.parameters, estimator.search
    end = estimate.evaluation
    robots = _robots(commanded, end)
    if commanded is not estimator.equations:
        commanded = commanded.with_tension(end.states.tension)
        end = commanded.at(end.theta, near=end)
    return Identification(
        **vars(parameter_table(estimator, estimate, sure)),
        **vars(identifiability(estimator, estimate)),
        **vars(misfit(estimator, estimate, sure, (start, end))),
        **vars(repeats(sure)),
        **vars(held),
        converged=search.converged,
        evaluations=search.evaluations,
        history=tuple(search.history),
        robot=robots[chosen.sessions[-1] if chosen.sessions else ""],
        robots=_of_sessions(robots, held),
        prior_test=tested_prior(estimator, estimate),
        fit=Fit(commanded, start, end, estimate, sure),
    )


def _of_sessions(
    robots: Mapping[str, Robot | SerialArm], held: HeldOut
) -> dict[str, Robot | SerialArm]:
    """The machines of all sessions by name, those that were held out with them."""
    found = {name: robot for name, robot in robots.items() if name}
    if found and held.holdout_later is not None and held.holdout_end is not None:
        chosen = held.holdout_later.parameters
        for name in chosen.sessions:
            if name not in found:
                values = chosen.values_at(held.holdout_end.theta, chosen.geometry_of(name))
                found[name] = as_given(chosen.robot.replace(values))
    return found


def _robots(commanded: Equations, end: Evaluation) -> dict[str, Robot | SerialArm]:
    """The machine of each session, "" where there are none, at the parameters of an evaluation."""
    chosen, found = commanded.parameters, {}
    for session in chosen.sessions or ("",):
        columns = chosen.geometry_of(session)
        robot = as_given(chosen.robot.replace(chosen.values_at(end.theta, columns)))
        table = commanded.table
        own = (table.machine_columns == columns).all(axis=1)[table.machine_of_pose]
        if isinstance(robot, Robot):
            robot = robot.closing(commanded.actuators[own], end.pose[own])
        found[session] = robot
    return found
