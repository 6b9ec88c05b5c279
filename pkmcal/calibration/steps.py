"""The steps of `identify`: each takes what the one before returned, and changes nothing of it.

    prepare → begin → without_outliers or require_agreement → without_slack → solve → with_datum
            → with_component_noise → compare → result

`Rows` says which rows there are, `Fit` what came of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.row_errors import contradicting
from pkmcal.estimation import solving
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fitted, informative
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.other_starts import likelier_start
from pkmcal.estimation.own_classes import require_true
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_minima import solved_in_least_minima
from pkmcal.estimation.starts import stated_beside
from pkmcal.estimation.unlike_components import unlike_components
from pkmcal.exceptions import ArgumentError, UnreachedError
from pkmcal.fitted.contradicted import contradicted, far_off
from pkmcal.fitted.datum import datum as choose_datum
from pkmcal.fitted.dropped import are_few, held_without, leaves_none, robust_outliers, without
from pkmcal.fitted.fit import Fit
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
    return replace(rows, fitted=[*rows.fitted, *stated_beside(list(rows.fitted))])


def _require_apart(held: Sequence[tuple[FitData, int]], fitted: Sequence[FitData]) -> None:
    """Refuse rows to be held out that say what rows that are fitted say."""
    for data, like in held:
        m, other = data.measured, fitted[like].measured
        if m.kind == other.kind and (reason := m.instrument.not_apart(m, other)):
            raise ArgumentError(f"holdout: {reason}")


def begin(rows: Rows, chosen: Parameters, loss: LossName) -> tuple[Equations, Evaluation]:
    """The equations of the fitted rows, and these at the nominal machine: `Fit.aligned`."""
    equations, start = begun(rows.fitted, chosen, rows.missing)
    if rows.held and equations.machines.cells:
        raise ArgumentError("holdout: rows whose tensions are unknown are all fitted: leave it out")
    if start.ok:  # else frames are not laid yet, and a camera may see nothing
        _require_predictions(equations, start)
    require_true(equations.prediction, start)
    equations.parameters.require_true_residuals(start.theta)
    return equations, likelier_start(equations, start, loss)


def _require_predictions(equations: Equations, start: Evaluation) -> None:
    """Refuse a reading, or an effect, that gives no number where the machine is known to be."""
    prediction, table = equations.prediction, equations.table
    for i, (m, place, off) in enumerate(
        zip(table.sets, table.pose_of, start.residuals, strict=True)
    ):
        read = np.isfinite(m.values.reshape(off.shape))
        silent = (read & ~np.isfinite(off)).any(axis=1) & (start.status[place] == 0)
        if silent.any():
            row = int(np.argmax(silent))
            alone = prediction.unmoved(i, start.pose, start.theta).values[row]
            why = f"predict of the class {type(m.instrument).__name__} gives NaN"
            if np.isfinite(alone[read[row]]).all():
                names = " or ".join(effect.name for effect in prediction.datasets[i].effects)
                why = f"moved of {names} gives NaN"
            raise ArgumentError(
                f"measurements: {m.kind}: nothing finite is predicted of row {row} of its set,"
                f" though the machine's pose is known there: {why}"
            )


def without_outliers(
    rows: Rows, chosen: Parameters, equations: Equations, start: Evaluation, loss: LossName
) -> tuple[Rows, Equations, Evaluation]:
    """Leave out rows that the others contradict in a robust fit, and begin without them.

    Before slack is looked for: a robust fit must not take an outlier for slack. What was read at a
    pose may contradict its actuators so much that nothing between agrees with both, as a mirrored
    picture: it is left out first.
    """
    if far := _contradicted(rows, chosen, equations, start, loss):
        rows = rows.without(far)
        equations, start = begin(rows, chosen, loss)
    try:
        odd = robust_outliers(equations, start)
    except UnreachedError as error:
        if not are_few(rows.fitted, error.rows):
            raise
        rows = rows.without(error.rows)
        equations, start = begin(rows, chosen, loss)
        odd = robust_outliers(equations, start)
    rows = rows.without(odd)
    return rows, *begin(rows, chosen, loss)


def require_agreement(
    rows: Rows, chosen: Parameters, equations: Equations, start: Evaluation, loss: LossName
) -> None:
    """Refuse a few poses that contradict the machine which all others agree on.

    Before a search among all of them, which takes long and ends anywhere.

    Raises
    ------
    ValueError
        There are such.
    """
    if loss == "linear" and (far := _contradicted(rows, chosen, equations, start, loss)):
        count = sum(len(data.rows) for data in rows.fitted)
        raise UnreachedError(f"{len(far)} of {count} rows contradict all others", far)


def _contradicted(
    rows: Rows, chosen: Parameters, equations: Equations, start: Evaluation, loss: LossName
) -> tuple[int, ...]:
    """Rows of a few poses that are far off, by the machine which all others agree on, too."""
    far = far_off(equations, start)
    if not far or not are_few(rows.fitted, far) or leaves_none(rows.fitted, far):
        return ()
    others = begin(rows.without(far), chosen, loss)
    return contradicted(equations, start, solved_in_least_minima(estimator_at(*others, loss)))


def that_others_contradict(rows: Rows, equations: Equations, start: Evaluation) -> list[str]:
    """Name the few rows that a robust fit leaves out, where that of all rows ran astray."""
    odd: tuple[int, ...] = ()
    with suppress(ArgumentError):
        odd = robust_outliers(equations, start)
    return contradicting(rows.fitted, odd) if odd else []


def without_slack(equations: Equations, start: Evaluation) -> tuple[Equations, tuple[Cell, ...]]:
    """Leave out readings of cables that the others show to be slack, and say which these are."""
    fewer, cells = taut(equations, start)
    return (fewer, cells) if cells else (equations, ())


def solve(
    equations: Equations,
    start: Evaluation,
    loss: LossName,
    rule: CovarianceRule,
    slack: tuple[Cell, ...] = (),
) -> Fit:
    """Search from the start, without slack cables; an error where rows are not reached."""
    estimator = estimator_at(equations, start, loss)
    estimate = solved_in_least_minima(estimator)
    if failed := equations.failures(estimate.evaluation):
        odd = equations.unreached(estimate.evaluation)
        named = contradicting(equations.prediction.datasets, odd)
        raise ArgumentError("; ".join([f"{failed} where the search ended", *named]))
    require_true(equations.prediction, estimate.evaluation)
    equations.parameters.require_true_residuals(estimate.evaluation.theta)
    return Fit(start, estimator, estimate, slack, rule=rule)


def with_datum(fit: Fit, rows: Rows) -> Fit:
    """Hold numbers that only say where frames lie, and solve again; slack cables stay left out."""
    held = choose_datum(fit.estimator, fit.estimate)
    if not held.names:
        return replace(fit, datum=held)
    asked = held.asked(fit.estimator.equations.parameters.asked)
    chosen = parameters(rows.machine, rows.fitted, asked)
    equations, start = begin(rows, chosen, fit.estimator.loss)
    if fit.slack:
        keys = [(cell.pose, cell.closures[0]) for cell in fit.slack]
        equations = equations.without_closures(keys, fit.estimate.evaluation)
    return replace(solve(equations, start, fit.estimator.loss, fit.rule, fit.slack), datum=held)


def with_component_noise(fit: Fit) -> Fit:
    """Weigh components by what each scatters, where that is unlike, and solve again."""
    estimator, estimate = fit.estimator, fit.estimate
    unlike = unlike_components(estimator, estimate, fit.linear)
    if unlike is None:
        return fit
    classes, deviations = unlike
    again = Estimator.of(
        estimator.equations.reweighted(deviations), estimator.start, estimator.loss
    )
    try:
        estimate = solving.solve(again, estimate.evaluation)
    except ArgumentError:  # grossly off: what there is says more than an error
        return fit
    if again.equations.failures(estimate.evaluation):
        return fit
    return replace(fit, estimator=again, estimate=estimate, classes=classes)


def compare(rows: Rows, fit: Fit, outliers: bool) -> tuple[Rows, HeldOut | None]:
    """Compare the points held out; with `outliers` without those that are off where few are."""
    if not rows.held:
        return rows, None
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


def result(rows: Rows, fit: Fit, held: HeldOut | None, find_slack: bool) -> Identification:
    """Set all numbers, once; with `find_slack` also which cables the fit shows to be slack."""
    estimator, estimate, sure = fit.estimator, fit.estimate, fit.uncertainty
    chosen = estimator.equations.parameters
    robots = _robots(estimator.equations, estimate.evaluation)
    fits = misfit(estimator, estimate, sure, (fit.start, fit.end), fit.before)
    cells = _found_slack(fit) if find_slack and fits["outliers"] else fit.slack
    table = parameter_table(estimator, estimate, sure, fit.start.theta)
    return Identification(
        **table,
        **identifiability(estimator, estimate, len(chosen) - len(table["free"])),
        **fits,
        **({} if held is None else vars(held)),
        converged=estimate.converged,
        evaluations=estimate.evaluations,
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


def _found_slack(fit: Fit) -> tuple[Cell, ...]:
    """Readings of slack cables; none where a robust fit does not come to an end."""
    with suppress(ArgumentError):
        return taut(fit.estimator.equations, fit.aligned)[1]
    return ()


def _of_sessions(
    robots: Mapping[str, Robot | SerialArm], held: HeldOut | None
) -> dict[str, Robot | SerialArm]:
    """The machines of all sessions by name, those that were held out with them."""
    found = {name: robot for name, robot in robots.items() if name}
    if found and held is not None and held.holdout_later and held.holdout_end:
        chosen = held.holdout_later.parameters
        for name in chosen.sessions:
            if name not in found:
                values = chosen.values_at(held.holdout_end.theta, chosen.geometry_of(name))
                found[name] = as_given(chosen.robot.replace(values))
    return found


def _robots(equations: Equations, end: Evaluation) -> dict[str, Robot | SerialArm]:
    """The machine of each session, "" where there are none, at the parameters of an evaluation."""
    chosen, found = equations.parameters, {}
    for session in chosen.sessions or ("",):
        columns = chosen.geometry_of(session)
        robot = as_given(chosen.robot.replace(chosen.values_at(end.theta, columns)))
        table = equations.table
        own = (table.machine_columns == columns).all(axis=1)[table.machine_of_pose]
        if isinstance(robot, Robot):
            robot = robot.closing(table.actuators[own], end.pose[own])
        found[session] = robot
    return found
