"""The steps of `identify`: each takes what the one before returned, and changes nothing of it.

    prepare → begin → without_outliers → without_slack → solve → with_datum → with_component_noise
            → judged → compare → result

`Rows` says which rows there are, `Problem` what is solved, `Fitted` what came of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import IntArray
from pkmcal.calibration.identification import Identification
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fitted, informative
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.parameters import Asked, Parameters
from pkmcal.estimation.starts import known_distances
from pkmcal.estimation.uncertainty import (
    LinearModel,
    Uncertainty,
    solved,
    uncertainty,
    unlike_components,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.datum import NO_DATUM, Datum
from pkmcal.fitted.datum import datum as choose_datum
from pkmcal.fitted.dropped import held_without, robust_outliers, without
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
from pkmcal.fitted.slack import Cell, slack_cables, taut
from pkmcal.kinematics.calibratable import Calibratable, as_given
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import CovarianceRule


@dataclass(frozen=True, eq=False)
class Rows:
    """Which rows are fitted, which are held out, which are left out.

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
    elif holdout is not None:
        pairs = [draw(data, holdout) for data in fitted]
        fitted, held = [kept for kept, _ in pairs], [(out, i) for i, (_, out) in enumerate(pairs)]
    rows = Rows(machine, given, fitted, held, drawn, missing).without(dropped)
    return replace(rows, fitted=[*rows.fitted, *known_distances(list(rows.fitted))])


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations to be solved.

    Attributes
    ----------
    equations : Equations
        Of the fitted rows.
    exact : Equations
        With poses that follow from the actuators exactly; the same ones where poses have no
        unknowns.
    start : Evaluation
        Where these begin: at the nominal machine, unknown frames aligned with the readings.
    slack : tuple of Cell
        Readings of slack cables that are left out.
    """

    equations: Equations
    exact: Equations
    start: Evaluation
    slack: tuple[Cell, ...] = ()

    def of(self, equations: Equations) -> Problem:
        """Other equations, from the same start."""
        return replace(self, equations=equations, exact=equations.with_exact_actuators())

    def estimator(self, loss: LossName) -> Estimator:
        """The search from the start; an error where rows are not reached."""
        return estimator_at(self.equations, self.exact, self.start, loss)


def begin(rows: Rows, chosen: Parameters) -> Problem:
    """State the problem at the nominal machine."""
    problem = Problem(*begun(rows.fitted, chosen, rows.missing))
    if rows.held and problem.equations.closures.cells:
        raise ArgumentError("holdout: rows whose tensions are unknown are all fitted: leave it out")
    _require_predictions(problem)
    return problem


def _require_predictions(problem: Problem) -> None:
    """Refuse a reading, or an effect, that gives no number where the machine is known to be."""
    table, start = problem.exact.table, problem.start
    for m, place, predicted in zip(table.sets, table.pose_of, start.predicted, strict=True):
        read = np.isfinite(m.values.reshape(predicted.shape))
        silent = (read & ~np.isfinite(predicted)).any(axis=1) & (start.status[place] == 0)
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


@dataclass(frozen=True, eq=False)
class Fitted:
    """A problem that is solved.

    Attributes
    ----------
    problem : Problem
        The problem.
    estimator, estimate : Estimator, Estimate
        The search and its end.
    datum : Datum
        Numbers that are held because they only say where frames lie.
    classes : ndarray of int (M,) or None
        Classes of equations whose noise was told apart.
    """

    problem: Problem
    estimator: Estimator
    estimate: Estimate
    datum: Datum = NO_DATUM
    classes: IntArray | None = None

    @cached_property
    def linear(self) -> LinearModel:
        """The linear model at the solution."""
        return solved(self.estimator, self.estimate)


def solve(problem: Problem, loss: LossName) -> Fitted:
    """Search from the start of the problem."""
    estimator = problem.estimator(loss)
    return Fitted(problem, estimator, estimator.solve())


def with_datum(fitted: Fitted, rows: Rows, asked: Asked) -> Fitted:
    """Hold numbers that only say where frames lie, and solve again; slack cables stay left out."""
    held = choose_datum(fitted.estimator, fitted.estimate)
    if not held.names:
        return replace(fitted, datum=held)
    problem = begin(rows, parameters(rows.machine, rows.fitted, held.asked(asked)))
    if cells := fitted.problem.slack:
        keys = [(cell.pose, cell.closures[0]) for cell in cells]
        equations = problem.equations.without_closures(keys, fitted.estimate.evaluation)
        problem = replace(problem.of(equations), slack=cells)
    return replace(solve(problem, fitted.estimator.loss), datum=held)


def with_component_noise(fitted: Fitted) -> Fitted:
    """Weigh components by what each scatters, where that is unlike, and solve again."""
    estimator, estimate = fitted.estimator, fitted.estimate
    unlike = unlike_components(estimator, estimate, fitted.linear)
    if unlike is None:
        return fitted
    classes, deviations = unlike
    problem = fitted.problem.of(fitted.problem.equations.reweighted(deviations))
    again = Estimator(problem.equations, estimator.start, estimator.loss)
    try:
        estimate = again.solve(estimate.evaluation)
    except ArgumentError:  # grossly off: what there is says more than an error
        return fitted
    return replace(fitted, problem=problem, estimator=again, estimate=estimate, classes=classes)


def judged(fitted: Fitted, rule: CovarianceRule) -> Uncertainty:
    """How sure the numbers are."""
    return uncertainty(fitted.estimator, fitted.estimate, fitted.linear, rule, fitted.classes)


def compare(rows: Rows, fitted: Fitted, sure: Uncertainty, outliers: bool) -> tuple[Rows, HeldOut]:
    """Compare the points held out; with `outliers` without those that are off where few are."""
    held = evaluate(rows.held, fitted.estimator, fitted.estimate, sure)
    odd = held.holdout_outliers
    if outliers and odd and not held.holdout_contradicts:
        names = row_names(held.holdout_data, odd)
        kept = held_without(rows.held, odd)
        held = evaluate(kept, fitted.estimator, fitted.estimate, sure)
        if rows.drawn:
            rows = replace(rows, held=kept, dropped=tuple(sorted({*rows.dropped, *odd})))
        else:
            held = replace(held, holdout_dropped=odd, holdout_dropped_names=names)
    return rows, replace(held, holdout_drawn=rows.drawn)


def result(
    rows: Rows, fitted: Fitted, sure: Uncertainty, held: HeldOut, find_slack: bool
) -> Identification:
    """Set all numbers, once; with `find_slack` also which cables the fit shows to be slack."""
    estimator, estimate, problem = fitted.estimator, fitted.estimate, fitted.problem
    chosen = estimator.equations.parameters
    exact, end = problem.exact, estimate.evaluation
    robots = _robots(exact, end)
    if exact is not estimator.equations:
        exact = exact.with_tension(end.states.tension)
        end = exact.at(end.theta, near=end)
    fits = misfit(estimator, estimate, sure, (problem.start, end))
    cells = _found_slack(problem) if find_slack and fits["outliers"] else problem.slack
    return Identification(
        **parameter_table(estimator, estimate, sure),
        **identifiability(estimator, estimate),
        **fits,
        **repeats(sure),
        **vars(held),
        converged=estimate.converged,
        evaluations=estimate.evaluations,
        history=estimate.history,
        robot=robots[chosen.sessions[-1] if chosen.sessions else ""],
        robots=_of_sessions(robots, held),
        prior_test=tested_prior(estimator, estimate),
        fit=Fit(exact, problem.start, end, estimate, sure),
        datum=fitted.datum,
        dropped=rows.dropped,
        dropped_names=row_names(rows.given, rows.dropped),
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
