"""Whether measurements are in the units and columns that they are said to be in."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray, mm_per_unit, rms
from pkmcal.core.library import POSE
from pkmcal.diagnostics.check import Check
from pkmcal.diagnostics.machine import far_numbers
from pkmcal.diagnostics.noise import NOISY
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements

GROSS = 0.05  # share of the machine's size by which measurements may be off before a calibration
MISFIT_RATIO = 0.2  # of the misfit that another reading may leave to be named as what was meant
_POOR = 0.1  # share of the misfit that a fit worth its name does not leave
_ALIKE = 1e-6  # share by which misfits differ that are not equal
_REVERSED = "counts the other way"
_FACTORS = {
    "mm": (("metres", 1e3), ("centimetres", 10.0), ("inches", 25.4), ("micrometres", 1e-3)),
    "rad": (
        ("degrees", np.pi / 180),
        ("milliradians", 1e-3),
        ("radians that were taken for degrees", 180 / np.pi),
    ),
}


def likely_unit_errors(
    datasets: Sequence[FitData], parameters: Parameters, evaluation: Evaluation
) -> list[str]:
    """Suspect units or exchanged columns in measurements that are grossly off.

    Each set is read in other units and with columns exchanged; a reading that fits far better is
    named. Where some rows are out of reach as given, it has to fit better than the others do.
    """
    size = parameters.robot.length
    found = []
    for i, data in enumerate(datasets):
        read = np.isfinite(data.measured.values.reshape(evaluation.residuals[i].shape))
        if not read.any():
            continue
        residual = np.where(read, evaluation.residuals[i], 0.0)
        off = _misfits(residual, data.measured.units, size)
        present = _together(off)
        if present <= GROSS * size:
            continue
        trials = {
            words: _misfits(
                np.where(read, _alone(replace(data, measured=other), parameters), 0.0),
                other.units,
                size,
            )
            for words, other in other_readings(data.measured, parameters.robot.actuator_units)
        }
        misfit = {words: _together(trial) for words, trial in trials.items()}
        # exchanges that are equivalent on a symmetric machine misfit alike
        least = min(misfit.values())
        words = next(text for text in trials if misfit[text] <= least * (1.0 + _ALIKE))
        if misfit[words] < MISFIT_RATIO * present and _better_where_reached(trials[words], off):
            which = f"measurements {i + 1}: " if len(datasets) > 1 else ""
            where = (
                f"off by {present:.3g} mm" if np.isfinite(present) else "out of the machine's reach"
            )
            found.append(f"{which}{where} as given, but by {misfit[words]:.3g} mm if {words}")
    return found


def _alone(data: FitData, parameters: Parameters) -> FloatArray:
    (residual,) = Equations.of([data], parameters).with_exact_actuators().start().residuals
    return residual


def _misfits(residual: FloatArray, units: Sequence[str], size: float) -> FloatArray:
    """Residual of each row, mm; angles as their arc. NaN if the row is not reached."""
    off: FloatArray = np.linalg.norm(residual * mm_per_unit(units, size), axis=1)
    return off


def _together(off: FloatArray) -> float:
    """Root mean square of all rows; inf if one is not reached."""
    return rms(off) if np.isfinite(off).all() else float("inf")


def _better_where_reached(trial: FloatArray, off: FloatArray) -> bool:
    """Whether the rows that are reached as given speak for another reading, too.

    Their medians, for some rows may be solved in another assembly mode.
    """
    reached = np.isfinite(off)
    if reached.all() or not reached.any():
        return True
    return bool(np.median(trial[reached]) < MISFIT_RATIO * np.median(off[reached]))


def other_readings(
    measured: Measurements, actuator_units: Sequence[str]
) -> Iterator[tuple[str, Measurements]]:
    """Read measurements in other units, with other signs and with columns exchanged."""
    for unit in dict.fromkeys(actuator_units):
        mine = np.array([unit == other for other in actuator_units])
        for name, factor in _FACTORS.get(unit, ()):
            q = np.where(mine, measured.actuators * factor, measured.actuators)
            yield f"the actuators are in {name}", replace(measured, actuators=q)
    yield "the actuators count the other way", replace(measured, actuators=-measured.actuators)
    yield from exchanges(measured)
    for unit in dict.fromkeys(measured.units):
        mine = np.array([unit == other for other in measured.units])
        what = {"mm": "measured lengths", "rad": "angles"}.get(unit, unit)
        for name, factor in _FACTORS.get(unit, ()):
            values = measured.values * (factor if mine.all() else np.where(mine, factor, 1.0))
            yield f"the {what} are in {name}", replace(measured, values=values)
    names = measured.components
    for one, other in itertools.combinations(range(len(names)), 2):
        if measured.units[one] != measured.units[other]:
            continue
        values = measured.values.copy()
        values[:, [one, other]] = values[:, [other, one]]
        yield f"{names[one]} and {names[other]} are exchanged", replace(measured, values=values)
    yield from _other_turns(measured)
    yield from _single_columns(measured, actuator_units)


def _single_columns(
    measured: Measurements, actuator_units: Sequence[str]
) -> Iterator[tuple[str, Measurements]]:
    """Read one column in another unit, or with the other sign."""
    for i, unit in enumerate(actuator_units):
        for words, factor in (*_FACTORS.get(unit, ()), (_REVERSED, -1.0)):
            q = measured.actuators.copy()
            q[:, i] *= factor
            yield _of_column(f"q{i + 1}", words), replace(measured, actuators=q)
    rows = measured.values.reshape(len(measured), -1)
    for k, (name, unit) in enumerate(zip(measured.components, measured.units, strict=True)):
        for words, factor in (*_FACTORS.get(unit, ()), (_REVERSED, -1.0)):
            values = rows.copy()
            values[:, k] *= factor
            values = values.reshape(measured.values.shape)
            yield _of_column(name, words), replace(measured, values=values)


def _of_column(name: str, words: str) -> str:
    return f"{name} {words}" if words == _REVERSED else f"{name} is in {words}"


def _other_turns(measured: Measurements) -> Iterator[tuple[str, Measurements]]:
    """Read orientations as quaternions in the other order, and as those of the base."""
    from scipy.spatial.transform import Rotation

    angles = [k for k, name in enumerate(measured.components) if name in POSE[3:]]
    if len(angles) < 3 or measured.values is None:
        return
    turned = measured.values[:, angles]
    good = np.isfinite(turned).all(axis=1)
    given = Rotation.from_euler("xyz", turned[good])
    q = given.as_quat()  # x y z w
    for words, other in (
        ("the scalar of the quaternions is their last number", q[:, [3, 0, 1, 2]]),
        ("the scalar of the quaternions is their first number", q[:, [1, 2, 3, 0]]),
        ("orientations are those of the base in the platform's frame", given.inv().as_quat()),
    ):
        values = measured.values.copy()
        values[np.ix_(good, np.array(angles))] = Rotation.from_quat(other).as_euler("xyz")
        yield words, replace(measured, values=values)


def exchanges(measured: Measurements) -> Iterator[tuple[str, Measurements]]:
    """Read measurements with two actuators exchanged."""
    columns = np.arange(measured.actuators.shape[1])
    for a, b in itertools.combinations(columns, 2):
        order = columns.copy()
        order[[a, b]] = b, a
        swapped = replace(measured, actuators=measured.actuators[:, order])
        yield f"q{a + 1} and q{b + 1} are exchanged", swapped


def _unit_errors(found: Solution) -> list[str]:
    """Suspect units where the fit is poor, or leads far off."""
    poor = found.rms > _POOR * found.rms_before or found.chi2_per_dof > NOISY
    if not poor and not far_numbers(found):
        return []
    equations = found.fit.uncertainty.equations
    return likely_unit_errors(equations.prediction.datasets, equations.parameters, found.fit.start)


CHECKS = (
    Check(
        name="unit-errors",
        about="measurements fit far better in other units, or with columns exchanged", at_once=True,
        run=_unit_errors, say=lambda found, text: text,
    ),
)  # fmt: skip
