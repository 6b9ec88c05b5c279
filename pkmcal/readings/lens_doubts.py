"""Doubts about a lens, or about the numbers of the corners, from pixels of boards."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core import instruments
from pkmcal.readings.board_poses import FEWEST, BoardPoses, board_poses, facing
from pkmcal.readings.lens import LENS, size_of_pictures

_FALLS = (
    3.0  # times less that corners are off with another lens, from which on that is the right one
)
_CLEAR = 0.3  # px that corners are off at least, to doubt a lens
_MIDDLE = 0.1  # share of a picture by which the principal point is off its middle, at most
_STEPS = 6  # towards a better lens
_TOLD = 1e-6  # of the largest singular value, from which combinations of its numbers are told
_FITS = 1.5  # times less that corners are off with a lens that fits as well as the best one
_AS_WELL = 1.1  # times what corners are off with the best one
_EXCHANGED = (1, 0, 3, 2, 4, 5, 7, 6, 8)  # numbers of a lens where x is y
_SCALES = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2, 3, 4)  # of pictures made smaller


def lens_doubts(
    corner: FloatArray,
    pixel: FloatArray,
    lens: FloatArray,
    picture: IntArray,
    size: tuple[int, int],
) -> Iterator[str]:
    """Sentences on what is wrong.

    Parameters
    ----------
    corner : ndarray (N, 3)
        In axes of the board, mm.
    pixel : ndarray (N, 2)
        Where they are seen.
    lens : ndarray (9,)
        fx fy cx cy k1 k2 p1 p2 k3.
    picture : ndarray of int (N,)
        Which picture each is of, 0 … P - 1.
    size : (int, int)
        Width and height of pictures, px; 0: not known.
    """
    found = board_poses(corner, pixel, lens, picture)
    off, said = _typical(found), False
    if off > _CLEAR:
        straight = np.where(np.arange(9) < 4, lens, 0.0)
        flat = _typical(board_poses(corner, pixel, straight, picture))
        if flat * _FALLS < off:
            said = True
            yield (
                f"the pictures have been rectified: corners are {off:.3g} px off with the"
                f" distortion of the lens and {flat:.3g} px without; state the lens of rectified"
                " pictures, without distortion"
            )
    most = pixel.max(axis=0)
    ends = np.array([end or 1.0 + last for end, last in zip(size, most, strict=True)])
    if (off > _CLEAR and not said) or (np.abs(lens[2:4] / ends - 0.5) > _MIDDLE).any():
        other, least = _better(corner, pixel, lens, picture, found)
        tried = [
            (_typical(board_poses(corner, pixel, each, picture)), what, how)
            for what, how, each in _kindred(lens, size)
        ]
        left, what, how = min(tried, key=lambda each: each[0])
        fits = left * _FITS < off and left < _AS_WELL * least
        if left * _FALLS < off or fits:
            yield (
                f"the lens is that of {what} pictures: its middle is at"
                f" {lens[2]:.0f}, {lens[3]:.0f} and pixels reach {most[0]:.0f}, {most[1]:.0f};"
                f" with {how} corners are {left:.3g} px off in place of {off:.3g}:"
                " state the lens of these pictures, or give them as the lens was calibrated"
            )
        elif off > _CLEAR and not said and least * _FALLS < off:
            numbers = ", ".join(
                f"{name} {value:.4g}" for name, value in zip(LENS, other, strict=True) if value
            )
            yield (
                f"the lens is not that of these pictures: corners are {off:.3g} px off with it and"
                f" {least:.3g} px with another ({numbers}); calibrate the camera as it is, or"
                ' identify the lens, too: --lens all (lens="all")'
            )
    behind = int((facing(found) < 0.0).sum())
    if behind > len(found.pose) / 2:
        yield (
            f"the board is seen from behind in {behind} of {len(found.pose)} pictures: pictures are"
            " mirrored, or corners numbered from the other side; places on the board are mirrored"
            " then, and with mirrored pictures nothing fits"
        )


def pixels_outside(pixel: FloatArray, size: tuple[int, int]) -> Iterator[str]:
    """Say that pixels (N, 2), NaN where nothing is seen, are beyond the edges of their pictures."""
    for name, way, end, seen in zip("uv", ("wide", "high"), size, pixel.T, strict=True):
        most, least = np.nanmax(seen, initial=0.0), np.nanmin(seen, initial=0.0)
        if end and (most > end or least < -1.0):
            yield (
                f"{name} reaches from {least:.0f} to {most:.0f} px, and pictures of this camera"
                f" are {end} px {way}: the lens is of pictures of another size, or turned"
            )


def _kindred(lens: FloatArray, size: tuple[int, int]) -> Iterator[tuple[str, str, FloatArray]]:
    """Lenses (9,) of the same pictures, turned or of another size: what they are, and the lens."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens.tolist()
    right, low = (end - 1.0 for end in size_of_pictures(lens, size))
    turned = {
        "the lens turned by 90 deg to the right": (fy, fx, low - cy, cx, p2, -p1),
        "the lens turned by 90 deg to the left": (fy, fx, cy, right - cx, -p2, p1),
        "the lens upside down": (fx, fy, right - cx, low - cy, -p1, -p2),
    }
    yield "turned", "x and y exchanged", lens[list(_EXCHANGED)]
    for how, (*focal, p, q) in turned.items():
        yield "turned", how, np.array([*focal, k1, k2, p, q, k3])
    for scale in _SCALES:
        middle = (lens[2:4] + 0.5) * scale - 0.5
        yield (
            "larger or smaller",
            f"the lens times {scale:.3g}",
            np.concatenate([lens[:2] * scale, middle, lens[4:]]),
        )


def _better(
    corner: FloatArray,
    pixel: FloatArray,
    lens: FloatArray,
    picture: IntArray,
    found: BoardPoses,
) -> tuple[FloatArray, float]:
    """The lens (9,) with which corners fit best, each board where it then is; and how far off.

    The latter is that of the median picture, px.
    """
    pose, best, least = found.pose[:, 0].copy(), lens, _typical(found)
    for _ in range(_STEPS):
        seen, by_motion, by_lens, _, _ = instruments.pixels(
            np.ascontiguousarray(pose[picture]), corner, np.tile(lens, (len(corner), 1))
        )
        whole = np.concatenate([by_lens[:, :, :8], (pixel - seen)[:, :, None]], axis=2)
        rows = []
        for each in range(len(pose)):
            mine = np.flatnonzero((picture == each) & np.isfinite(whole).all(axis=(1, 2)))
            if len(mine) < FEWEST:
                continue
            motion, _ = np.linalg.qr(by_motion[mine].reshape(-1, 6))
            own = whole[mine].reshape(-1, 9)
            rows.append(own - motion @ (motion.T @ own))
        if not rows:
            break
        system = np.concatenate(rows)
        size = np.linalg.norm(system[:, :8], axis=0)
        size[size == 0.0] = 1.0
        step = np.linalg.lstsq(system[:, :8] / size, system[:, 8], rcond=_TOLD)[0] / size
        lens = lens + np.append(step, 0.0)
        if not (lens[:2] > 0.0).all():
            break
        now = board_poses(corner, pixel, lens, picture)
        if not _typical(now) < least:
            break
        pose, best, least = now.pose[:, 0].copy(), lens, _typical(now)
    return best, least


def _typical(found: BoardPoses) -> float:
    """Return the misfit of corners in the median picture, px."""
    rms = found.rms[:, 0]
    return float(np.median(rms[np.isfinite(rms)])) if np.isfinite(rms).any() else float("inf")
