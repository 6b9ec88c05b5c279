"""Motions with their derivatives by time: the homogeneous matrix, its first and its second.

A motion is (..., 3, 4, 4). Products with constant matrices, and points carried along, are linear in
each of the three, so frames need no formula of their own.
"""

from __future__ import annotations

import numpy as np

from pkmcal import screw
from pkmcal.arrays import FloatArray


def cross_matrix(vector: FloatArray) -> FloatArray:
    """[v] of vectors (..., 3): the matrix of v × (.)."""
    out = np.zeros((*vector.shape[:-1], 3, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = np.moveaxis(vector, -1, 0)
    return out - np.swapaxes(out, -1, -2)


def straight(
    start: FloatArray, end: FloatArray, s: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """Interpolate between two poses: origin on a line, orientation about one axis (SLERP).

    Parameters
    ----------
    start, end : ndarray (6,)
        x y z in mm, α β γ in rad.
    s : three ndarray (N,)
        The share of the way, 0 to 1, its velocity and its acceleration.

    Returns
    -------
    ndarray (N, 3, 4, 4)
    """
    first, last = screw.from_pose(np.stack([start, end]))
    between = np.eye(4)
    between[:3, :3] = first[:3, :3].T @ last[:3, :3]
    turn = screw.log(between)[:3]  # φ of R = R0 exp(s [φ])
    way = end[:3] - start[:3]
    share, speed, bend = s
    spin = cross_matrix(turn)
    out = np.zeros((len(share), 3, 4, 4))
    turned = screw.exp(np.concatenate([turn, np.zeros(3)]), share)[:, :3, :3]
    R = first[:3, :3] @ turned
    out[:, 0, :3, :3] = R
    out[:, 0, :3, 3] = start[:3] + share[:, None] * way
    out[:, 0, 3, 3] = 1.0
    out[:, 1, :3, :3] = speed[:, None, None] * (R @ spin)
    out[:, 1, :3, 3] = speed[:, None] * way
    out[:, 2, :3, :3] = bend[:, None, None] * (R @ spin) + speed[:, None, None] ** 2 * (
        R @ spin @ spin
    )
    out[:, 2, :3, 3] = bend[:, None] * way
    return out


def written(pose: FloatArray, speed: FloatArray, bend: FloatArray) -> FloatArray:
    """Return x y z α β γ (N, 6) with speeds and accelerations; regular at β = ±90° too.

    Returns
    -------
    ndarray (N, 3, 4, 4)
    """
    out = np.zeros((len(pose), 3, 4, 4))
    out[:, 0, 3, 3] = 1.0
    out[:, :, :3, 3] = np.stack([pose[:, :3], speed[:, :3], bend[:, :3]], axis=1)
    R, R1, R2 = np.tile(np.eye(3), (len(pose), 1, 1)), np.zeros((3, 3)), np.zeros((3, 3))
    for k in (2, 1, 0):  # R = Rz(γ) Ry(β) Rx(α)
        axis = np.eye(3)[k]
        spin = cross_matrix(axis)
        angle, rate, change = (each[:, 3 + k, None, None] for each in (pose, speed, bend))
        turn = screw.exp(np.append(axis, np.zeros(3)), angle[:, 0, 0])[:, :3, :3]
        turn1, turn2 = rate * spin @ turn, (change * spin + rate**2 * spin @ spin) @ turn
        R, R1, R2 = R @ turn, R1 @ turn + R @ turn1, R2 @ turn + 2 * R1 @ turn1 + R @ turn2
    out[:, 0, :3, :3], out[:, 1, :3, :3], out[:, 2, :3, :3] = R, R1, R2
    return out


def twists(motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Twist and its rate, (N, 6) each: (ω, v) with v of the platform's origin, rad/s and mm/s."""
    R, R1, R2 = (motion[:, k, :3, :3] for k in range(3))
    R_inverse = np.swapaxes(R, -1, -2)
    spin, spin_rate = R1 @ R_inverse, R2 @ R_inverse + R1 @ np.swapaxes(R1, -1, -2)
    found = []
    for order, matrix in ((1, spin), (2, spin_rate)):
        omega = np.stack([matrix[:, 2, 1], matrix[:, 0, 2], matrix[:, 1, 0]], axis=1)
        found.append(np.concatenate([omega, motion[:, order, :3, 3]], axis=1))
    return found[0], found[1]
