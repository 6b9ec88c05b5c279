"""Derivatives of what instruments read are those of its differences, through the whole machine."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.core import instruments
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from pkmcal.measurements.measurements import Measurements

from .. import twin
from .kinds import KINDS, predict


def differences(equations: Equations, theta: np.ndarray, scale: np.ndarray) -> np.ndarray:
    columns = []
    for j, s in enumerate(scale):
        step = np.zeros(len(theta))
        step[j] = 1e-3 * s
        ahead, back = equations.at(theta + step), equations.at(theta - step)
        columns.append((back.residuals[0] - ahead.residuals[0]) / (2e-3 * s))
    return np.stack(columns, axis=-1)


def test_jacobian_passes_through_ties() -> None:
    robot = pk.load("examples/linear-delta/robot.toml")
    poses = np.array([[10.0, 20, 100, 0, 0, 0], [-40.0, 5, 80, 0, 0, 0], [0, -50.0, 120, 0, 0, 0]])
    readings = Measurements(robot.inverse(poses), poses[:, 2], "height")
    share = FitData(readings, np.arange(3), False, False)
    chosen = parameters(robot, [share], Asked())
    equations = Equations.of([share], chosen)
    (jacobian,) = equations.jacobian(equations.at(chosen.start))
    expected = differences(equations, chosen.start, chosen.scale)
    np.testing.assert_allclose(jacobian, expected, rtol=1e-5, atol=1e-7)


def test_points_and_distances_are_those_of_the_twin() -> None:
    rng = np.random.default_rng(3)
    pose, target, anchor = rng.normal(0, 1, (9, 6)), rng.normal(0, 9, (9, 3)), rng.normal(0, 9, 3)
    expected = np.array([p[:3] + twin.rotation(p) @ t for p, t in zip(pose, target, strict=True)])
    np.testing.assert_allclose(instruments.points(pose, target)[0], expected, rtol=0, atol=1e-13)
    lengths = np.linalg.norm(expected - anchor, axis=1)
    np.testing.assert_allclose(
        instruments.distances(pose, target, anchor)[0], lengths, rtol=0, atol=1e-13
    )


def test_a_distance_of_zero_has_no_derivative_and_no_nan() -> None:
    pose = np.array([[1.0, 2, 3, 0.1, 0.2, 0.3], [1, 2, 4, 0, 0, 0]])
    seen = predict("distance", pose, anchor=np.array([1.0, 2, 3]))
    np.testing.assert_array_equal(seen.values[:, 0], [0, 1])
    assert (seen.by_twist[0] == 0).all() and np.isfinite(seen.by_twist).all()


def test_a_frame_moves_points_as_the_pose_of_the_base_in_it() -> None:
    rng = np.random.default_rng(1)
    pose, frame = rng.normal(0, 0.5, (5, 6)), rng.normal(0, 0.5, 6)
    target = rng.normal(0, 50, (5, 3))
    seen = predict("position", pose, target, frame=frame).values
    inner = predict("position", pose, target).values
    outer = instruments.seen_points(frame, inner)[0]
    again = predict("position", np.tile(frame, (5, 1)), inner).values
    np.testing.assert_allclose(again, outer, atol=1e-12)
    np.testing.assert_allclose(seen, outer, atol=1e-12)


def test_poses_in_a_frame_carry_points_there() -> None:
    rng = np.random.default_rng(2)
    pose, frame = rng.normal(0, 0.5, (5, 6)), rng.normal(0, 0.5, 6)
    target = rng.normal(0, 50, (5, 3))
    composed = predict("pose", pose, frame=frame).values
    there = predict("position", composed, target).values
    expected = predict("position", pose, target, frame=frame).values
    np.testing.assert_allclose(there, expected, atol=1e-12)


def test_angles_differ_the_short_way_round() -> None:
    one = np.array([[0, 0, 0, np.pi - 0.01, 0, 0]])
    other = np.array([[0, 0, 0, -np.pi + 0.01, 0, 0]])
    np.testing.assert_allclose(KINDS["pose"].difference(one, other)[0, 3], -0.02, atol=1e-12)


def test_a_distance_between_touched_points_is_theirs_whatever_the_machine_does() -> None:
    rng = np.random.default_rng(4)
    place, anchor = rng.normal(0, 90, (4, 6)), rng.normal(0, 90, (4, 3))
    pose = rng.normal(0, 1, (4, 6))
    seen = predict("touch-distance", pose, place=place, anchor=anchor)
    expected = np.linalg.norm(place[:, :3] - anchor, axis=1)
    np.testing.assert_allclose(seen.values[:, 0], expected, rtol=1e-15)
    assert (seen.by_twist == 0).all()
    unit = (place[:, :3] - anchor) / expected[:, None]
    np.testing.assert_allclose(seen.by["place"][:, 0, :3], unit, atol=1e-15)
    np.testing.assert_allclose(seen.by["anchor"][:, 0], -unit, atol=1e-15)


def test_a_level_sensor_reads_pitch_and_roll() -> None:
    """x points up where the platform pitches back, y where it rolls to the left."""
    pose = np.array([[5.0, 6, 7, 0, -0.3, 2.0], [0, 0, 0, 0.2, 0, -1.0]])
    np.testing.assert_allclose(predict("tilt", pose).values, [[0.3, 0], [0, 0.2]], atol=1e-15)


def test_a_frame_turns_orientations_and_tilts_as_it_turns_the_platform() -> None:
    rng = np.random.default_rng(6)
    pose, frame = rng.normal(0, 0.4, (5, 6)), rng.normal(0, 0.4, 6)
    composed = predict("pose", pose, frame=frame).values
    mounting = rng.normal(0, 0.4, 3)
    for kind in ("orientation", "tilt"):
        seen = predict(kind, pose, frame=frame, mounting=mounting).values
        there = predict(kind, composed, mounting=mounting).values
        np.testing.assert_allclose(seen, there, atol=1e-14)
