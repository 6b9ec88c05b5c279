"""Hold-out: points that are not fitted, only compared with the calibrated machine.

`draw` splits them off before the fit, `evaluate` compares them after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, mm_per_unit, propagate
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import Estimate, Estimator
from pkmcal.calibration.mode_slips import in_their_modes
from pkmcal.calibration.parameters import FitData
from pkmcal.measurements.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements


@dataclass(frozen=True)
class HeldOut:
    """Errors of the points held out, mm; NaN where there are none.

    Attributes
    ----------
    rms_before, rms : float
        Root mean square distances with the start's parameters and with the estimate's.
    expected : float
        What `rms` should be if noise and covariance are right.
    failures : str
        Rows that were left out because their forward kinematics failed, in words.
    off_before, off : ndarray (N,)
        The distances themselves.
    """

    rms_before: float = float("nan")
    rms: float = float("nan")
    expected: float = float("nan")
    failures: str = ""
    off_before: FloatArray = field(default_factory=lambda: np.empty(0))
    off: FloatArray = field(default_factory=lambda: np.empty(0))


def draw(data: FitData, holdout: float) -> tuple[FitData, FitData]:
    """Split rows into those to fit and those to hold out, as `Measurements.split` does."""
    measured = data.measured
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = (part.values.astype(np.intp) for part in numbered.split(holdout))
    return _rows(data, kept), _rows(data, out)


def _rows(data: FitData, chosen: IntArray) -> FitData:
    return replace(data, measured=data.measured.select(chosen), rows=data.rows[chosen])


def evaluate(
    held: Sequence[tuple[FitData, int]], estimator: Estimator, estimate: Estimate
) -> HeldOut:
    """Compare points that were not fitted, before and after the calibration.

    Parameters
    ----------
    held : sequence of (FitData, int)
        With each, the fitted set whose noise it has where its own is not stated.
    estimator, estimate : Estimator, Estimate
        Of the fit.
    """
    if not held:
        return HeldOut()
    equations = Equations([data for data, _ in held], estimator.equations.parameters).commanded()
    estimated = estimate.state.noise[len(estimator.equations.sets) :]  # of the actuators, or none
    after = in_their_modes(equations, equations.at(estimate.evaluation.theta))
    before = equations.at(estimator.start.theta)
    scaled = estimate.covariance * np.outer(estimator.scale, estimator.scale)
    variances = []
    by_actuators = after.robot.actuator_twists(after.pose, after.actuators)
    for i, (part, (data, like)) in enumerate(zip(equations.jacobian(after), held, strict=True)):
        lengths = part[:, :3]  # of a pose its position
        variance = propagate(lengths, scaled) + _noise(data.measured, estimate.state.noise[like])
        sigma = _of_actuators(data.measured, after.robot, estimated)
        if sigma is not None:
            moved = after.predicted[i].by_twist[:, :3] @ by_actuators[equations.pose_of[i]]
            variance += ((moved * sigma[:, None]) ** 2).sum(axis=(1, 2))
        variances.append(variance)
    return HeldOut(
        rms_before=equations.rms(before),
        rms=equations.rms(after),
        expected=float(np.sqrt(np.nanmean(np.concatenate(variances)))),
        failures=equations.failures(after),
        off_before=equations.distances(before),
        off=equations.distances(after),
    )


def _of_actuators(
    measured: Measurements, robot: Calibratable, estimated: FloatArray
) -> FloatArray | None:
    """Deviations (N, n) of what the actuators of held-out rows read; None where they have none."""
    if measured.actuator_sigma is not None:
        return measured.actuator_sigma
    if not len(estimated):
        return None
    units = mm_per_unit(robot.actuator_units, robot.length)
    return np.tile(estimated[0] / units, (len(measured), 1))


def _noise(measured: Measurements, estimated: float) -> FloatArray:
    """Variance of the measured point of each row, mm² (N,)."""
    sigma = measured.sigma
    if sigma is None:
        lengths = min(len(measured.components), 3)
        return np.full(len(measured), lengths * estimated**2)
    if sigma.ndim == 2:
        squares: FloatArray = (sigma[:, :3] ** 2).sum(axis=1)
        return squares
    traces: FloatArray = np.trace(sigma[:, :3, :3], axis1=1, axis2=2)
    return traces
