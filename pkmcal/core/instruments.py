"""Readings of instruments at given poses, by the compiled core."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import rows

_NONE = np.zeros(1)


def points(
    pose: FloatArray, target: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the positions of a target (3,) or (N, 3) at poses (N, 6).

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
    pose: FloatArray,
    target: FloatArray,
    anchor: FloatArray,
    zero: FloatArray = _NONE,
    isa: int | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return distances of platform targets from base anchors, less zeros, at poses (N, 6).

    `target` and `anchor` are (3,) or (N, 3), `zero` is (1,) or (N, 1). Returns the distances (N,)
    and their derivatives by the platform's twist (ω, v) (N, 6), by the target (N, 3) and by the
    anchor (N, 3).
    """
    distance, *by = rows("distances", pose, target, anchor, zero, isa=isa)
    by_twist, by_target, by_anchor = by
    return distance, by_twist, by_target, by_anchor


def between(
    pose: FloatArray, other: FloatArray, target: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return distances of targets (3,) or (N, 3) at poses (N, 6) from where they are at others.

    Returns the distances (N,) and their derivatives by both twists (ω, v) (N, 6) and by the target
    (N, 3).
    """
    distance, by_twist, by_other, by_target = rows("between", pose, other, target, isa=isa)
    return distance, by_twist, by_other, by_target


def touched_points(
    artefact: FloatArray, point: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (N, 3) of the base in the axes of artefacts, which are poses (6,) or (N, 6) there.

    Returns them (N, 3) with their derivatives by the artefact (N, 3, 6) and by the point (N, 3, 3).
    """
    inside, by_artefact, by_point = rows("touched_points", artefact, point, isa=isa)
    return inside, by_artefact, by_point


def tilts(
    pose: FloatArray, mounting: FloatArray, up: FloatArray, isa: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return how far x and y of sensors point up, at poses (N, 6) of the platform.

    `mounting` are α β γ of the sensor on the platform, `up` the vertical in base axes, (3,) or
    (N, 3). Returns the angles (N, 2) and their derivatives by the turning of the platform, by the
    mounting and by the vertical, (N, 2, 3) each.
    """
    tilt, by_turn, by_mounting, by_up = rows("tilts", pose, mounting, up, isa=isa)
    return tilt, by_turn, by_mounting, by_up


def pixels(
    board: FloatArray,
    corner: FloatArray,
    lens: FloatArray,
    size: FloatArray = _NONE,
    isa: int | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return pixels of corners (N, 3) of boards at poses (N, 6) in the camera's axes, px.

    `lens` is (9,) or (N, 9): fx fy cx cy k1 k2 p1 p2 k3; `size` is (1,) or (N, 1), by which a board
    is larger than stated. Returns u, v (N, 2), their derivatives by the board's twist (ω, v) at the
    camera (N, 2, 6), by the lens (N, 2, 9) and by the size (N, 2), and how far before the camera
    the corners are, mm (N,).
    """
    seen, by_twist, by_lens, by_size, depth = rows("pixels", board, corner, lens, size, isa=isa)
    return seen, by_twist, by_lens, by_size, depth
