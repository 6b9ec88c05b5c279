"""The camera of a plan, where its options say that it is to be."""

from __future__ import annotations

from typing import get_args

import numpy as np

from pkmcal import screw
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.jobs.plan import Planning
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera, Mount


def planned_camera(job: Planning) -> Camera:
    """The camera that is to take pictures of a board, where it is to be.

    A board on the platform has its middle at the platform's origin and faces the camera.

    Raises
    ------
    ValueError
        An option is missing or is none of these.
    """
    lens, at = job.camera, job.camera_at
    if lens is None or job.board is None or at is None or job.look_at is None:
        raise ArgumentError(
            "--kind pixel: state --camera FILE, --board BOARD, --camera-at X,Y,Z and"
            " --look-at X,Y,Z"
        )
    seen = Board.parse(job.board)
    middle = 0.5 * (seen.places.max(axis=0) + seen.places.min(axis=0))
    aim = _numbers("--look-at", job.look_at, (3,))
    if word("--camera-on", job.camera_on, get_args(Mount)) == "base":
        eye = _numbers("--camera-at", at, (3,))
        stands = looking(eye, aim)
        up = _laid(np.zeros(3), np.pi if eye[2] > aim[2] else 0.0, middle)
        own = Camera.from_file(lens, on="base", stands=screw.to_pose(stands))
        return own.with_fields({"carried": screw.to_pose(up), "board": seen})
    pose = np.append(_numbers("--camera-at", at, (3, 6)), np.zeros(3))[:6]
    pose[3:] = np.radians(pose[3:])
    lying = screw.to_pose(np.linalg.inv(_laid(aim, np.pi, middle)))
    return Camera.from_file(lens, on="platform", stands=lying, carried=pose, board=seen)


def _numbers(option: str, text: str, counts: tuple[int, ...]) -> FloatArray:
    try:
        found = np.array([typed(each) for each in text.split(",")])
    except ValueError:
        found = np.empty(0)
    if len(found) not in counts or not np.isfinite(found).all():
        wanted = " or ".join(map(str, counts))
        raise ArgumentError(f"{option} {text}: expected {wanted} numbers, in mm and deg")
    return found


def _laid(place: FloatArray, turn: float, middle: FloatArray) -> FloatArray:
    """A board (4, 4), turned about x, whose middle is at a place."""
    motion = screw.from_pose(np.array([0.0, 0.0, 0.0, turn, 0.0, 0.0]))
    motion[:3, 3] = place - motion[:3, :3] @ middle
    return motion


def looking(eye: FloatArray, at: FloatArray) -> FloatArray:
    """The base (4, 4) in axes of a camera that looks at a point, its x level."""
    away = at - eye
    if not np.linalg.norm(away) > 0.0:
        raise ArgumentError("--look-at: the camera is at this point")
    ahead = away / np.linalg.norm(away)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-9:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    motion = np.eye(4)
    motion[:3, :3] = [right, np.cross(ahead, right), ahead]
    motion[:3, 3] = -motion[:3, :3] @ eye
    return motion
