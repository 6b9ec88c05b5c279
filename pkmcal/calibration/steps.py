"""The steps of `identify`: each takes what the one before returned, and changes nothing of it.

    prepare → begin → without_outliers → without_slack → solve → with_datum → with_component_noise
            → compare → result

`Rows` says which rows there are, `Problem` what is solved, `Fit` what came of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.identification import Identification
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fitted, informative
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.own_classes import require_true
from pkmcal.estimation.parameters import Asked, Parameters
from pkmcal.estimation.pose_minima import solved_in_least_minima
from pkmcal.estimation.starts import known_distances
from pkmcal.estimation.unlike_components import unlike_components
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.datum import datum as choose_datum
from pkmcal.fitted.dropped import held_without, robust_outliers, without
from pkmcal.fitted.fit import Fit, Problem
from pkmcal.fitted.fit_statistics import (
    identifiability,
    misfit,
    parameter_table,
    tested_prior,
)
from pkmcal.fitted.holdout import HeldOut, draw, evaluate
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.slack import Cell, slack_cables, taut
from pkmcal.kinematics.calibratable import Calibratable, as_given
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import CovarianceRule


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows that are fitted, held out and left out.

    Attributes
    ----------
    machine : Calibratable
        The nominal machine.
    given : sequence of FitData
        All sets as they were given.
    fitted : sequence of FitData
        The rows that are fitted, and known distances.
    held : sequence of (FitData, int)
        The rows that are held out, each set with the number of the fitted one that it is like.
    drawn : bool
        Whether these were drawn from the same measurements.
    missing : int
        How many rows say nothing, since nothing was read but the actuators.
    dropped : tuple of int
        The rows that are left out, by number.
    """

    machine: Calibratable
    given: Sequence[FitData]
    fitted: Sequence[FitData]
    held: Sequence[tuple[FitData, int]]
    drawn: bool
    missing: int
    dropped: tuple[int, ...] = ()

    def without(self, rows: Sequence[int]) -> Rows:
        """Leave rows out; of other measurements that are held out none."""
        return replace(
            self,
            fitted=without(self.fitted, rows),
            held=held_without(self.held, rows) if self.drawn else self.held,
            dropped=tuple(sorted({*self.dropped, *rows})),
        )

    @property
    def left(self) -> tuple[tuple[FitData, int], ...]:
        """Sets of the rows that are left out, each with the number of the fitted one like it."""
        found = []
        for data in self.given:
            mine = np.flatnonzero(np.isin(data.rows, self.dropped))
            like = [bool(np.isin(each.rows, data.rows).any()) for each in self.fitted]
            if len(mine) and any(like):
                found.append((data.select(mine), like.index(True)))
        return tuple(found)


def prepare(
    machine: Calibratable,
    given: list[FitData],
    holdout: float | Measurements | None,
    dropped: Sequence[int],
    by_session: bool,
) -> Rows:
    """Leave out rows that say nothing, draw those to hold out, then leave out the named ones.

    In this order, so that the draw does not depend on which rows are left out.
    """
    fitted, missing = informative(machine, given)
    held: list[tuple[FitData, int]] = []
    drawn = not isinstance(holdout, Measurements)
    if isinstance(holdout, Measurements):
        held = [as_fitted(machine, holdout, fitted, sessions=by_session)]
        _require_apart(held, fitted)
    elif holdout is not None:
        pairs = [draw(data, holdout) for data in fitted]
        fitted, held = [kept for kept, _ in pairs], [(out, i) for i, (_, out) in enumerate(pairs)]
    rows = Rows(machine, given, fitted, held, drawn, missing).without(dropped)
    return replace(rows, fitted=[*rows.fitted, *known_distances(list(rows.fitted))])


def _require_apart(held: Sequence[tuple[FitData, int]], fitted: Sequence[FitData]) -> None:
    """Refuse rows to be held out that say what rows that are fitted say."""
    for data, like in held:
        m, other = data.measured, fitted[like].measured
        if m.kind == other.kind and (reason := m.instrument.not_apart(m, other)):
            raise ArgumentError(f"holdout: {reason}")


def begin(rows: Rows, chosen: Parameters) -> Problem:
    """State the problem at the nominal machine."""
    problem = Problem(*begun(rows.fitted, chosen, rows.missing))
    if rows.held and problem.equations.machines.cells:
        raise ArgumentError("holdout: rows whose tensions are unknown are all fitted: leave it out")
    _require_predictions(problem)
    require_true(problem.exact.prediction, problem.start)
    return problem


def _require_predictions(problem: Problem) -> None:
    """Refuse a reading, or an effect, that gives no number where the machine is known to be."""
    table, start = problem.exact.table, problem.start
    for m, place, off in zip(table.sets, table.pose_of, start.residuals, strict=True):
        read = np.isfinite(m.values.reshape(off.shape))
        silent = (read & ~np.isfinite(off)).any(axis=1) & (start.status[place] == 0)
        if silent.any():
            raise ArgumentError(
                f"measurements: {m.kind}: nothing finite is predicted of row"
                f" {int(np.argmax(silent))} of its set, though the machine's pose is known there:"
                " its reading, or an effect, gives NaN"
            )


def without_outliers(rows: Rows, problem: Problem, chosen: Parameters) -> tuple[Rows, Problem]:
    """Leave out rows that the others contradict in a robust fit.

    Before slack is looked for: a robust fit must not take an outlier for slack.
    """
    rows = rows.without(robust_outliers(problem.equations, problem.exact, problem.start))
    return rows, begin(rows, chosen)


def without_slack(problem: Problem) -> Problem:
    """Leave out readings of cables that the others show to be slack."""
    equations, cells = taut(problem.equations, problem.exact, problem.start)
    return replace(problem.of(equations), slack=cells) if cells else problem


def solve(problem: Problem, loss: LossName, rule: CovarianceRule) -> Fit:
    """Search from the start of the problem; an error where rows are not reached."""
    estimator = estimator_at(problem.equations, problem.exact, problem.start, loss)
    estimate = solved_in_least_minima(estimator)
    if failed := problem.equations.failures(estimate.evaluation):
        raise ArgumentError(f"{failed} where the search ended")
    require_true(problem.equations.prediction, estimate.evaluation)
    return Fit(problem, estimator, estimate, rule=rule)


def with_datum(fit: Fit, rows: Rows, asked: Asked) -> Fit:
    """Hold numbers that only say where frames lie, and solve again; slack cables stay left out."""
    held = choose_datum(fit.estimator, fit.estimate)
    if not held.names:
        return replace(fit, datum=held)
    problem = begin(rows, parameters(rows.machine, rows.fitted, held.asked(asked)))
    if cells := fit.problem.slack:
        keys = [(cell.pose, cell.closures[0]) for cell in cells]
        equations = problem.equations.without_closures(keys, fit.estimate.evaluation)
        problem = replace(problem.of(equations), slack=cells)
    return replace(solve(problem, fit.estimator.loss, fit.rule), datum=held)


def with_component_noise(fit: Fit) -> Fit:
    """Weigh components by what each scatters, where that is unlike, and solve again."""
    estimator, estimate = fit.estimator, fit.estimate
    unlike = unlike_components(estimator, estimate, fit.linear)
    if unlike is None:
        return fit
    classes, deviations = unlike
    problem = fit.problem.of(fit.problem.equations.reweighted(deviations))
    again = Estimator(problem.equations, estimator.start, estimator.loss)
    try:
        estimate = again.solve(estimate.evaluation)
    except ArgumentError:  # grossly off: what there is says more than an error
        return fit
    if problem.equations.failures(estimate.evaluation):
        return fit
    return replace(fit, problem=problem, estimator=again, estimate=estimate, classes=classes)


def compare(rows: Rows, fit: Fit, outliers: bool) -> tuple[Rows, HeldOut]:
    """Compare the points held out; with `outliers` without those that are off where few are."""
    held = evaluate(rows.held, fit.estimator, fit.estimate, fit.uncertainty, fit.start.theta)
    odd = held.holdout_outliers
    if outliers and odd and not held.holdout_contradicts:
        names = row_names(held.holdout_data, odd)
        kept = held_without(rows.held, odd)
        held = evaluate(kept, fit.estimator, fit.estimate, fit.uncertainty, fit.start.theta)
        if rows.drawn:
            rows = replace(rows, held=kept, dropped=tuple(sorted({*rows.dropped, *odd})))
        else:
            held = replace(held, holdout_dropped=odd, holdout_dropped_names=names)
    return rows, replace(held, holdout_drawn=rows.drawn)


def result(rows: Rows, fit: Fit, held: HeldOut, find_slack: bool) -> Identification:
    """Set all numbers, once; with `find_slack` also which cables the fit shows to be slack."""
    estimator, estimate, problem, sure = fit.estimator, fit.estimate, fit.problem, fit.uncertainty
    chosen = estimator.equations.parameters
    robots = _robots(problem.exact, estimate.evaluation)
    fits = misfit(estimator, estimate, sure, (fit.start, fit.end))
    cells = _found_slack(problem) if find_slack and fits["outliers"] else problem.slack
    table = parameter_table(estimator, estimate, sure)
    return Identification(
        **table,
        **identifiability(estimator, estimate, len(chosen) - len(table["free"])),
        **fits,
        **vars(held),
        converged=estimate.converged,
        evaluations=estimate.evaluations,
        history=estimate.history,
        robot=robots[chosen.sessions[-1] if chosen.sessions else ""],
        robots=_of_sessions(robots, held),
        prior_test=tested_prior(estimator, estimate),
        uncertainty_test=tested_prior(estimator, estimate, of_uncertain=True),
        fit=fit,
        datum=fit.datum,
        dropped=rows.dropped,
        dropped_names=row_names(rows.given, rows.dropped),
        dropped_data=rows.left,
        slack=slack_cables(estimator.equations, estimate, cells),
    )


def _found_slack(problem: Problem) -> tuple[Cell, ...]:
    """Readings of slack cables; none where a robust fit does not come to an end."""
    with suppress(ArgumentError):
        return taut(problem.equations, problem.exact, problem.start)[1]
    return ()


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
            robot = robot.closing(commanded.table.actuators[own], end.pose[own])
        found[session] = robot
    return found
