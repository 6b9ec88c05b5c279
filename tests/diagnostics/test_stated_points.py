"""Corners of a board that are not where they are stated: alike in all pictures, and no noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics.stated_points import StatedPoints

from .test_pictures import BOARD, checks, pictures, with_lens

MM = 0.05


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


def elsewhere(measured: pk.Measurements, off: np.ndarray) -> pk.Measurements:
    """The same pictures, of a board whose corners (K, 3) are stated to be off by some mm."""
    corner = np.asarray(measured.instrument.corner)
    which = np.argmin(np.linalg.norm(corner[:, None] - BOARD.places[None], axis=2), axis=1)
    return with_lens(measured, corner=corner + off[which])  # type: ignore[arg-type]


def drawn(seed: int) -> np.ndarray:
    off = np.random.default_rng(seed).normal(0.0, MM, BOARD.places.shape)
    off[:, 2] = 0.0
    return off


@pytest.mark.parametrize("on", ["base", "platform"])
def test_corners_that_are_off_alike_in_all_pictures_are_doubted_with_their_size(
    sound: pk.Measurements, on: str
) -> None:
    """Of those that lie flat two of three coordinates are off."""
    measured = sound if on == "base" else riding()
    found, said = checks(elsewhere(measured, drawn(1)))
    (own,) = (each for each in found.verdict.said if each.check == "stated-points")
    assert isinstance(own.finding, StatedPoints) and own.finding.count == len(BOARD.ids)
    assert own.finding.off == pytest.approx(MM, rel=0.35)
    assert own.level == "doubt" and found.verdict.state == "doubtful"
    assert "corners of the board are not where they are stated" in said["stated-points"]


def riding() -> pk.Measurements:
    """A camera on a platform looks up at a board that stands."""
    robot = pk.load("hexapod")
    camera = pk.readings.Camera(
        on="platform", fx=1500.0, fy=1505.0, cx=640.0, cy=400.0, width=1280, height=800,
        stands=[87, 70, -float(robot.home[2]) - 700.0, 0, 0, 0],
    )  # fmt: skip
    poses = pk.sample_poses(robot, 24, seed=1, share=0.25)
    at, seeing = camera.seeing(robot.inverse(poses), BOARD)
    return pk.VirtualMachine(robot, 0.1, 5).measure(at, seeing)


@pytest.mark.parametrize("seed", [3, 5])
def test_sound_corners_are_not_doubted(sound: pk.Measurements, seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, 0.1, sound.values.shape)
    found, said = checks(replace(sound, values=sound.values + noise))
    assert "stated-points" not in said and found.verdict.state == "calibrated"


def test_errors_that_pictures_at_one_pose_share_are_none_of_the_board() -> None:
    """Four pictures at each of eight poses: how corners were found there is repeated with them.

    Encoders read a little else each time.
    """
    random, base = np.random.default_rng(0), pictures(8)
    shared = base.values + random.normal(0.0, 0.07, base.values.shape)
    corner = np.tile(np.asarray(base.instrument.corner), (4, 1))
    assert base.group is not None
    repeated = pk.Measurements(
        np.tile(base.actuators, (4, 1))
        + np.repeat(random.normal(0.0, 1e-3, (32, 6)), len(BOARD.ids), axis=0)[: 4 * len(base)],
        np.tile(shared, (4, 1)) + random.normal(0.0, 0.03, (4 * len(base), 2)),
        replace(base.instrument, corner=corner),
        group=np.concatenate([base.group + 100 * i for i in range(4)]),
    )
    assert "stated-points" not in checks(repeated)[1]


@pytest.mark.parametrize("lens", [{"fx": 1530.0, "fy": 1535.0}, {"cx": 655.0}])
def test_a_lens_that_is_off_is_no_board_that_is(
    sound: pk.Measurements, lens: dict[str, float]
) -> None:
    """It moves corners alike in all pictures, too, as far as they are in one place of these."""
    assert "stated-points" not in checks(with_lens(sound, **lens))[1]


def test_a_board_that_is_stretched_one_way_is_doubted_with_what_that_does(
    sound: pk.Measurements,
) -> None:
    """Errors that follow a pattern move the machine further than as large ones at random."""
    pattern = BOARD.places * [1e-3, -1e-3, 0.0]
    found, _ = checks(elsewhere(sound, pattern))
    (own,) = (each for each in found.verdict.said if each.check == "stated-points")
    shuffled = np.random.default_rng(2).permuted(pattern[:, :2], axis=0)
    other, _ = checks(elsewhere(sound, np.column_stack([shuffled, pattern[:, 2]])))
    (random,) = (each for each in other.verdict.said if each.check == "stated-points")
    assert own.finding.off < random.finding.off
    assert own.finding.shift / own.finding.off > 2.0 * random.finding.shift / random.finding.off
    assert own.level == "doubt"
