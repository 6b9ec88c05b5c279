"""`identify`: the geometry of a machine from measurements."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arguments import instance, word
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import Estimate, Estimator
from pkmcal.calibration.holdout import HeldOut, compare, drawn
from pkmcal.calibration.identifiability import in_words, observability, plain_basis
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.loss import LIMITS
from pkmcal.calibration.outliers import outliers
from pkmcal.calibration.parameters import Bounds, Prior, Share, parameters
from pkmcal.calibration.plausibility import beyond_strokes, meagre, misread, strayed
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.calibratable import as_given, as_machine
from pkmcal.measurements.lack_of_fit import joined
from pkmcal.measurements.measurements import Measurements

_POOR = 0.1  # share of the misfit that a fit worth its name does not leave
_NOISY = 9.0  # chi²/dof that a slip in sigma does not explain
_INVOLVED = 1e-6  # share of a parameter in what cannot be told, above which it cannot be told


def identify(
    robot: Robot | SerialArm,
    measurements: Measurements | Sequence[Measurements],
    free: str | Sequence[str] | None = None,
    prior: Prior = None,
    loss: str = "linear",
    frame: str | Sequence[str] = "known",
    target: str | Sequence[str] = "known",
    holdout: float | Measurements | None = None,
    bounds: Bounds = None,
    attachment: str | Sequence[str] = "known",
) -> Identification:
    """Find the geometry that agrees best with measurements.

    Weighted least squares on the measured quantities, through the forward kinematics and its
    exact derivatives.

    Parameters
    ----------
    robot : Robot or SerialArm
        The machine as drawn, or as last calibrated. The numbers of an arm are its joint errors,
        ``joint1.dx`` … ``joint6.dpsi``.
    measurements : Measurements or sequence of Measurements
        Of any kinds.
    free : str or sequence of str, optional
        Names of numbers to find, or wildcards (``"base*.x"``). None: the robot's own default set.
    prior : float or mapping of str to float, optional
        Standard deviation around the present value. A number, in mm, holds for all free numbers
        of the geometry (an angle as its arc at the machine's characteristic length); a mapping
        gives it by name or wildcard in mm and rad, later entries before earlier ones. None: no
        prior; what the measurements cannot tell then moves as little as possible.
    loss : {"linear", "huber", "cauchy"}
        How much rows count that are far off, by the length of the whole measured vector.
    frame : {"known", "unknown"} or a sequence of them
        Whether the instrument's frame is the robot's base frame or is to be found: six parameters
        ``frame.x`` … ``frame.gamma``, the pose of the base in the instrument's frame. With
        several sets one word each, if not the same for all. No start near it is needed.
    target : {"known", "unknown"} or a sequence of them
        Whether the measured points of the platform are known or to be found, from where
        `Measurements.target` puts them: ``target1.x`` …; for distances the fixed point,
        ``anchor1.x`` ….
    holdout : float or Measurements, optional
        A fraction of the poses of each set, drawn at random with repeats kept together, or other
        measurements: they are not fitted, only compared.
    bounds : mapping of str to (float, float), optional
        Lower and upper limit by name or wildcard, mm and rad.
    attachment : {"known", "unknown"} or a sequence of them
        Whether the points of the platform from which distances are measured are known or to be
        found, from where `Measurements.attachment` puts them: ``attachment1.x`` ….

    Returns
    -------
    Identification
        The calibrated robot, the parameters with their uncertainty, and how good they are.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit, a name that is not known or tied; rows that the machine as
        drawn cannot reach.

    Warns
    -----
    UserWarning
        Units or columns that look mistaken, too few or repeated rows, no convergence. The texts
        are also in `Identification.warnings`.

    Examples
    --------
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> from pkmcal.identify import identify
    >>> from pkmcal.measurements import Measurements
    >>> robot = pk.load("hexapod")
    >>> poses = np.array([0, 0, 850, 0, 0, 0]) + [[i * 20, 5 * i**2, 0, 0, 0, 0] for i in range(5)]
    >>> q = robot.inverse(poses)
    >>> true = robot.replace({"offset1": 0.3})
    >>> found = identify(robot, Measurements(q, true.forward(q).pose, "pose"), free="offset*")
    >>> round(found.robot.geometry["offset1"], 6)
    0.3
    """
    robot = as_machine(robot)
    shares = _shares(robot, measurements, frame, target, attachment)
    held: list[tuple[Share, int]] = []
    if isinstance(holdout, Measurements):
        held = [_like(robot, holdout, shares)]
    elif holdout is not None:
        pairs = [drawn(share, holdout) for share in shares]
        shares, held = [kept for kept, _ in pairs], [(out, i) for i, (_, out) in enumerate(pairs)]
    chosen = parameters(robot, shares, free, prior, bounds)
    word("loss", loss, LIMITS)
    equations = Equations(shares, chosen)
    start = equations.start()
    try:
        if not start.reached:
            raise ArgumentError(equations.unreached(start))
        estimator = Estimator(equations, start, loss)
        estimate = estimator.solve()
    except ValueError as error:
        hint = misread(shares, chosen, start)
        if not hint and not start.reached:
            hint = ["check units, signs and columns of their actuators, or leave these rows out"]
        raise ArgumentError("; ".join([f"measurements: {error}", *hint])) from None
    result = _result(estimator, estimate, compare(held, estimator, estimate))
    notes = _doubts(result, estimator, estimate, shares)
    for text in notes:
        warnings.warn(text, UserWarning, stacklevel=2)
    return replace(result, warnings=tuple(notes))


def _doubts(
    result: Identification, estimator: Estimator, estimate: Estimate, shares: Sequence[Share]
) -> list[str]:
    """What looks wrong with the measurements or the fit."""
    equations, size = estimator.equations, estimator.start.robot.length
    notes = strayed(estimator.start, estimate.point, equations.parameters)
    if notes or result.rms > _POOR * result.rms_before or result.chi2_per_dof > _NOISY:
        notes = misread(shares, equations.parameters, estimator.start) or notes
    notes += meagre(equations, result.rank, result.dof, bool(len(estimator.prior)))
    if result.chi2_per_dof > _NOISY:
        notes.append(
            f"residuals are {np.sqrt(result.chi2_per_dof):.3g} times what sigma says:"
            f" {_cure(result, estimator, estimate)}"
        )
    notes += beyond_strokes(equations, estimator.start, estimate.point)
    faint = estimate.setting.determined.rank - estimate.setting.searched.rank
    if faint:
        notes.append(
            f"{faint} combinations of parameters are told to no better than {size:.0f} mm, the"
            " machine's size, and were kept as they were: state a prior or measure more poses"
        )
    if not result.converged:
        notes.append("the least squares did not converge: the result is not to be trusted")
    if result.holdout_unreached:
        notes.append(f"holdout: {result.holdout_unreached}; left out")
    return notes


def _cure(result: Identification, estimator: Estimator, estimate: Estimate) -> str:
    """What to do about residuals far above sigma; repeats know which of two it is."""
    scatter = joined(estimator.repeats(estimate)).scatter
    if scatter**2 > _NOISY:
        return f"repeats of a pose scatter {scatter:.3g} times as much as it, state the true sigma"
    cure = "free more parameters"
    if not np.isfinite(scatter):
        cure += ", or state the true sigma"
    if result.outliers:
        cure = "look at the outliers, fit with loss='cauchy', or " + cure
    return cure


def _shares(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    frame: str | Sequence[str],
    target: str | Sequence[str],
    attachment: str | Sequence[str],
) -> list[Share]:
    sets = list(measurements) if isinstance(measurements, Iterable) else [measurements]
    for measured in sets:
        _check(robot, measured, "measurements")
    if not sets:
        raise ArgumentError("measurements: none given")
    shares, first = [], 0
    said = {"frame": frame, "target": target, "attachment": attachment}
    unknown = zip(*(_unknown(name, given, len(sets)) for name, given in said.items()), strict=True)
    for measured, unknowns in zip(sets, unknown, strict=True):
        shares.append(Share(measured, np.arange(first, first + len(measured)), *unknowns))
        first += len(measured)
    if any(share.unknown_frame for share in shares) and not any(share.framed for share in shares):
        raise ArgumentError("frame: distances do not depend on it, it cannot be unknown")
    distances = any(share.measured.kind == "distance" for share in shares)
    if any(share.unknown_attachment for share in shares) and not distances:
        raise ArgumentError("attachment: distances alone have one, it cannot be unknown")
    return shares


def _like(robot: Robot, holdout: Measurements, shares: Sequence[Share]) -> tuple[Share, int]:
    """Other measurements to hold out, read like those fitted of their kind."""
    _check(robot, holdout, "holdout")
    alike = [i for i, share in enumerate(shares) if share.measured.kind == holdout.kind]
    i = alike[0] if alike else 0
    return replace(shares[i], measured=holdout, rows=np.arange(len(holdout))), i


def _check(robot: Robot, measured: Measurements, argument: str) -> None:
    n = instance(argument, measured, Measurements).actuators.shape[1]
    if n != robot.n_actuators:
        raise ArgumentError(
            f"{argument}: {robot.name} has {robot.n_actuators} actuators, found {n} per row"
        )
    if measured.actuator_units not in (None, robot.actuator_units):
        raise ArgumentError(
            f"{argument}: the actuators of {robot.name} are in {', '.join(robot.actuator_units)},"
            f" found {', '.join(measured.actuator_units or ())}"
        )


def _unknown(argument: str, given: str | Sequence[str], count: int) -> list[bool]:
    alone = isinstance(given, str) or not isinstance(given, Iterable)
    said = [given] * count if alone else list(given)
    if len(said) != count:
        raise ArgumentError(f"{argument}: one word for each of {count} sets, found {len(said)}")
    return [word(argument, each, ("known", "unknown")) == "unknown" for each in said]


def _result(estimator: Estimator, estimate: Estimate, compared: HeldOut) -> Identification:
    equations, chosen = estimator.equations, estimator.equations.parameters
    setting, theta, scale = estimate.setting, estimate.point.theta, chosen.scale
    untold, searched = setting.determined.untold, setting.searched.told
    to_scale = chosen.reported_rates(theta) * scale
    covariance = to_scale @ estimate.covariance @ to_scale.T
    if (estimator.unstated & (estimate.freedom < 0.5)).any():
        covariance = np.full_like(covariance, np.inf)  # the noise is not known
    unknown = np.linalg.norm(to_scale @ untold, axis=1) > _INVOLVED * scale
    shown = covariance.copy()
    shown[unknown] = shown[:, unknown] = np.nan
    shown[unknown, unknown] = np.inf
    prior_off = estimator.prior @ ((theta - chosen.start) / scale)
    dof = float(estimate.weights @ equations.components) + len(prior_off) - setting.searched.rank
    squares = np.repeat(estimate.weights, equations.components) @ estimate.residual**2
    no_sigma = bool(estimator.unstated.all()) or dof <= 0
    at_bound = np.isclose(theta, chosen.lower, rtol=1e-9, atol=1e-9) | np.isclose(
        theta, chosen.upper, rtol=1e-9, atol=1e-9
    )
    repeated = joined(estimator.repeats(estimate)), joined(estimator.repeats(estimate, plain=True))
    plain = plain_basis(setting.told.untold, chosen.names)
    odd = outliers(
        estimate.residual,
        estimate.jacobian @ searched,
        equations.components,
        estimate.weights,
        estimator.prior @ searched,
    )
    return Identification(
        robot=as_given(chosen.robot.replace(chosen.values_at(theta))),
        free=chosen.names,
        units=chosen.units,
        values=chosen.reported(theta),
        start=chosen.reported(estimator.start.theta),
        stderr=np.sqrt(np.diagonal(shown)),
        covariance=shown,
        rank=setting.told.rank,
        gap=setting.told.gap,
        unidentifiable=tuple(in_words(c, chosen.names) for c in plain.T),
        rms=equations.rms(estimate.point),
        rms_before=equations.rms(estimator.start),
        holdout_rms=compared.rms,
        holdout_rms_before=compared.rms_before,
        holdout_expected=compared.expected,
        holdout_unreached=compared.unreached,
        holdout_off=compared.off,
        holdout_off_before=compared.off_before,
        chi2_per_dof=float("nan") if no_sigma else float((squares + prior_off @ prior_off) / dof),
        dof=dof,
        noise=tuple(np.where(estimator.unstated, setting.noise, np.nan).tolist()),
        repeatability=repeated[1].scatter,
        lack_of_fit=repeated[1].beyond,
        lack_of_fit_chance=repeated[0].chance,
        observability=observability(
            estimator.plain(estimate.point), len(equations.actuators), setting.told.rank
        ),
        residuals=estimate.point.residuals,
        rows=equations.rows,
        outliers=tuple(equations.rows[odd].tolist()),
        at_bounds=tuple(name for name, at in zip(chosen.names, at_bound, strict=True) if at),
        converged=estimator.search.converged,
        evaluations=estimator.search.evaluations,
        history=tuple(estimator.search.history),
        warnings=(),
        _told=covariance,
        _equations=equations,
        _start=estimator.start,
        _estimate=estimate,
    )
