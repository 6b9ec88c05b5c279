"""Actuators as instruments of the pose, and poses moved by steps: against differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics import pose_steps
from pkmcal.screw import from_pose, log

from .. import generated

STEP = 1e-5
NAMES = ("hexapod", "2tpr2tps", "2tpr2tps-spatial", "3prs", "rotary-delta", "3rrr-planar")


def machine(name: str) -> tuple[pk.Robot, np.ndarray, np.ndarray]:
    """A machine, poses that it takes, and actuators that read a little else."""
    if name == "redundant":
        rng = np.random.default_rng(3)
        robot = generated.machine("redundant", rng)
        pose = robot.frames.outward(generated.poses("redundant", robot, 6, rng))
        pose = pose[np.isfinite(robot.inverse(pose)).all(axis=1)]
    else:
        robot = pk.load(name)
        pose = pk.sample_poses(robot, 4, share=0.6)
        pose = robot.forward(robot.inverse(pose), pose).pose
    return robot, pose, robot.inverse(pose) + 0.01


@pytest.mark.parametrize("name", [*NAMES, "redundant"])
def test_what_actuators_would_read_follows_from_the_inverse(name: str) -> None:
    robot, pose, q = machine(name)
    residual, _ = pose_steps.readings(robot, pose, q)
    of_limb = np.array(pose_steps.sphere_actuators(robot))
    own = residual[:, of_limb >= 0] + q[:, of_limb[of_limb >= 0]]
    np.testing.assert_allclose(
        own, robot.inverse(pose, near=q)[:, of_limb[of_limb >= 0]], atol=1e-9
    )
    np.testing.assert_allclose(residual[:, of_limb < 0], 0.0, atol=1e-7)  # it takes these poses


@pytest.mark.parametrize("name", [*NAMES, "redundant"])
def test_derivatives_are_those_of_differences(name: str) -> None:
    robot, pose, q = machine(name)
    m = robot.machine.m
    _, by_step = pose_steps.readings(robot, pose, q)
    twists = pose_steps.step_twists(robot, pose)
    for j in range(m):
        step = np.zeros((len(pose), m))
        step[:, j] = STEP
        there, back = (pose_steps.moved(robot, pose, sign * step) for sign in (1, -1))
        off = pose_steps.readings(robot, there, q)[0] - pose_steps.readings(robot, back, q)[0]
        np.testing.assert_allclose(by_step[:, :, j], off / (2 * STEP), rtol=1e-5, atol=1e-4)
        turned = log(from_pose(there) @ np.linalg.inv(from_pose(back)))[:, :3] / (2 * STEP)
        np.testing.assert_allclose(twists[:, :3, j], turned, atol=1e-5)
        shifted = (there - back)[:, :3] / (2 * STEP)
        np.testing.assert_allclose(twists[:, 3:, j], shifted, rtol=1e-5, atol=1e-4)
    places = np.arange(len(robot.geometry))[::3]
    by_numbers = pose_steps.readings_by_numbers(robot, pose, q, places)
    for k, place in enumerate(places):
        ends = []
        for sign in (1, -1):
            values = robot.geometry.values.copy()
            values[place] += sign * STEP
            ends.append(pose_steps.readings(robot.with_values(values), pose, q)[0])
        slope = (ends[0] - ends[1]) / (2 * STEP)
        np.testing.assert_allclose(by_numbers[:, :, k], slope, rtol=1e-5, atol=1e-4)


EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    ("name", "surplus", "held"),
    [
        ("hexapod", 0, 0),
        ("3prs", 0, 3),
        ("linear-delta-6", 0, 3),  # two rods a carriage
        (str(EXAMPLES / "belts" / "robot.toml"), 2, 0),
        (str(EXAMPLES / "2tpr2tps-eight-rows.toml"), 0, 0),  # over-constrained
    ],
)
@pytest.mark.parametrize("errors", [0.0, 3.0])
def test_surplus_actuators_are_counted_not_surplus_closures(
    name: str, surplus: int, held: int, errors: float
) -> None:
    robot = pk.load(name)
    points = [n for n in robot.geometry.match("base*") if n[-1] in "xyz"]
    shifts = np.random.default_rng(2).normal(0, errors, len(points))
    robot = robot.replace({
        n: robot.geometry[n] + shift for n, shift in zip(points, shifts, strict=True)
    })  # fmt: skip
    roles = pose_steps.row_roles(robot)
    assert (roles.surplus, len(roles.held)) == (surplus, held)
    assert pose_steps.surplus(robot) == surplus


@pytest.mark.parametrize("name", ["hexapod", "3prs", "linear-delta-6", "rotary-delta"])
def test_the_platform_turns_and_moves_by_actuators_as_forward_kinematics_say(name: str) -> None:
    robot, pose, _ = machine(name)
    q = robot.inverse(pose)
    twists = robot.actuator_twists(pose, q)
    for a in range(robot.n_actuators):
        step = STEP * np.eye(robot.n_actuators)[a]
        there, back = (robot.forward(q + sign * step, pose).pose for sign in (1, -1))
        turned = log(from_pose(there) @ np.linalg.inv(from_pose(back)))[:, :3] / (2 * STEP)
        np.testing.assert_allclose(twists[:, :3, a], turned, rtol=1e-4, atol=1e-6)
        shifted = (there - back)[:, :3] / (2 * STEP)
        np.testing.assert_allclose(twists[:, 3:, a], shifted, rtol=1e-4, atol=1e-4)
