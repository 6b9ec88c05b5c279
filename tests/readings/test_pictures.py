"""Pictures are held out whole: corners of one share its pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD = Board.chessboard(4, 3, 40)


@pytest.fixture(scope="module")
def measured() -> pk.Measurements:
    robot = pk.load("hexapod")
    camera = Camera(
        fx=1500.0, fy=1500.0, cx=640.0, cy=480.0, stands=[0, 0, 1900, np.pi, 0, 0],
        carried=[0, 0, 0, np.pi, 0, 0],
    )  # fmt: skip
    at, seeing = camera.seeing(robot.inverse(pk.sample_poses(robot, 16, seed=0, share=0.3)), BOARD)
    seen = pk.VirtualMachine(robot, 0.05).measure(at, seeing)
    return replace(seen, actuator_sigma=np.zeros(6))


def fitted(rows: pk.Measurements, held: pk.Measurements) -> pk.Identification:
    return pk.identify(pk.load("hexapod"), rows, ["offset*"], holdout=held)


def test_corners_of_pictures_that_are_fitted_are_not_held_out(measured: pk.Measurements) -> None:
    odd = np.arange(len(measured)) % 2 == 1
    fits, held = (measured.select(np.flatnonzero(each)) for each in (~odd, odd))
    with pytest.raises(pk.ArgumentError, match=r"holdout: \d+ rows are corners of pictures whose"):
        fitted(fits, held)


def test_whole_pictures_are_and_those_taken_again_at_fitted_poses(
    measured: pk.Measurements,
) -> None:
    corners = len(BOARD.ids)
    first = np.arange(len(measured)) < 12 * corners
    fits, held = (measured.select(np.flatnonzero(each)) for each in (first, ~first))
    assert fitted(fits, held).holdout_rms < 0.1
    again = replace(fits, values=fits.values + 0.01)
    assert np.isfinite(fitted(fits, again).holdout_rms)
