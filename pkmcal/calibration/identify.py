"""`identify`: the geometry of a machine from measurements."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, TypeVar, cast

from pkmcal.arguments import earlier_keywords, function, word, words
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.asked import (
    EARLIER,
    ErrorWord,
    Unknown,
    fixed_names,
    loss_and_rule,
    now,
    unknown_roles,
)
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.steps import (
    begin,
    compare,
    prepare,
    require_agreement,
    result,
    solve,
    that_others_contradict,
    with_component_noise,
    with_datum,
    without_outliers,
    without_slack,
)
from pkmcal.diagnostics.row_errors import contradicting, likely_mistakes
from pkmcal.diagnostics.sag import sag_that_helps
from pkmcal.effects.effect import Effects
from pkmcal.effects.stated import effects_on
from pkmcal.estimation.datasets import as_fit_data, by_set, roles_of
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.held_coefficients import coefficients, of_the_machine, with_held
from pkmcal.estimation.own_residuals import Residual, checked_residuals
from pkmcal.estimation.parameters import Asked, Bounds, Prior
from pkmcal.estimation.uncertain_numbers import uncertain_sets
from pkmcal.estimation.unused_entries import refuse_stated_by_readings, require_used
from pkmcal.exceptions import ArgumentError, CalibrationWarning, FitError, UnreachedError
from pkmcal.fitted.dropped import Drop, left_out
from pkmcal.geometry.stated_uncertainty import Uncertain, stated_uncertainty
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.progress import PERCENT, Progress, part, telling, within

Given = TypeVar("Given", bound=Robot | SerialArm)


@earlier_keywords(*EARLIER, now=now)
def identify(
    robot: Given,
    measurements: Measurements | Sequence[Measurements],
    free: str | Sequence[str] | None = None,
    *,
    prior: Prior = None,
    loss: ErrorWord | Sequence[ErrorWord] = "linear",
    unknown: Unknown = (),
    holdout: float | Measurements | None = None,
    bounds: Bounds = None,
    per_session: str | Sequence[str] = (),
    fix: str | Sequence[str] = (),
    drop: Drop = None,
    effects: Effects | Literal["auto"] = (),
    uncertainty: Uncertain = None,
    residuals: Residual | Sequence[Residual] = (),
    progress: Progress | None = None,
) -> Identification[Given]:
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
        Empty: the machine is held, and only what the readings need beside it is found, as frames.
    prior : float or mapping of str to float or (float, float), optional
        Standard deviation around the present value. A number, in mm, holds for all free numbers
        of the geometry (an angle as its arc at the machine's characteristic length) but those of a
        balanced load; a mapping gives it by name or wildcard in mm, rad and N, later entries before
        earlier ones. A key may also be a function of numbers: a sum, ``"gain1 - gain2"``, or the
        length of a sum of points, ``"|base1 - base2|"``; a pair is a value that was measured
        otherwise, and its deviation.
        None: no prior; unidentifiable combinations then move as little as possible.
    loss : {"linear", "huber", "cauchy", "classical", "cluster"} or several of them
        How rows err. "linear", "huber", "cauchy": the weight of rows with large residuals, by the
        length of the whole measured vector. Beside it "cluster": rows of one pose may share an
        error, as several targets and repeats do; "classical": all errors are independent. These two
        change how uncertain the parameters are, not their values. Without either "cluster" holds
        where the residuals show a shared error or the loss is robust.
    unknown : str, sequence of str or mapping
        What is to be found beside the numbers of the machine: "frame", "target", "attachment", or
        several of them. No start near them is needed.

        "frame": the instrument's frame is not the robot's base frame: six parameters ``frame.x`` …
        ``frame.gamma``, the pose of the base in the instrument's frame.
        "target": the measured points of the platform, from where `Measurements.target` puts them:
        ``target1.x`` …; for distances the fixed point, ``anchor1.x`` …; for orientations how the
        sensor is mounted, ``mounting.alpha`` …; for poses where on the platform what was measured
        is, ``tool.x`` … ``tool.gamma``.
        "attachment": the points of the platform from which distances are measured, from where
        `Measurements.attachment` puts them: ``attachment1.x`` ….

        Of several sets all have the same frame and points. Where they differ a mapping has a word
        for each set, ``{"frame": ["unknown", "known", "unknown"]}``: each unknown one is another,
        ``frame.x@3``.
    holdout : float or Measurements, optional
        A fraction of the poses of each set, drawn at random with repeats kept together, or other
        measurements: they are not fitted, only compared.
    bounds : mapping of str to (float, float), optional
        Lower and upper limit by name or wildcard, mm and rad.
    per_session : str or sequence of str
        Names or wildcards, ``"offset*"``, ``"frame*"``, of what is found anew in each
        `Measurements.session`: ``offset5@thursday``. A set without sessions is one, named after its
        file or counted from 1. All else is common. Priors and bounds hold for each session's
        number; of a session that is held out such numbers are found from its rows, before these
        are compared with the fit.
    fix : str or sequence of str
        Numbers of the geometry and coefficients of effects, by name or wildcard, that keep their
        present values though `free`, the robot's default set or the effect has them.

        The word "datum" holds as many numbers as the measurements leave open of where the base
        frame and the platform frame lie, and of how the frames between an arm's joints are drawn:
        about 3-2-1 of the joints of each. What is predicted of a measurement stays as it is, and
        the other numbers have finite deviations, in the frames that the held ones define. They are
        `Identification.datum`. Without it such combinations move as little as possible.
    drop : int, "outliers", "slack" or several of them, optional
        What is left out. Rows, fitted or drawn to be held out, by their numbers, counted from 0
        through all sets; "outliers": rows that the others contradict in a robust fit. They are
        `Identification.dropped`. Of other measurements that are held out the "outliers" are
        `Identification.holdout_dropped`; where most rows contradict the fit none is left out.
        "slack": readings of cables that the others show to be slack, on a machine with more cables
        than needed; the rest of their rows is kept. They are `Identification.slack`; without the
        word a warning names them.
    effects : sequence of effects, or "auto"
        What moves the machine off the pose that its geometry gives: ``[pk.Expansion(11.5e-6)]``,
        by loads of the rows ``[pk.Elasticity("offset*")]``,
        of an arm ``[pk.Sag()]``. "auto": sag of an arm, if it helps at poses left out.
    uncertainty : mapping of str to float, optional
        How wrong numbers may be that are neither free nor held by `fix`: standard deviations by
        name or wildcard, mm, rad or 1, later entries before earlier ones, 0 of what is exact. They
        stand behind those of the robot file. Such numbers are fitted along, with this as a prior
        about their present values, and are in the result only if they moved by more than twice
        that: `Identification.nuisances`. ``target*``, ``frame*`` and the like mean what readings
        depend on, ``scale`` the scale of the instrument (20e-6). An entry all of whose numbers are
        free, held or not there is refused, but in the robot file, which other calibrations read,
        too.

        Under "common" are deviations of one amount by which all numbers are wrong alike, of points
        each coordinate: ``{"common": {"target*": 0.3}}``. Under "consider" are those of numbers of
        the geometry that are to stay exactly where they are: nothing but ± allows for them.
    residuals : function or sequence of functions
        What else is known, as functions of numbers by name (mm, rad, 1: all of the geometry, and
        what is found beside it; of a session ``offset5@thursday``): each gives one residual or
        several, in standard deviations, that are to be 0. They are fitted as a prior is.
        Derivatives are found by differences, unless the function gives a pair: its residuals and
        their derivatives by name, ``(r, {"base1.x": dr})``. Its attribute ``numbers`` may state
        more numbers to be found, by name where each starts, in mm or as ``(value, unit)``.
    progress : callable, optional
        Called now and then as ``progress(done, total)``, with what share of the work is done in
        percent, and 100: by its parts and the steps of searches, of which it is not known before
        how many there are. What it raises ends the work.

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
    if isinstance(effects, str):
        word("effects", effects, ("auto",))
        return _automatic(
            partial(
                identify, robot, measurements, free, prior=prior, loss=loss, unknown=unknown,
                holdout=holdout, bounds=bounds, per_session=per_session,
                fix=fix, drop=drop, uncertainty=uncertainty, residuals=residuals,
            ),
            progress,
        )  # fmt: skip
    if progress is not None:
        function("progress", progress)
    machine = as_machine(robot)
    roles, own = unknown_roles(unknown), words("per_session", per_session)
    fixed, find_datum = fixed_names(fix)
    named, of_file = stated_uncertainty(uncertainty), machine.model.uncertainty
    machine, moving, of_effects = effects_on(machine, effects)
    weighed, rule = loss_and_rule(loss)
    given = as_fit_data(machine, measurements, roles, bool(own), moving)
    of_machine = partial(
        of_the_machine, coefficients=coefficients(given), names=machine.geometry.names
    )
    named = replace(named, roles=roles_of(given))
    refuse_stated_by_readings(prior, named, given, machine.geometry.names)
    stated = of_file.with_later(named)
    given, uncertain = uncertain_sets(machine, with_held(given, fixed), stated)
    asked = Asked(
        None if free is None else of_machine("free", words("free", free)), prior, bounds, own,
        by_set(roles, given), of_machine("fix", fixed),
        of_effects=of_effects, uncertainty=stated, uncertain_roles=uncertain,
        residuals=checked_residuals(residuals),
    )  # fmt: skip
    dropped, drop_outliers, drop_slack = left_out(drop, sum(len(data.rows) for data in given))
    rows = prepare(machine, given, holdout, dropped, bool(own))
    with telling(progress):
        chosen = parameters(machine, rows.fitted, asked)
        require_used(named, chosen)
        part(0.02)
        start = None
        try:
            equations, start = begin(rows, chosen, weighed)
            if drop_outliers:
                part(0.25)
                rows, equations, start = without_outliers(rows, chosen, equations, start, weighed)
            else:
                require_agreement(rows, chosen, equations, start, weighed)
            if drop_slack:
                part(0.3)
            equations, slack = without_slack(equations, start) if drop_slack else (equations, ())
            part(0.5)
            fit = solve(equations, start, weighed, rule, slack)
            if find_datum:
                part(0.6)
                fit = with_datum(fit, rows)
        except FitError as error:
            hint = list[str]()
            if isinstance(error, UnreachedError):
                hint = contradicting(rows.fitted, error.rows)
            hint = hint or likely_mistakes(rows.fitted, chosen, start)
            if not hint and start is not None and start.ok and not drop_outliers:
                hint = that_others_contradict(rows, equations, start)
            if not hint and start is not None and not start.ok:
                hint = [
                    "check units, signs and columns of their actuators, or leave these rows out"
                ]
            raise ArgumentError("; ".join([f"measurements: {error}", *hint])) from None
        part(0.65)
        fit = with_component_noise(fit)
        part(0.8)
        rows, held = compare(rows, fit, drop_outliers)
        part(0.95)
        found = result(rows, fit, held, find_slack=not drop_slack)
        texts = found.warnings
    for text in texts:
        warnings.warn(text, CalibrationWarning, stacklevel=3)  # of who called, beyond the adapter
    return cast("Identification[Given]", found)  # an arm for an arm


def _automatic(
    identified: Callable[..., Identification[Given]], progress: Progress | None
) -> Identification[Given]:
    """The calibration with the sag that helps at poses left out, or else without."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CalibrationWarning)
        found = identified(effects=(), progress=within(progress, 0.0, 0.4))
    with telling(within(progress, 0.4, 0.6)):
        part(0.9)
        helps = sag_that_helps(found.fit)
    if helps is not None:
        return identified(effects=[helps.effect], progress=within(progress, 0.6, 1.0))
    if progress is not None:
        progress(PERCENT, PERCENT)
    for text in found.warnings:
        warnings.warn(text, CalibrationWarning, stacklevel=4)  # of who called, beyond the adapter
    return found
