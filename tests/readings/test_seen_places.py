"""Small flat boards look alike at two places: which one it is, all pictures together tell."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import chained
from pkmcal.core import instruments, screws
from pkmcal.readings import Board
from pkmcal.readings.board_poses import board_poses, mm_per_pixel
from pkmcal.readings.seen_places import in_agreement

from ..sweeps import sweep

LENS = np.array([3478.0, 3470.0, 1223.5, 1023.5, -0.1, 0.08, 4e-4, -3e-4, 0.0])
FRAME = np.array([60.0, -40, 1400, np.pi + 0.1, 0.15, 0.3])
TOOL = np.array([5.0, -8, 20, 0.02, -0.03, 0.4])


def seen(size: float, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses of the platform and true and found places of a board before the camera."""
    random = np.random.default_rng(seed)
    board = Board.chessboard(6, 5, size / 5)
    count, corners = 40, len(board.ids)
    pose = np.hstack([random.uniform(-100, 100, (count, 3)), random.uniform(-0.3, 0.3, (count, 3))])
    motion = screws.frames(FRAME[None]) @ screws.frames(pose) @ screws.frames(TOOL[None])
    true = screws.pose(np.ascontiguousarray(motion).reshape(-1, 16))
    corner, picture = np.tile(board.places, (count, 1)), np.repeat(np.arange(count), corners)
    pixel = instruments.pixels(true[picture], corner, LENS, np.zeros(1))[0]
    found = board_poses(corner, pixel + random.normal(0, noise, pixel.shape), LENS, picture)
    return pose, true, found


def turned(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between the places of boards."""
    motions = [screws.frames(np.ascontiguousarray(each))[:, :3, :3] for each in (one, other)]
    cosine = (np.einsum("nij,nij->n", *motions) - 1.0) / 2.0
    return np.arccos(np.clip(cosine, -1.0, 1.0))


SIZES = [(180, 0.1), (60, 0.1), (60, 0.5), (30, 0.1), (20, 0.1)]  # mm, px


@sweep("size, noise, seed", [(*each, k) for each in SIZES for k in range(3)],
       quick=[(60, 0.5, 0), (30, 0.1, 1), (20, 0.1, 2)])  # fmt: skip
def test_no_picture_is_at_its_mirrored_place(size: float, noise: float, seed: int) -> None:
    """Nor is the true place held to be impossible where the other one fits better by chance."""
    pose, true, found = seen(size, noise, seed)
    each = np.stack([turned(found.pose[:, side], true) for side in range(2)], axis=1)
    nearer = np.nanargmin(each, axis=1)
    assert found.possible[np.arange(len(true)), nearer].all()
    possible = np.where(found.possible[:, :, None], found.pose, np.nan)
    taken = in_agreement(possible, pose)
    np.testing.assert_array_equal(taken, possible[np.arange(len(true)), nearer])


@pytest.mark.parametrize("flat", [True, False])
def test_corners_of_which_three_are_in_a_line_place_a_board(flat: bool) -> None:
    """Four of them leave the projection of a plane open; its place they tell all the same.

    But for one that is turned a little otherwise and seen alike: no camera tells 0.02 px.
    """
    random = np.random.default_rng(0)
    board = np.array([[0, 0, 0], [60, 0, 0], [120, 0, 0], [30, 90, 0.0]])
    if not flat:
        board = np.vstack([board, [[80, 60, 40], [20, 30, 70.0]]])
    count = 30
    pose = np.hstack([random.uniform(-80, 80, (count, 2)), random.uniform(600, 900, (count, 1)),
                      random.uniform(-0.6, 0.6, (count, 3))])  # fmt: skip
    picture = np.repeat(np.arange(count), len(board))
    corner = np.tile(board, (count, 1))
    pixel = instruments.pixels(pose[picture], corner, LENS, np.zeros(1))[0]
    found = board_poses(corner, pixel, LENS, picture)
    off = np.linalg.norm(found.pose[:, :, :3] - pose[:, None, :3], axis=2)
    assert np.nanmin(off, axis=1).max() < (0.1 if flat else 1e-5)  # mm
    assert np.nanmin(found.rms, axis=1).max() < (0.02 if flat else 1e-6)  # px
    assert np.median(np.nanmin(off, axis=1)) < 1e-5


def test_places_do_not_hang_on_the_order_of_rows() -> None:
    board, random = Board.chessboard(6, 5, 30), np.random.default_rng(1)
    pose = np.array(
        [[10, -20, 700, 0.3, 0.2, 0.1], [-30, 5, 900, -0.2, 0.4, -0.5], [0, 0, 800, 0.5, 0, 1.0]]
    )
    picture = np.repeat(np.arange(3), len(board.ids))
    corner = np.tile(board.places, (3, 1))
    pixel = instruments.pixels(pose[picture], corner, LENS, np.zeros(1))[0]
    order = random.permutation(len(picture))
    for way in (np.arange(len(picture)), order):
        found = board_poses(corner[way], pixel[way], LENS, picture[way])
        np.testing.assert_allclose(found.pose[:, 0], pose, atol=1e-6)


def test_a_pixel_is_the_distance_over_the_focal_length_where_boards_are_across() -> None:
    board = Board.chessboard(5, 4, 10)
    straight = np.array([1000.0, 1000, 500, 400, 0, 0, 0, 0, 0])
    pose = np.array([[0, 0, 500.0, 0, 0, 0], [30, 10, 800, 0, 0, 0.7]])
    picture = np.repeat([0, 1], len(board.ids))
    corner = np.tile(board.places, (2, 1))
    pixel = instruments.pixels(pose[picture], corner, straight, np.zeros(1))[0]
    np.testing.assert_allclose(mm_per_pixel(corner, pixel, picture), [0.5, 0.8], rtol=1e-9)
    line = corner[:, 1] == 0
    assert np.isnan(mm_per_pixel(corner[line], pixel[line], picture[line])).all()


@pytest.mark.parametrize("width", [0, 9])
@pytest.mark.parametrize("each", [0, 1, 3, 40])
def test_derivatives_are_chained_alike_however_many_rows_share_a_matrix(
    each: int, width: int
) -> None:
    random = np.random.default_rng(0)
    matrices = random.normal(size=(5, 6, width))
    place = np.repeat([3, 0, 4, 0], each)
    rows = random.normal(size=(len(place), 2, 6))
    expected = np.einsum("nij,njk->nik", rows, matrices[place])
    np.testing.assert_allclose(chained(rows, matrices, place), expected, rtol=0, atol=1e-13)


def test_mirrored_pictures_of_an_arm_are_refused_from_its_platform_too() -> None:
    """A camera that rides: as one that stands, in `tests/diagnostics/test_pictures.py`."""
    robot = pk.load("hexapod")
    board_at = pk.screw.from_pose(np.array([0, 0, 1600.0, 0, 0, 0]))
    camera = pk.readings.Camera(
        fx=1500.0, fy=1500.0, cx=640.0, cy=480.0, on="platform",
        stands=pk.screw.to_pose(np.linalg.inv(board_at)),
        carried=[0, 0, 50, 0.02, -0.03, 0.1],
    )  # fmt: skip
    q = robot.inverse(pk.sample_poses(robot, 12, seed=0, share=0.3))
    at, seeing = camera.seeing(q, Board.chessboard(6, 5, 30))
    measured = pk.VirtualMachine(robot, 0.05).measure(at, seeing)
    values = measured.values * [-1, 1] + [2 * 640.0, 0]
    with pytest.raises(pk.exceptions.ArgumentError, match="mirrored"):
        pk.identify(robot, pk.Measurements(at, values, measured.instrument), free=[])
