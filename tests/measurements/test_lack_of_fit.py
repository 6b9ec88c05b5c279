"""Repeats of a pose: their scatter is the instrument's, what they agree on the model's."""

from __future__ import annotations

import dataclasses
import re
import warnings

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.repeats import groups
from pkmcal.statistics.noise import split

from ..simulated import hexapod_poses, tilted_poses, with_errors

TIMES = 4


def repeated(true: Robot, robot: Robot, count: int, seed: int, noise: float = 0.02) -> Measurements:
    rng = np.random.default_rng(seed)
    q = np.repeat(robot.inverse(hexapod_poses(robot, count, rng)), TIMES, axis=0)
    return pk.VirtualMachine(true, noise, seed).measure(q)


def fitted(robot: Robot, measured: Measurements, **options: object) -> Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pk.identify(robot, measured, **options)


def test_sums_of_squares_are_those_of_an_analysis_of_variance() -> None:
    scaled = np.random.default_rng(0).normal(size=(6, 4, 2))
    key = np.repeat(np.arange(6), 4)[:, None] * 2 + np.arange(2)
    found = split(scaled.reshape(-1), key.reshape(-1), leverage=5.0)
    assert found.pure == pytest.approx(((scaled - scaled.mean(axis=1, keepdims=True)) ** 2).sum())
    assert found.missed == pytest.approx(4 * (scaled.mean(axis=1) ** 2).sum())
    assert (found.pure_freedom, found.missed_freedom, found.repeats) == (36, 7, 4)


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
def test_a_right_model_is_told_to_miss_nothing(hexapod: Robot) -> None:
    chances = []
    for seed in range(40):
        true = with_errors(hexapod, 0.5, np.random.default_rng(seed))
        found = pk.identify(hexapod, repeated(true, hexapod, 20, seed), prior=0.5)
        chances.append(found.lack_of_fit_chance)
    # evenly spread between 0 and 1
    assert np.mean(chances) == pytest.approx(0.5, abs=4 / np.sqrt(12 * 40))
    assert min(chances) < 0.2 and max(chances) > 0.8
    assert "no lack of fit beyond that (p" in " ".join(found.summary().split())


def test_a_model_that_misses_is_told_from_an_instrument_that_scatters(hexapod: Robot) -> None:
    true = with_errors(hexapod, 0.5, np.random.default_rng(1))
    measured = repeated(true, hexapod, 30, 1)
    few = fitted(hexapod, measured, free="offset*")
    assert few.repeatability == pytest.approx(0.02, rel=0.15)
    assert few.lack_of_fit_chance < 1e-9
    assert few.lack_of_fit == pytest.approx(few.rms / np.sqrt(3), rel=0.1)
    assert "lack of fit beyond that" in " ".join(few.summary().split())
    (text,) = few.warnings
    assert text.endswith("times what sigma says: free more parameters")
    small = dataclasses.replace(measured, sigma=0.002)
    scattering = fitted(hexapod, small, prior=0.5)
    (text,) = scattering.warnings
    assert re.search(r"repeats of a pose scatter \d.* times as much as it, state the true", text)


def test_gross_errors_are_no_reason_to_state_another_sigma(hexapod: Robot) -> None:
    """A repeat that is off scatters as well."""
    true = with_errors(hexapod, 0.5, np.random.default_rng(1))
    measured = repeated(true, hexapod, 30, 1)
    values = measured.values.copy()
    values[[10, 51]] += [5.0, 0.0, -3.0]
    found = fitted(hexapod, dataclasses.replace(measured, values=values), prior=0.5)
    assert found.outliers == (10, 51)
    told = [text for text in found.warnings if "repeats of a pose scatter" in text]
    assert len(told) == 1 and ": look at the outliers; without any, state the true" in told[0]


def test_scatter_is_the_noise_where_no_sigma_is_stated(hexapod: Robot) -> None:
    """With as many parameters as poses tell, the repeats alone say what the noise is."""
    rng = np.random.default_rng(3)
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 2, rng)), 30, axis=0)
    measured = pk.VirtualMachine(hexapod, 0.05, 3).measure(q)
    found = fitted(hexapod, dataclasses.replace(measured, sigma=None), free="offset*")
    assert found.rank == 6
    assert found.noise[0] == pytest.approx(0.05, rel=0.1)
    assert np.isfinite(found.stderr).all()


def test_repeats_do_not_make_a_model_surer_than_its_poses(hexapod: Robot) -> None:
    """Parameters of a model with something missing: the errors are those of poses, not of rows."""
    ratios = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        measured = repeated(hexapod, hexapod, 25, seed, noise=0.005)
        missing = np.repeat(rng.normal(0, 0.05, (25, 3)), TIMES, axis=0)
        off = dataclasses.replace(measured, values=measured.values + missing, sigma=None)
        found = pk.identify(hexapod, off, free=["offset*", "base*.x"])
        truth = np.array([hexapod.geometry[name] for name in found.free])
        ratios.append((found.values - truth) / found.stderr)
        assert found.repeatability == pytest.approx(0.005, rel=0.2)
        assert found.lack_of_fit == pytest.approx(0.05, rel=0.4)
    assert np.std(ratios) == pytest.approx(1.0, abs=0.2)  # 0.5 if rows counted one by one


def test_rows_of_a_group_are_one_pose_whatever_their_actuators_read(hexapod: Robot) -> None:
    measured = repeated(hexapod, hexapod, 12, 4)
    jitter = np.random.default_rng(5).normal(0, 1e-4, measured.actuators.shape)
    number = np.repeat(np.arange(12), TIMES)
    read = dataclasses.replace(measured, actuators=measured.actuators + jitter, group=number)
    np.testing.assert_array_equal(groups(read), number)
    told = pk.identify(hexapod, read, free="offset*", holdout=0.25)
    assert told.repeatability == pytest.approx(0.02, rel=0.2)
    assert set(np.bincount(told.rows // TIMES, minlength=12)) == {0, TIMES}
    unknown = pk.identify(hexapod, dataclasses.replace(read, group=None), free="offset*")
    assert np.isnan(unknown.repeatability) and np.isnan(unknown.lack_of_fit_chance)


def test_targets_of_one_pose_are_no_repeats() -> None:
    robot = pk.load("2tpr2tps")
    q = np.repeat(robot.inverse(tilted_poses(robot, 10, np.random.default_rng(6))), 2, axis=0)
    m = Measurements(q, np.ones((20, 3)), target_index=np.tile([0, 1], 10))
    assert len(set(groups(m))) == 20
