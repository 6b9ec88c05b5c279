"""Motions without a closed form: actuators by the platform's, and the platform's by theirs.

Of machines of chains, and of those with more closures than free coordinates, whose pose that misses
them least moves with their second derivatives.

By central differences of fourth order along a path with the velocity and acceleration asked for.
The kinematics they are taken of is exact to 1e-13 of the size, and the path goes 1e-3 of it to each
side: velocities are good to 1e-10 of their size and accelerations to 1e-7.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.arrays import FloatArray, wrapped
from pkmcal.core import screws

WAY = 1e-3  # of the size that the path goes to each side
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0


def actuator_rates(
    inverse: Callable[[FloatArray], FloatArray],
    turns: FloatArray,
    size: float,
    motion: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Velocity and acceleration of the actuators, (N, n) each.

    Parameters
    ----------
    inverse : callable
        Poses (N, 6) to coordinates (N, n).
    turns : ndarray (n,)
        How far an actuator goes in a whole turn.
    size : float
        Of the machine, mm.
    motion : ndarray (N, 3, 4, 4)
        The platform's matrix and its first and second derivative by time.
    """
    R, velocity, acceleration = motion[:, 0, :3, :3], motion[:, 1], motion[:, 2]
    spin = velocity[:, :3, :3] @ R.swapaxes(1, 2)
    bend = acceleration[:, :3, :3] @ R.swapaxes(1, 2) - spin @ spin
    w, dw = _vee(spin), _vee(bend)
    v, dv = velocity[:, :3, 3], acceleration[:, :3, 3]
    speed = np.linalg.norm(w, axis=1) + np.linalg.norm(v, axis=1) / size
    bent = np.sqrt(np.linalg.norm(dw, axis=1) + np.linalg.norm(dv, axis=1) / size)
    step = WAY / np.maximum(np.maximum(speed, bent), 1e-12)
    found = []
    for k in range(-2, 3):
        t = (k * step)[:, None]
        turn = np.hstack([t * w + t * t / 2 * dw, np.zeros((len(R), 3))])
        frame = screws.exp(np.ascontiguousarray(turn)).reshape(-1, 4, 4)
        frame[:, :3, :3] = frame[:, :3, :3] @ R
        frame[:, :3, 3] = motion[:, 0, :3, 3] + t * v + t * t / 2 * dv
        found.append(inverse(screws.pose(np.ascontiguousarray(frame.reshape(-1, 16)))))
    finite = np.isfinite(turns)
    for q in found:  # at the turn of the middle one
        q[:, finite] -= turns[finite] * np.rint((q - found[2])[:, finite] / turns[finite])
    return _differences(np.array(found), step)


def platform_motion(
    forward: Callable[[FloatArray], FloatArray],
    pose: FloatArray,
    q: FloatArray,
    q1: FloatArray,
    q2: FloatArray,
    scale: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The platform's matrix with two derivatives (N, 3, 4, 4), and those of its pose (N, 6) each.

    Parameters
    ----------
    forward : callable
        Coordinates (N, n) to poses (N, 6) near those given.
    pose, q, q1, q2 : ndarray
        Where it is, and the actuators with their velocity and acceleration.
    scale : ndarray (n,)
        To which part of the size a unit of each actuator compares.
    """
    changes, step = _path(q1, q2, scale)
    poses = [forward(np.ascontiguousarray(q + change)) for change in changes]
    still = screws.frames(pose)
    turned = []
    for each in poses:
        between = screws.frames(each) @ np.linalg.inv(still)
        log = screws.log(np.ascontiguousarray(between.reshape(-1, 16)))
        turned.append(np.hstack([log[:, :3], each[:, :3]]))
    twist, rate = _differences(np.array(turned), step)
    out = np.zeros((len(pose), 3, 4, 4))
    out[:, 0] = still
    spin = _skew(twist[:, :3])
    out[:, 1, :3, :3] = spin @ still[:, :3, :3]
    out[:, 2, :3, :3] = (_skew(rate[:, :3]) + spin @ spin) @ still[:, :3, :3]
    out[:, 1, :3, 3], out[:, 2, :3, 3] = twist[:, 3:], rate[:, 3:]
    for each in poses:
        each[:, 3:] = pose[:, 3:] + wrapped(each[:, 3:] - pose[:, 3:])
    return out, *_differences(np.array(poses), step)


def along_path(
    function: Callable[[FloatArray], FloatArray],
    first: FloatArray,
    second: FloatArray,
    scale: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """First and second derivative by time, (N, k), of a function of numbers that change.

    Parameters
    ----------
    function : callable
        Changes of the numbers (N, n) to values (N, k).
    first, second : ndarray (N, n)
        Their velocity and acceleration.
    scale : ndarray (n,)
        To which part of the size a unit of each compares.
    """
    changes, step = _path(first, second, scale)
    return _differences(np.array([function(change) for change in changes]), step)


def _path(
    first: FloatArray, second: FloatArray, scale: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Changes (N, n) at five times around now, and the time from one to the next, (N,)."""
    speed = np.abs(first * scale).max(axis=1, initial=0.0)
    bent = np.sqrt(np.abs(second * scale).max(axis=1, initial=0.0))
    step = WAY / np.maximum(np.maximum(speed, bent), 1e-12)
    times = [(k * step)[:, None] for k in range(-2, 3)]
    return [t * first + t * t / 2 * second for t in times], step


def _differences(values: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivative of values (5, N, k) that are `step` (N,) apart."""
    first = np.einsum("s,snk->nk", _FIRST, values) / step[:, None]
    second = np.einsum("s,snk->nk", _SECOND, values) / step[:, None] ** 2
    return first, second


def _vee(matrix: FloatArray) -> FloatArray:
    found = [matrix[:, 2, 1], matrix[:, 0, 2], matrix[:, 1, 0]]
    return np.stack(found, axis=1)


def _skew(w: FloatArray) -> FloatArray:
    out = np.zeros((len(w), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = w.T
    skew: FloatArray = out - out.swapaxes(1, 2)
    return skew
