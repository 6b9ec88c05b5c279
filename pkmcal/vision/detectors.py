"""Corners of printed boards in one picture, by OpenCV, to some hundredths of a pixel.

(0, 0) is the centre of the first pixel. Corners of ChArUco boards and chessboards are refined once
more, which halves what they scatter. Tags are found by pupil-apriltags where it is installed: four
times as well as by OpenCV, and half a pixel off, for its (0, 0) is the corner of the first pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.boards import Board

_WINDOW = 5  # half the side of the square in which a corner is refined, px
_SHARE = 0.25  # of the way to the next corner that it may reach
_LARGER = 1.25  # times its neighbours, of a dot that tells how the board is turned; others: 1.1
# Each holds its smaller ones; the least of AprilTags is found in noise.
_FAMILIES = (
    "4X4_1000", "5X5_1000", "6X6_1000", "7X7_1000", "ARUCO_ORIGINAL", "APRILTAG_25h9",
    "APRILTAG_36h10", "APRILTAG_36h11",
)  # fmt: skip
_MARKERS = 6  # of one dictionary, that no noise has
_PUPIL = (1, 0, 3, 2)  # its order of a tag's corners, as a tag of OpenCV is drawn


class Seen(NamedTuple):
    """Corners of a board in one picture.

    Attributes
    ----------
    ids : ndarray of int (k,)
        Corners.
    pixel : ndarray (k, 2)
        Where they are.
    strange : int
        Markers of the board's dictionary that it does not have.
    either : bool
        Whether corners may be counted from either end: it looks alike turned by 180 degrees.
    """

    ids: Int64Array
    pixel: FloatArray
    strange: int = 0
    either: bool = False


NOTHING = Seen(np.empty(0, dtype=np.int64), np.empty((0, 2)))
Finder = Callable[[Any], Seen]


def opencv() -> Any:
    """Import OpenCV, or say how it is installed.

    Raises
    ------
    ValueError
        It is not installed.
    """
    try:
        return import_module("cv2")
    except ImportError:
        raise ArgumentError(
            "boards in pictures take OpenCV 4.8 or later: pip install opencv-python-headless"
        ) from None


def finder(board: Board) -> Finder:
    """Return a detector of corners for a picture (height, width) of grey levels.

    Raises
    ------
    ValueError
        Nothing can: a board of points, an unknown dictionary, OpenCV is not installed.
    """
    makers = {
        "chessboard": _chessboard, "charuco": _charuco, "apriltags": _apriltags,
        "circles": _circles,
    }  # fmt: skip
    if board.kind not in makers:
        raise ArgumentError(
            "board: points that were measured otherwise cannot be found in pictures; state the"
            " board that is printed"
        )
    return makers[board.kind](board)


def dictionary(board: Board) -> Any:
    """OpenCV's dictionary of a board's markers."""
    aruco = opencv().aruco
    known = {name[5:]: name for name in dir(aruco) if name.startswith("DICT_")}
    if board.dictionary not in known:
        hint = did_you_mean(board.dictionary, known)
        raise ArgumentError(f"board: OpenCV has no dictionary {board.dictionary!r}{hint}")
    return aruco.getPredefinedDictionary(getattr(aruco, known[board.dictionary]))


def family_of(grey: Any) -> str:
    """The dictionary of most markers in a picture; "" where no six are of one."""
    aruco, counts = opencv().aruco, dict[str, int]()
    for family in _FAMILIES:
        known = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{family}"))
        ids = aruco.ArucoDetector(known).detectMarkers(grey)[1]
        counts[family] = 0 if ids is None else len(set(np.ravel(ids).tolist()))
    most = max(counts, key=lambda each: counts[each])
    return most if counts[most] >= _MARKERS else ""


def charuco_board(board: Board) -> Any:
    """OpenCV's ChArUco board."""
    made = opencv().aruco.CharucoBoard(board.shape, *board.sizes, dictionary(board))
    made.setLegacyPattern(board.legacy)
    return made


def _chessboard(board: Board) -> Finder:
    cv2, (columns, rows) = opencv(), board.shape
    cells, alike = _centres_of_squares(columns, rows), (columns + rows) % 2 == 0

    def found(grey: Any) -> Seen:
        ok, corners = cv2.findChessboardCorners(grey, board.shape)
        if not ok:
            ok, corners = cv2.findChessboardCornersSB(grey, board.shape)
        if not ok:
            return NOTHING
        pixel = _refined(grey, corners.reshape(-1, 2))
        if not alike and _is_turned(grey, board, pixel, cells):
            pixel = pixel[::-1].copy()
        return Seen(board.ids.copy(), pixel, either=alike)

    return found


def _charuco(board: Board) -> Finder:
    made = charuco_board(board)
    detector = opencv().aruco.CharucoDetector(made)
    own = set(np.ravel(made.getIds()).tolist())
    square, marker = board.sizes[:2]
    share = min(_SHARE, 0.5 * (1.0 - marker / square))  # beyond it are the markers' own edges

    def found(grey: Any) -> Seen:
        corners, ids, _, markers = detector.detectBoard(grey)
        strange = 0 if markers is None else len(set(np.ravel(markers).tolist()) - own)
        if ids is None or not len(ids):
            return NOTHING._replace(strange=strange)
        pixel = _refined(grey, corners.reshape(-1, 2), share)
        return Seen(np.ravel(ids).astype(np.int64), pixel, strange)

    return found


def _apriltags(board: Board) -> Finder:
    family, count = board.dictionary, board.shape[0] * board.shape[1]
    markers = _by_pupil(family) if family.startswith("APRILTAG") else None
    markers = markers or _by_opencv(board)

    def found(grey: Any) -> Seen:
        seen = markers(grey)
        own = sorted((tag, corners) for tag, corners in seen if tag < count)
        if not own:
            return NOTHING._replace(strange=len(seen))
        ids = np.array([4 * tag + k for tag, _ in own for k in range(4)], dtype=np.int64)
        return Seen(ids, np.concatenate([c for _, c in own]), len(seen) - len(own))

    return found


Markers = Callable[[Any], "list[tuple[int, FloatArray]]"]  # numbers and corners (4, 2)


@lru_cache
def _by_pupil(family: str) -> Markers | None:
    """Tags by pupil-apriltags; None where it is not installed."""
    try:
        pupil = import_module("pupil_apriltags")
    except ImportError:
        return None
    detector = pupil.Detector(families="tag" + family.partition("_")[2].lower(), quad_decimate=1.0)

    def found(grey: Any) -> list[tuple[int, FloatArray]]:
        tags = detector.detect(np.ascontiguousarray(grey))
        return [(int(tag.tag_id), tag.corners[list(_PUPIL)] - 0.5) for tag in tags]

    return found


def _by_opencv(board: Board) -> Markers:
    """Tags by OpenCV, whose AprilTag refinement puts them half a pixel off and is not used."""
    aruco = opencv().aruco
    how = aruco.DetectorParameters()
    how.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
    detector = aruco.ArucoDetector(dictionary(board), how)

    def found(grey: Any) -> list[tuple[int, FloatArray]]:
        corners, ids, _ = detector.detectMarkers(grey)
        pairs = zip([] if ids is None else np.ravel(ids), corners, strict=True)
        return [(int(tag), np.asarray(four, dtype=np.float64).reshape(4, 2)) for tag, four in pairs]

    return found


def _circles(board: Board) -> Finder:
    cv2, (columns, rows) = opencv(), board.shape
    how = cv2.SimpleBlobDetector_Params()

    def found(grey: Any) -> Seen:
        how.maxArea = grey.size / len(board.ids)
        blobs = cv2.SimpleBlobDetector_create(how)
        ok, dots = cv2.findCirclesGrid(grey, board.shape, None, cv2.CALIB_CB_SYMMETRIC_GRID, blobs)
        if not ok:
            return NOTHING
        grid = np.asarray(dots, dtype=np.float64).reshape(rows, columns, 2)
        points = blobs.detect(grey)
        place, size = np.array([p.pt for p in points]), np.array([p.size for p in points])
        own = np.linalg.norm(grid[:, :, None] - place, axis=3).argmin(axis=2)
        grid, told = _large_dot_low(grid, size[own])
        return Seen(board.ids.copy(), grid.reshape(-1, 2), either=not told)

    return found


def _large_dot_low(grid: FloatArray, size: FloatArray) -> tuple[FloatArray, bool]:
    """Turn the grid (rows, columns, 2) to have a dot at a corner that is larger lower left.

    Returns whether there is one.
    """
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] < along[1] * down[0]:  # counted upwards
        grid, size = grid[::-1], size[::-1]
    ways = [0, 1, 2, 3] if grid.shape[0] == grid.shape[1] else [0, 2]
    turned = [(np.rot90(grid, way), np.rot90(size, way)) for way in ways]
    larger = [dots[-1, 0] / np.median([dots[-2, 0], dots[-1, 1]]) for _, dots in turned]
    best = int(np.argmax(larger))
    told = bool(larger[best] > _LARGER)
    return (turned[best][0] if told else grid), told


def _refined(grey: Any, pixel: Any, share: float = _SHARE) -> FloatArray:
    """Corners between squares to hundredths of a pixel, in a window that holds nothing else.

    The window reaches `share` of the way to the next corner.
    """
    cv2 = opencv()
    away = np.linalg.norm(pixel[:, None] - pixel[None], axis=2)
    np.fill_diagonal(away, np.inf)
    window = int(np.clip(np.rint(share * away.min(initial=np.inf)), 2, _WINDOW))
    corners = pixel.reshape(-1, 1, 2).astype(np.float32)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    cv2.cornerSubPix(grey, corners, (window, window), (-1, -1), until)
    return np.asarray(corners.reshape(-1, 2), dtype=np.float64)


def _centres_of_squares(columns: int, rows: int) -> tuple[FloatArray, Any]:
    """Centres between inner corners, one apart, and which are black: those as the first corner's.

    The square before the first corner, and so that behind it, is black.
    """
    y, x = (each.ravel() for each in np.mgrid[: rows - 1, : columns - 1])
    return np.column_stack([x + 0.5, y + 0.5]), (x + y) % 2 == 0


def _is_turned(grey: Any, board: Board, pixel: FloatArray, cells: tuple[FloatArray, Any]) -> bool:
    """Return whether the black squares are lighter than the others: turned by 180 degrees."""
    cv2, (centres, black) = opencv(), cells
    plane = (board.places / board.sizes[0])[:, None, :2]
    to_pixel = cv2.findHomography(plane, pixel[:, None])[0]
    at = cv2.perspectiveTransform(centres[:, None], to_pixel).reshape(-1, 2).round().astype(int)
    height, width = grey.shape
    level = grey[at[:, 1].clip(0, height - 1), at[:, 0].clip(0, width - 1)].astype(float)
    return bool(np.mean(level[black]) > np.mean(level[~black]))
