"""Sets of measurements whose stated sigma are wrong beside each other."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.measurements.measurements import Measurements

from ..simulated import hexapod_poses

NOISE = 0.05
RUNS = [pytest.param(15, 0.86, id="quick"),
        pytest.param(500, 0.93, id="500 runs", marks=pytest.mark.slow)]  # fmt: skip


def found_from(
    robot: pk.Robot, seed: int, sigmas: tuple[float | None, float | None]
) -> tuple[Identification, np.ndarray]:
    """Positions and distances, both with the same noise; which intervals hold the true offsets."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(0, 0.5, 6)
    true = robot.replace({f"offset{i + 1}": value for i, value in enumerate(truth)})
    sets = []
    for kind, sigma in zip(("position", "distance"), sigmas, strict=True):
        q = robot.inverse(hexapod_poses(robot, 24, rng) * [1, 1, 1, 0.5, 0.5, 0.5])
        place = true.forward(q).pose[:, :3]
        if kind == "position":
            seen = place + rng.normal(0, NOISE, place.shape)
            sets.append(Measurements(q, seen, "position", sigma=sigma))
        else:
            anchor = np.array([900.0, 100, 50])
            seen = np.linalg.norm(place - anchor, axis=1) + rng.normal(0, NOISE, 24)
            wire = pk.readings.Distance([0, 0, 0])
            sets.append(Measurements(q, seen, wire, target=anchor, sigma=sigma))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = pk.identify(robot, sets, "offset*")
    held = (found.interval95[:, 0] <= truth) & (truth <= found.interval95[:, 1])
    return found, held


@pytest.mark.parametrize(("runs", "least"), RUNS)
@pytest.mark.parametrize(
    "sigmas", [(None, NOISE / 5), (NOISE * 5, None), (NOISE, NOISE / 10), (NOISE, NOISE * 10)]
)
def test_intervals_hold_though_one_set_is_trusted_too_much(
    hexapod: pk.Robot, sigmas: tuple[float | None, float | None], runs: int, least: float
) -> None:
    held, said = [], 0
    for seed in range(runs):
        found, inside = found_from(hexapod, seed, sigmas)
        held.append(inside)
        said += any("weighted wrongly" in text for text in found.verdict.reasons)
        assert found.verdict.state != "calibrated" and found.covariance_rule == "cluster"
    assert np.mean(held) >= least and said >= 0.98 * runs


@pytest.mark.parametrize(
    "sigmas", [(None, NOISE), (NOISE, NOISE), (NOISE / 2, NOISE / 2), (None, None)]
)
def test_right_weights_are_left_alone(
    hexapod: pk.Robot, sigmas: tuple[float | None, float | None]
) -> None:
    """Also where all sigmas are wrong alike: that is a matter of scale."""
    said = sum(
        any("weighted" in text for text in found_from(hexapod, seed, sigmas)[0].verdict.reasons)
        for seed in range(20)
    )
    assert said <= 2


def test_components_whose_noise_differs_are_told_with_their_units() -> None:
    robot = pk.load("hexapod")
    rng = np.random.default_rng(3)
    q = robot.inverse(hexapod_poses(robot, 60, rng))
    noise = np.array([0.01, 0.02, 0.2, 2e-5, 4e-5, 4e-4])  # mm and rad
    seen = robot.forward(q).pose + rng.normal(size=(60, 6)) * noise
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        text = " ".join(str(pk.identify(robot, Measurements(q, seen, "pose"), "offset*")).split())
    told = [part.split() for part in text.split("; noise of ")[1].split("; ")[0].split(", ")]
    names, values, units = zip(*told, strict=True)
    assert names == ("x", "y", "z", "alpha", "beta", "gamma")
    assert units == ("mm",) * 3 + ("deg",) * 3
    expected = [*noise[:3], *np.degrees(noise[3:])]
    np.testing.assert_allclose([float(value) for value in values], expected, rtol=0.4)


@pytest.mark.parametrize("exact", [1, 2])
def test_sets_without_any_residual_are_no_division_by_zero(exact: int) -> None:
    """An arm read where its own numbers have it, to the last bit; or one of two sets of it."""
    arm = pk.load("3r")
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 3))
    place = as_machine(arm).forward(q).pose[:, :3]
    noise = np.random.default_rng(1).normal(0, NOISE, place.shape)
    sets = [
        Measurements(q, place, sigma=NOISE),
        Measurements(q, place + noise * (exact < 2), sigma=NOISE),
    ]
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = pk.identify(arm, sets, "joint1.d[xyz]")
        said = str(found) + "".join(str(each.message) for each in heard)
    assert {each.category for each in heard} <= {pk.CalibrationWarning}
    assert ("weighted wrongly" in said) == (exact == 1)
    if exact == 2:
        assert not found.rms and not (found.values - found.start).any()
