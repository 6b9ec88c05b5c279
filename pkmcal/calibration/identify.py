"""`identify`: the geometry of a machine from measurements."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

from pkmcal.arguments import word, words
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.steps import (
    begin,
    compare,
    judged,
    prepare,
    result,
    solve,
    with_component_noise,
    with_datum,
    without_outliers,
    without_slack,
)
from pkmcal.diagnostics.row_errors import likely_mistakes
from pkmcal.effects.expansion import Coefficients, expansion_of
from pkmcal.estimation.datasets import as_fit_data, by_set
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.loss import LIMITS, LossName
from pkmcal.estimation.parameters import Asked, Bounds, Known, Prior
from pkmcal.exceptions import ArgumentError, CalibrationWarning
from pkmcal.fitted.datum import DATUMS, DatumRule
from pkmcal.fitted.dropped import (
    OUTLIERS,
    Drop,
    named_rows,
)
from pkmcal.fitted.slack import SLACK, Slack
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import RULES, CovarianceRule


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
    named = named_rows(drop, sum(len(data.rows) for data in given))
    rows = prepare(machine, given, holdout, named, bool(anew))
    chosen = parameters(machine, rows.fitted, asked)
    word("loss", loss, LIMITS)
    word("covariance", covariance, RULES)
    word("datum", datum, DATUMS)
    word("slack", slack, SLACK)
    problem = begin(rows, chosen)
    try:
        if drop == OUTLIERS:
            rows, problem = without_outliers(rows, problem, chosen)
        if slack == "drop":
            problem = without_slack(problem)
        fitted = solve(problem, loss)
        if datum == "auto":
            fitted = with_datum(fitted, rows, asked)
    except ValueError as error:
        hint = likely_mistakes(rows.fitted, chosen, problem.start)
        if not hint and not problem.start.ok:
            hint = ["check units, signs and columns of their actuators, or leave these rows out"]
        raise ArgumentError("; ".join([f"measurements: {error}", *hint])) from None
    fitted = with_component_noise(fitted)
    sure = judged(fitted, covariance)
    rows, held = compare(rows, fitted, sure, outliers=drop == OUTLIERS)
    found = result(rows, fitted, sure, held, find_slack=slack == "keep")
    for text in found.warnings:
        warnings.warn(text, CalibrationWarning, stacklevel=2)
    return found
