"""What an instrument reads at given poses, as Python sees it of the compiled core."""

from __future__ import annotations

from pkmcal.arrays import FloatArray
from pkmcal.core.library import rows


def points(
    pose: FloatArray, target: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where poses (N, 6) carry a target (3,) or (N, 3).

    Returns the points (N, 3) and their derivatives by the platform's twist (ω, v) (N, 3, 6) and by
    the target (N, 3, 3).
    """
    point, by_twist, by_target = rows("points", pose, target, isa=isa)
    return point, by_twist, by_target


def seen_points(
    frame: FloatArray, point: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (N, 3) of the base in a frame (6,): the base's pose as an instrument has it.

    Returns them (N, 3) with their derivatives by the frame (N, 3, 6) and by the point (N, 3, 3).
    """
    seen, by_frame, by_point = rows("seen_points", frame, point, isa=isa)
    return seen, by_frame, by_point


def distances(
    pose: FloatArray, target: FloatArray, anchor: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """How far targets of the platform are from anchors of the base, at poses (N, 6).

    `target` and `anchor` are (3,) or (N, 3). Returns the distances (N,) and their derivatives by
    the platform's twist (ω, v) (N, 6), by the target (N, 3) and by the anchor (N, 3).
    """
    distance, by_twist, by_target, by_anchor = rows("distances", pose, target, anchor, isa=isa)
    return distance, by_twist, by_target, by_anchor
