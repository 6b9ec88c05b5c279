"""A stated sigma that some of the components have and others have not, and machines that have it."""

from __future__ import annotations

from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import Case, machine, off, scenario

SIGMA, TURNING = 0.02, 5e-5  # mm, rad


def posed(name: str, rng: np.random.Generator, count: int, size: float = 0.3) -> Any:
    """A machine with errors in its free numbers: it, the true one, actuators, poses."""
    robot = machine(name)
    true = off(robot, rng, size, list(robot.model.free))
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=0.5)
    return robot, true, robot.inverse(poses, match=True if robot.model.match else None), poses


def stated(robot: Any, true: Any, q: Any, there: Any, rng: np.random.Generator) -> Case:
    """Poses with the noise that is stated of them."""
    sigma = [SIGMA] * 3 + [TURNING] * 3
    read = there + rng.normal(size=there.shape) * sigma
    return Case(robot, true, pk.Measurements(q, read, "pose", sigma=sigma))


@scenario("sound")
def sound_3rps_stated(rng: np.random.Generator) -> Case:
    robot, true, q, poses = posed("3rps", rng, 45)
    return stated(robot, true, q, true.forward(q, guess=poses).pose, rng)


@scenario("sound")
def sound_seven_joints_stated(rng: np.random.Generator) -> Case:
    robot, true, theta = seven_joints(rng)
    return stated(robot, true, theta, pk.screw.to_pose(true.forward(theta)), rng)


def seven_joints(rng: np.random.Generator, count: int = 60) -> Any:
    """An arm of seven joints of revolution: it, the true one, angles."""
    quarter = np.pi / 2
    robot = pk.SerialArm.from_dh(
        a=[0.0] * 7, d=[340, 0, 400, 0, 400, 0, 126],
        alpha=[-quarter, quarter, quarter, -quarter, -quarter, quarter, 0], theta=[0.0] * 7,
    )  # fmt: skip
    true = robot.replace(rng.normal(size=(7, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])
    return robot, true, rng.uniform(-1.2, 1.2, (count, 7))


@scenario("other")
def interpolation_of_encoders(rng: np.random.Generator) -> Case:
    """Encoders of a planar 3-RRR interpolate with an error of 0.1 mrad, 200 times a turn."""
    robot, true, q, poses = posed("3rrr-planar", rng, 45)
    at = q + 1e-4 * np.sin(200.0 * q + rng.uniform(0, 2 * np.pi, 3))
    return stated(robot, true, q, true.forward(at, guess=poses).pose, rng)


@scenario("other")
def play_of_a_joint(rng: np.random.Generator) -> Case:
    """A joint of a 3-RPS hangs 0.06 mm to the side to which the platform leans."""
    robot, true, q, poses = posed("3rps", rng, 45)
    name = robot.geometry.match("platform2*")[0]
    there = [
        true.replace({name: true.geometry[name] + by}).forward(q, guess=poses).pose
        for by in (0.06, -0.06)
    ]
    return stated(robot, true, q, np.where(poses[:, 3:4] > 0, *there), rng)


@scenario("other")
def gains_of_a_3rps(rng: np.random.Generator) -> Case:
    """Its gains are off by 0.03 %, and not free."""
    robot, true, q, poses = posed("3rps", rng, 45)
    wrong = {f"gain{i}": 1.0 + 3e-4 * rng.normal() for i in (1, 2, 3)}
    true = true.replace(wrong)
    return stated(robot, true, q, true.forward(q, guess=poses).pose, rng)
