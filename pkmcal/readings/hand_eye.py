"""Hand-eye start: a tool on the platform, and the instrument's frame with it.

What was measured is M = F P T: the frame F, the platform's pose P, the tool T. The rotations follow
from a singular value decomposition (M. Shah, Solving the robot-world/hand-eye calibration problem
using the Kronecker product, Journal of Mechanisms and Robotics 5 (2013) 031007) and a few steps of
Newton's, the places linearly. Where poses hardly turn the frame's turn is that of their places: of
both starts the one that misfits less is taken. What poses that turn too little do not determine
stays where it is: a tool that is not turned against the platform.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import screws
from pkmcal.readings import orientation
from pkmcal.readings.alignment import (
    TILT,
    centred,
    frame_of,
    inverse_above,
    nearest_rotations,
)

_ALIKE = 1e-4  # share by which singular values differ of turnings that poses do not tell apart
_ROUNDS = 30  # steps at most, by which frame and tool are turned
_SETTLED = 1e-9  # rad; a smaller step ends the search
_LEAST = 1e-9  # share by which no turn is preferred to one about a line of places


def of_tool(measured: FloatArray, pose: FloatArray) -> FloatArray:
    """Pose (6,) of a tool on the platform, by poses (N, 6) of both in one frame."""
    m, p, at, origin = _motions(measured, pose)
    turn = nearest_rotations(_mean(p.transpose(0, 2, 1) @ m))
    place = _mean((p.transpose(0, 2, 1) @ (at - origin)[:, :, None])[:, :, 0])
    return frame_of(turn, place)


def of_frame_and_tool(measured: FloatArray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses (6,) of the base in the instrument's frame and of a tool on the platform.

    Parameters
    ----------
    measured : ndarray (N, 6)
        Of the tool, in the instrument's frame.
    pose : ndarray (N, 6)
        Of the platform, in the base frame.
    """
    m, p, at, origin = _motions(measured, pose)
    # M Tᵀ Pᵀ = F, so that Σ P ⊗ M takes Tᵀ to N times F
    both = np.einsum("nij,nkl->ikjl", p, m).reshape(9, 9)
    _, singular, right = np.linalg.svd(both)
    alike = right[singular > (1.0 - _ALIKE) * singular[0]]
    unturned = alike.T @ (alike @ np.eye(3).ravel())  # what they leave of no turning
    kept = len(alike) > 1 and np.linalg.norm(unturned) > _ALIKE
    back = (unturned if kept else right[0]).reshape(3, 3).T  # Tᵀ but for its size and sign
    back = nearest_rotations(back if np.linalg.det(back) > 0 else -back)
    turn, back = turned_alike(m, p, back)
    by_places = _turn_of_places(at, origin)
    starts = [
        (turn, back),
        (by_places, nearest_rotations(_mean(m.transpose(0, 2, 1) @ by_places @ p))),
    ]
    laid = [_laid(m, p, at, origin, *each) for each in starts]
    _, frame, tool = min(laid, key=lambda each: each[0])
    return frame, tool


def turned_alike(m: FloatArray, p: FloatArray, back: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotations F and Tᵀ (3, 3) at which M Tᵀ and F P differ least; `back` is Tᵀ to begin with.

    They differ least where Σ tr(Fᵀ M Tᵀ Pᵀ) is largest. Newton's steps lead there; where one makes
    the sum smaller, the best F for this Tᵀ and then the best Tᵀ for that F, which never do.
    """
    p_back = p.transpose(0, 2, 1)

    def best_of_each(back: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn = nearest_rotations(_mean(m @ back @ p_back))
        return turn, nearest_rotations(_mean(m.transpose(0, 2, 1) @ turn @ p))

    turn, back = best_of_each(back)
    left, right = turn.T @ m, back @ p_back
    for _ in range(_ROUNDS):
        step = _newton_step(left, right)
        first, second = screws.turnings(step.reshape(2, 3))
        before, last = float(np.einsum("nij,nji->", left, right)), back
        turn, back = turn @ first, second @ last
        left, right = turn.T @ m, back @ p_back
        if float(np.einsum("nij,nji->", left, right)) < before:
            turn, back = best_of_each(last)
            left, right, step = turn.T @ m, back @ p_back, back - last
        if np.abs(step).max() < _SETTLED:
            break
    return turn, back


def _newton_step(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return by what to turn F and Tᵀ so that Σ tr(L R) grows most, a and b in one (6,).

    L = Fᵀ M and R = Tᵀ Pᵀ, (N, 3, 3); behind the step L is exp(-a) L and R is exp(b) R. What poses
    do not tell is not turned.
    """
    both = left @ right
    sums = np.stack([both.sum(axis=0), (right @ left).sum(axis=0)])
    of_a, of_b = 2.0 * screws.skew_vectors(sums)
    bent = np.zeros((6, 6))  # less the second derivatives
    for part, each in ((slice(3), sums[0]), (slice(3, 6), sums[1])):
        bent[part, part] = np.trace(each) * np.eye(3) - 0.5 * (each + each.T)
    traces = np.trace(both, axis1=1, axis2=2)[:, None, None]
    bent[:3, 3:] = -((traces * np.eye(3) - both) @ left).sum(axis=0)
    bent[3:, :3] = bent[:3, 3:].T
    size, axes = np.linalg.eigh(bent)
    told = np.abs(size) > _ALIKE * len(left)
    step: FloatArray = axes[:, told] @ (
        axes[:, told].T @ np.concatenate([of_a, -of_b]) / np.abs(size[told])
    )
    return step


def _turn_of_places(at: FloatArray, origin: FloatArray) -> FloatArray:
    """The turn (3, 3) of places (N, 3) to others; as little as they leave open."""
    both = centred(at).T @ centred(origin)
    turn: FloatArray = nearest_rotations(both + _LEAST * float(np.linalg.norm(both)) * np.eye(3))
    return turn


def _laid(
    m: FloatArray,
    p: FloatArray,
    at: FloatArray,
    origin: FloatArray,
    turn: FloatArray,
    back: FloatArray,
) -> tuple[float, FloatArray, FloatArray]:
    """Squared misfit of a frame and a tool so turned, and both; turnings count as arcs."""
    lever = centred(p).reshape(-1, 3)
    off = at @ turn - origin
    place = inverse_above(lever, TILT * np.sqrt(len(p))) @ centred(off).ravel()
    where = turn @ _mean(off - p @ place)
    places = float((centred(off - p @ place) ** 2).sum())
    size = float((centred(origin) ** 2).sum()) / len(p)
    turned = float(((m - turn @ p @ back.T) ** 2).sum())
    return places + size * turned, frame_of(turn, where), frame_of(back.T, place)


def _motions(
    measured: FloatArray, pose: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rotations (N, 3, 3) of both and their places (N, 3), of rows that have both."""
    known = np.isfinite(measured).all(axis=1) & np.isfinite(pose).all(axis=1)
    turned, own = (orientation.rotations(each[known, 3:]) for each in (measured, pose))
    return turned, own, measured[known, :3], pose[known, :3]


def _mean(rows: FloatArray) -> FloatArray:
    mean: FloatArray = rows.mean(axis=0)
    return mean
