"""Pictures of boards: where each shows its board, and where the machine says that it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.readings.board_poses import FEWEST, in_a_line


@dataclass(frozen=True)
class Picture:
    """A picture of a board beside what a calibration says of it.

    Attributes
    ----------
    row : int
        The first row of the picture, in its measurements.
    corners : int
        How many were read.
    distance : float
        From the camera to the middle of these corners, mm.
    tilt : float
        Between the line of sight and the normal of the board, rad.
    mm_per_pixel : float
        At the middle of the corners, across the line of sight.
    across, along : float
        How far the board is seen from where the machine says that it is, across the line of sight
        and along it, mm; NaN of a picture that does not tell it.
    turned : float
        And how far it is turned, rad.
    off : float
        Distance of the corners from where they are then expected, rms, px: what no place of the
        board explains.
    off_commanded : float
        Distance from where the machine says that they are, rms, px.
    """

    row: int
    corners: int
    distance: float
    tilt: float
    mm_per_pixel: float
    across: float
    along: float
    turned: float
    off: float
    off_commanded: float


def pictures(
    picture: IntArray,
    board: FloatArray,
    corner: FloatArray,
    by_motion: FloatArray,
    off: FloatArray,
    focal: float,
) -> list[Picture]:
    """List pictures in the order of their first rows.

    Parameters
    ----------
    picture : ndarray of int (N,)
        Which picture each row is of.
    board : ndarray (N, 4, 4)
        The board in axes of the camera, as the machine says.
    corner : ndarray (N, 3)
        In axes of the board, mm.
    by_motion : ndarray (N, 2, 6)
        Derivative of pixels to a twist of the board at the camera.
    off : ndarray (N, 2)
        Pixels less those that the machine says.
    focal : float
        Focal length, px.
    """
    found = []
    for each in dict.fromkeys(picture.tolist()):
        mine = np.flatnonzero((picture == each) & np.isfinite(off).all(axis=1))
        first = int(np.argmax(picture == each))
        if not len(mine):
            found.append(Picture(first, 0, *[float("nan")] * 8))
            continue
        motion = board[mine[0]]
        at = motion[:3, :3] @ corner[mine].mean(axis=0) + motion[:3, 3]
        distance = float(np.linalg.norm(at))
        sight = at / distance
        tilt = float(np.arccos(np.clip(abs(sight @ motion[:3, 2]), 0.0, 1.0)))
        across = along = turned = rest = float("nan")
        one = np.zeros(len(mine), dtype=np.intp)
        if len(mine) >= FEWEST and not in_a_line(corner[mine], one, 1)[0]:
            rates, seen = by_motion[mine].reshape(-1, 6), off[mine].ravel()
            size = np.linalg.norm(rates, axis=0)
            twist = np.linalg.lstsq(rates / size, seen, rcond=None)[0] / size
            moved = twist[3:] + np.cross(twist[:3], at)
            along = float(moved @ sight)
            across = float(np.linalg.norm(moved - along * sight))
            turned = float(np.linalg.norm(twist[:3]))
            rest = _rms(seen - rates @ twist)
        found.append(
            Picture(
                first, len(mine), distance, tilt, float(at[2]) / focal, across, along, turned, rest,
                _rms(off[mine].ravel()),
            )
        )  # fmt: skip
    return found


def of_pictures_that_are_fitted(
    actuators: FloatArray, corner: FloatArray, fitted: FloatArray, fitted_corner: FloatArray
) -> str:
    """Say that corners to be held out are of pictures of which others are fitted; "" if not.

    Of a picture taken again at these actuators (N, n) the same corners (N, 3) are fitted as well.
    """
    places = {row.tobytes() for row in fitted}
    known = {row.tobytes() for row in np.hstack([fitted, fitted_corner])}
    both = np.hstack([actuators, corner])
    there = np.array([row.tobytes() in places for row in actuators])
    again = np.array([row.tobytes() in known for row in both])
    if not there.any() or again.any():
        return ""
    return (
        f"{int(there.sum())} rows are corners of pictures whose other corners are fitted: all share"
        " the pose and its error, and agree however good the machine is; hold out whole pictures"
    )


def _rms(off: FloatArray) -> float:
    """Distance in the picture, rms, of corners whose two numbers are off by these."""
    return float(np.sqrt(2.0 * np.mean(off**2)))
