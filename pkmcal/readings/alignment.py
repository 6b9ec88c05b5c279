"""Place of an instrument: the frame in which predictions lie nearest to readings.

In closed form or nearly so, with the nominal machine: where the search for its errors starts.
SciPy aligns one set of known points; here targets may be unknown, and 24 starts run at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, first_largest
from pkmcal.core import screws

_ROUNDS = 60  # of turning and shifting in turn
_ALIKE = 1e-12  # share of squares by which turnings differ that are not equally good
TILT = 1e-3  # rad; with tilts below it the poses do not determine where a target is
_FLAT = 0.05  # share of the largest spread of points below which they lie in a plane, or a line


@dataclass(frozen=True, eq=False)
class Sighting:
    """Readings in an unknown frame, and what the machine predicts of them in the base frame.

    Attributes
    ----------
    values, predicted : ndarray (N, k)
        As they were read, and as they should be in the base frame; NaN where there is none.
    point : ndarray (N, 3)
        Of readings with a target, the points in the base frame, where targets are said to be.
    turn : ndarray (N, 3, 3)
        From the platform's axes to those of the base.
    target : ndarray of int (N,)
        The first parameter of the unknown target of each row; -1 where its place is known.
    """

    values: FloatArray
    predicted: FloatArray
    point: FloatArray
    turn: FloatArray
    target: IntArray


Laid = tuple[FloatArray, Mapping[int, FloatArray]]  # a frame (6,), and shifts (3,) of targets


def frame_of_points(seen: Sighting) -> Laid:
    """The frame of points, some of whose targets are unknown; by heights where there is no more."""
    values = seen.values
    # rows of what was read at all: of a machine in a plane, say, not across it
    never: BoolArray = np.asarray(np.isnan(values).all(axis=0))
    read = np.isfinite(values[:, ~never]).all(axis=1)
    if not read.any() or never[:2].all():
        up = values[:, 2]
        known = np.isfinite(up)
        return of_heights(up[known], seen.point[known]) if known.any() else np.zeros(6), {}
    firsts, target = np.unique(seen.target[read], return_inverse=True)
    pairs = PointPairs(
        values=np.where(never, 0.0, values)[read],
        point=seen.point[read],
        turn=seen.turn[read],
        target=target.reshape(-1) - int(firsts[0] < 0),
    )
    frame, shifts = of_points(pairs)
    return frame, dict(zip(firsts[firsts >= 0].tolist(), shifts, strict=True))


def frame_of_poses(seen: Sighting) -> Laid:
    """The frame of poses, or of orientations alone."""
    whole = np.zeros((2, len(seen.values), 6))
    whole[:, :, 6 - seen.values.shape[1] :] = seen.values, seen.predicted
    whole[0, :, np.isnan(whole[0]).all(axis=0)] = 0.0  # never read, as across a plane
    read, predicted = whole[:, np.isfinite(whole[0]).all(axis=1)]
    return of_poses(read, predicted) if len(read) else np.zeros(6), {}


@dataclass(frozen=True, eq=False)
class PointPairs:
    """Measured points of one or several sets, and the same points as the machine predicts them.

    Attributes
    ----------
    values : ndarray (N, 3)
        As the instrument has them.
    point : ndarray (N, 3)
        In the base frame, with targets where they are said to be.
    turn : ndarray (N, 3, 3)
        From the platform's axes to those of the base.
    target : ndarray of int (N,)
        Which unknown target each row measured; -1 where its place is known.
    """

    values: FloatArray
    point: FloatArray
    turn: FloatArray
    target: IntArray


def of_points(seen: PointPairs) -> tuple[FloatArray, FloatArray]:
    """Frame (6,) and shifts (k, 3) of the unknown targets that bring points nearest to readings.

    For a given turning of the frame both its place and the shifts follow linearly; for given
    shifts the turning is Kabsch's (W. Kabsch, Acta Crystallographica A 32 (1976) 922). The two in
    turn, from all 24 turnings of a cube, for there are minima that are not the least.
    """
    from scipy.spatial.transform import Rotation

    count = int(seen.target.max(initial=-1)) + 1
    values, point = centred(seen.values), centred(seen.point)
    shifted = np.zeros((len(values), 3, count, 3))
    for k in range(count):
        mine = seen.target == k
        shifted[mine, :, k] = seen.turn[mine]
    lever = centred(shifted).reshape(3 * len(values), 3 * count)  # of all points, by the shifts
    inverse = inverse_above(lever, TILT * np.sqrt(len(values)))
    # shifts = gain · vec(turn) - still, and turn = Kabsch of `straight` + `by_shift` · shifts
    seen_by = np.einsum("ni,jk->njik", values, np.eye(3)).reshape(-1, 9)  # of Rᵀ v, by vec(R)
    gain, still = inverse @ seen_by, inverse @ point.reshape(-1)
    straight = values.T @ point
    by_shift = np.einsum("ni,njk->ijk", values, lever.reshape(len(values), 3, 3 * count))
    turns = Rotation.create_group("O").as_matrix()
    for _ in range(_ROUNDS if count else 1):
        shifts = turns.reshape(-1, 9) @ gain.T - still
        common = straight + np.einsum("ijk,sk->sij", by_shift, shifts)
        # a turning that points in a plane or a line do not determine stays as it is
        turns = nearest_rotations(common + _ALIKE * np.linalg.norm(straight) * turns)
    off = (turns.reshape(-1, 9) @ seen_by.T) - point.reshape(-1)
    misfit = ((off - off @ inverse.T @ lever.T) ** 2).sum(axis=1)
    best = first_largest(-misfit, _ALIKE * float((point**2).sum()))
    shift = inverse @ off[best]
    point = seen.point + (shifted.reshape(lever.shape) @ shift).reshape(-1, 3)
    place = seen.values.mean(axis=0) - turns[best] @ point.mean(axis=0)
    return frame_of(turns[best], place), shift.reshape(count, 3)


def of_poses(values: FloatArray, pose: FloatArray) -> FloatArray:
    """Frame (6,) in which poses (N, 6) lie nearest to those that were measured (N, 6)."""
    from scipy.spatial.transform import Rotation

    measured = Rotation.from_euler("xyz", values[:, 3:])
    turn = (measured * Rotation.from_euler("xyz", pose[:, 3:]).inv()).mean()
    place = (values[:, :3] - turn.apply(pose[:, :3])).mean(axis=0)
    return frame_of(turn.as_matrix(), place)


def of_heights(values: FloatArray, point: FloatArray) -> FloatArray:
    """Frame (6,) in which points (N, 3) have nearly the heights (N,) that were measured.

    Heights say which way is up, but for what lies in a plane: there it is up as in the robot file.
    """
    spread, axes = np.linalg.svd(centred(point), full_matrices=False)[1:]
    seen = axes[spread > _FLAT * spread[0]]
    up = np.linalg.lstsq(centred(point) @ seen.T, centred(values), rcond=None)[0] @ seen
    rest = np.array([0.0, 0.0, 1.0]) - seen.T @ seen[:, 2]
    if np.linalg.norm(rest) > _FLAT:
        rest *= np.sqrt(max(0.0, 1.0 - up @ up)) / np.linalg.norm(rest)
        up = up + rest
    if not up.any():
        up = np.array([0.0, 0.0, 1.0])
    up /= np.linalg.norm(up)
    frame = np.zeros(6)
    frame[2] = (values - point @ up).mean()
    frame[3:5] = np.arctan2(up[1], up[2]), np.arctan2(-up[0], np.hypot(up[1], up[2]))
    return frame


def of_directions(values: FloatArray, directions: FloatArray) -> FloatArray:
    """The turning (3, 3) that takes directions (N, 3) nearest to those that were measured (N, 3).

    About directions that they have in common it turns as little as may be.
    """
    common = values.T @ directions
    return nearest_rotations(common + _ALIKE * (np.linalg.norm(common) + 1.0) * np.eye(3))


def angles_of(turn: FloatArray) -> FloatArray:
    """α β γ (3,) of a turning (3, 3)."""
    return frame_of(turn, np.zeros(3))[3:]


def inverse_above(lever: FloatArray, floor: float) -> FloatArray:
    """Pseudo-inverse of mm per mm; what poses determine less than `floor` stays where it is stated.

    The floor is absolute: with poses of one orientation the lever is rounding alone, and a floor
    relative to its largest singular value would let that decide.
    """
    left, singular, right = np.linalg.svd(lever, full_matrices=False)
    kept = singular > floor
    inverse: FloatArray = (right[kept].T / singular[kept]) @ left[:, kept].T
    return inverse


def centred(rows: FloatArray) -> FloatArray:
    """Rows less their mean."""
    about: FloatArray = rows - rows.mean(axis=0)
    return about


def frame_of(turn: FloatArray, place: FloatArray) -> FloatArray:
    """The pose (6,) of a turning (3, 3) and a place (3,)."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, place
    frame: FloatArray = screws.pose(motion.reshape(1, 16))[0]
    return frame


def nearest_rotations(matrices: FloatArray) -> FloatArray:
    """The rotations (..., 3, 3) that have most in common with matrices (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrices)
    left[..., 2] *= np.linalg.det(left @ right)[..., None]
    rotations: FloatArray = left @ right
    return rotations
