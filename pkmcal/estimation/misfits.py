"""Misfits of readings and closures at an evaluation, in mm and N."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, rms
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.pose_system import PoseSystem
from pkmcal.measurements.measurements import Measurements

_ROUNDING = 2e-15  # of the largest value: the error of a solved pose


def worst_readings(equations: Equations, residuals: Sequence[FloatArray]) -> FloatArray:
    """Return the worst reading of each pose, mm (K,), of measured less predicted; inf without one.

    Angles count as their arc. NaN where nothing was read.
    """
    worst = np.full(len(equations.table.actuators), np.nan)
    for m, mm, place, residual in zip(
        equations.table.sets, equations.mm, equations.table.pose_of, residuals, strict=True
    ):
        read = np.isfinite(m.values.reshape(residual.shape))
        known = np.where(read, residual, 0.0)
        off = np.linalg.norm(known * mm, axis=1)
        off = np.where(np.isfinite(off), off, np.inf)
        some = read.any(axis=1)
        np.fmax.at(worst, place[some], off[some])
    return worst


def distances(equations: Equations, evaluation: Evaluation) -> FloatArray:
    """Return distances of the measured points, mm, in the order of the sets."""
    whole = equations.whole or equations
    return np.concatenate([
        np.linalg.norm(of_read(m, r) * mm if m.components else of_read(m, r), axis=1)
        for m, mm, r in zip(whole.table.sets, whole.mm, evaluation.residuals, strict=True)
    ])  # fmt: skip


def progress(equations: Equations, evaluation: Evaluation) -> float:
    """Root mean square of the `distances` of the rows that were reached; NaN without any.

    `closure_rms` where nothing but the actuators was read.
    """
    if not equations.whitening.any_read:
        return closure_rms(equations, evaluation)
    off = distances(equations, evaluation)
    return rms(off[np.isfinite(off)])


def closure_rms(
    equations: Equations, evaluation: Evaluation, poses: BoolArray | None = None
) -> float:
    """Return the rms misfit of the closures at poses (K,), mm of actuators; NaN where they hold."""
    system = equations.system
    if system is None:
        return float("nan")
    off = _closures_off(system, evaluation)
    if system.blocks.counting is not None or poses is not None or not evaluation.ok:
        some = evaluation.status == 0 if poses is None else poses & (evaluation.status == 0)
        off = off[~system.blocks.slack[:, : off.shape[1]] & some[:, None]]
    return rms(off)


def worst_closures(equations: Equations, evaluation: Evaluation) -> FloatArray:
    """Return the worst closure of each pose, mm (K,); NaN where closures hold."""
    system = equations.system
    if system is None:
        return np.full(len(equations.table.actuators), np.nan)
    off: FloatArray = np.abs(_closures_off(system, evaluation))
    off[system.blocks.slack[:, : off.shape[1]]] = 0.0
    worst: FloatArray = off.max(axis=1)
    return worst


def cell_rms(equations: Equations, evaluation: Evaluation) -> float:
    """Return tensions' misfit to the load cells, N; NaN where tensions are no unknowns."""
    cells, system = equations.machines.cells, equations.system
    if not cells or system is None:
        return float("nan")
    return rms(system.readings_off(evaluation)[:, -cells:][system.blocks.counts[:, -cells:]])


def _closures_off(system: PoseSystem, evaluation: Evaluation) -> FloatArray:
    """`PoseSystem.readings_off` of the actuators, in mm."""
    machines = evaluation.machines
    off: FloatArray = system.readings_off(evaluation) * machines.lengths()
    return off[:, : machines.equations - machines.cells]


def rounding(equations: Equations, noise: FloatArray) -> float:
    """Length of the whitened rounding errors of what is predicted, for noise (G,)."""
    equations = equations.whole or equations
    readings, sigma = 0.0, equations.machines.sigma
    if equations.system is None or equations.whitening.any_read:
        readings = float(np.linalg.norm(rounding_of_readings(equations, noise)))
    if equations.system is None or sigma is None:
        return readings
    size = _ROUNDING * float(np.abs(equations.table.actuators).max())
    whitened = size / (noise[equations.system.blocks.groups] * sigma)
    return float(np.hypot(readings, np.linalg.norm(whitened)))


def rounding_of_readings(equations: Equations, noise: FloatArray) -> FloatArray:
    """Whitened rounding errors (M,) of what is predicted of readings, for noise (G,)."""
    length = equations.parameters.robot.length
    pairs = zip(equations.table.sets, equations.mm, strict=True)
    parts = [rounding_of(m, length, mm) for m, mm in pairs]
    return equations.whitening.whitened(parts, noise)


def rounding_of(measured: Measurements, length: float, mm: FloatArray) -> FloatArray:
    """Rounding errors (N, k) of what is predicted, mm, rad; `mm` is `Equations.mm` of the set."""
    values = measured.values.reshape(len(measured), -1)
    lengths = np.array([unit == "mm" for unit in measured.units], dtype=bool)
    size = np.max(np.nan_to_num(np.abs(values[:, lengths])), initial=0.0) + length
    return np.broadcast_to(_ROUNDING * size / mm, values.shape)


def of_read(measured: Measurements, residual: FloatArray) -> FloatArray:
    """Residuals (N, k) of what was read, 0 beside it; NaN in rows where nothing was."""
    read = np.isfinite(measured.values.reshape(residual.shape))
    if not residual.shape[1]:
        return np.full((len(residual), 1), np.nan)
    if read.all():
        return residual
    known = np.where(read, residual, 0.0)
    known[~read.any(axis=1)] = np.nan
    return known
