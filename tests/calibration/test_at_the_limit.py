"""Calibrations are as good as the Cramér-Rao bound lets them be, and know how good they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot

from .. import workspaces
from ..simulated import missed, tilted_poses, with_errors

SIGMA, NOISE, ARM = 0.5, 0.02, 200.0  # mm; angles are read as well as an arm of so many mm shows
ELSEWHERE = 100  # poses that are not measured

# What is measured of each machine, and at how many poses.
MACHINES = {
    "2tpr2tps": ("position", 30),
    "hexapod": ("pose", 40),
    "rbt-6t03p": ("pose", 40),
    "rotary-delta": ("position", 40),
}
# Runs, and how far the root mean square may be from the bound: its own scatter is 0.19/√runs.
QUICK = pytest.param(30, 0.12, (0.92, 0.97), id="quick")
FULL = pytest.param(200, 0.05, (0.93, 0.97), id="200 runs", marks=pytest.mark.slow)


def poses(robot: Robot, name: str, count: int, rng: np.random.Generator) -> FloatArray:
    if name == "2tpr2tps":
        return tilted_poses(robot, count, rng)
    return workspaces.poses(name, count, int(rng.integers(2**32)))


def bound(true: Robot, names: tuple[str, ...], q: FloatArray, kind: str, at: FloatArray) -> float:
    """Least mean square distance (mm²) at `at` that measurements at `q` and the prior allow."""
    geometry = true.geometry
    places = [geometry.names.index(name) for name in names]
    scale = np.array([1 / true.length if geometry.units[i] == "rad" else 1.0 for i in places])

    def jacobian(actuators: FloatArray) -> FloatArray:
        at = true.forward(actuators).pose
        return true.error_jacobian(at, actuators)[:, :, places] * scale

    weights = np.array([1, 1, 1, ARM, ARM, ARM]) / NOISE
    seen = (weights[:, None] * jacobian(q))[:, : 6 if kind == "pose" else 3]
    rows = seen.reshape(-1, len(names))
    covariance = np.linalg.inv(rows.T @ rows + np.eye(len(names)) / SIGMA**2)
    points = jacobian(at)[:, :3]
    return float(np.einsum("nij,jk,nik->n", points, covariance, points).mean())


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.parametrize(("runs", "within", "covered"), [QUICK, FULL])
@pytest.mark.parametrize("name", MACHINES)
def test_as_good_as_the_cramer_rao_bound_and_honest(
    name: str, runs: int, within: float, covered: tuple[float, float]
) -> None:
    robot = pk.load(name)
    kind, count = MACHINES[name]
    squares, least, inside = [], [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, SIGMA, rng)
        q = robot.inverse(poses(robot, name, count, rng))
        at = robot.inverse(poses(robot, name, ELSEWHERE, rng))
        measured = pk.VirtualMachine(true, NOISE, seed).measure(q, kind=kind)
        found = pk.identify(robot, measured, prior=SIGMA)
        squares.append(np.mean(missed(found.robot, true, at) ** 2))
        least.append(bound(true, found.free, q, kind, at))
        truth = [true.geometry[name] for name in found.free]
        inside.append(np.abs(found.values - truth) < 1.96 * found.stderr)
    assert np.sqrt(np.mean(squares) / np.mean(least)) == pytest.approx(1.0, abs=within)
    assert covered[0] <= np.mean(inside) <= covered[1]


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.slow
def test_held_out_points_are_off_by_what_is_expected_in_200_runs() -> None:
    robot = pk.load("2tpr2tps")
    off, expected = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        machine = pk.VirtualMachine(with_errors(robot, SIGMA, rng), NOISE, seed)
        measured = machine.measure(robot.inverse(tilted_poses(robot, 40, rng)))
        found = pk.identify(robot, measured, prior=SIGMA, holdout=10)
        off.append(found.holdout_rms**2)
        expected.append(found.holdout_expected**2)
    assert np.sqrt(np.mean(off) / np.mean(expected)) == pytest.approx(1.0, abs=0.05)


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*look at the outliers:UserWarning")
@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_two_rows_off_hardly_matter_in_200_runs(loss: str) -> None:
    robot = pk.load("2tpr2tps")
    off = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, SIGMA, rng)
        q = robot.inverse(tilted_poses(robot, 30, rng))
        measured = pk.VirtualMachine(true, NOISE, seed).measure(q)
        odd, push = np.sort(rng.choice(30, 2, replace=False)), rng.normal(size=(2, 3))
        wrong = measured.values.copy()
        wrong[odd] += 2.0 * push / np.linalg.norm(push, axis=1, keepdims=True)
        found = pk.identify(
            robot, dataclasses.replace(measured, values=wrong), prior=SIGMA, loss=loss
        )
        assert found.outliers == tuple(odd)
        at = robot.inverse(tilted_poses(robot, ELSEWHERE, rng))
        off.append(missed(found.robot, true, at).mean())
    assert np.mean(off) <= 0.021


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.slow
def test_the_papers_machine_in_200_runs() -> None:
    robot = pk.load("2tpr2tps")
    off = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, SIGMA, rng)
        q = robot.inverse(tilted_poses(robot, 30, rng))
        found = pk.identify(robot, pk.VirtualMachine(true, NOISE, seed).measure(q), prior=SIGMA)
        at = robot.inverse(tilted_poses(robot, ELSEWHERE, rng))
        off.append(missed(found.robot, true, at).mean())
    assert np.mean(off) <= 0.019
