"""Bootstrap: the scatter of repeated calibrations, whoever computes them."""

from __future__ import annotations

import dataclasses
import pickle
import warnings
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.bootstrap import Replicate
from pkmcal.calibration.identification import Identification
from pkmcal.kinematics.robot import Robot

from ..simulated import hexapod_poses, tilted_poses, with_errors


@pytest.fixture(scope="module")
def offsets(hexapod: Robot) -> Identification:
    rng = np.random.default_rng(0)
    q = hexapod.inverse(hexapod_poses(hexapod, 60, rng))
    true = hexapod.replace({"offset1": 0.3, "offset4": -0.2})
    return pk.identify(hexapod, pk.VirtualMachine(true, seed=1).measure(q), free="offset*")


@pytest.mark.parametrize("workers", [1, 2, 3])
@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_same_seed_gives_the_same_numbers_on_any_number_of_workers(
    offsets: Identification, pool: Callable[[int], Executor], workers: int
) -> None:
    here = pk.bootstrap(offsets, 70, seed=3)
    with pool(workers) as executor:
        there = pk.bootstrap(offsets, 70, seed=3, executor=executor)
    np.testing.assert_array_equal(there.values, here.values)
    assert (pk.bootstrap(offsets, 70, seed=4).values != here.values).all()
    # the first ones of many are those of few
    np.testing.assert_array_equal(pk.bootstrap(offsets, 30, seed=3).values, here.values[:30])


def test_standard_errors_are_those_of_the_covariance(offsets: Identification) -> None:
    found = pk.bootstrap(offsets)
    assert found.n_failed == found.failed == 0 and found.values.shape == (1000, 6)
    np.testing.assert_allclose(found.stderr, offsets.stderr, rtol=0.35)
    assert np.mean(found.stderr / offsets.stderr) == pytest.approx(1.0, abs=0.12)
    assert np.abs(found.bias / found.stderr).max() < 0.15
    inside = (found.interval95[:, 0] < offsets.values) & (offsets.values < found.interval95[:, 1])
    assert inside.all()
    width = np.diff(found.interval95, axis=1)[:, 0] / found.stderr
    np.testing.assert_allclose(width, 2 * 1.96, rtol=0.1)


@pytest.mark.filterwarnings("ignore:residuals are:UserWarning")
def test_a_prior_is_drawn_anew_and_what_nothing_tells_stays_unknown() -> None:
    robot = pk.load("2tpr2tps")
    rng = np.random.default_rng(1)
    true = with_errors(robot, 0.5, rng)
    measured = pk.VirtualMachine(true, seed=1).measure(robot.inverse(tilted_poses(robot, 30, rng)))
    with_prior = pk.identify(robot, measured, prior=0.5)
    found = pk.bootstrap(with_prior, 600)
    assert np.mean(found.stderr / with_prior.stderr) == pytest.approx(1.0, abs=0.1)
    without = pk.identify(robot, measured, free=["offset*", "platform3.x"])
    unknown = pk.bootstrap(without, 50)
    assert np.isinf(unknown.stderr[without.free.index("platform3.x")])
    everything = unknown.interval95[without.free.index("platform3.x")]
    assert tuple(everything) == (-np.inf, np.inf)
    assert np.isfinite(unknown.stderr[without.free.index("offset1")])


def test_errors_that_rows_of_a_pose_share_are_seen(hexapod: Robot) -> None:
    """Four rows at each pose that are off together: they are not independent, and it shows."""
    poses = hexapod_poses(hexapod, 40, np.random.default_rng(2))
    q = np.repeat(hexapod.inverse(poses), 4, axis=0)
    measured = pk.VirtualMachine(hexapod, 0.001).measure(q)
    ratios = []
    for seed in range(6):
        common = np.repeat(np.random.default_rng(seed).normal(0, 0.02, (40, 3)), 4, axis=0)
        off = dataclasses.replace(measured, values=measured.values + common, sigma=0.02)
        found = pk.identify(hexapod, off, free=["offset*"])
        ratios.append(pk.bootstrap(found, 200).stderr / found.stderr)
    assert np.mean(ratios) == pytest.approx(1, rel=0.15)  # 2 if rows counted one by one


def test_stated_noise_that_is_wrong_does_not_mislead(hexapod: Robot) -> None:
    rng = np.random.default_rng(3)
    q = hexapod.inverse(hexapod_poses(hexapod, 60, rng))
    measured = pk.VirtualMachine(hexapod, 0.03, seed=3).measure(q)
    boasted = pk.identify(hexapod, dataclasses.replace(measured, sigma=0.015), free="offset*")
    assert np.mean(pk.bootstrap(boasted, 300).stderr / boasted.stderr) == pytest.approx(1, rel=0.1)
    alone = pk.identify(hexapod, dataclasses.replace(measured, sigma=0.03), free="offset*")
    assert boasted.stderr == pytest.approx(alone.stderr, rel=0.1)


def test_mixed_measurements_robust_loss_and_covariances(hexapod: Robot) -> None:
    rng = np.random.default_rng(4)
    q = hexapod.inverse(hexapod_poses(hexapod, 30, rng))
    tracker = pk.Tracker(0.01, 1e-5, 2e-5, position=(2000, 0, 0))
    anchor = [400.0, 300, -100]
    sets = [
        pk.VirtualMachine(hexapod, tracker, seed=4).measure(q),
        pk.VirtualMachine(hexapod, 0.05, seed=5).measure(
            q, pk.readings.Distance([50, 0, 20]), anchor
        ),
        pk.VirtualMachine(hexapod, 0.02, seed=6).measure(q, "pose"),
    ]
    found = pk.identify(hexapod, sets, free="offset*", loss="huber")
    assert np.mean(pk.bootstrap(found, 200).stderr / found.stderr) == pytest.approx(1, abs=0.25)


def test_an_identification_pickles(offsets: Identification) -> None:
    again = pickle.loads(pickle.dumps(offsets))
    assert again.summary() == offsets.summary()
    np.testing.assert_array_equal(again.values, offsets.values)
    poses = hexapod_poses(offsets.robot, 5, np.random.default_rng(5))
    np.testing.assert_array_equal(again.accuracy(poses), offsets.accuracy(poses))
    np.testing.assert_array_equal(again.robot.inverse(poses), offsets.robot.inverse(poses))
    np.testing.assert_array_equal(pk.bootstrap(again, 20).values, pk.bootstrap(offsets, 20).values)


def test_bootstrap_is_read_by_a_person(offsets: Identification) -> None:
    lines = str(pk.bootstrap(offsets, 40)).splitlines()
    assert lines[0] == "40 bootstrap replicates"
    assert lines[1].split() == ["parameter", "stderr", "linear", "bias", "2.5", "%", "97.5", "%"]
    assert len(lines) == 8
    # numbers end below the end of what heads them
    for head in ("stderr", "linear", "bias"):
        end = lines[1].index(head) + len(head)
        assert all(line[end - 1].isdigit() and line[end] == " " for line in lines[2:])


def test_residuals_that_are_drawn_are_as_large_as_the_noise(hexapod: Robot) -> None:
    """Four positions for six numbers: half of what the noise did is in these, and is put back.

    The mean of the variances of the bootstrap is the variance, however few equations are left.
    """
    rng, ratios = np.random.default_rng(11), []
    q = hexapod.inverse(hexapod_poses(hexapod, 4, rng))
    instrument = [pk.VirtualMachine(hexapod, 0.02, seed=seed) for seed in range(24)]
    for each in instrument:
        measured = dataclasses.replace(each.measure(q), sigma=0.02)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pk.CalibrationWarning)
            found = pk.identify(hexapod, measured, free="offset*", loss="classical")
        fit = found.fit
        true = np.diag(fit.covariance) / fit.uncertainty.covariance.scale**2
        seeds = np.random.SeedSequence(1).spawn(12)
        off = Replicate(fit)(seeds) - found.values
        ratios.append(np.mean(off**2, axis=0) / true)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("replicates", [0, 1, 2.5, True])
def test_fewer_than_two_replicates_are_refused(offsets: Identification, replicates: Any) -> None:
    with pytest.raises(ValueError, match="replicates must be a whole number from 2"):
        pk.bootstrap(offsets, replicates)


@pytest.mark.filterwarnings("ignore:.*no degrees of freedom:UserWarning")
def test_without_an_equation_left_over_there_is_nothing_to_draw(hexapod: Robot) -> None:
    q = hexapod.inverse(hexapod_poses(hexapod, 2, np.random.default_rng(6)))
    found = pk.identify(hexapod, pk.VirtualMachine(hexapod).measure(q), free="offset*")
    with pytest.raises(ValueError, match="found: no degrees of freedom"):
        pk.bootstrap(found, 10)
