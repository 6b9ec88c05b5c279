"""`identify`: the geometry of a machine from measurements."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pkmcal.equations import Equations, Point, Share
from pkmcal.estimate import Estimate, Estimator
from pkmcal.identifiability import in_words, observability, sparse_basis
from pkmcal.identification import Identification
from pkmcal.loss import LIMITS
from pkmcal.measurements import Measurements
from pkmcal.outliers import outliers
from pkmcal.parameters import Bounds, Parameters, Prior, parameters
from pkmcal.plausibility import meagre, misread
from pkmcal.robot import Robot
from pkmcal.suggest import did_you_mean

FloatArray = NDArray[np.float64]

_INVOLVED = 1e-6  # share of a parameter in what cannot be told, above which it cannot be told


def identify(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    free: str | Sequence[str] | None = None,
    prior: Prior = None,
    loss: str = "linear",
    frame: str | Sequence[str] = "known",
    target: str | Sequence[str] = "known",
    holdout: float | Measurements | None = None,
    bounds: Bounds = None,
) -> Identification:
    """Find the geometry that agrees best with measurements.

    Weighted least squares on the measured quantities, through the forward kinematics and its
    exact derivatives.

    Parameters
    ----------
    robot : Robot
        The machine as drawn, or as last calibrated.
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
        several sets one word each, if not the same for all.
    target : {"known", "unknown"} or a sequence of them
        Whether the measured points of the platform are known or to be found, from where
        `Measurements.target` puts them: ``target1.x`` …; for distances the fixed point,
        ``anchor1.x`` ….
    holdout : float or Measurements, optional
        A fraction of the poses of each set, drawn at random with repeats kept together, or other
        measurements: they are not fitted, only compared.
    bounds : mapping of str to (float, float), optional
        Lower and upper limit by name or wildcard, mm and rad.

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
    shares, held, parameter = _arguments(
        robot, measurements, free, prior, loss, frame, target, holdout, bounds
    )
    equations = Equations(shares, parameter)
    start = equations.start()
    noted = misread(shares, parameter, start)
    if not start.reached:
        hint = f" ({'; '.join(noted)})" if noted else ""
        raise ValueError(f"measurements: {equations.unreached(start)}{hint}")
    estimator = Estimator(equations, start, loss)
    estimate = estimator.solve()
    noted += meagre(equations, estimate.setting.told.rank, bool(len(estimator.prior)))
    if not estimator.converged:
        noted.append("the least squares did not converge; the result is not to be trusted")
    compared = _Compared(Equations(held, parameter), start, estimate) if held else None
    if compared is not None and compared.unreached:
        noted.append(f"holdout: {compared.unreached}; left out")
    for text in noted:
        warnings.warn(text, UserWarning, stacklevel=2)
    return _result(estimator, estimate, compared, tuple(noted))


def _arguments(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    free: str | Sequence[str] | None,
    prior: Prior,
    loss: str,
    frame: str | Sequence[str],
    target: str | Sequence[str],
    holdout: float | Measurements | None,
    bounds: Bounds,
) -> tuple[list[Share], list[Share], Parameters]:
    """What is fitted, what is held out, and the parameters."""
    if loss not in LIMITS:
        raise ValueError(f"loss must be one of {', '.join(LIMITS)}; found {loss!r}")
    sets = [measurements] if isinstance(measurements, Measurements) else list(measurements)
    if not sets:
        raise ValueError("measurements: none given")
    for measured in sets:
        _check(robot, measured, "measurements")
    frames, targets = _words("frame", frame, len(sets)), _words("target", target, len(sets))
    if any(frames) and all(m.kind == "distance" or not f for m, f in zip(sets, frames)):
        raise ValueError("frame: distances do not depend on a frame")
    shares, held = [], []
    first = 0
    for measured, unknown_frame, unknown_target in zip(sets, frames, targets, strict=True):
        rows = np.arange(first, first + len(measured))
        first += len(measured)
        whole = Share(measured, rows, unknown_frame, unknown_target)
        if holdout is None or isinstance(holdout, Measurements):
            shares.append(whole)
            continue
        kept, out = _split(measured, holdout)
        for side, chosen in ((shares, kept), (held, out)):
            part = Share(measured.select(chosen), rows[chosen], unknown_frame, unknown_target)
            side.append(part)
    if isinstance(holdout, Measurements):
        _check(robot, holdout, "holdout")
        alike = [i for i, m in enumerate(sets) if (m.kind == "distance") == (holdout.kind == "distance")]
        nearest = next((i for i in alike if sets[i].kind == holdout.kind), alike[0] if alike else 0)
        held.append(
            Share(holdout, np.arange(len(holdout)), frames[nearest], targets[nearest])
        )
    fitted = [share.measured for share in shares]
    return shares, held, parameters(robot, fitted, free, prior, frames, targets, bounds)


def _check(robot: Robot, measured: Measurements, argument: str) -> None:
    if not isinstance(measured, Measurements):
        raise TypeError(f"{argument} must be Measurements, found {type(measured).__name__}")
    n = measured.actuators.shape[1]
    if n != robot.n_actuators:
        raise ValueError(
            f"{argument}: {robot.name} has {robot.n_actuators} actuators, found {n} per row"
        )
    if measured.actuator_units not in (None, robot.actuator_units):
        raise ValueError(
            f"{argument}: the actuators of {robot.name} are in {', '.join(robot.actuator_units)},"
            f" found {', '.join(measured.actuator_units or ())}"
        )


def _words(argument: str, given: str | Sequence[str], count: int) -> list[bool]:
    words = [given] * count if isinstance(given, str) else list(given)
    if len(words) != count:
        raise ValueError(f"{argument}: one word for each of {count} sets, found {len(words)}")
    for word in words:
        if word not in ("known", "unknown"):
            known = did_you_mean(str(word), ("known", "unknown"))
            raise ValueError(f"{argument} must be 'known' or 'unknown', found {word!r}{known}")
    return [word == "unknown" for word in words]


def _split(measured: Measurements, holdout: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row numbers to fit and to hold out, drawn as `Measurements.split` draws them."""
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = numbered.split(holdout)
    return kept.values.astype(np.intp), out.values.astype(np.intp)


class _HeldOut:
    """How far off points that were not fitted are, and should be."""

    def __init__(
        self, shares: Sequence[Share], like: Sequence[int], estimator: Estimator, estimate: Estimate
    ) -> None:
        equations = Equations(shares, estimator.equations.parameters)
        before = equations.at(estimator.start.theta)
        after = equations.at(estimate.point.theta)
        self.unreached = equations.unreached(after)
        self.rms_before, self.rms = equations.rms(before), equations.rms(after)
        half = np.linalg.cholesky(_ridged(estimate.covariance)) * estimator.scale[:, None]
        variance = []
        for part, measured, i in zip(equations.jacobian(after), equations.sets, like, strict=True):
            model = ((part[:, :3] @ half) ** 2).sum(axis=(1, 2))
            lengths = min(part.shape[1], 3)
            if measured.sigma is None:
                noise = np.full(len(measured), lengths * estimate.setting.noise[i] ** 2)
            elif measured.sigma.ndim == 2:
                noise = (measured.sigma[:, :3] ** 2).sum(axis=1)
            else:
                noise = np.trace(measured.sigma[:, :3, :3], axis1=1, axis2=2)
            variance.append(model + noise)
        self.expected = float(np.sqrt(np.nanmean(np.concatenate(variance))))
