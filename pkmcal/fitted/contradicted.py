"""Poses at which much was read that contradicts the actuators, by the machine of all others.

A search with a mirrored picture among the others takes long and ends anywhere. What seems far off
at the start is predicted by a fit of the rest, and counts as contradicted where it is further off
than that prediction is sure: by its numbers, those of a lens among them, and by what actuators
scatter, which moves a platform far near a singular pose.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, mm_per_unit
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.misfits import worst_readings
from pkmcal.estimation.mode_slips import in_their_modes
from pkmcal.fitted.outliers import LARGE

_FAR = 0.01  # of the largest length, by which poses are far off
_SEEM, _TIMES = 3.0, 10.0  # times the median, by which they are: at the start, and by others' fit
_SURE = 5.0  # deviations of what is predicted there


def far_off(equations: Equations, start: Evaluation) -> tuple[int, ...]:
    """Numbers of the rows of poses that seem far off, where most are near, before a fit."""
    much = (equations.blocks.components >= LARGE).any()
    if equations.system is None or not (much and start.ok):
        return ()
    return _rows_of(equations, start, _SEEM, 0.0)


def contradicted(equations: Equations, start: Evaluation, others: Estimate) -> tuple[int, ...]:
    """Numbers of the rows of poses that a fit of the `others` contradicts."""
    there = others.evaluation
    machine = equations.with_parameters(there.parameters).with_exact_actuators()
    predicted = in_their_modes(machine, machine.at(there.theta, near=start.states))
    if not predicted.ok:
        return ()
    unsure = _SURE * _deviations(machine, predicted, others)
    return _rows_of(equations, predicted, _TIMES, unsure)


def _rows_of(
    equations: Equations, evaluation: Evaluation, times: float, unsure: FloatArray | float
) -> tuple[int, ...]:
    """Numbers of the rows of poses that are off by these times the median, and more than unsure."""
    off = worst_readings(equations, evaluation.residuals)
    usual = float(np.nanmedian(off)) if np.isfinite(off).any() else np.inf
    odd = np.flatnonzero(off > np.maximum(max(times * usual, _FAR * equations.size), unsure))
    whole = [np.isin(place, odd) for place in equations.table.pose_of]
    return tuple(equations.table.rows[np.concatenate(whole)].tolist())


def _deviations(machine: Equations, predicted: Evaluation, others: Estimate) -> FloatArray:
    """Deviation, mm (K,), of the worst reading of each pose, as a fit of others predicts it."""
    table, scale = machine.table, machine.parameters.scale
    found = np.zeros(len(table.actuators))
    seen = machine.prediction.predicted(predicted)
    units = mm_per_unit(predicted.robot.actuator_units, predicted.robot.length)
    for i, (m, mm, part) in enumerate(
        zip(table.sets, machine.mm, machine.jacobian(predicted), strict=True)
    ):
        place = table.pose_of[i]
        variance = ((part * scale @ others.half) ** 2).sum(axis=2)
        moved = seen[i].by_twist @ predicted.machines.actuator_twists(predicted.states, place)
        own = m.actuator_sigma
        sigma = np.tile(others.state.noise[-1] / units, (len(m), 1)) if own is None else own
        variance += ((moved * sigma[:, None]) ** 2).sum(axis=2)
        np.fmax.at(found, place, np.sqrt((variance * mm**2).sum(axis=1)))
    return found
