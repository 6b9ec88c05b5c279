"""Where the search for what was touched begins: on the places that were touched."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.starts import with_starts

CENTRE, RADIUS = np.array([20.0, -10.0, 480.0]), 30.0
ABOUT = np.array([[1.0, 0, 0], [0, 1, 0], [0.6, 0, 0.8], [0, -0.8, 0.6], [-0.6, -0.8, 0]])


def starts(robot: pk.Robot, points: np.ndarray, artefact: str) -> dict[str, np.ndarray]:
    poses = np.hstack([points, np.zeros((len(points), 3))])
    touch = pk.readings.Touch(["A"] * len(points), artefact)
    touched = pk.Measurements(robot.inverse(poses), None, touch)
    (data,) = with_starts(robot, [FitData(touched, np.arange(len(points)), False, False)])
    return {role: start.values for (role, _), start in data.starts.items()}


@pytest.mark.parametrize("touches", [4, 5])
def test_a_ball_begins_as_the_sphere_through_its_touches(hexapod: pk.Robot, touches: int) -> None:
    """Four points that lie on no circle have one sphere."""
    found = starts(hexapod, CENTRE + RADIUS * ABOUT[:touches], "sphere")
    np.testing.assert_allclose(found["touch"], CENTRE, atol=1e-6)
    np.testing.assert_allclose(found["touch radius"], RADIUS, atol=1e-6)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.2, -0.1)])
def test_a_plane_begins_through_its_touches(hexapod: pk.Robot, tilt: tuple[float, float]) -> None:
    """Its place on z, and the turnings about x and y that take z to its normal."""
    alpha, beta = tilt
    normal = np.array([np.sin(beta) * np.cos(alpha), -np.sin(alpha), np.cos(beta) * np.cos(alpha)])
    across = np.random.default_rng(0).uniform(-40, 40, (6, 2))
    z = 480.0 - across @ normal[:2] / normal[2]
    found = starts(hexapod, np.column_stack([across, z]), "plane")["touch"]
    np.testing.assert_allclose(found, [480.0, alpha, beta], atol=1e-6)


def test_a_plane_that_was_touched_once_begins_there(hexapod: pk.Robot) -> None:
    np.testing.assert_allclose(
        starts(hexapod, CENTRE[None], "plane")["touch"], [480.0, 0.0, 0.0], atol=1e-9
    )
