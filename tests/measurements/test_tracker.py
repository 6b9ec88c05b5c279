"""A laser tracker's noise: what a range and two angles make of the covariance of a point."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.measurements import Measurements

from ..simulated import hexapod_poses, missed, with_errors

PLACE = np.array([2500.0, -900.0, 300.0])
TRACKER = pk.Tracker(range=0.01, azimuth=2e-5, elevation=5e-5, position=tuple(PLACE))


def test_covariance_is_that_of_noisy_ranges_and_angles() -> None:
    rng = np.random.default_rng(0)
    for point in ([0.0, 0, 800], [3000.0, 500, -400], [2500.0, 2000, 900]):
        x, y, z = np.array(point) - PLACE
        distance = np.sqrt(x * x + y * y + z * z) + rng.normal(0, 0.01, 200_000)
        azimuth = np.arctan2(y, x) + rng.normal(0, 2e-5, 200_000)
        elevation = np.arctan2(z, np.hypot(x, y)) + rng.normal(0, 5e-5, 200_000)
        across = distance * np.cos(elevation)
        read = [across * np.cos(azimuth), across * np.sin(azimuth), distance * np.sin(elevation)]
        expected, found = np.cov(read), TRACKER.covariance(point)
        size = np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected)))
        np.testing.assert_allclose(found / size, expected / size, atol=0.01)


def test_equal_arms_are_equal_in_all_directions() -> None:
    points = np.array([[3000.0, 0, 0], [0, -3000, 0], [2000, 1000, -2000]])
    even = pk.Tracker(range=0.03, azimuth=1e-5 / np.cos(np.arcsin(2 / 3)), elevation=1e-5)
    np.testing.assert_allclose(even.covariance(points[2]), 9e-4 * np.eye(3), atol=1e-18)
    level = pk.Tracker(range=0.03, azimuth=1e-5, elevation=1e-5)
    np.testing.assert_allclose(level.covariance(points[:2]), [9e-4 * np.eye(3)] * 2, atol=1e-18)


def test_a_tracker_stands_for_sigma_and_for_the_noise_of_a_machine() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 30, np.random.default_rng(1)))
    measured = pk.VirtualMachine(robot, TRACKER, seed=2).measure(q)
    stated = Measurements(q, measured.values, sigma=TRACKER)
    np.testing.assert_array_equal(stated.sigma, TRACKER.covariance(stated.values))
    # drawn by the covariance of the true points, stated by that of the measured ones
    np.testing.assert_allclose(measured.sigma, stated.sigma, rtol=1e-3, atol=1e-12)
    off = measured.values - robot.forward(q).pose[:, :3]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(stated.sigma), off)
    assert squares.mean() == pytest.approx(3, abs=4 * np.sqrt(6 / 30))


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
def test_the_trackers_covariances_make_a_better_calibration_than_one_sigma() -> None:
    robot = pk.load("hexapod")
    coarse = pk.Tracker(range=0.005, azimuth=2e-5, elevation=5e-5, position=tuple(PLACE))
    squares: dict[str, list[float]] = {"tracker": [], "one sigma": []}
    for seed in range(12):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, 0.5, rng)
        q, at = (robot.inverse(hexapod_poses(robot, n, rng)) for n in (40, 50))
        seen = pk.VirtualMachine(true, coarse, seed).measure(q)
        one = Measurements(q, seen.values, sigma=np.sqrt(np.trace(seen.sigma.mean(axis=0)) / 3))
        for name, measured in (("tracker", seen), ("one sigma", one)):
            found = pk.identify(robot, measured, prior=0.5)
            squares[name].append(np.mean(missed(found.robot, true, at) ** 2))
    assert np.mean(squares["tracker"]) < 0.9 * np.mean(squares["one sigma"])


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"range": 0.0}, "range must be above 0, found 0.0"),
        ({"azimuth": np.nan}, "azimuth must be"),
        ({"elevation": -1e-5}, "elevation must be"),
        ({"position": (1, 2)}, "position must have shape"),
        ({"position": (1, 2, np.inf)}, "position must be three finite numbers"),
    ],
)
def test_what_does_not_fit_is_named(fields: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pk.Tracker(**({"range": 0.01, "azimuth": 1e-5, "elevation": 1e-5} | fields))


def test_a_tracker_measures_points_that_have_an_azimuth() -> None:
    with pytest.raises(ValueError, match="row 1 is straight above or below"):
        TRACKER.covariance([PLACE + 100, PLACE + np.array([0, 0, 500])])
    with pytest.raises(ValueError, match="a tracker measures positions, not values of kind 'heig"):
        Measurements(np.ones((2, 6)), np.ones(2), "height", sigma=TRACKER)
    machine = pk.VirtualMachine(pk.load("hexapod"), TRACKER)
    with pytest.raises(ValueError, match="a tracker measures positions, found 'pose'"):
        machine.measure(machine.true_robot.inverse(machine.true_robot.home), kind="pose")
