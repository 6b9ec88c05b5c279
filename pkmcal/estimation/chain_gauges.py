"""Freedoms that no self-calibration of a machine of chains ends, by what they do to the platform.

The numbers of chains are errors of joints, of which a free set leaves out what others do as well. A
motion of the base is then no motion of certain numbers: it is what carries the platform along at
every pose as if the base had moved. A change of the platform's own frame moves it alike in its own
axes.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.parameters import Parameters
from pkmcal.kinematics.pose_steps import moved, step_units
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose
from pkmcal.statistics.linear_fit import column_basis

_POSES = 12
_WAY = 0.2  # rad, and of the characteristic length: how far they spread
_OUTSIDE = 1e-5  # share of an effect outside such motions that does not count


def frame_motions(
    parameters: Parameters, robot: Robot, unidentifiable: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unidentifiable combinations that move the base or the platform's frame.

    `unidentifiable` (n, d) has orthonormal columns, scaled.

    Returns
    -------
    combinations : ndarray (d, k)
        Orthonormal; of the columns.
    motions : ndarray (12, k)
        What they are, orthonormal: along and about x y z of the base, then of the platform.
    """
    pose, q = _around_home(robot)
    own = parameters.geometry
    beside = np.delete(unidentifiable, own, axis=0)  # frames, targets, drifts
    changes = np.zeros((len(robot.geometry.names), unidentifiable.shape[1]))
    free = robot.geometry.chain[:, parameters.places][:, parameters.number_of[own]]
    changes += free @ (parameters.scale[own, None] * unidentifiable[own])
    weigh = np.repeat([robot.length, 1.0], 3)[:, None]  # a turn as its arc
    effects = (weigh * (robot.error_twists(pose, q) @ changes)).reshape(-1, changes.shape[1])
    motions = (weigh * _motions(pose) / np.tile(np.repeat([1.0, robot.length], 3), 2)).reshape(
        -1, 12
    )
    if not (len(pose) and np.isfinite(effects).all()):
        return np.empty((changes.shape[1], 0)), np.empty((12, 0))
    span = column_basis(motions)
    outside = effects - span @ (span.T @ effects)
    others = np.vstack([outside, np.abs(effects).max() * beside])
    _, size, rows = np.linalg.svd(others, full_matrices=True)
    size = np.append(size, np.zeros(len(rows) - len(size)))
    found = rows[size <= _OUTSIDE * np.linalg.norm(effects, axis=0).max()].T
    return found, np.linalg.qr(np.linalg.pinv(motions) @ effects @ found).Q


def _around_home(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Poses (N, 6) around home, and their coordinates."""
    units = np.array([_WAY * (robot.length if u == "mm" else 1.0) for u in step_units(robot)])
    way = units * np.random.default_rng(0).uniform(-1, 1, (_POSES, len(units)))
    q = robot.inverse(moved(robot, np.tile(robot.home, (_POSES, 1)), way))
    pose = robot.forward(q).pose
    held = np.isfinite(pose).all(axis=1)
    return pose[held], q[held]


def _motions(pose: FloatArray) -> FloatArray:
    """Twists (ω, v of the origin), (N, 6, 12), as the base and as the platform's frame move."""
    T = from_pose(pose)
    R, p = T[:, :3, :3], pose[:, :3]
    found = np.zeros((len(pose), 6, 12))
    found[:, 3:, 0:3] = found[:, :3, 3:6] = np.eye(3)
    found[:, 3:, 3:6] = np.cross(np.eye(3)[None], p[:, None]).swapaxes(1, 2)
    found[:, 3:, 6:9] = found[:, :3, 9:12] = R
    return found
