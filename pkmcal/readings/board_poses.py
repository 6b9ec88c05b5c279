"""Boards before a camera: their places, from the pixels of the corners alone.

A flat board that is small in its picture has two places at which its corners are seen nearly
alike, mirrored at the plane across the line of sight. Which of them it is only several pictures
together tell: both are found here.

Own code: a table of pixels is enough to calibrate a machine, without a library of pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.core import instruments, screws
from pkmcal.core.elimination import PoseEquations
from pkmcal.readings import orientation
from pkmcal.readings.alignment import nearest_rotations
from pkmcal.statistics.distributions import f_tail

FEWEST = 4  # corners of a picture that tell where a flat board is; of another one two more
_UNBENDING = 20  # rounds of undoing the distortion
_UNBENT = 1e-15  # change of a direction at which it is undone
_MANY = 8  # corners, of fewer than which the search begins once more
_ASIDE = 0.2  # rad, to either side
_LOST = 0.05  # of the extent in a picture, by which its corners are off where the search is lost
_STEPS = 30  # of Levenberg and Marquardt
_DAMPED = 1e-12  # at least, so that corners in a point or a line have a step
_SMALL = 1e-10  # step, as a share of the distance and in rad, at which a place is found
_SAME = 1e-4  # turning between two places, rad, below which they are one
_LINE = 0.01  # square across over along, at which corners of a picture are in a line
_BY_CHANCE = 1e-9  # that corners seem so much further off at the right place
_SQUARE = 1e-10  # the same of corners of which a line is told apart to a few digits
_ROUNDED = 1e-24  # the same of what rounding leaves apart
_FLAT = 1e-6  # share of a board's size by which its corners may stand off a plane


@dataclass(frozen=True, eq=False)
class BoardPoses:
    """Places of the board in each of P pictures, best first.

    Attributes
    ----------
    pose : ndarray (P, 2, 6)
        Of the board in axes of the camera, mm and rad; the second is NaN where there is but one.
    rms : ndarray (P, 2)
        How far off the corners are, px.
    possible : ndarray of bool (P, 2)
        Whether it can be there: not where the corners of the other place are off by so much less
        that chance does not explain it.
    """

    pose: FloatArray
    rms: FloatArray
    possible: BoolArray


def board_poses(
    corner: FloatArray, pixel: FloatArray, lens: FloatArray, picture: IntArray
) -> BoardPoses:
    """Find the places of boards.

    Parameters
    ----------
    corner : ndarray (N, 3)
        In axes of the board, mm.
    pixel : ndarray (N, 2)
        Where they are seen.
    lens : ndarray (N, 9) or (9,)
        fx fy cx cy k1 k2 p1 p2 k3.
    picture : ndarray of int (N,)
        Which picture each is of, 0 … P - 1. Four corners of a flat board, or six, are needed.
    """
    order = np.argsort(picture, kind="stable")
    corner, pixel, picture = corner[order], pixel[order], picture[order]
    lens = np.broadcast_to(lens, (len(pixel), 9))[order]
    direction = unbent(pixel, lens)
    folded = ~np.isfinite(direction).all(axis=1)  # with a lens of other pictures: a guess will do
    direction[folded] = (pixel[folded] - lens[folded, 2:4]) / lens[folded, :2]
    found = [
        _refined(guess, corner, pixel, lens, picture)
        for guess in _guessed(corner, direction, picture, _projection)
    ]
    pose, rms = (np.stack(each, axis=1) for each in zip(*found, strict=True))
    few = np.bincount(picture) < _MANY  # of which three may be in a line: see `_affinity`
    lost = np.flatnonzero(few | ~(rms.min(axis=1) <= _LOST * _extents(pixel, picture)))
    if len(lost):
        rows, among = _of_pictures(lost, picture, len(pose))
        some = corner[rows], pixel[rows], lens[rows], among
        for i, guess in enumerate(_guessed(some[0], direction[rows], among, _affinity)):
            for again, off in _aside(_refined(guess, *some)[0], *some):
                better = off < rms[lost, i]
                pose[lost[better], i], rms[lost[better], i] = again[better], off[better]
    turn = orientation.between(pose[:, 1, 3:], pose[:, 0, 3:])
    swap = rms[:, 1] < rms[:, 0]
    pose[swap], rms[swap] = pose[swap, ::-1], rms[swap, ::-1]
    same = ~(np.linalg.norm(turn, axis=1) > _SAME)
    pose[same, 1], rms[same, 1] = np.nan, np.nan
    possible = np.isfinite(rms)
    for each in np.flatnonzero(possible.all(axis=1) & (rms[:, 0] > 0)).tolist():
        freedom = 2 * int((picture == each).sum()) - 6
        ratio = float(rms[each, 1] / rms[each, 0]) ** 2
        possible[each, 1] = f_tail(ratio, freedom, freedom) > _BY_CHANCE
    return BoardPoses(pose, rms, possible)


def facing(found: BoardPoses) -> FloatArray:
    """Above 0 where a board is seen from the front (P,), its z pointing away from the camera."""
    motion = screws.frames(np.ascontiguousarray(found.pose[:, 0]))
    facing: FloatArray = (motion[:, :3, 2] * motion[:, :3, 3]).sum(axis=1)
    return facing


def unbent(pixel: FloatArray, lens: FloatArray) -> FloatArray:
    """Directions x/z, y/z (N, 2) of pixels (N, 2): the distortion undone; NaN where it folds."""
    bent = (pixel - lens[:, 2:4]) / lens[:, :2]
    corner, level = np.zeros((len(pixel), 3)), np.zeros((len(pixel), 6))
    found: FloatArray = bent.copy()
    for _ in range(_UNBENDING):
        level[:, :2], level[:, 2] = found, 1.0
        seen, by_twist, *_ = instruments.pixels(level, corner, lens)
        off = seen - pixel
        (a, b), (c, d) = by_twist[:, :, 3:5].transpose(1, 2, 0)
        step = np.array([d, -c]) * off[:, 0] + np.array([-b, a]) * off[:, 1]
        step /= a * d - b * c
        found -= step.T
        if not (np.abs(step) > _UNBENT).any():
            break
    found[~(np.abs(off).max(axis=1) < 1e-6 * lens[:, 0])] = np.nan
    return found


def in_a_line(
    corner: FloatArray, picture: IntArray, pictures: int, thin: float = _LINE
) -> BoolArray:
    """Pictures (P,) of which corners (N, 3) are in a line, or nearly: they tell no turning.

    Nearly is by a share `thin` of squares; corners that are apart by rounding are in a point.
    """
    count = np.maximum(np.bincount(picture, minlength=pictures), 1)
    away = corner - (summed(corner, picture, pictures) / count[:, None])[picture]
    squares = summed(away[:, :, None] * away[:, None, :], picture, pictures)
    size = np.linalg.eigvalsh(squares)
    rounded = _ROUNDED * summed(corner**2, picture, pictures).sum(axis=1)
    return np.asarray(size[:, 1] <= np.maximum(thin * size[:, 2], rounded))


def pictures_told(
    corner: FloatArray, pixel: FloatArray, picture: IntArray
) -> tuple[IntArray, IntArray]:
    """Rows (n,) of pictures that tell where a board is, and which picture each is of (n,).

    Of N rows those whose pixel is not NaN count. `picture` (N,) counts from 0; that of what is
    found does so, too. A picture that has all its corners in a point or a line tells nothing.
    """
    known = np.isfinite(pixel).all(axis=1)
    flat = np.linalg.svd(corner - corner.mean(axis=0), compute_uv=False)
    fewest = FEWEST if flat[-1] <= _FLAT * flat[0] else FEWEST + 2
    enough = np.bincount(picture[known], minlength=int(picture.max()) + 1) >= fewest
    enough &= ~in_a_line(corner[known], picture[known], len(enough))
    seen = np.column_stack([pixel[known], np.zeros(int(known.sum()))])
    enough &= ~in_a_line(seen, picture[known], len(enough), _SQUARE)
    used = np.flatnonzero(known & enough[picture])
    return used, np.unique(picture[used], return_inverse=True)[1].reshape(-1)


def mm_per_pixel(corner: FloatArray, pixel: FloatArray, picture: IntArray) -> FloatArray:
    """Return the size of a pixel at the board of each picture, mm, as if from far away (P,).

    NaN where corners (N, 3) of a picture are in a line, or seen in one point. `picture` (N,)
    counts from 0.
    """
    count = np.bincount(picture)
    both = np.hstack([corner, pixel])
    away = both - (summed(both, picture) / np.maximum(count, 1)[:, None])[picture]
    products = summed(away[:, :3, None] * away[:, None, :], picture)
    size, axes = np.linalg.eigh(products[:, :, :3])
    told = size > _SQUARE * size[:, -1:]
    share = np.where(told, 1.0 / np.where(told, size, 1.0), 0.0)
    image = (axes * share[:, None]) @ axes.transpose(0, 2, 1) @ products[:, :, 3:]
    found = np.full(len(count), np.nan)
    flat = told.sum(axis=1) > 1
    pixels = np.linalg.norm(image, ord=2, axis=(1, 2))
    flat &= pixels > 0.0
    found[flat] = 1.0 / pixels[flat]
    return found


def _of_pictures(some: IntArray, picture: IntArray, pictures: int) -> tuple[IntArray, IntArray]:
    """Rows (n,) of some pictures, and which of these each is of (n,)."""
    among = np.full(pictures, -1)
    among[some] = np.arange(len(some))
    rows = np.flatnonzero(among[picture] >= 0)
    return rows, among[picture[rows]]


def _extents(pixel: FloatArray, picture: IntArray) -> FloatArray:
    """Rms distance of pixels (N, 2) from the middle of their picture (P,)."""
    count = np.bincount(picture)
    off = pixel - (summed(pixel, picture) / count[:, None])[picture]
    extent: FloatArray = np.sqrt(summed((off**2).sum(axis=1), picture) / count)
    return extent


def _guessed(
    corner: FloatArray,
    direction: FloatArray,
    picture: IntArray,
    projected: Callable[[FloatArray, FloatArray, IntArray], FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Two places (P, 6) each to search from; of a board that is not flat they are one.

    `projected` finds the projection of each picture.
    """
    middle = corner.mean(axis=0)
    axes = np.linalg.svd(corner - middle, full_matrices=False)[2]
    axes[2] *= np.sign(np.linalg.det(axes))
    own = (corner - middle) @ axes.T  # the board from its middle, the third axis across it
    size = float(np.abs(own).max())
    if float(np.abs(own[:, 2]).max()) < _FLAT * size:
        turns, place = _of_flat(projected(own[:, :2] / size, direction, picture), size)
    else:
        projection = projected(own / size, direction, picture)
        scale = np.cbrt(np.abs(np.linalg.det(projection[:, :, :3])))[:, None]
        turns = [nearest_rotations(projection[:, :, :3] / scale[:, None])] * 2
        place = projection[:, :, 3] * size / scale
    first, second = (_poses(turn @ axes, place - turn @ (axes @ middle)) for turn in turns)
    return first, second


def _projection(point: FloatArray, direction: FloatArray, picture: IntArray) -> FloatArray:
    """Matrices (P, 3, w + 1) that take points (N, w) with a 1 behind to directions, but for size.

    Directions are counted from the middle of their picture in units of its extent, without which
    the smallest eigenvector of the squares is off where a board is small.
    """
    count = np.bincount(picture)[:, None]
    middle = summed(direction, picture) / count
    off = direction - middle[picture]
    extent = np.sqrt(summed(off**2, picture).sum(axis=1, keepdims=True) / count)
    off /= extent[picture]
    point = np.column_stack([point, np.ones(len(point))])
    width = point.shape[1]
    rows = np.zeros((len(point), 2, 3 * width))
    for i in range(2):
        rows[:, i, i * width : (i + 1) * width] = point
        rows[:, i, 2 * width :] = -off[:, i, None] * point
    _, vectors = np.linalg.eigh(summed(rows.transpose(0, 2, 1) @ rows, picture))
    found = vectors[:, :, 0].reshape(-1, 3, width)
    found[:, :2] *= extent[:, :, None]
    found[:, :2] += middle[:, :, None] * found[:, 2:]
    before: FloatArray = found * np.where(found[:, 2:, -1:] < 0, -1.0, 1.0)
    return before


def _affinity(point: FloatArray, direction: FloatArray, picture: IntArray) -> FloatArray:
    """Return `_projection` as if from far away: three points tell it of a flat board.

    Four tell a projection, but not where three of them are in a line.
    """
    point = np.column_stack([point, np.ones(len(point))])
    squares = summed(point[:, :, None] * point[:, None, :], picture)
    products = summed(point[:, :, None] * direction[:, None, :], picture)
    found = np.zeros((len(squares), 3, point.shape[1]))
    found[:, :2] = (np.linalg.pinv(squares, hermitian=True) @ products).transpose(0, 2, 1)
    if point.shape[1] > 3:
        third = np.cross(found[:, 0, :3], found[:, 1, :3])
        found[:, 2, :3] = third / np.sqrt(np.linalg.norm(third, axis=1, keepdims=True))
    found[:, 2, -1] = 1.0
    return found


def _of_flat(plane: FloatArray, size: float) -> tuple[list[FloatArray], FloatArray]:
    """Return both rotations (P, 3, 3) of flat boards and their middle (P, 3).

    The derivative of the projection at the middle of the board is that of an affine camera along
    the line of sight, which two turnings fulfil (T. Collins, A. Bartoli, Infinitesimal plane-based
    pose estimation, International Journal of Computer Vision 109 (2014) 252-286).
    """
    plane = plane / plane[:, 2:, 2:]
    middle = plane[:, :2, 2]
    change = (plane[:, :2, :2] - middle[:, :, None] * plane[:, 2:, :2]) / size
    sight = np.column_stack([middle, np.ones(len(middle))])
    to_sight = _turned_to(sight / np.linalg.norm(sight, axis=1, keepdims=True))
    across = to_sight[:, :2, :2] - middle[:, :, None] * to_sight[:, 2:, :2]
    seen = np.linalg.solve(across, change)
    near = np.linalg.norm(seen, ord=2, axis=(1, 2))  # 1 / depth
    columns = seen / near[:, None, None]
    rest = np.eye(2) - columns.transpose(0, 2, 1) @ columns
    tilt = np.sqrt(np.maximum(np.einsum("pii->pi", rest), 0.0))
    tilt[:, 1] *= np.where(rest[:, 0, 1] < 0, -1.0, 1.0)
    turns = []
    for side in (1.0, -1.0):
        two = np.concatenate([columns, side * tilt[:, None]], axis=1)
        third = np.cross(two[:, :, 0], two[:, :, 1])[:, :, None]
        turns.append(nearest_rotations(to_sight @ np.concatenate([two, third], axis=2)))
    return turns, sight / near[:, None]


def _turned_to(directions: FloatArray) -> FloatArray:
    """The shortest turnings (P, 3, 3) that take z to unit vectors (P, 3)."""
    axis = np.cross([0.0, 0.0, 1.0], directions)
    cosine = directions[:, 2]
    angle = np.arctan2(np.linalg.norm(axis, axis=1), cosine)
    scale = np.where(angle > 0, angle / np.where(angle > 0, np.sin(angle), 1.0), 1.0)
    return screws.turnings(axis * scale[:, None])


def _poses(turn: FloatArray, place: FloatArray) -> FloatArray:
    """Poses (P, 6) of turnings (P, 3, 3) and places (P, 3)."""
    motion = np.tile(np.eye(4), (len(turn), 1, 1))
    motion[:, :3, :3], motion[:, :3, 3] = turn, place
    return screws.pose(motion.reshape(-1, 16))


def _refined(
    pose: FloatArray, corner: FloatArray, pixel: FloatArray, lens: FloatArray, picture: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Places (P, 6) at which the squares of what corners are off are least, and their rms, px."""
    damping = np.full(len(pose), 1e-6)
    cost, normal, pull = _equations(pose, corner, pixel, lens, picture)
    moving = np.flatnonzero(np.isfinite(cost))
    for _ in range(_STEPS):
        if not len(moving):
            break
        size = np.sqrt(np.einsum("pii->pi", normal[moving]))
        size[~(size > 0.0)] = 1.0
        scaled = normal[moving] / (size[:, :, None] * size[:, None, :])
        damped = scaled + damping[moving, None, None] * np.eye(6)
        step = np.linalg.solve(damped, (pull[moving] / size)[:, :, None])[:, :, 0] / size
        trial = _moved(pose[moving], step)
        rows, among = _of_pictures(moving, picture, len(pose))
        new = _equations(trial, corner[rows], pixel[rows], lens[rows], among)
        better = new[0] <= cost[moving]
        pose[moving[better]] = trial[better]
        for now, then in zip((cost, normal, pull), new, strict=True):
            now[moving[better]] = then[better]
        damping[moving] = np.maximum(damping[moving] * np.where(better, 0.1, 10.0), _DAMPED)
        small = np.abs(step[:, :3]).max(axis=1) < _SMALL
        moving = moving[~(small | (damping[moving] > 1e12))]
    count = np.bincount(picture, minlength=len(pose))
    return pose, np.sqrt(cost / count)


def _aside(
    pose: FloatArray, corner: FloatArray, pixel: FloatArray, lens: FloatArray, picture: IntArray
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield `_refined` from places (P, 6) turned a little, to either side, by what is told least.

    Between two places of a flat board there is one at which squares are level, and a search that
    begins near it ends there.
    """
    _, normal, _ = _equations(pose, corner, pixel, lens, picture)
    size = np.sqrt(np.einsum("pii->pi", normal))
    known = np.isfinite(size).all(axis=1) & (size > 0.0).all(axis=1)
    scaled = normal[known] / (size[known, :, None] * size[known, None, :])
    least = np.linalg.eigh(scaled)[1][:, :, 0] / size[known]
    least *= _ASIDE / np.linalg.norm(least[:, :3], axis=1, keepdims=True)
    for side in (-1.0, 1.0):
        turned = pose.copy()
        turned[known] = _moved(pose[known], side * least)
        yield _refined(turned, corner, pixel, lens, picture)


def _equations(
    pose: FloatArray, corner: FloatArray, pixel: FloatArray, lens: FloatArray, picture: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sum of squares (P,), normal matrix (P, 6, 6) and right side (P, 6) by the board's twist.

    Infinite where a corner is not before the camera. Rows are picture by picture.
    """
    at = np.ascontiguousarray(pose[picture])
    seen, by_twist, _, _, depth = instruments.pixels(at, corner, lens)
    seen[~(depth > 0)] = np.inf
    off = (pixel - seen).ravel()
    numbers = 2 * np.bincount(picture, minlength=len(pose))
    of_pictures = PoseEquations(np.arange(len(off)), numbers, 6)
    normal, pull, squares = of_pictures.normals(off, by_twist.reshape(-1, 6))
    return np.where(np.isfinite(squares), squares, np.inf), normal, pull


def _moved(pose: FloatArray, twist: FloatArray) -> FloatArray:
    """Poses (P, 6) after small twists (P, 6) at the camera."""
    moved = screws.exp(np.ascontiguousarray(twist)).reshape(-1, 4, 4) @ screws.frames(pose)
    return screws.pose(moved.reshape(-1, 16))


def summed(rows: FloatArray, picture: IntArray, pictures: int = 0) -> FloatArray:
    """Sums (P, ...) of the rows of each picture; there are `pictures` at least."""
    count = np.bincount(picture, minlength=pictures)
    if (picture[1:] < picture[:-1]).any():
        rows = rows[np.argsort(picture, kind="stable")]
    found = np.zeros((len(count), *rows.shape[1:]))
    shown = count > 0
    if shown.any():
        found[shown] = np.add.reduceat(rows, (np.cumsum(count) - count)[shown])
    return found
