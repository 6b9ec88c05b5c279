"""Corners of a board in a folder of pictures: rows of pixels, and which pictures are bad."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arguments import function, instance
from pkmcal.arrays import FloatArray, Int64Array, IntArray
from pkmcal.display import Table, printable
from pkmcal.files.csv_writer import WrittenColumn, write_csv
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera
from pkmcal.result import Result
from pkmcal.vision.detectors import NOTHING, Finder, family_of, finder, opencv
from pkmcal.vision.pictures import (
    FEWEST,
    Picture,
    brightness,
    files,
    grey,
    looked_at,
    of_one_board,
    of_one_size,
    sharp,
)
from pkmcal.vision.sheet import Panel, draw

_EDGE = 1 / 8  # of a picture, in which corners tell the distortion
_DARK = 1 / 8  # of the range of a picture, beyond which one that was exposed well has levels
_LISTED = 6  # pictures
_TILTED = np.radians(5.0)  # between pictures, of a board that is tilted enough to tell the lens


@dataclass(frozen=True, repr=False)
class Detection(Result):
    """Corners of a board in pictures.

    Attributes
    ----------
    board : Board
        What was looked for.
    pictures : tuple of Picture
        All of them, in the order given.
    remarks : tuple of str
        What of all pictures together should be known before they are used.
    """

    board: Board
    pictures: tuple[Picture, ...]
    remarks: tuple[str, ...] = ()

    @property
    def taken(self) -> tuple[Picture, ...]:
        """Pictures that show the board."""
        return tuple(each for each in self.pictures if not each.bad)

    @property
    def bad(self) -> Mapping[str, str]:
        """Why each of the others is not taken, by its name."""
        return {each.path.name: each.bad for each in self.pictures if each.bad}

    @property
    def image(self) -> IntArray:
        """Picture of each corner, as a place in `taken`, (N,)."""
        return np.repeat(np.arange(len(self.taken)), [len(each.seen.ids) for each in self.taken])

    @property
    def corner(self) -> Int64Array:
        """The number of each corner, (N,)."""
        return np.concatenate([np.empty(0, np.int64), *(each.seen.ids for each in self.taken)])

    @property
    def pixel(self) -> FloatArray:
        """Place of each corner, (N, 2), px."""
        return np.concatenate([np.empty((0, 2)), *(each.seen.pixel for each in self.taken)])

    def write(
        self, path: str | PathLike[str], comment: str = "", *, camera: str = "", board: str = ""
    ) -> None:
        """Write a CSV file of image, corner, u and v, as `pkmcal calibrate` reads it.

        Parameters
        ----------
        path : str or path
            The file.
        comment : str
            Lines for its head, each with its ``#``.
        camera, board : str
            Their names, where there are several; each is a column.
        """
        u, v = self.pixel.T
        columns = [
            WrittenColumn(name, "", np.full(len(u), which))
            for name, which in (("camera", camera), ("board", board))
            if which
        ]
        columns += [
            WrittenColumn(
                "image", "", np.array([each.path.name for each in self.taken])[self.image]
            ),
            WrittenColumn("corner", "", self.corner),
            WrittenColumn("u", "px", u),
            WrittenColumn("v", "px", v),
        ]
        rows = zip(*(each.cells() for each in columns), strict=True)
        write_csv(path, [each.heading for each in columns], rows, comment=comment)

    def draw(self, path: str | PathLike[str]) -> None:
        """Write a PNG file with all pictures, corners marked; those that are bad in red frames."""
        panels = [
            Panel(
                grey(each.path, each.path.read_bytes()),
                each.path.name,
                each.seen.ids,
                each.seen.pixel,
                bool(each.bad),
            )
            for each in self.pictures
        ]
        Path(path).write_bytes(draw(panels))

    def _columns(self) -> Mapping[str, Sequence[Any]]:
        names = [each.path.name for each in self.taken]
        return {
            "image": [names[i] for i in self.image],
            "corner": self.corner.tolist(),
            "u": self.pixel[:, 0].tolist(),
            "v": self.pixel[:, 1].tolist(),
        }

    def _parts(self) -> Iterator[str | Table]:
        count, taken = len(self.pictures), len(self.taken)
        noun = "picture" if count == 1 else "pictures"
        yield f"{taken} of {count} {noun} with {len(self.corner)} corners"
        yield from self.remarks
        for name, why in self.bad.items():
            yield f"{printable(name)}: {why}: left out"


def detect(
    images: str | PathLike[str] | Iterable[str | PathLike[str]],
    board: Board,
    camera: Camera | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Detection:
    """Find the corners of a board in pictures.

    Parameters
    ----------
    images : path or iterable of paths
        Files, or folders, of which all pictures are taken in the order of their names.
    board : Board
        What is printed.
    camera : Camera, optional
        Its lens, by which pictures are judged, and the tilt of the board is said.
    progress : callable, optional
        Called with the number of pictures done and of all.

    Returns
    -------
    Detection
        Corners and pictures that are not taken, with the reason.

    Raises
    ------
    ValueError
        No pictures, two of one name, a board that cannot be found, or OpenCV is not installed
        (``pip install opencv-python-headless``).
    OSError
        A file cannot be read.
    """
    instance("board", board, Board)
    if camera is not None:
        instance("camera", camera, Camera)
    if progress is not None:
        function("progress", progress)
    paths = files(images)
    finds = finder(board)
    pictures, twins = list[Picture](), _twins(paths)
    for file in paths:
        if file in twins:
            pictures.append(Picture(file, NOTHING, f"the same picture as {twins[file]}"))
        else:
            pictures.append(looked_at(file, grey(file, file.read_bytes()), finds))
        if progress is not None:
            progress(len(pictures), len(paths))
    pictures = of_one_size(pictures)
    pictures, tilts = of_one_board(pictures, board, camera)
    pictures = sharp(pictures)
    found = Detection(board, tuple(pictures))
    return replace(found, remarks=tuple(_remarks(found, board, tilts, finds)))


def _twins(paths: Sequence[Path]) -> dict[Path, str]:
    """Files of the same bytes as others, with the name of one: of which joints it is none tells."""
    alike = dict[bytes, list[Path]]()
    for file in paths:
        alike.setdefault(sha256(file.read_bytes()).digest(), []).append(file)
    several = [each for each in alike.values() if len(each) > 1]
    return {file: each[file == each[0]].name for each in several for file in each}


def _remarks(found: Detection, board: Board, tilts: FloatArray, finds: Finder) -> Iterator[str]:
    """List remarks on all pictures together."""
    if not found.taken:
        if _seen_in_a_mirror(found.pictures, finds):
            yield (
                "the pictures are mirrored: the board is found in their mirror images; take them"
                " without mirroring, which no lens describes"
            )
        elif _seen_exchanged(found.pictures, board):
            columns, rows = board.shape
            yield (
                f"a board of {rows}x{columns} is found: state the columns before the rows, as they"
                " were printed"
            )
        elif board.dictionary and (family := _family(found.pictures)):
            kind = family.rpartition("_")[0]
            own = board.dictionary == family or (
                board.dictionary.startswith(f"{kind}_") and "X" in kind
            )
            asked = "shape, and the order of its markers," if own else "dictionary"
            yield (
                f"markers of {family} are found, but no board of {board.shape[0]}x{board.shape[1]}"
                f" with {board.dictionary}: state the {asked} that was printed"
            )
        elif dark := _dark(found.pictures):
            yield dark
        return
    pixel, size = found.pixel, np.array(found.taken[0].size)
    hulls = [_area(each.seen.pixel) for each in found.taken]
    said = f"the board fills {100 * np.median(hulls) / size.prod():.0f} % of a picture"
    if np.isfinite(tilts).any():
        angles, between = _tilts(tilts[np.isfinite(tilts).all(axis=1)])
        said += f", tilted by {np.degrees(angles.min()):.0f} to {np.degrees(angles.max()):.0f} deg"
        if between < _TILTED and len(found.taken) > 1:
            yield (
                f"all pictures show the board tilted alike, within {np.degrees(between):.2g} deg:"
                " they hardly tell how the machine turns; tilt it by 10 deg and more about two axes"
            )
    yield said
    edge = (pixel < _EDGE * size) | (pixel > (1 - _EDGE) * size)
    if not edge.any():
        yield "no corner is near the edge of a picture: distortion is told badly"
    either = [each.path.name for each in found.taken if each.seen.either]
    if either and board.kind == "chessboard":
        yield (
            "this chessboard looks alike when it is turned by 180 deg, and corners may be numbered"
            " from either end: print one with an odd and an even side, or a ChArUco board"
        )
    elif either:
        yield _without_large_dot(either, len(found.taken))


def _without_large_dot(names: Sequence[str], count: int) -> str:
    """Say that dots may be numbered from either end in pictures of these names."""
    which = ", ".join(map(printable, names[:_LISTED])) + " …" * (len(names) > _LISTED)
    some = "" if len(names) == count else f" ({which})"
    return (
        f"in {len(names)} of {count} pictures no dot at the lower left is seen to be larger than"
        f" the others{some}: the board looks alike when it is turned by 180 deg, and dots may be"
        " numbered from either end: print that dot 1.7 times as large as the others, as pkmcal"
        " board does, or a ChArUco board"
    )


def _tilts(normals: FloatArray) -> tuple[FloatArray, float]:
    """Angles from the line of sight, and the largest between two pictures."""
    angles = np.arccos(np.clip(np.abs(normals[:, 2]), 0.0, 1.0))
    cosines = np.clip(normals @ normals.T, -1.0, 1.0)
    return angles, float(np.arccos(cosines.min()))


def _area(pixel: FloatArray) -> float:
    cv2 = opencv()
    return float(cv2.contourArea(cv2.convexHull(pixel.astype(np.float32))))


def _seen_in_a_mirror(pictures: Sequence[Picture], finds: Finder) -> bool:
    """Return whether the first picture that shows no board shows one from behind."""
    return _first_shows(pictures, lambda levels: finds(np.ascontiguousarray(levels[:, ::-1])))


def _seen_exchanged(pictures: Sequence[Picture], board: Board) -> bool:
    """Return whether the first picture that shows no board shows one of as many rows as columns."""
    other = replace(board, shape=board.shape[::-1])
    return other.shape != board.shape and _first_shows(pictures, finder(other))


def _family(pictures: Sequence[Picture]) -> str:
    """The dictionary of the markers in the first picture that shows no board; "" of none."""
    for each in pictures:
        if each.bad.startswith("no board"):
            return family_of(grey(each.path, each.path.read_bytes()))
    return ""


def _dark(pictures: Sequence[Picture]) -> str:
    """Say that the first picture that shows no board is dark; "" where it is not."""
    for each in pictures:
        if each.bad.startswith("no board"):
            largest, most = brightness(each.path, each.path.read_bytes())
            if largest >= _DARK * most:
                return ""
            why = (
                "pictures of 10 or 12 bits in files of 16 have to be stretched to the whole range"
                if most > 255
                else "expose them longer"
            )
            return (
                f"{printable(each.path.name)} is dark, with levels up to {largest} of {most}: {why}"
            )
    return ""


def _first_shows(pictures: Sequence[Picture], finds: Finder) -> bool:
    """Return whether corners are found in the first picture that shows no board."""
    for each in pictures:
        if each.bad.startswith("no board"):
            return len(finds(grey(each.path, each.path.read_bytes())).ids) >= FEWEST
    return False
