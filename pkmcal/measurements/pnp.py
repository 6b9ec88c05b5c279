"""Poses that somebody's own software found of a board in pictures (PnP), and how sure each is.

Such a pose is a hundred times surer across the line of sight than along it, and its angles than
they would be from afar: weighted alike, as software for hand and eye does, the rows tell a machine
several times less than the pictures did. Which way each is sure follows from the pose itself: from
pixels of a board of stand-in corners that a stand-in camera sees there.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arguments import instance, number, whole, word
from pkmcal.arrays import FloatArray
from pkmcal.core import instruments, screws
from pkmcal.exceptions import ArgumentError, CalibrationWarning
from pkmcal.measurements.inverted import inverted
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings import twists
from pkmcal.readings.boards import Board
from pkmcal.readings.rows import numbers

_CORNERS = 25  # of a stand-in board of which nobody says how many it has
_DRAWN = 400  # at most, of a board with more
_BESIDE = 0.5  # of a board's larger side, within which lines of sight tell where its middle is
_SLANTING = np.radians(75.0)  # from the normal of the board, of lines of sight that end on it


def from_pnp(
    measurements: Measurements,
    focal: float,
    board: Board | Sequence[float],
    *,
    on: str = "base",
    noise: float = 1.0,
    corners: int | None = None,
) -> Measurements:
    """State of poses from pictures how sure each is, as measurements with covariances.

    Parameters
    ----------
    measurements : Measurements
        Of kind "pose": the board in axes of the camera (z forward, x right, y down), as
        ``solvePnP`` and the like find it; of a camera on the platform as `read_measurements` with
        ``on="platform"`` reads them.
    focal : float
        Focal length of the camera, px.
    board : Board, (width, height) or (width, height, x, y)
        What it saw; of an unknown board its size and where its middle is on it, mm: half the size
        where poses are of its corner, 0, 0 where they are of its middle. Without that it is where
        the lines of sight meet the plane z = 0, of a camera that was pointed at the board.
    on : {"base", "platform"}
        What the camera is fixed to; the board is on the other. On the platform the poses are
        turned round: frame and tool are the base and the camera in axes of the board.
    noise : float
        Standard deviation of a corner, px, of all alike. `Identification.chi2_per_dof` says by how
        much it is wrong: its square root times this is right.
    corners : int, optional
        How many corners each pose was found from, 4 or more, where the size of a board is given: 4
        of one tag. Without it 25: where they were 50 of the stated `noise`, σ is 1.35 times too
        large, and where they were 4, 2 times too small.

    Returns
    -------
    Measurements
        Poses with `sigma` (N, 6, 6), for ``identify(unknown=["frame", "target"])``.

    Raises
    ------
    ValueError
        Other readings; a board that is not before the camera; a size, a focal length or a noise
        that is not above 0; fewer than 4 corners, or a number of those of a `Board`.

    Warns
    -----
    CalibrationWarning
        Lines of sight do not tell where on the board its middle is.

    Examples
    --------
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> seen = pk.Measurements([[500] * 6], [[10, -5, 900, 0.1, 0.05, 0]], "pose")
    >>> sigma = pk.from_pnp(seen, 1500, (160, 120), noise=0.3).sigma
    >>> np.sqrt(np.diagonal(sigma[0])[:3]).round(3)  # along the line of sight it is worst
    array([0.046, 0.041, 0.589])
    """
    m = instance("measurements", measurements, Measurements)
    word("on", on, ("base", "platform"))
    for name, value in (("focal", focal), ("noise", noise)):
        number(name, value, above=0.0)
    if m.kind != "pose":
        raise ArgumentError(f"measurements: expected poses of a board, found kind {m.kind!r}")
    read = np.isfinite(m.values).all(axis=1)
    if not read.any():
        raise ArgumentError("measurements: no pose was read in full")
    behind = np.flatnonzero(read & ~(m.values[:, 2] > 0.0))
    if len(behind):
        row = int(behind[0])
        raise ArgumentError(
            f"measurements: in {len(behind)} of {int(read.sum())} rows the board is not before the"
            f" camera (row {row}: z {m.values[row, 2]:.6g} mm): poses have to be those of the board"
            " in axes of the camera; --invert-poses (invert_poses=True) is for a file that has"
            " those of the camera in axes of the board, and for no other"
        )
    pose = np.ascontiguousarray(m.values[read])
    places = _corners(pose, board, corners)
    drawn_for_each = len(places) / (corners or len(places))
    sigma = np.tile(np.eye(6), (len(m), 1, 1))
    sigma[read] = _covariances(pose, places, focal) * noise**2 * drawn_for_each
    stated = replace(m, sigma=sigma)
    return stated if on == "base" else inverted(stated)


def _corners(pose: FloatArray, board: Board | Sequence[float], count: int | None) -> FloatArray:
    """Corners (K, 3) in axes of the board; of a size about as many as are stated."""
    if isinstance(board, Board):
        if count is not None:
            raise ArgumentError("corners: a Board has its own; state them with the size of one")
        return board.places
    if count is not None:
        whole("corners", count, least=4)
    size = numbers("board", board)
    if size.shape not in ((2,), (4,)) or not (size[:2] > 0.0).all():
        raise ArgumentError(
            "board must be its width and height in mm, above 0, and perhaps x and y of its middle;"
            f" found {board!r}"
        )
    along, down = (np.linspace(-0.5, 0.5, n) for n in _grid(size, count))
    x, y = np.meshgrid(along * size[0], down * size[1])
    middle = size[2:] if len(size) == 4 else _middle(pose, size)
    return np.column_stack([x.ravel() + middle[0], y.ravel() + middle[1], np.zeros(x.size)])


def _grid(size: FloatArray, count: int | None) -> tuple[int, int]:
    """Columns and rows of about `count` corners as far apart along as down; 5 of each without."""
    if count is None:
        count, long = _CORNERS, 1.0
    else:
        count, long = min(count, _DRAWN), float(size[0] / size[1])
    # rows of (rows - 1) long + 1 corners each
    rows = (long - 1.0 + np.sqrt((long - 1.0) ** 2 + 4.0 * long * count)) / (2.0 * long)
    rows = max(2, round(rows))
    return max(2, round(count / rows)), rows


def _middle(pose: FloatArray, size: FloatArray) -> FloatArray:
    """Point of a board (2,) of some size, the median, where lines of sight meet its plane.

    Its origin where none does. A board elsewhere is wrong by much: how far off a pose is turns
    about the middle of what was seen.
    """
    camera = np.linalg.inv(screws.frames(pose))
    eye, ahead = camera[:, :3, 3], camera[:, :3, 2]
    meets = np.abs(ahead[:, 2]) > np.cos(_SLANTING)
    if not meets.any():
        return np.zeros(2)
    eye, ahead = eye[meets], ahead[meets]
    every = (eye - ahead * (eye[:, 2] / ahead[:, 2])[:, None])[:, :2]
    found: FloatArray = np.median(every, axis=0)
    away = float(np.median(np.linalg.norm(every - found, axis=1)))
    if away > _BESIDE * float(size.max()):
        warnings.warn(
            f"board: where its middle is nobody knows: lines of sight meet its plane {away:.3g} mm"
            f" about a point, and it is {size[0]:g} x {size[1]:g} mm; state x and y of its middle"
            " as well (middle=XxY), half the size where poses are of its corner, 0 and 0 where they"
            " are of its middle",
            CalibrationWarning,
            stacklevel=4,  # of who calls `from_pnp`
        )
    return found


def _covariances(pose: FloatArray, corners: FloatArray, focal: float) -> FloatArray:
    """Covariances (N, 6, 6) of x y z α β γ, of corners seen with 1 px of noise."""
    count, each = len(pose), len(corners)
    lens = np.array([focal, focal, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    _, by_motion, _, _, depth = instruments.pixels(
        np.repeat(pose, each, axis=0), np.tile(corners, (count, 1)), lens
    )
    if not (depth > 0.0).all():
        row = int(np.argmin(depth)) // each
        raise ArgumentError(
            f"measurements: a part of the board is not before the camera in row {row}: the board is"
            " smaller, or nearer where the camera looks"
        )
    rates = by_motion.reshape(count, 2 * each, 6) @ twists.twists_of_numbers(pose)
    size = np.linalg.norm(rates, axis=1)
    triangle = np.linalg.qr(rates / size[:, None, :], mode="r")
    root = np.linalg.inv(triangle) / size[:, :, None]
    found: FloatArray = root @ root.transpose(0, 2, 1)
    return found
