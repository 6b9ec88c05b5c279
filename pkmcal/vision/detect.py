"""Corners of a board in a folder of pictures: rows of pixels, and which pictures are bad."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import function, instance, path
from pkmcal.arrays import FloatArray, Int64Array, IntArray
from pkmcal.display import Table, printable
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.csv_writer import WrittenColumn, write_csv
from pkmcal.readings import orientation
from pkmcal.readings.board_poses import board_poses, in_a_line
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera
from pkmcal.result import Result
from pkmcal.vision.detectors import NOTHING, Finder, Seen, finder, opencv
from pkmcal.vision.sheet import Panel, draw

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm")
_FEWEST = 6  # corners of a picture that is taken
_BENT = 5.0  # times what corners of other pictures are off their board, and
_OFF = 0.5  # px at least: moved while it was taken, or corners with wrong numbers
_BLURRED = 1 / 3  # of the median contrast of other pictures
_EDGE = 1 / 8  # of a picture, in which corners tell the distortion
_TILTED = np.radians(5.0)  # between pictures, of a board that is tilted enough to tell the lens


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

    def write(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write a CSV file of image, corner, u and v, as `pkmcal calibrate` reads it.

        Parameters
        ----------
        path : str or path
            The file.
        comment : str
            Lines for its head, each with its ``#``.
        """
        u, v = self.pixel.T
        columns = [
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
                _grey_or_none(each.path),
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
        (``pip install 'pkmcal[vision]'``).
    OSError
        A file cannot be read.
    """
    instance("board", board, Board)
    if camera is not None:
        instance("camera", camera, Camera)
    if progress is not None:
        function("progress", progress)
    paths = _files(images)
    finds = finder(board)
    pictures, contents = list[Picture](), dict[bytes, str]()
    for file in paths:
        content = file.read_bytes()
        first = contents.setdefault(sha256(content).digest(), file.name)
        if first != file.name:
            pictures.append(Picture(file, NOTHING, f"the same picture as {first}"))
        else:
            pictures.append(_picture(file, _grey(file, content), finds))
        if progress is not None:
            progress(len(pictures), len(paths))
    pictures = _of_one_size(pictures)
    pictures, tilts = _of_one_board(pictures, board, camera)
    pictures = _sharp(pictures)
    found = Detection(board, tuple(pictures))
    return replace(found, remarks=tuple(_remarks(found, board, tilts, finds)))


def _files(images: str | PathLike[str] | Iterable[str | PathLike[str]]) -> list[Path]:
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


def _grey(path: Path, content: bytes) -> Any:
    cv2 = opencv()
    image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FileError(f"{path}: this is no picture that can be read")
    return image


def _grey_or_none(path: Path) -> Any:
    return _grey(path, path.read_bytes())


def _picture(path: Path, grey: Any, finds: Finder) -> Picture:
    height, width = grey.shape
    seen = finds(grey)
    if not len(seen.ids):
        others = f" ({seen.strange} markers of its dictionary, none of it)" if seen.strange else ""
        return Picture(path, seen, f"no board found{others}", (width, height))
    bad = ""
    if len(seen.ids) < _FEWEST:
        bad = f"{len(seen.ids)} corners, {_FEWEST} are needed"
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


def _of_one_size(pictures: list[Picture]) -> list[Picture]:
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


def _of_one_board(
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


def _sharp(pictures: list[Picture]) -> list[Picture]:
    """Blurred pictures are bad."""
    levels = [each.contrast for each in pictures if not each.bad]
    least = _BLURRED * float(np.median(levels)) if levels else 0.0
    return [
        each._replace(bad=f"blurred: contrast {each.contrast:.0f} of {3 * least:.0f}")
        if not each.bad and each.contrast < least
        else each
        for each in pictures
    ]


def _remarks(found: Detection, board: Board, tilts: FloatArray, finds: Finder) -> Iterator[str]:
    """List remarks on all pictures together."""
    if not found.taken:
        if _seen_in_a_mirror(found.pictures, finds):
            yield (
                "the pictures are mirrored: the board is found in their mirror images; take them"
                " without mirroring, which no lens describes"
            )
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
    if board.kind == "chessboard" and sum(board.shape) % 2 == 0:
        yield (
            "this chessboard looks alike when it is turned by 180 deg, and corners may be numbered"
            " from either end: print one with an odd and an even side, or a ChArUco board"
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
    for each in pictures:
        if each.bad.startswith("no board"):
            grey = _grey(each.path, each.path.read_bytes())
            return len(finds(np.ascontiguousarray(grey[:, ::-1])).ids) >= _FEWEST
    return False
