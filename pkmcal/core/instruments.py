"""What an instrument reads at given poses, as Python sees it of the compiled core."""

from __future__ import annotations

import numpy as np

from pkmcal._core import lib
from pkmcal.arrays import FloatArray
from pkmcal.core.library import ISA, pointer


def points(
    pose: FloatArray, target: FloatArray, isa: int = ISA
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where poses (N, 6) carry a target (3,) or (N, 3).

    Returns the points (N, 3) and their derivatives by the platform's twist (ω, v) (N, 3, 6) and by
    the target (N, 3, 3).
    """
    n = len(pose)
    point, by_twist, by_target = np.empty((n, 3)), np.empty((n, 3, 6)), np.empty((n, 3, 3))
    if n:
        lib.pkm_points(
            isa,
            n,
            pointer(pose),
            pointer(target),
            3 if target.ndim == 2 else 0,
            pointer(point),
            pointer(by_twist),
            pointer(by_target),
        )
    return point, by_twist, by_target


def seen_points(
    frame: FloatArray, point: FloatArray, isa: int = ISA
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (N, 3) of the base in a frame (6,): the base's pose as an instrument has it.

    Returns them (N, 3) with their derivatives by the frame (N, 3, 6) and by the point (N, 3, 3).
    """
    n = len(point)
    seen, by_frame, by_point = np.empty((n, 3)), np.empty((n, 3, 6)), np.empty((n, 3, 3))
    if n:
        lib.pkm_seen_points(
            isa,
            n,
            pointer(frame),
            pointer(point),
            pointer(seen),
            pointer(by_frame),
            pointer(by_point),
        )
    return seen, by_frame, by_point


def seen_pose_rates(frame: FloatArray, seen: FloatArray, isa: int = ISA) -> FloatArray:
    """Rates (N, 6, 6) of poses as seen (N, 6) by the twist (ω, v) of the platform in the base."""
    out = np.empty((len(seen), 6, 6))
    if len(seen):
        lib.pkm_seen_poses(isa, len(seen), pointer(frame), pointer(seen), pointer(out))
    return out


def distances(
    pose: FloatArray, target: FloatArray, anchor: FloatArray, isa: int = ISA
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """How far targets of the platform are from anchors of the base, at poses (N, 6).

    `target` and `anchor` are (3,) or (N, 3). Returns the distances (N,) and their derivatives by
    the platform's twist (ω, v) (N, 6), by the target (N, 3) and by the anchor (N, 3).
    """
    n = len(pose)
    distance, by_twist = np.empty(n), np.empty((n, 6))
    by_target, by_anchor = np.empty((n, 3)), np.empty((n, 3))
    if n:
        lib.pkm_distances(
            isa,
            n,
            pointer(pose),
            pointer(target),
            3 if target.ndim == 2 else 0,
            pointer(anchor),
            3 if anchor.ndim == 2 else 0,
            pointer(distance),
            pointer(by_twist),
            pointer(by_target),
            pointer(by_anchor),
        )
    return distance, by_twist, by_target, by_anchor
