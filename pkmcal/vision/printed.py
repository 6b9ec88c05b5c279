"""A board as it is printed."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from pkmcal import arguments
from pkmcal.arguments import instance, number
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.boards import Board
from pkmcal.vision.detectors import charuco_board, dictionary, opencv

_WHITE = 255
_PER_MM = 20  # pixels, of a file
_LARGE = 1.7  # times the diameter of the other dots
_ONE_INCH = 25.4  # mm


def board_image(board: Board, per_mm: float, margin: float = 0.0) -> Any:
    """Draw a board.

    Parameters
    ----------
    board : Board
        Any but one of points.
    per_mm : float
        Pixels a mm. A square of a ChArUco board should be a whole number of them.
    margin : float
        White around it, mm.

    Returns
    -------
    ndarray of uint8 (height, width)
        Grey levels. The board's origin is at `margin` from the left and the top; of a chessboard
        and of dots, one square more.
    """
    number("per_mm", per_mm, above=0.0)
    (columns, rows), length = board.shape, board.sizes
    edge = round(margin * per_mm)
    if board.kind == "charuco":
        size = (round(columns * length[0] * per_mm), round(rows * length[0] * per_mm))
        drawn = charuco_board(board).generateImage(size, marginSize=0)
    elif board.kind == "chessboard":
        y, x = np.mgrid[: rows + 1, : columns + 1]
        side = round(length[0] * per_mm)
        drawn = np.kron(np.where((x + y) % 2, _WHITE, 0), np.ones((side, side)))
    elif board.kind == "apriltags":
        drawn = _tags(board, per_mm)
    elif board.kind == "circles":
        drawn = _dots(board, per_mm)
    else:
        raise ArgumentError("board: points that were measured otherwise cannot be printed")
    return np.pad(np.asarray(drawn, dtype=np.uint8), edge, constant_values=_WHITE)


def print_board(board: Board, path: str | PathLike[str], margin: float = 10.0) -> None:
    """Write a board in its true size, as PDF, SVG or PNG by the name of the file.

    Parameters
    ----------
    board : Board
        Any but one of points.
    path : str or path
        The file.
    margin : float
        White around it, mm.
    """
    instance("board", board, Board)
    number("margin", margin, least=0.0)
    file = arguments.path("path", path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # 0.2 s
    from matplotlib.figure import Figure

    image = board_image(board, _PER_MM, margin)
    height, width = image.shape
    figure = Figure(figsize=(width / _PER_MM / _ONE_INCH, height / _PER_MM / _ONE_INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image, cmap="gray", vmin=0, vmax=_WHITE, interpolation="none", aspect="auto")
    axes.set_axis_off()
    figure.savefig(file, dpi=_PER_MM * _ONE_INCH)


def _tags(board: Board, per_mm: float) -> Any:
    """Tags on white, the first at the origin."""
    aruco, (columns, rows), (tag, gap) = opencv().aruco, board.shape, board.sizes
    markers, side = dictionary(board), round(tag * per_mm)
    extent = [round((n * (tag + gap) - gap) * per_mm) for n in (rows, columns)]
    drawn = np.full(extent, _WHITE, dtype=np.uint8)
    for i in range(columns * rows):
        top, left = (round(n * (tag + gap) * per_mm) for n in divmod(i, columns))
        drawn[top : top + side, left : left + side] = aruco.generateImageMarker(markers, i, side)
    return drawn


def _dots(board: Board, per_mm: float) -> Any:
    """Dots of half the pitch, the one at the lower left larger, one pitch from the edges."""
    (columns, rows), pitch = board.shape, board.sizes[0] * per_mm
    y, x = np.mgrid[: round((rows + 1) * pitch), : round((columns + 1) * pitch)] + 0.5
    column, row = (np.clip(np.round(each / pitch), 1, n) for each, n in ((x, columns), (y, rows)))
    across = np.where((column == 1) & (row == rows), _LARGE, 1.0) * pitch / 2
    black = np.hypot(x - column * pitch, y - row * pitch) < across / 2
    return np.where(black, 0, _WHITE)
