"""Poses of machines with more actuators than ways to move that ended in a false minimum.

No pose meets all closures of such a machine, and what they miss may be least at several poses: a
platform between eight cables that is turned the other way. Where a search ends depends on where it
begins. A row that ended in a false minimum misses its closures far more than the others do, as if
one of its actuators read wrong: it is looked for again from turned platforms before anything is
said of its readings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.library import POSE
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.mode_slips import MOST_ODD
from pkmcal.estimation.solving import solve
from pkmcal.kinematics.calibratable import as_parallel
from pkmcal.kinematics.pose_steps import surplus
from pkmcal.kinematics.robot import Robot

_ANGLES = POSE[3:]
_ODD = 3.0  # times the median mean square from which a pose is looked for again
_SOUND = 9.0  # times it, below which a minimum is taken for the true one
TOLD_APART = 2.0 * np.log(100.0)  # of squares in units of their variance: odds of 100 to 1
_TURN = 0.6  # rad, either way about each axis that the platform turns about
_ROUNDS = 5  # of fitting anew from poses that were found


def solved_in_least_minima(estimator: Estimator) -> Estimate:
    """Solve, and again with poses that turn out to have ended in a false minimum."""
    estimate = solve(estimator)
    for _ in range(_ROUNDS):
        noise = estimate.state.noise
        better = in_least_minima(estimator.equations.fewest, estimate.evaluation, noise)
        if better is estimate.evaluation:
            break
        estimate = solve(estimator, better)
    return estimate


def in_least_minima(
    equations: Equations, evaluation: Evaluation, noise: FloatArray | None = None
) -> Evaluation:
    """Evaluate with odd poses where they miss less, if there is such a minimum.

    `noise` (G,) is that of `Equations.at`. The evaluation itself where nothing is found, where
    poses have no unknowns, and of a machine without more actuators than it needs: the modes that
    these leave are looked for by `mode_slips`.
    """
    robot = as_parallel(equations.parameters.robot)
    if equations.system is None or robot is None or not surplus(robot):
        return evaluation
    factors = np.ones(len(equations.blocks.unstated)) if noise is None else noise
    freedom = _freedom(equations)
    squares = squares_of_poses(equations, evaluation, factors)
    odd, usual = _odd(squares, freedom)
    found = evaluation.onward.pose.copy()
    lost = odd
    for begun in _elsewhere(robot, evaluation.pose):
        if not len(lost):
            break
        states = evaluation.onward.at_poses(lost, begun[lost])
        there = equations.at(evaluation.theta, noise, states)
        now = squares_of_poses(equations, there, factors)[lost]
        lower = now < squares[lost] - TOLD_APART * usual
        better = lost[lower & (now <= _SOUND * usual * freedom[lost])]
        found[better] = there.pose[better]
        lost = np.setdiff1d(lost, better)
    better = np.setdiff1d(odd, lost)
    if not len(better):
        return evaluation
    states = evaluation.onward.at_poses(better, found[better])
    return equations.at(evaluation.theta, noise, states)


def squares_of_poses(equations: Equations, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
    """Squared, whitened equations of each pose (K,); inf of poses that are not reached."""
    blocks, found = equations.blocks, np.zeros(len(equations.table.actuators))
    squares = blocks.squares(equations.residual(evaluation, noise))
    np.add.at(found, blocks.pose_of_block, squares)
    return np.where((evaluation.status == 0) & np.isfinite(found), found, np.inf)


def _freedom(equations: Equations) -> IntArray:
    """Equations of each pose (K,) beyond those that determine it."""
    blocks = equations.blocks
    count = np.bincount(blocks.pose_of_block, blocks.stands_for, len(equations.table.actuators))
    return count.astype(np.intp)


def _odd(squares: FloatArray, freedom: IntArray) -> tuple[IntArray, float]:
    """Poses that miss far more than most do, or are not reached; and the usual mean square."""
    seen = np.isfinite(squares) & (freedom > 0)
    if not seen.any():
        return np.empty(0, dtype=np.intp), np.inf
    usual = float(np.median(squares[seen] / freedom[seen]))
    odd = np.flatnonzero(squares > _ODD * usual * freedom)
    return (odd if len(odd) <= MOST_ODD * len(squares) else odd[:0]), usual


def _elsewhere(robot: Robot, pose: FloatArray) -> Iterator[FloatArray]:
    """Poses (K, 6) to look from: where they were found, turned; then home, and that turned."""
    axes = [k for k, name in enumerate(_ANGLES) if name in robot.coordinates]
    turns = [sign * _TURN * np.eye(3)[k] for k in axes for sign in (1.0, -1.0)]
    home = np.broadcast_to(robot.home, pose.shape)
    for place in (np.where(np.isfinite(pose), pose, home), home):
        if place is home:
            yield home
        for turn in turns:
            turned = robot.frames.inward(place).copy()
            turned[:, 3:] = robot.own_home[3:] + turn
            yield robot.frames.outward(turned)
