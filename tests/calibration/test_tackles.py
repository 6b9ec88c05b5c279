"""Calibration of cables over several points, and the freedoms that self-calibration leaves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk
from tests.kinematics.test_tackles import FOUR, OVER, PARTS, tackle
from tests.robots import made

NOISE = 0.3
FREE = [f"over{i}.1.{c}" for i in (2, 3) for c in "xy"]


def lengths(points: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Of the three cables (N, 3) to places (N, 2); `points` (3, 2, 2)."""
    away = np.linalg.norm(at[:, None, None] - points, axis=3)
    found: np.ndarray = (away * np.array(PARTS)).sum(axis=2)
    return found


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Readings of the cables (N, 3), and the true points behind the first of each."""
    rng = np.random.default_rng(seed)
    points = np.array([FOUR[list(over), :2] for over in OVER])
    points[1:, 1] += rng.normal(0, 15, (2, 2))
    at = rng.uniform([700, 500], [3300, 2500], (40, 2))
    return lengths(points, at) + rng.normal(0, NOISE, (40, 3)), points


@pytest.fixture(scope="module")
def machine() -> pk.Robot:
    limbs = [tackle(FOUR[list(o)], p, [0, 0, 0]) for o, p in zip(OVER, PARTS, strict=True)]
    return made("xy", {"x": 1900.0, "y": 1300.0}, limbs)


def test_points_of_tackles_are_found_with_all_places_unknown(machine: pk.Robot) -> None:
    """Against one least squares of all points and places, which have their own residuals."""
    q, true = drawn(0)
    found = pk.identify(machine, pk.Measurements(q, None, "closure", actuator_sigma=NOISE), FREE)

    def residual(x: np.ndarray) -> np.ndarray:
        points = true.copy()
        points[1:, 1] = x[:4].reshape(2, 2)
        return ((lengths(points, x[4:].reshape(-1, 2)) - q) / NOISE).ravel()

    start = [*FOUR[[2, 3], :2].ravel(), *np.tile([1900.0, 1300.0], 40)]
    best = least_squares(residual, start, "3-point", x_scale="jac", xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(found.values, best.x[:4], atol=2e-3 * found.stderr.min())
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:4, :4]
    ratio = found.stderr / np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(ratio, ratio[0], rtol=2e-3)  # a Birge ratio, common to all
    assert 0.7 < ratio[0] < 1.4


def test_stated_deviations_of_points_are_honest(machine: pk.Robot) -> None:
    z = []
    for seed in range(40):
        q, true = drawn(100 + seed)
        log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
        found = pk.identify(machine, log, FREE)
        z.append((found.values - true[1:, 1].ravel()) / found.stderr)
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2


def test_anchors_behind_others_move_with_the_frame(machine: pk.Robot) -> None:
    q, _ = drawn(1)
    log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
    free = [name for name in machine.geometry.names if name[0] in "bo" and name[-1] in "xy"]
    found = pk.identify(machine, log, free)
    assert len(found.free) == 12
    (text,) = (text for text in found.gauges if "base frame" in text)
    assert "moved along x and y and turned about z" in text


@pytest.mark.filterwarnings("ignore:.*determined to no better than")  # one swivel, hardly
def test_axes_turn_with_the_frame_and_points_with_the_platform() -> None:
    """Eight pulleys: six freedoms of the base with its swivel axes, six of the platform's frame."""
    robot = pk.load(Path(__file__).parents[2] / "examples" / "cable-robot" / "robot.toml")
    rng = np.random.default_rng(1)
    at = np.array([0, 0, 1200, 0, 0, 0])
    at = at + rng.uniform(-1, 1, (60, 6)) * [900, 600, 500, 0.2, 0.2, 0.2]
    q = robot.inverse(at) + rng.normal(0, 0.2, (60, 8))
    log = pk.Measurements(q, None, "closure", actuator_sigma=0.2)
    all_ways = "moved along x, y and z and turned about x, y and z"
    (of_base,) = pk.identify(robot, log, ["base*", "swivel*"]).gauges
    assert f"the base frame may be {all_ways}" in of_base
    (upright,) = pk.identify(robot, log, ["base*"]).gauges  # swivel axes are held
    assert "moved along x, y and z and turned about z:" in upright
    both = pk.identify(robot, log, ["base*", "platform*"])
    assert both.rank == len(both.free) - 10 and not both.unidentifiable
    assert f"the platform's frame may be {all_ways}" in both.gauges[1]


def test_zeros_of_swivels_turn_with_the_frame() -> None:
    """What encoders of swivels read from unknown zeros does not say where the frame points."""
    anchors = np.array([[1500.0, 1000, 2000], [-1500, 1000, 2000], [-1500, -1000, 2000],
                        [1500, -1000, 2100]])  # fmt: skip
    limbs = [
        {"kind": "pulley", "base": a, "platform": [0, 0, 0], "radius": 50.0, "swivel": [0, 0, 1.0]}
        for a in anchors
    ]
    robot = made("translation", {"z": 700.0}, limbs)
    at = np.zeros((30, 6))
    at[:, :3] = np.random.default_rng(5).uniform([-1000, -700, 100], [1000, 700, 1700], (30, 3))
    q, turned = robot.inverse(at), robot.forward(robot.inverse(at)).passive
    sets = [
        pk.Measurements(
            q, turned[:, k], pk.readings.Angle(f"swivel{k + 1}"), sigma=1e-3, actuator_sigma=0.3
        )
        for k in range(4)
    ]
    found = pk.identify(robot, sets, ["base*"])
    assert found.rank == len(found.free) - 4
    assert "moved along x, y and z and turned about z:" in found.gauges[0]
    assert not found.unidentifiable
