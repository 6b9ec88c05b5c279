"""ISO 230-4: what a ball bar says of circles, on circles whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray

ANGLE = np.linspace(0, 2 * np.pi, 721)
RADIUS = 150.0


def path(radius: FloatArray | float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    ways = np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    return ways * np.broadcast_to(radius, ANGLE.shape)[:, None] + [x, y]


def test_a_circle_off_centre_is_round_and_its_centre_is_found() -> None:
    found = pk.circular_test(path(RADIUS + 0.005, 0.3, -0.2), radius=RADIUS)
    assert found.deviation[0] == pytest.approx(0.0, abs=1e-10)
    assert found.radial[0] == pytest.approx((0.005, 0.005), abs=1e-10)
    np.testing.assert_allclose(found.centre, [0.3, -0.2], atol=1e-10)
    assert np.isnan(found.bidirectional) and np.isnan(found.mean_radial)


def test_about_the_instruments_centre_the_radial_deviation_has_the_eccentricity() -> None:
    found = pk.circular_test(path(RADIUS, 0.03), radius=RADIUS, centred=False)
    assert found.radial[0] == pytest.approx((0.03, -0.03), abs=1e-9)


def test_axes_out_of_square_make_an_oval_of_twice_the_error() -> None:
    """x grows by θ y: the radius by θ r sin φ cos φ, from -θ r / 2 to θ r / 2."""
    theta = 1e-4
    points = path(RADIUS)
    points[:, 0] += theta * points[:, 1]
    found = pk.circular_test(points, radius=RADIUS)
    assert found.deviation[0] == pytest.approx(theta * RADIUS, rel=1e-3)


def test_backlash_shows_between_the_directions_alone() -> None:
    """Either path is a circle; they stand apart by the backlash, in x."""
    lost = 0.02
    found = pk.circular_test(path(RADIUS, lost / 2), path(RADIUS, -lost / 2)[::-1], radius=RADIUS)
    assert found.deviation == pytest.approx((0.0, 0.0), abs=1e-10)
    assert found.bidirectional == pytest.approx(lost, rel=1e-3)
    assert found.mean_radial == pytest.approx(0.0, abs=1e-10)


def test_the_range_is_no_less_than_the_least_zone_and_no_more_than_twice() -> None:
    from scipy.optimize import minimize

    rng = np.random.default_rng(5)
    lobes = sum(rng.normal(0, 0.01) * np.cos(k * ANGLE + rng.uniform(0, 6)) for k in range(2, 7))
    points = path(RADIUS + lobes)

    def zone(centre: FloatArray) -> float:
        return float(np.ptp(np.linalg.norm(points - centre, axis=1)))

    least = minimize(zone, [0.0, 0.0], method="Nelder-Mead", options={"xatol": 1e-9}).fun
    assert least <= pk.circular_test(points, radius=RADIUS).deviation[0] < 2 * least


def test_a_table_says_it() -> None:
    text = str(pk.circular_test(path(RADIUS + 0.01), path(RADIUS)[::-1], radius=RADIUS))
    assert "full circles of radius 150 mm, after ISO 230-4" in text
    assert "circular deviation G" in text and "0.0050" in text


def test_what_is_no_circle_is_refused() -> None:
    with pytest.raises(ValueError, match="path must be 4 or more finite points"):
        pk.circular_test([[1, 0], [0, 1], [-1, 0]], radius=1)
    with pytest.raises(ValueError, match="points lie on a line"):
        pk.circular_test([[1, 0], [2, 0], [3, 0], [4, 0]], radius=1, centred=False)
    with pytest.raises(ValueError, match="an arc has no least-squares centre"):
        pk.circular_test(path(RADIUS)[:300], radius=RADIUS)
    with pytest.raises(ValueError, match="radius must be above 0"):
        pk.circular_test(path(RADIUS), radius=0)
    arc = pk.circular_test(path(RADIUS)[:300], radius=RADIUS, centred=False)
    assert not arc.full and arc.deviation[0] == pytest.approx(0.0, abs=1e-9)


def test_a_delta_with_towers_out_of_place_draws_ovals() -> None:
    """As a ball bar sees it: distances from a fixed socket to the tool's ball, along a circle."""
    robot = pk.load("linear-delta")
    true = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.2})
    circle = np.zeros((len(ANGLE), 6))
    circle[:, :2] = 60.0 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    circle[:, 2] = robot.home[2]
    socket = [0.0, 0.0, robot.home[2]]
    machine = pk.VirtualMachine(true, noise=0.0)
    read = machine.measure(robot.inverse(circle), "distance", socket)
    assert read.kind == "distance"
    points = read.values[:, None] * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    there = true.forward(robot.inverse(circle)).pose[:, :2]
    found = pk.circular_test(points, radius=60.0)
    expected = pk.circular_test(there, radius=60.0)
    assert found.deviation[0] == pytest.approx(expected.deviation[0], rel=0.05)
    assert found.deviation[0] > 0.01
