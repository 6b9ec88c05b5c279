"""Held-out points that are nearer than expected are said: the fit has errors that they lack."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import f as f_distribution

import pkmcal as pk
from pkmcal.statistics.holdout_test import HoldoutTest

from ..simulated import said_by
from ..sweeps import sweep

NOISE = 0.01
pytestmark = pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")


def positions(robot: pk.Robot, true: pk.Robot, noise: float, seed: int) -> pk.Measurements:
    q = robot.inverse(pk.sample_poses(robot, 40, seed=seed, share=0.4))
    return replace(pk.VirtualMachine(true, noise, seed).measure(q, "position"), sigma=None)


def said(found: pk.Identification) -> set[str]:
    return {each.check for each in found.verdict.said if each.check.startswith("holdout")}


@sweep("name, seed", product(["hexapod", "6-rus"], range(2)), quick=[("6-rus", 0)])
def test_readings_that_are_better_than_those_that_were_fitted_are_said(
    name: str, seed: int
) -> None:
    robot, rng = pk.load(name), np.random.default_rng(seed)
    free = list(robot.geometry.names[:3])
    true = robot.replace({n: robot.geometry[n] + 0.1 * rng.normal() for n in free})
    fitted, later = (
        [positions(robot, true, noise, 10 * seed + k) for noise in (NOISE, 3.0 * NOISE)]
        for k in range(2)
    )
    nearer = pk.identify(robot, fitted[1], free, holdout=later[0])
    assert said(nearer) == {"holdout-nearer"}
    assert nearer.verdict.state == "calibrated"
    alike = pk.identify(robot, fitted[0], free, holdout=later[0])
    assert "holdout-nearer" not in said(alike)
    worse = pk.identify(robot, fitted[0], free, holdout=later[1])
    assert "holdout-contradicts" in said(worse) and "holdout-nearer" not in said(worse)


@sweep("seed", range(2), quick=[0])
@pytest.mark.parametrize("gains", [0.0, 3e-3])
def test_errors_of_the_model_that_a_session_takes_up_are_said(gains: float, seed: int) -> None:
    """Gains are wrong; zeros and frame of a session in a third of the workspace hide it there."""
    robot, rng, parts = pk.load("hexapod"), np.random.default_rng(seed), []
    true = robot.replace({n: 1 + gains * rng.normal() for n in robot.geometry.match("gain*")})
    for day, share in (("one", 1.0), ("two", 1.0), ("three", 1 / 3)):
        off = rng.uniform(-1, 1, (40, 6)) * [100, 100, 70, 0.2, 0.2, 0.2] * np.array(share)
        q = robot.inverse(robot.home + off)
        zeros = {f"offset{i}": 0.2 * rng.normal() for i in range(1, 7)}
        off_zero = true.replace({n: true.geometry[n] + zero for n, zero in zeros.items()})
        there = off_zero.forward(q, guess=robot.home + off).pose[:, :3]
        read = there + rng.normal(0, NOISE, (40, 3)) + rng.normal(size=3)
        parts.append(pk.Measurements(q, read, "position", session=day))
    found = pk.identify(
        robot, parts[:2], ["base*", "platform*", "offset*"], holdout=parts[2],
        unknown="frame", per_session=["offset*", "frame.*"],
    )  # fmt: skip
    names = ("holdout-nearer", "holdout-contradicts")
    assert ("holdout-nearer" in said_by(found, *names)) == (gains > 0.0)


@pytest.mark.parametrize("freedom", [(6.0, 30.0), (40.0, 12.0), (200.0, 150.0)])
def test_the_chance_of_a_smaller_ratio_is_that_of_the_f_distribution(
    freedom: tuple[float, float],
) -> None:
    for ratio in (0.3, 0.6, 0.9):
        own = HoldoutTest(ratio, ratio, 1.0, freedom).chance_nearer
        assert own == pytest.approx(f_distribution.cdf(ratio**2, *freedom), rel=1e-9)
