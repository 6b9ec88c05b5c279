"""Tables of corrections: exact at their nodes, and off in between by what they say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.compensation.correction_grid import CorrectionGrid, correction_grid
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.robot import Robot

from ..simulated import with_errors

AXES = {"y": np.linspace(-60, 60, 7), "z": np.linspace(360, 430, 5)}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return pk.load("2tpr2tps")


@pytest.fixture(scope="module")
def calibrated(robot: Robot) -> Robot:
    return with_errors(robot, 0.5, np.random.default_rng(0))


@pytest.fixture(scope="module")
def grid(robot: Robot, calibrated: Robot) -> CorrectionGrid:
    tilts = np.linspace(-0.2, 0.2, 4)
    return correction_grid(robot, calibrated, {**AXES, "alpha": tilts, "beta": tilts})


def test_nodes_hold_the_difference_of_the_inverses(
    robot: Robot, calibrated: Robot, grid: CorrectionGrid
) -> None:
    assert grid.coordinates == ("y", "z", "alpha", "beta")
    assert grid.corrections.shape == (7, 5, 4, 4, 4)
    z, beta = AXES["z"][3], -0.2
    pose = [z * np.tan(beta), AXES["y"][2], z, 0.2, beta, 0.0]
    wanted = calibrated.inverse(pose) - robot.inverse(pose)
    np.testing.assert_allclose(grid.corrections[2, 3, 3, 0], wanted, atol=1e-9)
    np.testing.assert_allclose(grid.at(pose), wanted, atol=1e-9)


def test_stated_error_covers_poses_anywhere_in_the_grid(
    robot: Robot, calibrated: Robot, grid: CorrectionGrid
) -> None:
    rng = np.random.default_rng(1)
    low, high = np.array([[a[0], a[-1]] for a in grid.axes]).T
    y, z, alpha, beta = rng.uniform(low, high, (500, 4)).T
    poses = np.stack([z * np.tan(beta), y, z, alpha, beta, 0 * y], axis=1)
    ideal = robot.inverse(poses)
    off = np.abs(grid.at(poses) - (calibrated.inverse(poses) - ideal))
    assert (off.max(axis=0) < 1.2 * grid.error).all()
    assert (off.max(axis=0) > 0.2 * grid.error).all()
    missed = calibrated.forward(ideal + grid.at(poses), guess=poses).pose - poses
    distance = np.linalg.norm(missed[:, :3], axis=1)
    assert distance.max() < 1.2 * grid.position_error
    raw = calibrated.forward(ideal, guess=poses).pose - poses
    assert distance.max() < 0.1 * np.linalg.norm(raw[:, :3], axis=1).mean()


def test_half_the_spacing_leaves_a_quarter_of_the_error(robot: Robot, calibrated: Robot) -> None:
    errors = []
    for count in (5, 9, 17):
        axes = {"y": np.linspace(-60, 60, count), "z": np.linspace(360, 430, count)}
        errors.append(correction_grid(robot, calibrated, axes).position_error)
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.3)


def test_cubic_is_better_than_linear(robot: Robot, calibrated: Robot) -> None:
    linear, cubic = (
        correction_grid(robot, calibrated, AXES, method=m) for m in ("linear", "cubic")
    )
    assert cubic.position_error < 0.2 * linear.position_error


def test_outside_and_out_of_reach_is_nan() -> None:
    robot = pk.load("linear-delta")
    true = robot.replace({"offset1": robot.geometry["offset1"] + 0.3})
    found = correction_grid(robot, true, {"x": np.linspace(-320, 320, 17)})
    assert np.isnan(found.corrections[0]).all()
    assert np.isfinite(found.corrections[8]).all()
    assert 0 < found.reached < found.checked == 16
    assert np.isfinite(found.error).all()
    far = robot.home.copy()
    far[0] = 700.0
    assert np.isnan(found.at(far)).all()


def test_written_table_reads_back(grid: CorrectionGrid, tmp_path: Path) -> None:
    grid.write(tmp_path / "grid.csv")
    text = (tmp_path / "grid.csv").read_text()
    assert "error of the position" in text.splitlines()[1]
    assert "y [mm],z [mm],alpha [deg],beta [deg],dq1 [mm]" in text
    table = Table(tmp_path / "grid.csv")
    values = np.stack([table.numbers(f"dq{i}", "mm")[0] for i in range(1, 5)], axis=1)
    np.testing.assert_allclose(values, grid.corrections.reshape(-1, 4), atol=6e-7)
    alpha, _ = table.numbers("alpha", "rad")
    np.testing.assert_allclose(alpha[:16], np.repeat(grid.axes[2], 4), atol=1e-9)


BAD: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"axes": {}}, ValueError, "names no coordinate"),
    ({"axes": {"alhpa": [0, 1]}}, ValueError, "alpha"),
    ({"axes": {"y": [0.0]}}, ValueError, "at least 2"),
    ({"axes": {"y": [0.0, 1.0, 2.0]}, "method": "cubic"}, ValueError, "at least 4"),
    ({"axes": {"y": [1.0, 0.0]}}, ValueError, "increase"),
    ({"axes": {"y": ["a", "b"]}}, TypeError, "numbers"),
    ({"method": "nearest"}, ValueError, "method"),
    ({"origin": [[0.0] * 6]}, ValueError, "origin"),
]


@pytest.mark.parametrize(("changes", "error", "message"), BAD)
def test_bad_arguments_are_named(
    robot: Robot, changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        correction_grid(**{"robot": robot, "calibrated": robot, "axes": AXES, **changes})


def test_a_grid_that_the_machines_cannot_span_is_refused(robot: Robot) -> None:
    with pytest.raises(ValueError, match="'x' is no coordinate that 2TPR&2TPS moves"):
        correction_grid(robot, robot, {"x": [0.0, 1.0, 2.0]})
    with pytest.raises(ValueError, match="must have the actuators of 2TPR&2TPS, 4; hexapod has 6"):
        correction_grid(robot, pk.load("hexapod"), AXES)
    delta = pk.load("linear-delta")
    with pytest.raises(ValueError, match="cannot take the poses half-way"):
        correction_grid(delta, delta, {"x": [-9000.0, 9000.0, 9001.0]})


def test_a_cubic_table_without_all_nodes_is_refused_in_words() -> None:
    robot = pk.load("3rrr-planar")
    calibrated = robot.replace({"rod3": robot.geometry["rod3"] - 1})
    axes = {"x": np.linspace(-50, 50, 11), "y": np.linspace(-50, 50, 11)}
    failed = int(correction_grid(robot, calibrated, axes).failed.sum())
    with pytest.raises(pk.exceptions.ArgumentError, match=f"{failed} of 121 nodes have no corr"):
        correction_grid(robot, calibrated, axes, method="cubic")


def test_a_machine_that_yields_gets_there_with_corrections_for_its_load() -> None:
    """At the nodes exactly; without the load it misses by the sag."""
    controller = pk.load("hexapod")
    load = pk.Load(mass=100.0, centre=(20.0, 0.0, 60.0))
    soft = controller.replace({"offset1": 0.3}).yielding({"offset*": 1e-4})
    axes = {"x": np.linspace(-60, 60, 3), "z": np.linspace(820, 880, 3)}
    found = correction_grid(controller, soft, axes, load=load)
    nodes = np.tile(controller.home, (9, 1))
    nodes[:, 0], nodes[:, 2] = np.repeat(axes["x"], 3), np.tile(axes["z"], 3)
    commands = controller.inverse(nodes) + found.corrections.reshape(-1, 6)
    reached = soft.forward(commands, guess=nodes, load=load).pose
    assert np.abs(reached - nodes).max() < 1e-9
    assert np.abs(soft.forward(commands, guess=nodes).pose - nodes)[:, :3].max() > 0.01
    with pytest.raises(ValueError, match="nothing of hexapod yields"):
        correction_grid(controller, controller, axes, load=load)
    with pytest.raises(ValueError, match="load: mass"):
        correction_grid(controller, soft, axes, load=pk.Load(mass=[1.0, 2.0]))
