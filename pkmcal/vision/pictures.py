"""Pictures in folders, corners in each, and which are bad beside the others."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import path
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.readings import orientation
from pkmcal.readings.board_poses import board_poses, in_a_line
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera
from pkmcal.vision.detectors import Finder, Seen, opencv

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm")
FEWEST = 6  # corners of a picture that is taken
_BENT = 5.0  # times what corners of other pictures are off their board, and
_OFF = 0.5  # px at least: moved while it was taken, or corners with wrong numbers
_BLURRED = 1 / 3  # of the median contrast of other pictures


class Picture(NamedTuple):
    """A picture and its corners.

    Attributes
    ----------
    path : Path
        The file.
    seen : Seen
        Corners; none of a picture that is not taken.
    bad : str
        Why it is not taken; "" where it is.
    size : (int, int)
        Width and height, px.
    contrast : float
        Steepest grey levels at corners, a pixel.
    """

    path: Path
    seen: Seen
    bad: str = ""
    size: tuple[int, int] = (0, 0)
    contrast: float = np.nan


def files(images: str | PathLike[str] | Iterable[str | PathLike[str]]) -> list[Path]:
    """Pictures that are named, and those of folders, in the order of their names."""
    if isinstance(images, str | PathLike) or not isinstance(images, Iterable):
        images = [path("images", images)]
    given = [path("images", each) for each in images]
    paths: list[Path] = []
    for each in given:
        if each.is_dir():
            inside = [f for f in each.iterdir() if f.suffix.lower() in _SUFFIXES]
            paths += sorted(inside, key=lambda f: _natural(f.name))
        else:
            paths.append(each)
    if not paths:
        raise ArgumentError(
            f"images: no pictures ({', '.join(_SUFFIXES[:4])} …) were found in"
            f" {', '.join(map(str, given)) or 'nothing'}"
        )
    names = [each.name for each in paths]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise ArgumentError(
            f"images: two pictures are called {twice}: names tell which joints belong to which"
        )
    return paths


def _natural(name: str) -> list[tuple[bool, int, str]]:
    """A key that puts 2.png before 10.png."""
    parts = "".join(c if c.isdigit() else f" {c} " for c in name).split()
    return [(False, int(p), "") if p.isdecimal() else (True, 0, p) for p in parts]


def grey(path: Path, content: bytes) -> Any:
    """Grey levels of a picture, 0 to 255."""
    return _decoded(path, content, opencv().IMREAD_GRAYSCALE)


def brightness(path: Path, content: bytes) -> tuple[int, int]:
    """The largest number in a picture, and the largest that its kind of numbers can have."""
    cv2 = opencv()
    levels = _decoded(path, content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    most = int(np.iinfo(levels.dtype).max) if levels.dtype.kind in "iu" else 1
    return int(levels.max()), most


def _decoded(path: Path, content: bytes, how: int) -> Any:
    """Numbers of a picture; OpenCV returns nothing of some bad files and raises at others."""
    if not content:
        raise FileError(f"{path}: this file is empty, no picture; take the picture again")
    cv2 = opencv()
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), how)
    except cv2.error as error:
        raise FileError(f"{path}: this is no picture that can be read: {error.err}") from None
    if image is None:
        raise FileError(f"{path}: this is no picture that can be read")
    return image


def looked_at(path: Path, grey: Any, finds: Finder) -> Picture:
    """A picture with the corners in it."""
    height, width = grey.shape
    seen = finds(grey)
    if not len(seen.ids):
        others = f" ({seen.strange} markers of its dictionary, none of it)" if seen.strange else ""
        return Picture(path, seen, f"no board found{others}", (width, height))
    bad = ""
    if len(seen.ids) < FEWEST:
        bad = f"{len(seen.ids)} corners, {FEWEST} are needed"
    return Picture(path, seen, bad, (width, height), _contrast(grey, seen.pixel))


def _contrast(grey: Any, pixel: FloatArray) -> float:
    """Return the contrast next to corners, pixel to pixel, the median of the largest."""
    height, width = grey.shape
    steepest = []
    for u, v in pixel.round().astype(int):
        near = grey[max(v - 3, 0) : min(v + 4, height), max(u - 3, 0) : min(u + 4, width)]
        steps = [np.abs(np.diff(near.astype(float), axis=k)) for k in (0, 1)]
        steepest.append(max((each.max(initial=0.0) for each in steps), default=0.0))
    return float(np.median(steepest))


def of_one_size(pictures: list[Picture]) -> list[Picture]:
    """Pictures of another size than most are bad."""
    sizes = [each.size for each in pictures if not each.bad]
    if not sizes:
        return pictures
    usual = max(set(sizes), key=sizes.count)
    off = f"the others {usual[0]} x {usual[1]}"
    return [
        each._replace(bad=f"{each.size[0]} x {each.size[1]}, {off}")
        if not each.bad and each.size != usual
        else each
        for each in pictures
    ]


def of_one_board(
    pictures: list[Picture], board: Board, camera: Camera | None
) -> tuple[list[Picture], FloatArray]:
    """Pictures whose corners are off where a board has them are bad; tilts (P, 3) with a lens.

    By the lens where it is known; else by a projection of a plane, which hardly bends.
    """
    pictures = list(pictures)
    tilts = np.full((len(pictures), 3), np.nan)
    off = np.full(len(pictures), np.nan)
    for i, each in enumerate(pictures):
        if each.bad:
            continue
        places = board.at(each.seen.ids)
        if in_a_line(places, np.zeros(len(places), dtype=np.intp), 1)[0]:
            pictures[i] = each._replace(bad=f"{len(places)} corners in a line tell no turning")
            continue
        if camera is not None:
            one = np.zeros(len(places), dtype=np.intp)
            found = board_poses(places, each.seen.pixel, camera.lens_numbers(), one)
            off[i], tilts[i] = found.rms[0, 0], _normal(found.pose[0, 0])
        else:
            off[i] = _off_a_plane(places, each.seen.pixel)
    known = np.isfinite(off)
    if not known.any():
        return pictures, tilts
    usual = float(np.median(off[known]))
    result = list(pictures)
    for i in np.flatnonzero(known & (off > max(_BENT * usual, _OFF))).tolist():
        why = f"corners are {off[i]:.1f} px off a board, of the others {usual:.1f}: it has moved"
        result[i] = pictures[i]._replace(bad=f"{why}, or numbers of corners are wrong")
        tilts[i] = np.nan
    return result, tilts


def _normal(pose: FloatArray) -> FloatArray:
    normal: FloatArray = orientation.rotations(pose[None, 3:])[0][:, 2]
    return normal


def _off_a_plane(places: FloatArray, pixel: FloatArray) -> float:
    """Root mean square distance of corners from a projection of the board, px."""
    cv2 = opencv()
    plane = places[:, None, :2]
    to_pixel = cv2.findHomography(plane, pixel[:, None])[0]
    if to_pixel is None:
        return float("inf")
    seen = cv2.perspectiveTransform(plane, to_pixel)[:, 0]
    return float(np.sqrt(((seen - pixel) ** 2).sum(axis=1).mean()))


def sharp(pictures: list[Picture]) -> list[Picture]:
    """Blurred pictures are bad."""
    levels = [each.contrast for each in pictures if not each.bad]
    least = _BLURRED * float(np.median(levels)) if levels else 0.0
    return [
        each._replace(bad=f"blurred: contrast {each.contrast:.0f} of {3 * least:.0f}")
        if not each.bad and each.contrast < least
        else each
        for each in pictures
    ]
