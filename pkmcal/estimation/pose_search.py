"""The search for poses with unknowns that fit best, each by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.core.elimination import Fit, PoseEquations
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines

_STEPS = 50  # of finding the best poses
_STRAIGHT = 12  # of these, as if equations were straight; then as they bend
_NEAR = 1e-4  # share of the way on which equations are as large as what is left, to see them bend
_SETTLED = 1e-12  # share of a pose's cost that a further step would gain
_CLOSE = 1e-6  # the same where steps have become too short to gain anything
_ROUNDING = 1e-15  # of the largest number that equations are made of
_RIDGE = 1e-13  # of a normal matrix, for unknowns that no equation has

Whitened = tuple[FloatArray, FloatArray]  # whitened (E,), and their derivative by unknowns (E, u)
System = tuple[FloatArray, FloatArray, FloatArray]  # as `Whitened`, and the reduced equations (M,)
Equate = Callable[[RowStates], Whitened]


def best(
    equations: PoseEquations, size: float, machines: Machines, states: RowStates, system: Equate
) -> tuple[RowStates, System]:
    """The states of least squares, each pose by itself.

    Levenberg's and Marquardt's steps for all poses at once, each with a damping of its own. Where
    a reading is far off, equations bend by more than Gauss's and Newton's matrix, whose steps then
    are too long or, damped, too short: poses that have not settled by it go on with Newton's.

    The search begins at `states`; `system` gives the whitened equations at any, and `size` is the
    largest number that they are made of. Poses that no step improves, though their gradient is not
    zero, have status 1.
    """
    poses, pose_of = len(equations.left_of), equations.pose_of
    rounding = _ROUNDING * size

    def fitted(there: Whitened, damping: FloatArray, least: float = _SETTLED) -> Fit:
        return equations.fit(*there, damping, least, rounding)

    damping = np.zeros(poses)
    moving = np.ones(poses, dtype=bool)
    there = system(states)
    fit = fitted(there, damping)
    for k in range(_STEPS):
        if k >= _STRAIGHT:

            def pulled(by: FloatArray, at: RowStates = states) -> FloatArray:
                return equations.normals(*system(machines.moved(at, by)))[1]

            damping[:] *= k > _STRAIGHT
            fit = _newton(equations, rounding, fit, there, damping, moving, pulled)
        moving = fit.gain > 0.0
        if not moving.any():
            break
        trial = machines.moved(states, fit.step)
        beyond = system(trial)
        after = fitted(beyond, damping)
        worse = moving & ~(after.cost < fit.cost)
        if worse.any():
            states = trial.chosen(~worse, states)
            stay = worse[pose_of]
            there = (
                np.where(stay, there[0], beyond[0]),
                np.where(stay[:, None], there[1], beyond[1]),
            )
        else:
            states, there, fit = trial, beyond, after
        if worse.any() or damping.any():
            eased = 0.1 * damping * (damping > 1e-5)
            damping = np.where(worse, np.maximum(10.0 * damping, 1e-3), eased)
            fit = fitted(there, damping)
            if (damping[moving] > 1e8).all():
                break
    if moving.any() or damping.any():  # short of steps, or they have become too short
        fit = fitted(there, np.zeros(poses), _CLOSE)
    unsolved = (fit.gain != 0.0) & (states.status == 0)
    if unsolved.any():
        status = np.where(unsolved, 1, states.status).astype(np.int32)
        states = replace(states, status=status)
    return states, (*there, fit.left)


def unmoved(equations: PoseEquations, size: float, there: Whitened) -> System:
    """The equations where poses are not moved; `size` as for `best`."""
    damping = np.zeros(len(equations.left_of))
    return *there, equations.fit(*there, damping, _SETTLED, _ROUNDING * size).left


def _newton(
    equations: PoseEquations,
    rounding: float,
    straight: Fit,
    there: Whitened,
    damping: FloatArray,
    moving: BoolArray,
    pulled: Callable[[FloatArray], FloatArray],
) -> Fit:
    """Newton's steps of poses that move, equations bent as `_curved` finds them by `pulled`."""
    matrix, pull, cost = equations.normals(*there)
    rounded = rounding * np.sqrt(np.einsum("kii->k", matrix))
    matrix = _curved(matrix, pull, np.where(moving, cost, 0.0), pulled)
    size = np.einsum("kii->ki", matrix)
    ridge = _RIDGE * size.sum(axis=1) + np.finfo(np.float64).tiny
    unit = np.eye(equations.unknowns)
    damped = matrix + unit * (damping[:, None] * size + ridge[:, None])[:, None]
    known = np.isfinite(damped).all(axis=(1, 2)) & np.isfinite(pull).all(axis=1)
    damped[~known] = unit
    step = -np.linalg.solve(damped, pull[:, :, None])
    gain = -(step[:, :, 0] * (2.0 * pull + (matrix @ step)[:, :, 0])).sum(axis=1)
    gain[gain <= _SETTLED * cost + rounded * (rounded + np.sqrt(cost))] = 0.0
    gain[~known] = np.nan
    return straight._replace(step=np.where(gain[:, None] > 0.0, step[:, :, 0], 0.0), gain=gain)


def _curved(
    matrix: FloatArray,
    pull: FloatArray,
    cost: FloatArray,
    pulled: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """Second derivatives (K, u, u) of half the squares, of poses with a cost (K,); else JᵀJ.

    By differences of `pull` (K, u), which `pulled` tells at steps (K, u). Directions in which the
    squares are curved downwards count as if they were curved upwards: steps go down.
    """
    size = np.einsum("kii->ki", matrix)
    way = np.zeros_like(size)
    np.divide(cost[:, None], size, out=way, where=size > 0.0)
    way = _NEAR * np.sqrt(way)
    bent = np.empty_like(matrix)
    for i in range(matrix.shape[1]):
        by = np.zeros_like(way)
        by[:, i] = way[:, i]
        bent[:, i] = (pulled(by) - pull) / np.where(way[:, i], way[:, i], 1.0)[:, None]
    mine = (way > 0.0).all(axis=1) & np.isfinite(bent).all(axis=(1, 2))
    curved, axes = np.linalg.eigh(0.5 * (bent + bent.transpose(0, 2, 1))[mine])
    found: FloatArray = matrix.copy()
    found[mine] = (axes * np.abs(curved)[:, None]) @ axes.transpose(0, 2, 1)
    return found
