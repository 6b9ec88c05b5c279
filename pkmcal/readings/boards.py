"""Printed boards: where their corners are, by the numbers that detectors give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import flag, number, shown
from pkmcal.arrays import BoolArray, FloatArray, Int64Array, IntArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.readings import rows

_MOST = 100_000  # squares, tags or dots of a board, more than any picture tells apart
Print = Literal["chessboard", "charuco", "apriltags", "circles", "points"]
_FORMS = (
    "chessboard:COLUMNSxROWS,SQUARE of inner corners",
    "charuco:COLUMNSxROWS,SQUARE,MARKER,DICTIONARY[,legacy] of squares",
    "apriltags:COLUMNSxROWS,TAG,GAP,FAMILY of tags",
    "circles:COLUMNSxROWS,PITCH of dots",
)


@dataclass(frozen=True, eq=False)
class Board:
    """A board with corners that a camera sees, in axes of the board: x right, y down as printed.

    Made by `chessboard`, `charuco`, `apriltags`, `circles`, `points`, or by `parse` from a word.

    Attributes
    ----------
    kind : str
        What is printed: "chessboard", "charuco", "apriltags", "circles" or "points".
    ids : ndarray of int (n,)
        The number of each corner, as detectors count them.
    places : ndarray (n, 3)
        Where it is, mm.
    shape : (int, int)
        Columns and rows: inner corners of a chessboard, squares of a ChArUco board, tags, dots.
    sizes : tuple of float
        Of a square; of a square and a marker; of a tag and the gap between two; from dot to dot;
        mm.
    dictionary : str
        The markers': "5X5_100", "APRILTAG_36h11" …
    legacy : bool
        Of a ChArUco board, whether it is of OpenCV before 4.6, where an even number of rows begins
        with a marker.

    Examples
    --------
    >>> board = Board.charuco(8, 6, square=20, marker=15, dictionary="5X5_100")
    >>> len(board.ids), board.at([0, 7])
    (35, array([[20., 20.,  0.],
           [20., 40.,  0.]]))
    """

    kind: Print
    ids: Int64Array
    places: FloatArray
    shape: tuple[int, int] = (0, 0)
    sizes: tuple[float, ...] = ()
    dictionary: str = ""
    legacy: bool = False

    @staticmethod
    def chessboard(columns: int, rows: int, square: float) -> Board:
        """Corners between the squares, row by row.

        Parameters
        ----------
        columns, rows : int
            How many inner corners there are along and down. One odd and one even number, or the
            board looks alike when it is turned by 180°. The square at the first corner is black.
        square : float
            Side of a square, mm.
        """
        shape, sizes = _shape(columns, rows, 2), _sizes(square=square)
        return _board("chessboard", _grid(*shape) * square, shape, sizes)

    @staticmethod
    def charuco(
        columns: int,
        rows: int,
        square: float,
        marker: float,
        dictionary: str,
        legacy: bool = False,
    ) -> Board:
        """Corners between the squares of a ChArUco board, counted as OpenCV does.

        Parameters
        ----------
        columns, rows : int
            How many squares there are along and down.
        square, marker : float
            Sides of a square and of the marker in it, mm.
        dictionary : str
            Of the markers, as ``5X5_100``.
        legacy : bool
            Whether it was printed by OpenCV before 4.6.
        """
        shape, sizes = _shape(columns, rows, 3), _sizes(square=square, marker=marker)
        if marker >= square:
            raise ArgumentError(f"marker must be smaller than the square of {square:g} mm")
        places = (_grid(columns - 1, rows - 1) + np.array([1.0, 1.0, 0.0])) * square
        return _board("charuco", places, shape, sizes, dictionary, flag("legacy", legacy))

    @staticmethod
    def apriltags(
        columns: int, rows: int, tag: float, gap: float, family: str = "APRILTAG_36h11"
    ) -> Board:
        """Tags row by row; corner k of tag i is number 4 i + k: from top left on, clockwise.

        Parameters
        ----------
        columns, rows : int
            How many tags there are along and down, numbered from 0.
        tag, gap : float
            Side of a tag, from corner to corner of its black square, and between two tags, mm.
        family : str
            Of the tags, as OpenCV's dictionary calls it.
        """
        shape, sizes = _shape(columns, rows, 1), _sizes(tag=tag, gap=gap)
        own = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * tag
        places = (_grid(*shape)[:, None, :] * (tag + gap) + own).reshape(-1, 3)
        return _board("apriltags", places, shape, sizes, family)

    @staticmethod
    def circles(columns: int, rows: int, pitch: float) -> Board:
        """Dots row by row; one at the lower left that is larger tells how the board is turned.

        It is recognised from 1.4 times the diameter of the others on, 1.5 where they are but 5 px.

        Parameters
        ----------
        columns, rows : int
            How many dots there are along and down.
        pitch : float
            From dot to dot, mm.
        """
        shape, sizes = _shape(columns, rows, 2), _sizes(pitch=pitch)
        return _board("circles", _grid(*shape) * pitch, shape, sizes)

    @staticmethod
    def points(ids: Sequence[int], places: ArrayLike) -> Board:
        """Corners that were measured otherwise, which need not be flat.

        Parameters
        ----------
        ids : sequence of int, n
            The number of each.
        places : (n, 3) array
            Where it is, mm.
        """
        found = rows.numbers("places", places)
        numbers = np.array(ids)
        if found.ndim != 2 or found.shape != (len(numbers), 3) or numbers.dtype.kind not in "iu":
            raise ArgumentError(
                f"places must be three numbers for each of {len(numbers)} ids; found {found.shape}"
            )
        if len(np.unique(numbers)) < len(numbers):
            raise ArgumentError("ids: a corner is given twice")
        return Board("points", numbers.astype(np.int64), found)

    @staticmethod
    def parse(word: str | PathLike[str]) -> Board:
        """Make the board that a word states, or a CSV file of ``corner, x, y, z`` in mm.

        Parameters
        ----------
        word : str or path
            ``chessboard:10x7,20``, ``charuco:8x6,20,15,5X5_100``,
            ``apriltags:6x4,30,9,APRILTAG_36h11``, ``circles:10x7,25``, or the path of a file that
            ends in ``.csv``.

        Raises
        ------
        ValueError
            It is none of these.
        """
        if str(word).lower().endswith(".csv"):
            table = Table(word)
            table.require(["corner", "x", "y", "z"])
            places = table.stacked(["x", "y", "z"], ["mm"] * 3)
            return Board.points(table.integers("corner").tolist(), places)
        kind, _, rest = str(word).partition(":")
        size, *others = rest.split(",")
        try:
            columns, rows_ = (int(each) for each in size.lower().split("x"))
            if kind in ("chessboard", "circles"):
                (first,), second, dictionary, legacy = others, "0", "", False
            else:
                legacy = kind == "charuco" and others[3:] == ["legacy"]
                first, second, dictionary = others[:3] if legacy else others
            length, inner = float(first), float(second)
            if kind not in ("chessboard", "circles", "charuco", "apriltags"):
                raise ValueError(kind)
        except ValueError:
            forms = "; ".join(_FORMS)
            raise ArgumentError(f"board: expected {forms}, in mm; found {shown(word)}") from None
        if kind in ("chessboard", "circles"):
            make = Board.chessboard if kind == "chessboard" else Board.circles
            return make(columns, rows_, length)
        if kind == "charuco":
            return Board.charuco(columns, rows_, length, inner, dictionary, legacy)
        return Board.apriltags(columns, rows_, length, inner, dictionary)

    @property
    def outline(self) -> FloatArray:
        """Places (n, 3), mm, that have to be in a picture in which detectors find all corners.

        Corners and middles of the edges of what is printed, of tags with white around them; of
        points that were measured otherwise the points.
        """
        if self.kind == "points":
            return self.places
        around = self.sizes[1] if self.kind == "apriltags" else self.sizes[0]
        least, most = self.places.min(axis=0)[:2] - around, self.places.max(axis=0)[:2] + around
        shares = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]]) / 2.0
        return np.column_stack([least + shares * (most - least), np.zeros(len(shares))])

    def at(self, ids: ArrayLike) -> FloatArray:
        """Places (N, 3), mm, of corners by their numbers (N,).

        Raises
        ------
        ValueError
            A number that the board does not have.
        """
        places: FloatArray = self.places[self._entries(ids)]
        return places

    def outward_at(self, ids: ArrayLike) -> FloatArray | None:
        """Where corners (N,) are from the middle of their tag (N, 3), length 1; None without tags.

        Raises
        ------
        ValueError
            A number that the board does not have.
        """
        if self.kind != "apriltags":
            return None
        tags = self.places.reshape(-1, 4, 3)
        away = (tags - tags.mean(axis=1, keepdims=True)).reshape(-1, 3)
        ways: FloatArray = away / np.linalg.norm(away, axis=1, keepdims=True)
        return ways[self._entries(ids)]

    def strange(self, ids: ArrayLike) -> BoolArray:
        """Which numbers of corners (N,) the board does not have."""
        return np.asarray(~np.isin(np.atleast_1d(ids), self.ids))

    @property
    def counted(self) -> str:
        """How many corners it has, and their numbers, as messages say it."""
        return f"the board has {len(self.ids)} corners, {self.ids.min()} to {self.ids.max()}"

    def _entries(self, ids: ArrayLike) -> IntArray:
        """Return where corners (N,) stand among `ids`."""
        asked = np.atleast_1d(ids)
        order = np.argsort(self.ids)
        place = np.minimum(np.searchsorted(self.ids, asked, sorter=order), len(order) - 1)
        wrong = self.strange(asked)
        if wrong.any():
            raise ArgumentError(f"corner: {self.counted}; found {asked[wrong][0]}")
        return order[place]


def _board(
    kind: Print,
    places: FloatArray,
    shape: tuple[int, int],
    sizes: tuple[float, ...],
    dictionary: str = "",
    legacy: bool = False,
) -> Board:
    return Board(kind, np.arange(len(places)), places, shape, sizes, dictionary, legacy)


def _grid(columns: int, rows_: int) -> FloatArray:
    """Points (columns · rows, 3) one apart, row by row."""
    y, x = np.mgrid[:rows_, :columns]
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype(np.float64)


def _shape(columns: int, rows_: int, least: int) -> tuple[int, int]:
    for name, given in (("columns", columns), ("rows", rows_)):
        if not isinstance(given, int) or given < least:
            raise ArgumentError(f"{name} must be a whole number from {least} on; found {given!r}")
    if columns * rows_ > _MOST:
        raise ArgumentError(
            f"columns and rows: {columns} x {rows_} are more than {_MOST} on one board; state how"
            " many are printed, not their size"
        )
    return columns, rows_


def _sizes(**given: float) -> tuple[float, ...]:
    for name, value in given.items():
        if not number(name, value) > 0:
            raise ArgumentError(f"{name} must be above 0 mm; found {value!r}")
    return tuple(map(float, given.values()))
