"""What a simulated camera sees of a board."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD = Board.chessboard(5, 4, 30)
LENS = {"fx": 1500.0, "fy": 1500.0, "cx": 600.0, "cy": 450.0, "width": 1201, "height": 901}


def seen(tilt: float = 0.0, x: float = 0.0, **changes: float) -> np.ndarray:
    """Pixels of a board on the platform, under a camera that looks down on it."""
    robot = pk.load("hexapod")
    middle = BOARD.places.mean(axis=0)
    carried = pk.screw.from_pose(np.array([0, 0, 0, np.pi + tilt, 0, 0]))
    carried[:3, 3] = [x, 0, 0] - carried[:3, :3] @ middle
    camera = Camera(
        **{**LENS, **changes}, stands=[0, 0, 1850, np.pi, 0, 0], carried=pk.screw.to_pose(carried)
    )
    q, seeing = camera.seeing(robot.inverse([[0, 0, 850, 0, 0, 0]]), BOARD)
    return pk.VirtualMachine(robot, 0.0).measure(q, seeing).values


def test_a_board_in_the_middle_is_seen_whole_and_one_at_the_edge_in_part() -> None:
    whole = seen()
    assert np.isfinite(whole).all()
    np.testing.assert_allclose(whole.mean(axis=0), [600, 450], atol=1.0)
    part = np.isfinite(seen(x=380.0)).all(axis=1)
    assert 0 < part.sum() < len(part)
    wide = seen(x=380.0, width=0)
    assert np.array_equal(part, wide[:, 0] <= 1200) and np.isfinite(wide).all()


@pytest.mark.parametrize(("tilt", "sees"), [(50, True), (-50, True), (64, False), (180, False)])
def test_boards_are_seen_from_the_front_and_not_too_slanting(tilt: float, sees: bool) -> None:
    assert np.isfinite(seen(np.radians(tilt))).all() == sees
    assert np.isfinite(seen(np.radians(tilt))).any() == sees


def test_points_that_distortion_folds_back_into_the_picture_are_not_seen() -> None:
    """1 - 3 r² = 0 at k1 = -1: beyond x/z = 0.577 what is farther out is nearer the middle."""
    lens = {"k1": -1.0, "fx": 800.0, "fy": 800.0}
    assert np.isfinite(seen(x=300.0, **lens)).all()
    gone = seen(x=700.0, **lens)
    assert np.isnan(gone).all()
    where = 0.7 * (1 - 0.7**2) * 800 + 600
    assert 0 < where < 1200  # where a formula alone would see it
