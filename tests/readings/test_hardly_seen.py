"""Boards that no picture tells, and cameras that are none: named, without warnings of NumPy."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import propagate
from pkmcal.readings import Board, Camera
from pkmcal.readings.board_poses import in_a_line, mm_per_pixel, pictures_told

BOARD = Board.chessboard(4, 3, 40)
PICTURE = np.zeros(12, dtype=np.intp)


@pytest.fixture(scope="module")
def measured() -> pk.Measurements:
    robot = pk.load("hexapod")
    camera = Camera(
        fx=1500.0, fy=1500.0, cx=640.0, cy=480.0, stands=[0, 0, 1900, np.pi, 0, 0],
        carried=[0, 0, 0, np.pi, 0, 0],
    )  # fmt: skip
    at, seeing = camera.seeing(robot.inverse(pk.sample_poses(robot, 5, seed=0, share=0.3)), BOARD)
    return pk.VirtualMachine(robot, 0.05, seed=0).measure(at, seeing)


def of_board(measured: pk.Measurements, name: str) -> pk.Measurements:
    return replace(measured, instrument=replace(measured.instrument, board_name=name))


def test_a_board_of_which_one_corner_is_seen_is_named_with_what_to_do(
    measured: pk.Measurements,
) -> None:
    hardly = of_board(measured.select(np.arange(len(measured)) == 3), "disc")
    with pytest.raises(ValueError, match=r"board 'disc', 1 row: .*leave these rows out"):
        pk.identify(pk.load("hexapod"), [of_board(measured, "plate"), hardly])


def test_pixels_that_are_all_equal_are_refused_without_a_warning(
    measured: pk.Measurements,
) -> None:
    with warnings.catch_warnings(), pytest.raises(ValueError, match="no picture shows four"):
        warnings.simplefilter("error")
        pk.identify(
            pk.load("hexapod"), replace(measured, values=np.full(measured.values.shape, 123.456))
        )


@pytest.mark.parametrize("middle", [0.0, 123.456, 1e4])
def test_corners_in_one_pixel_tell_no_board_and_those_of_a_narrow_one_do(middle: float) -> None:
    flat = BOARD.places[:, :2]
    for narrow, told in ((0.0, 0), (1e-3, 12), (1.0, 12)):
        pixel = middle + flat * [1.0, narrow]
        assert len(pictures_told(BOARD.places, pixel, PICTURE)[0]) == told
    same = np.full((12, 2), middle)
    assert not len(pictures_told(BOARD.places, same, PICTURE)[0])
    assert np.isnan(mm_per_pixel(BOARD.places, np.zeros((12, 2)), PICTURE)).all()
    assert in_a_line(np.column_stack([same, same[:, 0]]), PICTURE, 1)[0]


def test_variances_of_numbers_that_are_not_determined_are_not_finite_and_warn_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = propagate(np.eye(3)[None], np.diag([1.0, np.inf, 1.0]))
    assert not np.isfinite(found).any()


@pytest.mark.parametrize(
    "wrong", [{"camera_name": 5}, {"board_name": None}, {"width": -5}, {"height": 3.5}]
)
def test_a_camera_names_its_argument_that_is_none(
    measured: pk.Measurements, wrong: dict[str, Any]
) -> None:
    with pytest.raises((ValueError, TypeError), match=rf"{next(iter(wrong))} must be"):
        replace(measured, instrument=replace(measured.instrument, **wrong))


def test_one_pose_cannot_be_held_out(measured: pk.Measurements) -> None:
    with pytest.raises(ValueError, match="12 rows are of one pose"):
        measured.select(np.arange(len(measured)) < 12).split(0.2, seed=0)


@pytest.mark.parametrize("kind", ["charuco:{},20,15,5X5_100", "chessboard:{},20", "circles:{},20"])
def test_a_board_larger_than_any_is_refused_before_it_is_made(kind: str) -> None:
    with pytest.raises(ValueError, match="columns and rows: 100000 x 100000 are more than"):
        Board.parse(kind.format("100000x100000"))
    assert len(Board.parse(kind.format("100x99")).ids) > 9000
