"""Frames are found whatever they are: no start near them is needed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal.core import instruments
from pkmcal.core.poses import compose
from pkmcal.readings import alignment
from pkmcal.readings.alignment import PointPairs

TURNS = {
    "none": np.zeros(3),
    "about x by 180": np.array([np.pi, 0.0, 0.0]),
    "about a slanting axis by 170": Rotation.from_rotvec(
        np.radians(170) * np.array([1, 2, -1]) / np.sqrt(6)
    ).as_euler("xyz"),
    "beta 90": np.array([0.4, np.pi / 2, 0.2]),
}
every = pytest.mark.parametrize("angles", TURNS.values(), ids=TURNS)


def poses(count: int, tilt: float) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (count, 6)) * [150, 150, 80, tilt, tilt, tilt]


def frame_of(angles: np.ndarray) -> np.ndarray:
    return np.array([4000.0, -7000.0, 900.0, *angles])


def assert_same(found: np.ndarray, expected: np.ndarray, atol: float = 1e-6) -> None:
    corners = 1000.0 * np.vstack([np.zeros(3), np.eye(3)])
    ends = [instruments.seen_points(np.ascontiguousarray(f), corners)[0] for f in (found, expected)]
    np.testing.assert_allclose(*ends, atol=atol)


def seen(frame: np.ndarray, pose: np.ndarray, true: np.ndarray, said: np.ndarray,
         target: np.ndarray) -> PointPairs:  # fmt: skip
    point, _, turn = instruments.points(pose, said)
    values = instruments.seen_points(frame, instruments.points(pose, true)[0])[0]
    return PointPairs(values, point, turn, target)


@every
def test_points_of_a_known_target_give_the_frame_at_once(angles: np.ndarray) -> None:
    pose, target = poses(10, 0.4), np.tile([60.0, -20.0, 35.0], (10, 1))
    found, shifts = alignment.of_points(
        seen(frame_of(angles), pose, target, target, np.full(10, -1))
    )
    assert_same(found, frame_of(angles))
    assert shifts.shape == (0, 3)


@every
@pytest.mark.parametrize("reach", [50.0, 400.0])
def test_unknown_targets_are_found_along(angles: np.ndarray, reach: float) -> None:
    index = np.arange(60) % 2
    true = reach * np.array([[0.6, -0.2, 0.8], [-0.5, 0.7, 0.1]])
    pose = poses(60, 0.5)
    found, shifts = alignment.of_points(
        seen(frame_of(angles), pose, true[index], np.zeros((60, 3)), index)
    )
    assert_same(found, frame_of(angles), atol=1.0)
    np.testing.assert_allclose(shifts, true, atol=1.0)


def test_targets_that_translations_do_not_tell_stay_where_they_are_said() -> None:
    pose = poses(20, 0.0)
    true, said = np.tile([60.0, 0.0, 0.0], (20, 1)), np.zeros((20, 3))
    _, shifts = alignment.of_points(
        seen(frame_of(TURNS["none"]), pose, true, said, np.zeros(20, dtype=np.intp))
    )
    np.testing.assert_allclose(shifts, 0.0, atol=1e-6)


@every
def test_poses_give_the_frame(angles: np.ndarray) -> None:
    pose, frame = poses(10, 0.4), frame_of(angles)
    assert_same(alignment.of_poses(compose(frame, pose), pose), frame)


@every
def test_heights_say_which_way_is_up(angles: np.ndarray) -> None:
    point, frame = poses(10, 0.0)[:, :3].copy(), frame_of(angles)
    values = instruments.seen_points(frame, point)[0][:, 2]
    found = alignment.of_heights(values, point)
    np.testing.assert_allclose(instruments.seen_points(found, point)[0][:, 2], values, atol=1e-6)
    up = [instruments.seen_points(f, np.eye(3))[2][0, 2] for f in (found, frame)]
    np.testing.assert_allclose(*up, atol=1e-9)


def test_heights_over_a_plane_leave_up_as_drawn() -> None:
    point = poses(10, 0.0)[:, :3] * [1, 1, 1e-3]  # a bed that was probed
    frame = np.array([0, 0, 30.0, 0.02, -0.03, 0.0])
    values = instruments.seen_points(frame, point)[0][:, 2]
    found = alignment.of_heights(values + 0.03 * np.random.default_rng(2).normal(size=10), point)
    np.testing.assert_allclose(found, frame, atol=0.05)
    np.testing.assert_allclose(found[3:], frame[3:], atol=5e-4)


@pytest.mark.parametrize("count", [1, 2])
def test_too_few_points_give_some_frame(count: int) -> None:
    point = poses(count, 0.0)[:, :3].copy()
    found = alignment.of_heights(np.arange(count) + 5.0, point)
    assert np.isfinite(found).all()
    turn, none = np.tile(np.eye(3), (count, 1, 1)), np.full(count, -1)
    frame, _ = alignment.of_points(PointPairs(point + 1.0, point, turn, none))
    np.testing.assert_allclose(instruments.seen_points(frame, point)[0], point + 1.0, atol=1e-9)
