"""Rows that were solved in another assembly mode than the one they were measured in.

Forward kinematics starts from what was measured, or from home, and may end in another mode. Such a
row misses grossly, and there is a mode that does not: so rows that miss grossly are tried in every
mode. A reading that is wrong itself has no such mode.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arrays import TIED, BoolArray, FloatArray, IntArray, first_largest, largest_first
from pkmcal.display import first_rows
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.misfits import worst_readings
from pkmcal.estimation.row_states import RowStates
from pkmcal.kinematics.calibratable import as_parallel
from pkmcal.kinematics.robot import Robot

_GROSS = 6.0  # times the median misfit from which a row is tried in other modes
_LEAST = 1e-3  # mm; misfits of measurements without noise
_HALF = 0.5  # of the misfit that another mode may leave
_FITTING = 4.0  # times what is gross, beyond which no mode fits
_EACH = 100  # rows of which all modes are found by themselves
_NEIGHBOURS = 6  # rows from whose poses a machine is solved whose modes are not known
MOST_ODD = 0.5  # share of the poses that may miss grossly: of more, something else is wrong


def in_their_modes(equations: Equations, evaluation: Evaluation) -> Evaluation:
    """The equations with rows that miss grossly solved in the mode that fits them, if one does."""
    better, poses = _better(equations, evaluation)
    if not len(better):
        return evaluation
    states = evaluation.begun.at_poses(better, poses)
    return equations.at(evaluation.theta, near=states)


def start_in_modes(
    equations: Equations,
    near: FloatArray | None = None,
    own: BoolArray | None = None,
    states: RowStates | None = None,
) -> Evaluation:
    """`Equations.start`, once more where rows in other modes had moved unknown frames."""
    start = equations.start(near, own, states)
    better = in_their_modes(equations.with_parameters(start.parameters), start)
    return start if better is start else equations.start(near, own, better.begun)


def in_other_modes(equations: Equations, evaluation: Evaluation) -> list[str]:
    """Say which rows fit another assembly mode than the one they were solved in."""
    better, _ = _better(equations, evaluation)
    rows = equations.table.rows[np.isin(np.concatenate(equations.table.pose_of), better)].tolist()
    if not rows:
        return []
    many = f"{len(rows)} rows fit" if len(rows) > 1 else "1 row fits"
    return [
        f"{many} another assembly mode than the one that the fit has for it"
        f" (rows {first_rows(rows, 10)}): the result is not to be trusted; state home nearer to the"
        " measured poses, or leave these rows out"
    ]


def _better(equations: Equations, evaluation: Evaluation) -> tuple[IntArray, FloatArray]:
    """Distinct rows of actuators (s,) that another mode fits better, and their poses there."""
    pose = evaluation.pose
    none = np.empty(0, dtype=np.intp), np.empty((0, 6))
    if as_parallel(evaluation.robot) is None:
        return none  # an arm has one pose
    prediction = equations.prediction
    misfit = worst_readings(equations, evaluation.residuals)
    solved, read = np.isfinite(misfit), ~np.isnan(misfit)
    if not solved.any():
        return none
    limit = max(_GROSS * float(np.median(misfit[solved])), _LEAST)
    gross = np.flatnonzero(read & ~(misfit <= limit))
    if not 0 < len(gross) <= MOST_ODD * np.count_nonzero(read):
        return none
    least, best = np.where(solved, misfit, np.inf), pose.copy()
    modes = _modes_of_rows(evaluation, equations.table.actuators, gross, misfit <= limit)
    for j in range(max(map(len, modes))):
        trial = pose.copy()
        for k, of_row in zip(gross, modes, strict=True):
            trial[k] = of_row[j] if j < len(of_row) else np.nan
        now = worst_readings(equations, prediction.seen(trial, evaluation.theta)[1])
        nearer = now < least
        least, best = np.where(nearer, now, least), np.where(nearer[:, None], trial, best)
    fits = (least < _HALF * np.where(solved, misfit, np.inf)) & (least <= _FITTING * limit)
    better = gross[fits[gross]]
    return better, best[better]


def _modes_of_rows(
    evaluation: Evaluation, actuators: FloatArray, rows: IntArray, sound: BoolArray
) -> list[FloatArray]:
    """Poses (j, 6) that the machine may have at the actuators of each of these rows.

    All modes of a row take a tenth of a second: of many rows they are found for some, and followed
    from the nearest of these to the others.
    """
    spread = np.maximum(np.ptp(actuators, axis=0), np.finfo(float).tiny)
    some = rows[np.linspace(0, len(rows) - 1, min(len(rows), _EACH)).astype(np.intp)]
    found: dict[int, FloatArray] = {}
    for k in [*some.tolist(), *np.setdiff1d(rows, some).tolist()]:
        robot = instance("robot", evaluation.machines.at(k), Robot)
        if len(found) < len(some):
            found[k] = _modes(robot, actuators, evaluation.pose, k, sound)
            continue
        apart = np.linalg.norm((actuators[some] - actuators[k]) / spread, axis=1)
        begin = found[int(some[first_largest(-apart, TIED)])]
        solved = robot.forward(np.tile(actuators[k], (len(begin), 1)), begin)
        found[k] = solved.pose[solved.ok]
    return [found[k] for k in rows.tolist()]


def _modes(
    robot: Robot, actuators: FloatArray, pose: FloatArray, k: int, sound: BoolArray
) -> FloatArray:
    """Poses (j, 6) that the machine may have at the actuators of row `k`."""
    found = robot.rigid.forward_all(actuators[k])
    if found.complete or not sound.any():
        return found.poses
    there = np.flatnonzero(sound)
    spread = np.maximum(np.ptp(actuators, axis=0), np.finfo(float).tiny)
    apart = np.linalg.norm((actuators[there] - actuators[k]) / spread, axis=1)
    near = there[largest_first(-apart, TIED)[:_NEIGHBOURS]]
    solved = robot.forward(np.tile(actuators[k], (len(near), 1)), pose[near])
    return np.vstack([found.poses, solved.pose[solved.ok]])
