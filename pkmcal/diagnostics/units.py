"""Check whether measurements are in the units and columns that they are said to be in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import TIED, BoolArray, FloatArray, rms
from pkmcal.diagnostics.check import Check
from pkmcal.diagnostics.families import GROSS, unlike_families
from pkmcal.diagnostics.machine import far_numbers
from pkmcal.diagnostics.noise import NOISY
from pkmcal.diagnostics.other_readings import other_readings
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.machine_size import compared_by
from pkmcal.estimation.parameters import Parameters
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.solution import Solution
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements

MISFIT_RATIO = 0.2  # of the misfit that another reading may leave to be named as what was meant
_POOR = 0.1  # share of the misfit that a fit worth its name does not leave


def likely_unit_errors(
    datasets: Sequence[FitData],
    parameters: Parameters,
    evaluation: Evaluation | None,
    *,
    near: FloatArray | None = None,
    least: float = GROSS,
) -> list[str]:
    """Suspect units or exchanged columns in measurements that are grossly off.

    Each set is read in other units and with columns exchanged; a reading that fits far better is
    named. Where some rows are out of reach as given, it has to fit better than the others do; where
    they were refused before anything was evaluated, most have to fit.
    They are read at the present machine, or at parameters `near` (n,) it; what is off by no more
    than a share `least` of the machine's size is not suspected.
    """
    size, together = parameters.robot.length, _together if evaluation is not None else _typical
    found = []
    for i, data in enumerate(datasets):
        values = data.measured.values
        residual = values if evaluation is None else evaluation.residuals[i]
        read = np.isfinite(values.reshape(residual.shape))
        if not read.any():
            continue
        off = np.full(len(values), np.nan)
        if evaluation is not None:
            off = _misfits(np.where(read, residual, 0.0), data.measured, parameters.robot)
        present = together(off)
        if present <= least * size:
            continue
        others = dict(other_readings(data.measured, parameters.robot.actuator_units))
        trials = {
            meant: (_read_as(replace(data, measured=other), parameters, near, read), shrunk)
            for meant, other in others.items()
            if (shrunk := _shrunk(data.measured, other)) > 0.0
        }
        # smaller numbers misfit by less, whatever they mean: a machine without lengths fits any
        misfit = {meant: together(off) / by for meant, (off, by) in trials.items()}
        # exchanges that are equivalent on a symmetric machine misfit alike
        lowest = min(misfit.values())
        meant = next(each for each in trials if misfit[each] <= lowest * (1.0 + TIED))
        most = GROSS * size if evaluation is None else MISFIT_RATIO * present
        if (
            misfit[meant] < most
            and _better_where_reached(trials[meant][0], off)
            and _doubts(others[meant]) <= _doubts(data.measured)
        ):
            which = f"measurements {i + 1}: " if len(datasets) > 1 else ""
            where = (
                f"off by {present:.3g} mm" if np.isfinite(present) else "out of the machine's reach"
            )
            given = "readings are off" if evaluation is None else f"{where} as given, but"
            found.append(
                f"{which}{given} by {together(trials[meant][0]):.3g} mm if"
                f" {meant.among([each.measured for each in datasets])}"
            )
    return found


def _alone(data: FitData, parameters: Parameters, near: FloatArray | None) -> FloatArray:
    (residual,) = Equations.of([data], parameters).with_exact_actuators().start(near).residuals
    return residual


def _read_as(
    data: FitData, parameters: Parameters, near: FloatArray | None, read: BoolArray
) -> FloatArray:
    """Misfit of each row as it is read now, mm; only of what was read."""
    try:
        residual = np.where(read, _alone(data, parameters, near), 0.0)
    except ArgumentError:  # such readings are refused
        return np.full(len(data.measured), np.nan)
    return _misfits(residual, data.measured, parameters.robot)


def _shrunk(given: Measurements, other: Measurements) -> float:
    """Return the factor by which measured numbers shrink, at most 1."""
    turning = given.instrument.turning  # orientations do not become small
    columns = slice(None) if turning is None else slice(0, turning)
    before, after = (
        np.linalg.norm(np.nan_to_num(m.values.reshape(len(m), -1)[:, columns]))
        for m in (given, other)
    )
    return min(1.0, float(after / before)) if before > 0.0 else 1.0


def _misfits(residual: FloatArray, measured: Measurements, robot: Calibratable) -> FloatArray:
    """Residual of each row, mm; angles as their arc. NaN if the row is not reached."""
    off: FloatArray = np.linalg.norm(residual * compared_by(robot, measured), axis=1)
    return off


def _doubts(measured: Measurements) -> int:
    """How much is wrong by the readings themselves, as pictures that show a board from behind."""
    return sum(1 for _ in measured.instrument.doubts(measured))


def _together(off: FloatArray) -> float:
    """Root mean square of all rows; inf if one is not reached."""
    return rms(off) if np.isfinite(off).all() else float("inf")


def _typical(off: FloatArray) -> float:
    """Median of all rows, of which some may be solved in another assembly mode."""
    return float(np.median(np.where(np.isfinite(off), off, np.inf)))


def _better_where_reached(trial: FloatArray, off: FloatArray) -> bool:
    """Return whether the rows that are reached as given speak for another reading, too.

    Their medians, for some rows may be solved in another assembly mode.
    """
    reached = np.isfinite(off)
    if reached.all() or not reached.any():
        return True
    return bool(np.median(trial[reached]) < MISFIT_RATIO * np.median(off[reached]))


def _unit_errors(found: Solution) -> list[str]:
    """Suspect units where the fit is poor, or leads far off."""
    poor = found.rms > _POOR * found.rms_before or found.chi2_per_dof > NOISY
    unlike = any(True for _ in unlike_families(found))
    if not poor and not unlike and not far_numbers(found):
        return []
    equations, end = found.fit.uncertainty.equations, found.fit.end
    sets = equations.prediction.datasets
    named = likely_unit_errors(sets, equations.parameters, found.fit.start)
    if named or not unlike:
        return named
    # the other family has found the machine, whose own errors then hide no convention
    return likely_unit_errors(sets, end.parameters, end, near=end.theta, least=0.0)


CHECKS = (
    Check(
        name="unit-errors",
        about="measurements fit far better in other units, or with columns exchanged", at_once=True,
        run=_unit_errors, say=lambda found, text: text,
    ),
)  # fmt: skip
