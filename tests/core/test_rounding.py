"""Fits of exact measurements end at the limit of rounding, and know that they did."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray

EIGHT_ROWS = Path(__file__).parents[2] / "examples" / "2tpr2tps-eight-rows.toml"
MACHINES = ["hexapod", "rbt-6t03p", "2tpr2tps", "rotary-delta", str(EIGHT_ROWS)]


def poses(robot: pk.Robot, count: int, seed: int) -> FloatArray:
    return robot.complete(pk.sample_poses(robot, count, seed))


def with_errors(robot: pk.Robot, size: float, seed: int) -> pk.Robot:
    """Its free numbers off by so many mm, or rad on an arm of 300 mm."""
    geometry, rng = robot.geometry, np.random.default_rng(seed)
    per_unit = {"mm": size, "rad": size / 300.0, "1": size / 300.0}
    return robot.replace({
        name: geometry[name] + rng.normal(0.0, per_unit[geometry.units[geometry.names.index(name)]])
        for name in geometry.match(robot.model.free)
    })  # fmt: skip


def fitted(
    robot: pk.Robot, true: pk.Robot, kind: str, sigma: float | None, seed: int
) -> pk.Identification:
    """From measurements without noise; any warning but of the machine's limits is an error."""
    q = robot.inverse(poses(robot, 40, seed))
    seen = true.forward(q).pose
    values = seen if kind == "pose" else seen[:, :3]
    measured = pk.Measurements(q, values, kind, sigma=sigma, actuator_units=robot.actuator_units)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "actuators out of stroke|.* combinations of param")
        return pk.identify(robot, measured)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("kind", ["pose", "position"])
@pytest.mark.parametrize("sigma", [None, 0.01])
def test_a_fit_that_starts_at_the_answer_stays_there(
    name: str, kind: str, sigma: float | None
) -> None:
    robot = pk.load(name)
    found = fitted(robot, robot, kind, sigma, seed=1)
    assert found.converged and found.evaluations <= 6
    assert found.rms <= found.rms_before + 3e-12 < 1e-10  # with arcs at a radius
    assert np.abs(found.values - found.start).max() < 1e-9


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("seed", range(3))
def test_exact_positions_are_met_to_rounding(name: str, seed: int) -> None:
    robot = pk.load(name)
    true = with_errors(robot, 0.3, seed)
    found = fitted(robot, true, "position", None, seed)
    assert found.converged and found.evaluations < 60
    assert found.rms < 1e-8 and found.rms < 1e-7 * found.rms_before
    elsewhere = robot.inverse(poses(robot, 20, seed=100))
    ends = [machine.forward(elsewhere).pose[:, :3] for machine in (true, found.robot)]
    assert np.abs(ends[1] - ends[0]).max() < 1e-6
