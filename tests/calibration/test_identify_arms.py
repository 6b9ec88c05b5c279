"""Calibration of serial arms: joint errors found, ranks named, derivatives regular everywhere."""

from __future__ import annotations

import json
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.readings import Distance

ARM = pk.SerialArm.from_dh(  # an industrial arm with a wrist in one point
    a=[312, 1075, 225, 0, 0, 0],
    alpha=np.radians([-90, 0, -90, 90, -90, 0]),
    d=[670, 0, 0, 1280, 0, 215],
    theta=np.radians([0, -90, 0, 0, 0, 0]),
    name="six joints",
)
SCARA = pk.SerialArm(
    [[0, 0, 1]] * 4,
    [[0, 0, 0], [400, 0, 0], [700, 0, 0], [700, 0, 0]],
    [700, 0, -50, 0, 0, 0],
    kinds=["revolute", "revolute", "prismatic", "revolute"],
)
TARGET = [30.0, 40.0, 50.0]
THREE = np.array([[30.0, 40.0, 50.0], [-60.0, 20.0, 30.0], [10.0, -80.0, 45.0]])


# published Denavit-Hartenberg numbers, and a gantry with two turning axes
OTHERS = {
    "SCARA": SCARA,
    "six joints": ARM,
    "UR10": pk.SerialArm.from_dh(
        a=[0, -612, -572.3, 0, 0, 0],
        alpha=np.radians([90, 0, 0, 90, -90, 0]),
        d=[127.3, 0, 0, 163.9, 115.7, 92.2],
    ),
    "LBR iiwa 7": pk.SerialArm.from_dh(
        a=0, alpha=np.radians([-90, 90, 90, -90, -90, 90, 0]), d=[340, 0, 400, 0, 400, 0, 126]
    ),
    "PUMA 560": pk.SerialArm.from_dh(
        a=[0, 431.8, 20.3, 0, 0, 0],
        alpha=np.radians([90, 0, -90, 90, -90, 0]),
        d=[0, 0, 150.05, 431.8, 0, 56],
    ),
    "Stanford": pk.SerialArm.from_dh(
        a=0,
        alpha=np.radians([-90, 90, 0, -90, 90, 0]),
        d=[400, 150, 500, 0, 0, 60],
        theta=np.radians([0, 0, -90, 0, 0, 0]),
        kinds=["revolute"] * 2 + ["prismatic"] + ["revolute"] * 3,
    ),
    "gantry": pk.SerialArm(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]],
        [[0, 0, 0]] * 4 + [[0, 0, -150]],
        [0, 0, -250, 0, 0, 0],
        kinds=["prismatic"] * 3 + ["revolute"] * 2,
    ),
}


def tracked(
    arm: pk.SerialArm, theta: np.ndarray, frame: np.ndarray, points: np.ndarray, noise: float
) -> Measurements:
    """Points of the tool (k, 3) at coordinates (N, n), as a tracker in a frame sees them."""
    k = len(points)
    seen = (frame @ arm.forward(theta) @ np.vstack([points.T, np.ones(k)]))[:, :3]
    values = seen.transpose(0, 2, 1).reshape(-1, 3)
    values += np.random.default_rng(len(theta)).normal(0.0, noise, values.shape)
    return Measurements(
        np.repeat(theta, k, axis=0),
        values,
        sigma=noise or None,
        target_index=np.tile(np.arange(k), len(theta)),
    )


def erring(arm: pk.SerialArm, seed: int = 0) -> pk.SerialArm:
    """The arm with errors of 0.5 mm and 1 mrad."""
    drawn = np.random.default_rng(seed).normal(size=(arm.n_joints, 6))
    return arm.replace(drawn * [0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-3])


def coordinates(arm: pk.SerialArm, count: int, seed: int = 1) -> np.ndarray:
    scale = [2.0 if unit == "rad" else 100.0 for unit in arm.actuator_units]
    return np.random.default_rng(seed).uniform(-1, 1, (count, arm.n_joints)) * scale


def off(found: pk.SerialArm, true: pk.SerialArm, target: list[float]) -> np.ndarray:
    """Distance of the targets at new coordinates, mm."""
    theta = coordinates(true, 100, seed=9)
    point = [*target, 1.0]
    return np.linalg.norm((found.forward(theta) - true.forward(theta)) @ point, axis=1)


# --- what is found ------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", [ARM, SCARA, pk.load("3r")], ids=lambda arm: arm.name)
@pytest.mark.parametrize("kind", ["position", "pose"])
def test_without_noise_the_arm_is_found(arm: pk.SerialArm, kind: str) -> None:
    true = erring(arm)
    target = TARGET if kind == "position" else None
    measured = VirtualMachine(true, noise=0).measure(coordinates(arm, 60), kind, target=target)
    found = identify(arm, measured)
    assert isinstance(found.robot, pk.SerialArm)
    assert found.rms < 1e-7
    assert off(found.robot, true, target or [0.0, 0.0, 0.0]).max() < 1e-5


@pytest.mark.parametrize("kind", ["height", "distance"])
def test_any_kind_of_measurement_will_do(kind: str) -> None:
    true = erring(ARM)
    where = {"target": [2500.0, 300.0, 900.0]} if kind == "distance" else {"target": TARGET}
    measured = VirtualMachine(true, noise=0).measure(coordinates(ARM, 200), kind, **where)
    found = identify(ARM, measured)
    assert found.rms < 1e-7


def test_with_noise_the_uncertainty_is_what_is_off() -> None:
    true = erring(ARM)
    measured = VirtualMachine(true, noise=0.02).measure(coordinates(ARM, 60), target=TARGET)
    found = identify(ARM, measured)
    assert 0.7 < found.chi2_per_dof < 1.4
    expected = found.accuracy(coordinates(ARM, 100, seed=9), TARGET)
    actual = off(found.robot, true, TARGET)
    assert np.sqrt(np.mean(actual**2) / np.mean(expected**2)) == pytest.approx(1.0, abs=0.4)


def test_a_frame_and_targets_are_found_along() -> None:
    true = erring(ARM)
    frame = pk.screw.from_pose([1500.0, -800.0, 300.0, 0.2, -0.3, 2.0])
    measured = tracked(true, coordinates(ARM, 60), frame, THREE, noise=0.0)
    found = identify(ARM, measured, unknown=["frame", "target"])
    assert found.rms_before > 1.0
    assert found.rms < 1e-6


# --- ranks --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "targets, rank, columns",
    [([TARGET], 27, 45), ([[0.0, 0.0, 80.0]], 25, 45), (THREE, 33, 51)],
    ids=["one target", "one on axis 6", "three targets"],
)
def test_rank_of_six_joints_with_unknown_frame_and_targets(
    targets: list[list[float]], rank: int, columns: int
) -> None:
    theta = coordinates(ARM, 80)
    k = len(targets)
    index = np.tile(np.arange(k), 80)
    tools = np.repeat(ARM.forward(theta), k, axis=0)
    places = np.asarray(targets, dtype=float)[index]
    values = (tools @ np.column_stack([places, np.ones(len(index))])[:, :, None])[:, :3, 0]
    measured = Measurements(
        np.repeat(theta, k, axis=0),
        values,
        sigma=0.05,
        target=np.array(targets),
        target_index=index,
    )
    found = identify(ARM, measured, unknown=["frame", "target"])
    assert (found.rank, len(found.free)) == (rank, columns)
    assert len(found.unidentifiable) == columns - rank
    assert found.gap > 1e6


@pytest.mark.parametrize("name", OTHERS)
def test_arms_of_all_sorts_are_as_good_elsewhere_as_the_tracker(name: str) -> None:
    arm, noise = OTHERS[name], 0.05
    true = erring(arm)
    frame = pk.screw.from_pose([1500.0, -800.0, 300.0, 0.2, -0.3, 2.0])
    fitted = tracked(true, coordinates(arm, 40), frame, THREE, noise)
    elsewhere = tracked(true, coordinates(arm, 41, seed=2), frame, THREE, noise)
    found = identify(arm, fitted, unknown=["frame", "target"], holdout=elsewhere)
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.2)
    assert found.holdout_rms < 1.15 * noise * np.sqrt(3)  # what is left of a point is its noise
    # four of a revolute joint, two of a prismatic one, base and tool, the targets' triangle
    revolute = arm.kinds.count("revolute")
    assert found.rank == 4 * revolute + 2 * (arm.n_joints - revolute) + 6 + 3


def test_rank_of_the_3r_arm_is_14_of_18_and_says_what_goes_together() -> None:
    arm = pk.load("3r")
    measured = VirtualMachine(arm, noise=0.02).measure(coordinates(arm, 40), "pose")
    found = identify(arm, measured)
    assert (found.rank, len(found.free)) == (14, 18)
    # along and about axis 1, and along axis 2, two neighbouring errors do the same
    pairs = [{"joint1.dz", "joint2.dz"}, {"joint1.dpsi", "joint2.dpsi"}, {"joint2.dx", "joint3.dx"}]
    named = [set(re.findall(r"joint\d\.\w+", text)) for text in found.unidentifiable]
    assert all(pair in named for pair in pairs)
    assert "rank 14 of 18" in found.summary()


# --- derivatives --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["position", "height", "distance", "pose"])
@pytest.mark.parametrize("framed", [False, True])
def test_derivatives_of_what_is_read_are_those_of_differences(kind: str, framed: bool) -> None:
    if kind == "distance" and framed:
        pytest.skip("distances depend on no frame")
    rng = np.random.default_rng(3)
    theta = coordinates(ARM, 7)
    if kind != "pose":
        theta[0] = 0.0  # the tool is at beta = 90 degrees there, where angles have no rates
        assert abs(pk.screw.to_pose(ARM.forward(theta[0]))[4]) == pytest.approx(np.pi / 2, abs=1e-9)
    shape = {"height": (7,), "distance": (7,), "position": (7, 3), "pose": (7, 6)}[kind]
    measured = Measurements(
        theta, rng.normal(size=shape),
        Distance([50.0, 60.0, 70.0]) if kind == "distance" else kind,
        target=None if kind == "pose" else [300.0, -200.0, 150.0],
    )  # fmt: skip
    share = FitData(measured, np.arange(7), framed, False)
    equations = Equations.of([share], parameters(ArmMachine(erring(ARM)), [share], Asked()))
    at = equations.parameters.start.copy()
    if framed:
        at[-6:] = [10.0, -20.0, 30.0, 0.3, -0.2, 0.9]
    (jacobian,) = equations.jacobian(equations.at(at))
    scale = equations.parameters.scale
    for j in range(len(at)):
        step = np.zeros(len(at))
        step[j] = 1e-3 * scale[j]
        low, high = (equations.at(at + s).residuals[0] for s in (-step, step))
        difference = (low - high) / (2e-3 * scale[j])  # residuals are measured less predicted
        assert np.abs(difference - jacobian[:, :, j]).max() * scale[j] < 1e-7


# --- what comes back, and mistakes ----------------------------------------------------------------


def test_the_result_is_an_arm_that_can_be_saved_and_sent(tmp_path: Path) -> None:
    measured = VirtualMachine(erring(ARM)).measure(coordinates(ARM, 40), target=TARGET)
    found = identify(ARM, measured, free="joint[2-6].*", unknown="frame")  # which is joint 1's
    assert found.free[0] == "joint2.dx"
    assert not found.robot.joint_errors[0].any()
    for again in (pickle.loads(pickle.dumps(found.robot)), _saved(found.robot, tmp_path)):
        assert (again.joint_errors == found.robot.joint_errors).all()
        assert (again.forward(np.ones(6)) == found.robot.forward(np.ones(6))).all()
    assert found.parameters["joint6.dpsi"].keys() == {"value", "stderr"}


def _saved(arm: pk.SerialArm, folder: Path) -> pk.SerialArm:
    arm.save(folder / "arm.toml")
    return pk.load(folder / "arm.toml")


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda m: identify(ARM, m, free="joint7.*"), "no number of the arm matches 'joint7"),
        (lambda m: identify(ARM, m, free="joint2.dxx"), "did you mean 'joint2.dx'"),
        (lambda m: identify(pk.load("3r"), m), "3R arm has 3 actuators, found 6 per row"),
        (lambda m: identify(SCARA, m.select(np.arange(4))), "4 actuators, found 6"),
    ],
)
def test_mistakes_are_named(call: Callable[[Measurements], object], message: str) -> None:
    measured = VirtualMachine(ARM).measure(coordinates(ARM, 20), target=TARGET)
    with pytest.raises(ValueError, match=message):
        call(measured)


def test_coordinates_that_are_not_finite_are_refused_by_row() -> None:
    machine = VirtualMachine(ARM)
    with pytest.raises(ValueError, match="1 of 3 rows have no pose on the true machine"):
        machine.measure([[0.0] * 6, [1e6] * 6, [1.0] * 6])


def test_the_command_calibrates_an_arm_too(run: Any, tmp_path: Path) -> None:

    erring(ARM).replace(np.zeros((6, 6))).save(tmp_path / "arm.toml")
    VirtualMachine(erring(ARM)).measure(coordinates(ARM, 40), target=TARGET).write(
        tmp_path / "tracker.csv"
    )
    files = [str(tmp_path / name) for name in ("arm.toml", "tracker.csv")]
    done = run("calibrate", *files, "--out", str(tmp_path / "found"))
    assert done.exit_code == 0, done.output
    found = pk.load(tmp_path / "found" / "robot.toml")
    assert off(found, erring(ARM), TARGET).max() < 0.1
    printed = json.loads(run("calibrate", *files, "--json").stdout)
    numbers = dict(zip(printed["free"], found.joint_errors.ravel(), strict=True))
    assert printed["robot"] == {"name": "six joints", "geometry": pytest.approx(numbers)}
    assert printed["parameters"]["joint2.dtheta"]["value"] == numbers["joint2.dtheta"]
