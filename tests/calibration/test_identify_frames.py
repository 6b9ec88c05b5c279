"""Instruments that stand anywhere: no frame is so turned that a calibration does not find it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.core import instruments
from pkmcal.core.poses import compose
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

from .. import workspaces

SLANTING = Rotation.from_rotvec(np.radians(170) * np.array([1, 2, -1]) / np.sqrt(6))
FRAMES = {
    "far and turned by 170 degrees": [5000.0, -8000.0, 1500.0, *SLANTING.as_euler("xyz")],
    "its x is the machine's -z": [4000.0, 3000.0, -1500.0, 0.4, np.pi / 2, 0.2],
    "upside down": [-3000.0, 2000.0, 800.0, np.pi, 0.0, 0.0],
}
NOISE = 0.02
TARGET = np.array([300.0, -100.0, 175.0])
every = pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)


def logged(name: str, frame: list[float], kind: str) -> tuple[Robot, Robot, Measurements]:
    """A machine as drawn, as it is, and what an instrument at `frame` reads of it."""
    rng = np.random.default_rng(1)
    robot = pk.load(name)
    true = robot.replace({f"offset{i}": rng.normal(0, 0.5) for i in range(1, 7)})
    q, at = robot.inverse(workspaces.poses(name, 60, 3)), np.array(frame)
    pose = true.forward(q).pose
    if kind == "pose":
        angle = NOISE / 500
        sigma = np.array([NOISE] * 3 + [angle] * 3)
        values = compose(at, pose) + sigma * rng.normal(size=(60, 6))
        return robot, true, Measurements(q, values, kind, sigma=sigma)
    points = instruments.seen_points(at, instruments.points(pose, TARGET)[0])[0]
    points += NOISE * rng.normal(size=points.shape)
    if kind == "height":
        return robot, true, Measurements(q, points[:, 2], kind, sigma=NOISE, target=TARGET)
    return robot, true, Measurements(q, points, kind, sigma=NOISE)


def assert_found(found: pk.Identification, true: Robot, frame: list[float]) -> None:
    assert found.converged and found.warnings == ()
    assert found.evaluations < 20
    assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))
    first = found.free.index("frame.x")
    corners = 300.0 * np.eye(3)
    reported = np.ascontiguousarray(found.values[first : first + 6])
    ends = [instruments.seen_points(f, corners)[0] for f in (reported, np.array(frame))]
    np.testing.assert_allclose(*ends, atol=0.3)
    off = found.robot.forward(found.fit.equations.actuators).pose
    off -= true.forward(found.fit.equations.actuators).pose
    assert np.abs(off[:, :3]).max() < 0.3


@every
@pytest.mark.parametrize("name", ["hexapod", "rbt-6t03p"])
def test_an_unknown_target_far_from_where_it_is_said_to_be(name: str, frame: list[float]) -> None:
    robot, true, readings = logged(name, frame, "position")
    found = identify(robot, readings, free="offset*", frame="unknown", target="unknown", prior=0.5)
    assert_found(found, true, frame)
    np.testing.assert_allclose(found.values[-3:], TARGET, atol=0.3)


@every
def test_poses(frame: list[float]) -> None:
    robot, true, readings = logged("hexapod", frame, "pose")
    found = identify(robot, readings, free="offset*", frame="unknown")
    assert found.rank == 12
    assert_found(found, true, frame)


def test_heights_of_an_instrument_on_its_side() -> None:
    robot, _, readings = logged("hexapod", FRAMES["far and turned by 170 degrees"], "height")
    found = identify(robot, readings, free="offset*", frame="unknown", prior=0.5)
    assert found.converged and found.rms < 1.5 * NOISE


def test_uncertainty_of_a_frame_is_the_scatter_of_calibrations() -> None:
    frame = FRAMES["far and turned by 170 degrees"]
    robot, true, readings = logged("hexapod", frame, "pose")
    clean = compose(np.array(frame), true.forward(readings.actuators).pose)
    values, rng = [], np.random.default_rng(2)
    for _ in range(40):
        noise = readings.sigma * rng.normal(size=(60, 6))
        again = dataclasses.replace(readings, values=clean + noise)
        found = identify(robot, again, free="offset*", frame="unknown")
        values.append(found.values[-6:])
    np.testing.assert_allclose(np.std(values, axis=0), found.stderr[-6:], rtol=0.4)
    assert np.corrcoef(np.array(values).T)[3, 5] == pytest.approx(
        found.covariance[-3, -1] / (found.stderr[-3] * found.stderr[-1]), abs=0.3
    )


def test_a_prior_of_the_frame_is_around_the_base() -> None:
    """As it is stated: then the frame's numbers count from zero."""
    robot, _, readings = logged("hexapod", [0.3, 0.0, 0.0, 0.0, 0.0, 0.0], "pose")
    options = {"free": "offset*", "frame": "unknown"}
    loose = identify(robot, readings, prior={"frame.x": 1.0}, **options)
    assert loose.parameters["frame.x"]["value"] == pytest.approx(0.3, abs=0.02)
    tight = identify(robot, readings, prior={"frame.x": 1e-5}, **options)
    assert tight.parameters["frame.x"]["value"] == pytest.approx(0.0, abs=1e-4)
