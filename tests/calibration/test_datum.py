"""A datum says where frames lie and nothing else: what is predicted is the same with any."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.estimation.identifiability import decompose
from pkmcal.kinematics.calibratable import as_machine

from .. import workspaces

NOISE = 0.01
TARGETS = np.array([[80.0, 0, 20], [-40, 70, 10], [-40, -70, 30]])
FRAME = np.array([100.0, 200, 50, 0.1, 0.2, 0.3])
POSES, OTHERS = 60, 40
ARM = "3r"
# of linear-delta-6 some combinations can hardly be identified, and are or not as rounding has it
MACHINES = [*(name for name in workspaces.WORKSPACE if name != "linear-delta-6"), ARM]
every = pytest.mark.parametrize("name", MACHINES)


def matrices(poses: np.ndarray) -> np.ndarray:
    """Homogeneous matrices (N, 4, 4) of poses (N, 6), written without the package."""
    made = np.zeros((len(poses), 4, 4))
    made[:, :3, :3] = Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
    made[:, :3, 3], made[:, 3, 3] = poses[:, :3], 1.0
    return made


def seen(robot: Any, q: np.ndarray, frame: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Targets in the instrument's frame, (N, 3 targets, 3)."""
    points = np.column_stack([targets, np.ones(len(targets))])
    poses = as_machine(robot).forward(q).pose
    return (matrices(frame[None]) @ matrices(poses) @ points.T).transpose(0, 2, 1)[:, :, :3]


def seen_by(found: pk.Identification, q: np.ndarray) -> np.ndarray:
    """What the calibration predicts that the instrument reads."""
    numbers = dict(zip(found.free, found.values, strict=True))
    frame = np.array(
        [numbers[f"frame.{axis}"] for axis in ("x", "y", "z", "alpha", "beta", "gamma")]
    )
    targets = np.array([
        [numbers.get(f"target{k + 1}.{axis}", TARGETS[k, i]) for i, axis in enumerate("xyz")]
        for k in range(len(TARGETS))
    ])  # fmt: skip
    return seen(found.robot, q, frame, targets)


def actuators(name: str, count: int, seed: int) -> np.ndarray:
    if name == ARM:
        return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3))
    return pk.load(name).inverse(workspaces.poses(name, count, seed))


def with_errors(robot: Any, names: list[str], rng: np.random.Generator) -> Any:
    """The robot with errors of about 0.1 mm, or as much at its size, of these numbers."""
    machine = as_machine(robot)
    units = dict(zip(machine.geometry.names, machine.geometry.units, strict=True))
    values = dict(zip(machine.geometry.names, machine.geometry.values.tolist(), strict=True))
    for name in names:
        values[name] += rng.normal(0, 0.1) / (1.0 if units[name] == "mm" else machine.length)
    if isinstance(robot, pk.SerialArm):
        return robot.replace(np.array(list(values.values())).reshape(-1, 6))
    return robot.replace({name: values[name] for name in names})


def measured(true: Any, q: np.ndarray, rng: np.random.Generator) -> pk.Measurements:
    values = seen(true, q, FRAME, TARGETS)
    values += rng.normal(0, NOISE, values.shape)
    index = np.tile(np.arange(len(TARGETS)), len(q))
    rows = np.repeat(q, len(TARGETS), axis=0)
    flat = values.reshape(-1, 3)
    return pk.Measurements(rows, flat, "position", sigma=NOISE, target=TARGETS, target_index=index)


@functools.cache
def calibrated(name: str, datum: Any) -> pk.Identification:
    robot, rng = pk.load(name), np.random.default_rng(4)
    machine = as_machine(robot)
    true = with_errors(robot, list(machine.geometry.match(machine.model.free)), rng)
    readings = measured(true, actuators(name, POSES, 5), rng)
    return pk.identify(
        robot, readings, unknown=["frame", "target"], fix=["datum"] if datum == "auto" else []
    )


@every
def test_what_is_predicted_does_not_depend_on_the_datum(name: str) -> None:
    plain, held = calibrated(name, "none"), calibrated(name, "auto")
    assert plain.datum.names == () and held.datum.names
    assert held.rank == plain.rank
    assert held.rms == pytest.approx(plain.rms, rel=1e-3)
    q = actuators(name, OTHERS, 6)
    np.testing.assert_allclose(seen_by(held, q), seen_by(plain, q), atol=NOISE / 50)


@every
def test_every_number_is_held_or_has_a_finite_deviation(name: str) -> None:
    held = calibrated(name, "auto")
    assert len(held.free) + len(held.datum.names) == len(calibrated(name, "none").free)
    unsure = {name for name, sigma in zip(held.free, held.stderr, strict=True) if np.isinf(sigma)}
    # a planar machine does not show how high its targets are beside the instrument's frame
    assert unsure <= {
        f"{point}.{axis}" for point in ("frame", "target1", "target2", "target3") for axis in "xyz"
    }
    assert not unsure or name == "3rrr-planar"
    machine, nominal = as_machine(held.robot), as_machine(pk.load(name))
    values = dict(zip(machine.geometry.names, machine.geometry.values, strict=True))
    for number, value in zip(nominal.geometry.names, nominal.geometry.values, strict=True):
        assert number not in held.datum.names or values[number] == value


@every
def test_deviations_are_those_of_the_s_transformation(name: str) -> None:
    """Baarda: S C Sᵀ with S = 1 - N (N_held)⁻¹, of the covariance C of the free network."""
    plain, held = calibrated(name, "none"), calibrated(name, "auto")
    if np.isinf(held.stderr).any():
        pytest.skip("some numbers of this machine stay unidentifiable")
    chosen, names = plain.fit.parameters, list(plain.free)
    rank = plain.rank
    _, basis = decompose(plain.fit.estimate.triangle)
    null = basis[:, rank:]
    pinned = [names.index(each) for each in held.datum.names]
    kept = [names.index(each) for each in held.free]
    scaled = np.linalg.inv(held.fit.parameters.scale * np.eye(len(kept)))
    network = plain.fit.uncertainty.scaled
    turn = np.eye(len(names))
    turn -= null @ np.linalg.solve(null[pinned], np.eye(len(names))[pinned])
    expected = (turn @ network @ turn.T)[np.ix_(kept, kept)]
    own = scaled @ held.covariance @ scaled.T
    mm = [k for k, each in enumerate(held.free) if not each.startswith("frame.")]
    ratio = np.sqrt(np.diagonal(own)[mm] / np.diagonal(expected)[mm])
    # the two are at different places of one family of machines, which is curved
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)
    assert ("frame", "") in chosen.nuisance


@pytest.mark.parametrize("name", ["hexapod", "linear-delta", ARM])
def test_a_machine_whose_held_numbers_are_right_is_found(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(8)
    machine = as_machine(robot)
    held = calibrated(name, "auto").datum.names
    names = [each for each in machine.geometry.match(machine.model.free) if each not in held]
    true = with_errors(robot, names, rng)
    readings = measured(true, actuators(name, POSES, 9), rng)
    found = pk.identify(robot, readings, unknown=["frame", "target"], fix="datum")
    assert set(found.datum.names) == set(held)
    own = as_machine(true).geometry
    right = dict(zip(own.names, own.values, strict=True))
    right |= {f"target{k + 1}.{a}": TARGETS[k, i] for k in range(3) for i, a in enumerate("xyz")}
    axes = ("x", "y", "z", "alpha", "beta", "gamma")
    right |= {f"frame.{axis}": FRAME[i] for i, axis in enumerate(axes)}
    off = found.values - np.array([right[each] for each in found.free])
    squares = off @ np.linalg.solve(found.covariance, off)
    dof = len(off)
    assert squares == pytest.approx(dof, abs=5 * np.sqrt(2 * dof))


def test_the_actuators_that_reach_a_place_do_not_depend_on_the_datum() -> None:
    plain, held = calibrated("hexapod", "none"), calibrated("hexapod", "auto")
    near = actuators("hexapod", 5, 12)
    for q in near:
        wanted = seen_by(plain, q[None])
        found = least_squares(
            lambda x, wanted=wanted: (seen_by(held, x[None]) - wanted).ravel(), q + 0.5, x_scale=0.1
        )
        np.testing.assert_allclose(found.x, q, atol=NOISE / 50)


def test_six_numbers_fix_the_base_frame_and_six_the_platform_frame() -> None:
    held = calibrated("hexapod", "auto").datum
    assert (held.base, held.platform, held.between, len(held.names)) == (6, 6, 0, 12)
    for part in ("base", "platform"):
        joints = [name.split(".")[0] for name in held.names if name.startswith(part)]
        counts = sorted(joints.count(joint) for joint in set(joints))
        assert counts == [1, 2, 3], "3-2-1"
    said = " ".join(str(calibrated("hexapod", "auto")).split())
    assert "12 numbers only say where frames lie and are held (6 for the base frame, 6 for" in said


def test_what_is_known_needs_no_datum() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(2)
    q = actuators("hexapod", 40, 3)
    true = with_errors(robot, robot.geometry.match(robot.model.free), rng)
    values = seen(true, q, np.zeros(6), TARGETS).reshape(-1, 3)
    index = np.tile(np.arange(3), len(q))
    rows = np.repeat(q, 3, axis=0)
    readings = pk.Measurements(
        rows, values, "position", sigma=0.01, target=TARGETS, target_index=index
    )
    assert pk.identify(robot, readings, fix="datum").datum.names == ()
    by_frame = pk.identify(robot, readings, unknown="frame", fix="datum").datum
    assert (by_frame.base, by_frame.platform, len(by_frame.names)) == (6, 0, 6)
    by_target = pk.identify(robot, readings, unknown="target", fix="datum").datum
    assert (by_target.base, by_target.platform, len(by_target.names)) == (0, 6, 6)


def test_too_few_poses_are_no_matter_of_frames() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(2)
    readings = measured(robot, actuators("hexapod", 4, 3), rng)
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, readings, unknown=["frame", "target"], fix="datum")
    assert len(found.datum.names) == 12
    assert found.rank < len(found.free) and found.unidentifiable
    assert np.isinf(found.stderr).any()


def test_a_number_with_a_prior_or_bounds_is_not_held() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(2)
    readings = measured(robot, actuators("hexapod", 40, 3), rng)
    both = {"unknown": ["frame", "target"], "fix": "datum"}
    held = pk.identify(robot, readings, **both, bounds={"base1.*": (-1e4, 1e4)}).datum
    assert len(held.names) == 12 and not [name for name in held.names if "base1." in name]
    tied = pk.identify(robot, readings, **both, prior={"base*": 0.1}).datum
    assert (tied.base, tied.platform) == (0, 6)


def test_a_datum_of_frames_alone_holds_nothing() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 12, seed=1))
    measured = pk.VirtualMachine(robot, 0.01).measure(q, "pose")
    found = pk.identify(robot, measured, [], unknown=["frame", "target"], fix="datum")
    assert not found.datum.names and len(found.free) == 12


def test_numbers_that_are_fixed_are_no_parameters() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(2)
    readings = measured(robot, actuators("hexapod", 30, 3), rng)
    kinds = {"unknown": ["frame", "target"]}
    found = pk.identify(
        robot, readings, **kinds, free=["base*", "offset*"], fix=["base1.*", "base2.z"]
    )
    assert not {"base1.x", "base1.y", "base1.z", "base2.z"} & set(found.free)
    assert {"base2.x", "offset6"} <= set(found.free)
    with pytest.raises(pk.ArgumentError, match="fix: no number of the geometry matches 'nose'"):
        pk.identify(robot, readings, **kinds, fix="nose")
    with pytest.raises(pk.ArgumentError, match="fix: no parameter is left free"):
        pk.identify(robot, readings, **kinds, free="base*", fix="base*")
    with pytest.raises(pk.ArgumentError, match="matches '3-2-1'"):
        pk.identify(robot, readings, **kinds, fix=["3-2-1"])


def test_json_has_held_numbers_apart_from_the_parameters(run: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    file = tmp_path / "measured.csv"
    readings = measured(pk.load("hexapod"), actuators("hexapod", 20, 3), rng)
    readings.write(file)
    command = ("calibrate", "hexapod", file, "--frame", "unknown", "--target", "unknown")
    said = json.loads(run(*command, "--datum", "auto", "--json").stdout)
    assert len(said["datum"]["names"]) == 12
    assert not set(said["datum"]["names"]) & set(said["parameters"])
    assert not set(said["datum"]["names"]) & set(said["free"])
    text = run(*command, "--datum", "auto").stdout
    assert "6 for the base frame" in text and "± inf" not in text
    assert "--datum auto" in run(*command).stdout
    assert "base1.x " not in run(*command, "--fix", "base1.x,base2.*").stdout


def test_a_datum_is_advised_where_frames_were_sought() -> None:
    """Too few poses leave numbers open that no datum would fix."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(2)
    readings = measured(robot, actuators("hexapod", 4, 3), rng)
    with pytest.warns(pk.CalibrationWarning):
        known = pk.identify(robot, readings)
    with pytest.warns(pk.CalibrationWarning):
        sought = pk.identify(robot, readings, unknown="frame")
    assert known.unidentifiable and "--datum" not in str(known)
    assert sought.unidentifiable and "--datum auto" in str(sought)
