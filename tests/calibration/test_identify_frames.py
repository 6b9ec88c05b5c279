"""Instruments that stand anywhere: no frame is so turned that a calibration does not find it."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.core import instruments
from pkmcal.core.poses import compose
from pkmcal.exceptions import CalibrationWarning
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
    off = found.robot.forward(found.fit.equations.table.actuators).pose
    off -= true.forward(found.fit.equations.table.actuators).pose
    assert np.abs(off[:, :3]).max() < 0.3


@every
@pytest.mark.parametrize("name", ["hexapod", "rbt-6t03p"])
def test_an_unknown_target_far_from_where_it_is_said_to_be(name: str, frame: list[float]) -> None:
    robot, true, readings = logged(name, frame, "position")
    found = identify(robot, readings, free="offset*", unknown=["frame", "target"], prior=0.5)
    assert_found(found, true, frame)
    np.testing.assert_allclose(found.values[-3:], TARGET, atol=0.3)


@every
def test_poses(frame: list[float]) -> None:
    robot, true, readings = logged("hexapod", frame, "pose")
    found = identify(robot, readings, free="offset*", unknown="frame")
    assert found.rank == 12
    assert_found(found, true, frame)


def test_heights_of_an_instrument_on_its_side() -> None:
    robot, _, readings = logged("hexapod", FRAMES["far and turned by 170 degrees"], "height")
    found = identify(robot, readings, free="offset*", unknown="frame", prior=0.5)
    assert found.converged and found.rms < 1.5 * NOISE


def test_uncertainty_of_a_frame_is_the_scatter_of_calibrations() -> None:
    frame = FRAMES["far and turned by 170 degrees"]
    robot, true, readings = logged("hexapod", frame, "pose")
    clean = compose(np.array(frame), true.forward(readings.actuators).pose)
    values, rng = [], np.random.default_rng(2)
    for _ in range(40):
        noise = readings.sigma * rng.normal(size=(60, 6))
        again = dataclasses.replace(readings, values=clean + noise)
        found = identify(robot, again, free="offset*", unknown="frame")
        values.append(found.values[-6:])
    np.testing.assert_allclose(np.std(values, axis=0), found.stderr[-6:], rtol=0.4)
    assert np.corrcoef(np.array(values).T)[3, 5] == pytest.approx(
        found.covariance[-3, -1] / (found.stderr[-3] * found.stderr[-1]), abs=0.3
    )


def test_a_prior_of_the_frame_is_around_the_base() -> None:
    """As it is stated: then the frame's numbers count from zero."""
    robot, _, readings = logged("hexapod", [0.3, 0.0, 0.0, 0.0, 0.0, 0.0], "pose")
    options = {"free": "offset*", "unknown": "frame"}
    loose = identify(robot, readings, prior={"frame.x": 1.0}, **options)
    assert loose.parameters["frame.x"]["value"] == pytest.approx(0.3, abs=0.02)
    with pytest.warns(CalibrationWarning, match="contradict the prior"):
        tight = identify(robot, readings, prior={"frame.x": 1e-5}, **options)
    assert tight.parameters["frame.x"]["value"] == pytest.approx(0.0, abs=1e-4)


LEVEL = {  # machines that can move without turning, and how far in x y z
    "hexapod": (100.0, 100.0, 80.0),
    "rbt-6t03p": (10.0, 10.0, 10.0),
    "6-rus": (20.0, 20.0, 20.0),
    "2tpr2tps": (0.0, 80.0, 40.0),
    "linear-delta": (60.0, 60.0, 30.0),
    "linear-delta-6": (60.0, 60.0, 30.0),
    "rotary-delta": (60.0, 60.0, 30.0),
}


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6, 1e-4])
@pytest.mark.parametrize("name", LEVEL)
@pytest.mark.filterwarnings("ignore::pkmcal.exceptions.CalibrationWarning")
def test_level_poses_leave_the_target_where_it_was_stated(name: str, tilt: float) -> None:
    robot = pk.load(name)
    n, z = len(robot.model.limbs), []
    stated = TARGET / 6.0 + [5.0, -5.0, 3.0]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        turning = tilt if name in ("hexapod", "rbt-6t03p", "6-rus") else 0.0
        at = robot.home + rng.uniform(-1, 1, (40, 6)) * [*LEVEL[name], *[turning] * 3]
        q = robot.inverse(at)
        units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
        names = [f"offset{i + 1}" for i in range(n)]
        change = rng.normal(0.0, 0.3, n) * [1.0 if units[k] == "mm" else 0.01 for k in names]
        start = np.array([robot.geometry[k] for k in names])
        true = robot.replace(dict(zip(names, start + change, strict=True)))
        points = instruments.points(true.forward(q).pose, TARGET / 6.0)[0]
        values = instruments.seen_points(np.array(FRAMES["upside down"]), points)[0]
        values += NOISE * rng.normal(size=values.shape)
        measured = Measurements(q, values, sigma=NOISE, target=stated)
        found = identify(robot, measured, free="offset*", unknown=["frame", "target"])
        assert np.abs(found.values[-3:] - stated).max() < 10.0 + 5.0 * np.ptp(at, axis=0).max()
        assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))
        sure = np.isfinite(found.stderr[:n])
        z += ((found.values[:n] - start - change) / found.stderr[:n])[sure].tolist()
    assert not z or np.sqrt(np.mean(np.square(z))) < 2.0


def test_poses_that_do_not_turn_can_be_planned_with_frame_and_target_unknown() -> None:
    for name in ("hexapod", "2tpr2tps"):
        robot = pk.load(name)
        offsets = np.random.default_rng(0).uniform(-1, 1, (60, 3)) * LEVEL[name]
        level = robot.home + np.hstack([offsets, np.zeros((60, 3))])
        plan = pk.plan_poses(robot, level, 20, free="offset*", unknown=["frame", "target"])
        assert 0.1 < plan.predicted < 100.0


def test_a_target_found_far_from_the_machine_is_named() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(0)
    at = robot.home + rng.uniform(-1, 1, (60, 6)) * [100, 100, 80, 0.1, 0.1, 0.1]
    points = instruments.points(at, np.array([4000.0, 0.0, 0.0]))[0]
    measured = Measurements(robot.inverse(at), points, sigma=0.1)
    free = {"free": "offset*", "unknown": ["frame", "target"]}
    with pytest.warns(pk.CalibrationWarning, match="target 1 was found 4e\\+03 mm"):
        identify(robot, measured, **free)
    there = dataclasses.replace(measured, target=[3990.0, 0.0, 0.0])
    assert identify(robot, there, **free).warnings == ()


def test_a_target_found_far_from_the_machine_in_one_session_is_named_with_it() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(0)
    places, sets = {"monday": [30.0, 0.0, 0.0], "friday": [4000.0, 0.0, 0.0]}, []
    for day, place in places.items():
        at = robot.home + rng.uniform(-1, 1, (60, 6)) * [100, 100, 80, 0.1, 0.1, 0.1]
        points = instruments.points(at, np.array(place))[0]
        sets.append(Measurements(robot.inverse(at), points, sigma=0.1, session=day))
    options = {"unknown": "target", "per_session": "target*"}
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        identify(robot, sets, "offset*", **options)
    texts = [str(each.message) for each in heard if "was found" in str(each.message)]
    assert len(texts) == 1 and texts[0].startswith("target 1 of friday was found 4e+03 mm")


@pytest.mark.parametrize("turned", [0.3, 2.5, -3.0])
@pytest.mark.filterwarnings("ignore::pkmcal.exceptions.CalibrationWarning")
def test_the_frame_of_poses_in_a_plane_is_found_from_what_was_read_of_them(turned: float) -> None:
    """An instrument above a planar machine, however it is turned, reads all but its height."""
    robot, rng = pk.load("3rrr-planar"), np.random.default_rng(4)
    true = robot.replace({f"offset{i}": robot.geometry[f"offset{i}"] + 1e-3 * i for i in (1, 2, 3)})
    at = pk.sample_poses(robot, 30, seed=1, share=0.3)
    q = robot.inverse(at)
    pose = true.forward(q, guess=at).pose
    values = np.full((30, 6), np.nan)
    turn = Rotation.from_euler("z", turned)
    values[:, :2] = turn.apply(pose[:, :3])[:, :2] + [700.0, -300.0] + rng.normal(0, 0.01, (30, 2))
    values[:, 5] = np.remainder(pose[:, 5] + turned + np.pi, 2 * np.pi) - np.pi
    values[:, 3:] = np.c_[np.zeros((30, 2)), values[:, 5]] + rng.normal(0, 1e-5, (30, 3))
    measured = Measurements(q, values, "pose", sigma=[0.01] * 3 + [1e-5] * 3)
    found = identify(robot, measured, free="offset*", unknown="frame")
    value = dict(zip(found.free, found.values.tolist(), strict=True))
    assert found.converged and found.rms < 0.03
    assert value["frame.x"] == pytest.approx(700.0, abs=1.0)
    assert value["frame.y"] == pytest.approx(-300.0, abs=1.0)
    assert value["frame.gamma"] == pytest.approx(turned, abs=0.01)
