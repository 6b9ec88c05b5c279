"""Actuators of machines whose chains cannot be taken one by one, by Gauss and Newton on `forward`.

With joints behind the platform a pose is that of the tool; where the platform is follows from all
actuators at once. A chain that shares a joint may need the others to hold it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array
from pkmcal.core import screws

_STEPS = 30
_SETTLED = 1e-12  # of the size, steps and what is missed
_REST = 1e-9  # of the size: a step after which what is missed is what the machine cannot reach
_TURN = 0.6  # rad, and of the length: no step is larger
_FAR = 2.0  # times the way foreseen: what goes further may be another mode
_SHARES = (1.0, 0.25, 0.05)  # of a step that leads nowhere


def coordinates(
    forward: Callable[[FloatArray, FloatArray | None], tuple[FloatArray, Int32Array]],
    jacobian: Callable[[FloatArray, FloatArray], FloatArray],
    pose: FloatArray,
    home: tuple[FloatArray, FloatArray],
    size: float,
    arms: FloatArray,
) -> FloatArray:
    """Poses (N, 6) to coordinates (N, n) from home; NaN where none is found.

    Where the machine cannot take a pose, the coordinates that come nearest to it.

    Parameters
    ----------
    forward : callable
        Coordinates (N, n) and poses (N, 6) near, or None for home, to poses and status.
    jacobian : callable
        Poses and coordinates to twists (N, 6, n) by the actuators.
    pose : ndarray (N, 6)
        Where the tool should be.
    home : tuple of ndarray (6,), (n,)
        A pose and its coordinates.
    size : float
        Of the machine, mm.
    arms : ndarray (n,)
        To which way, mm, a unit of each actuator compares; the last is the characteristic length.
    """
    length = float(arms[-1])
    at, q = (np.tile(each, (len(pose), 1)) for each in home)
    weigh = np.repeat([length, 1.0], 3)[:, None]
    goal = screws.frames(np.nan_to_num(pose))
    active: BoolArray = np.asarray(np.isfinite(pose).all(axis=1))
    good = np.zeros(len(pose), dtype=bool)
    for _ in range(_STEPS):
        rows = np.flatnonzero(active)
        if not rows.size:
            break
        missed = _missed(at[rows], goal[rows])[..., None] * weigh
        slopes = jacobian(at[rows], q[rows]) * weigh / arms[:-1]
        known = np.isfinite(slopes).all(axis=(1, 2))
        active[rows[~known]] = False
        rows, missed, slopes = rows[known], missed[known], slopes[known]
        step = (np.linalg.pinv(slopes, rcond=1e-9) @ missed)[..., 0]
        longest = np.abs(step).max(axis=1, initial=0.0)
        small = np.abs(missed).max(axis=(1, 2), initial=0.0) <= _SETTLED * size
        done = (longest <= _SETTLED * size) | (small & (longest <= _REST * size))
        good[rows[done]] = True
        active[rows[done]] = False
        rows, step, longest, slopes = rows[~done], step[~done], longest[~done], slopes[~done]
        step *= np.minimum(1.0, _TURN * length / np.maximum(longest, 1e-300))[:, None]
        for share in _SHARES:
            there = np.ascontiguousarray(q[rows] + share * step / arms[:-1])
            way = share * np.linalg.norm(slopes @ step[..., None], axis=1)[:, 0]
            found, ok = _followed(forward, there, np.ascontiguousarray(at[rows]), way, weigh)
            q[rows[ok]], at[rows[ok]] = there[ok], found[ok]
            rows, step, slopes = rows[~ok], step[~ok], slopes[~ok]
        active[rows] = False
    q[~good] = np.nan
    return q


def _followed(
    forward: Callable[[FloatArray, FloatArray | None], tuple[FloatArray, Int32Array]],
    q: FloatArray,
    at: FloatArray,
    way: FloatArray,
    weigh: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Poses of coordinates (N, n) near those (N, 6) from where they should go a way (N,), mm.

    From home, which takes a fiftieth of the time; where that leads elsewhere, from the pose itself.
    """
    found, status = forward(q, None)
    apart = np.linalg.norm(_missed(at, screws.frames(np.nan_to_num(found))) * weigh.T, axis=1)
    lost = np.flatnonzero((status != 0) | (apart > _FAR * way))
    if lost.size:
        found[lost], status[lost] = forward(q[lost], np.ascontiguousarray(at[lost]))
    return found, np.asarray(status == 0)


def _missed(at: FloatArray, goal: FloatArray) -> FloatArray:
    """The twist (ω, v) from poses (N, 6) to frames (N, 4, 4): turning, then way of the origin."""
    here = screws.frames(at)
    turn = np.zeros_like(goal)
    turn[:, :3, :3] = goal[:, :3, :3] @ here[:, :3, :3].swapaxes(1, 2)
    turn[:, 3, 3] = 1.0
    log = screws.log(np.ascontiguousarray(turn.reshape(-1, 16)))
    return np.hstack([log[:, :3], goal[:, :3, 3] - here[:, :3, 3]])
