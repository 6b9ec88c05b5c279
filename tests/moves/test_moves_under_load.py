"""Moves of machines that yield: on their way under a load, with the rates that this way has."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.screw import from_pose

from .test_trajectory import slope

LOAD = pk.Load(mass=20, centre=(5, 10, 50), force=(10, 0, 30), moment=(0, 500, 0))
YIELDING = {
    "hexapod": ("offset*", 1e-4),
    "rbt-6t03p": ("offset*", 1e-4),
    "6-rus": ("offset*", 1e-6),
    "rotary-delta": ("offset*", 2e-8),
    "linear-delta-6": ("rod*", 1e-4),
    "2tpr2tps-spatial": ("offset*", 1e-4),
}
SPACES = [(name, space) for name in YIELDING for space in ("pose", "coordinates", "joint")
          if space != "pose" or name in ("hexapod", "rbt-6t03p", "6-rus")]  # fmt: skip


@pytest.mark.parametrize(("name", "space"), SPACES)
def test_moves_under_a_load_are_those_of_the_loaded_machine(name: str, space: str) -> None:
    number, compliance = YIELDING[name]
    robot = pk.load(name).yielding({number: compliance})
    loaded = robot.under(LOAD)
    drawn = pk.sample_poses(robot.rigid, 2, seed=1, share=0.3)
    start, end = (loaded.complete(pose) for pose in drawn)
    made = pk.trajectory.move(robot, start, end, duration=2.0, space=space, load=LOAD)
    t = np.linspace(0.3, 1.7, 7)
    found = made.sample(t)
    assert np.abs(loaded.inverse(found.pose, near=found.actuators) - found.actuators).max() < 1e-9
    there = robot.forward(found.actuators, guess=found.pose, load=LOAD).pose
    assert np.abs(from_pose(there) - from_pose(found.pose)).max() < 1e-9
    sag = robot.rigid.forward(found.actuators, guess=found.pose).pose - found.pose
    assert np.abs(sag[:, :3]).max() > 1e-3
    for rates, values in (
        (found.velocities, lambda s: made.sample(s).actuators),
        (found.accelerations, lambda s: made.sample(s).velocities),
        (found.twist[:, 3:], lambda s: made.sample(s).pose[:, :3]),
        (found.twist_rate[:, 3:], lambda s: made.sample(s).twist[:, 3:]),
    ):
        assert np.abs(slope(values, t) - rates).max() < 1e-6 * max(1.0, np.abs(rates).max())
    ends = made.sample(np.array([0.0, 2.0])).pose
    assert np.abs(from_pose(ends) - from_pose(np.stack([start, end]))).max() < 1e-8


def test_load_of_a_move_is_one_of_a_machine_that_yields() -> None:
    robot = pk.load("hexapod")
    end = robot.home + np.array([10.0, 0, 0, 0, 0, 0])
    with pytest.raises(ValueError, match="nothing of hexapod yields"):
        pk.trajectory.move(robot, robot.home, end, duration=1.0, load=LOAD)
    yielding = robot.yielding({"offset*": 1e-4})
    with pytest.raises(ValueError, match="load"):
        pk.trajectory.move(yielding, robot.home, end, duration=1.0, load=pk.Load(mass=[1.0, 2.0]))
    with pytest.raises(TypeError, match="load must be a Load"):
        pk.trajectory.move(yielding, robot.home, end, duration=1.0, load=5.0)
