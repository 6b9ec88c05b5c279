"""Causes that nothing in the package was written for, on machines and noise of their own.

Each is what a real machine or instrument does, without a number for it in any model: what the
verdict says of them was not known when they were written.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import Case, at_target, machine, off, scenario


def built(name: str, rng: np.random.Generator, size: float, free: Any, count: int) -> Any:
    """A machine with errors in its free numbers: it, the true one, actuators, poses."""
    robot = machine(name)
    names = robot.model.free if free == "*" else robot.geometry.match(free)
    true = off(robot, rng, size, list(names))
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=0.5)
    return robot, true, robot.inverse(poses, match=True if robot.model.match else None), poses


def arm_of(rng: np.random.Generator, count: int) -> Any:
    """An arm with errors of its joints, and angles."""
    robot = machine("arm")
    true = robot.replace(rng.normal(size=(6, 6)) * [0.4, 0.4, 0.4, 4e-4, 4e-4, 4e-4])
    return robot, true, rng.uniform(-1.0, 1.0, (count, 6))


def positions(rng: np.random.Generator, there: Any, noise: float) -> Any:
    return there + rng.normal(0.0, noise, there.shape)


@scenario("other")
def eccentric_encoder(rng: np.random.Generator) -> Case:
    """The disc of an arm's second encoder is off its axis: 0.15 mrad, once a turn."""
    robot, true, theta = arm_of(rng, 50)
    at = theta.copy()
    at[:, 1] += 1.5e-4 * np.sin(theta[:, 1] + rng.uniform(0, 2 * np.pi))
    poses = pk.screw.to_pose(true.forward(at)) + rng.normal(size=(50, 6)) * [
        *[0.03] * 3,
        *[2e-5] * 3,
    ]
    return Case(robot, true, pk.Measurements(theta, poses, "pose"))


@scenario("other")
def cold_side_of_the_frame(rng: np.random.Generator) -> Case:
    """One side of a frame warms up while it is measured: anchors there move by up to 0.15 mm."""
    robot, true, q, poses = built("6-rus", rng, 0.3, ["base*", "platform*"], 40)
    there = []
    for k, warm in enumerate(np.linspace(0.0, 0.15, 40)):
        moved = {n: true.geometry[n] + warm for n in ("base1.x", "base2.x", "base1.z", "base2.z")}
        there.append(true.replace(moved).forward(q[k : k + 1], guess=poses[k : k + 1]).pose[0])
    read = np.array(there) + rng.normal(size=(40, 6)) * [*[0.01] * 3, *[2e-5] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"), ["base*", "platform*"])


@scenario("other")
def loose_joint(rng: np.random.Generator) -> Case:
    """A joint of the platform hangs 0.06 mm to the side to which the platform leans."""
    robot, true, q, poses = built("hexapod", rng, 0.3, ["base*", "platform*", "offset*"], 50)
    there = true.forward(q, guess=poses).pose
    side = np.sign(poses[:, 3:4])
    near = true.replace({"platform3.y": true.geometry["platform3.y"] + 0.06})
    far = true.replace({"platform3.y": true.geometry["platform3.y"] - 0.06})
    there = np.where(side > 0, near.forward(q, guess=there).pose, far.forward(q, guess=there).pose)
    read = there + rng.normal(size=there.shape) * [*[0.015] * 3, *[4e-5] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"), ["base*", "platform*", "offset*"])


@scenario("other")
def refraction(rng: np.random.Generator) -> Case:
    """Warm air over a machine: what is further from a tracker seems higher, 0.1 mm over 1 m."""
    robot, true, q, poses = built("tricept", rng, 0.2, "*", 60)
    there = true.forward(q, guess=poses).pose[:, :3]
    away = there[:, 0] - there[:, 0].min() + 500.0
    read = positions(rng, there, 0.02)
    read[:, 2] += 0.1 * (away / 1000.0) ** 2
    return Case(robot, true, pk.Measurements(q, read, "position"))


@scenario("other")
def bent_screw(rng: np.random.Generator) -> Case:
    """The screw of one leg is bent: a bow of 0.08 mm over its travel."""
    free = ["base*", "platform*", "offset*"]
    robot, true, q, poses = built("hexapod", rng, 0.3, free, 50)
    at = q.copy()
    share = (q[:, 1] - q[:, 1].min()) / np.ptp(q[:, 1])
    at[:, 1] += 0.08 * np.sin(np.pi * share)
    there = true.forward(at, guess=poses).pose
    read = there + rng.normal(size=there.shape) * [*[0.01] * 3, *[3e-5] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"), free)


@scenario("other")
def tool_of_the_second_session(rng: np.random.Generator) -> Case:
    """After lunch the ball of an arm sat 0.2 mm deeper in its nest."""
    robot, true, theta = arm_of(rng, 60)
    tool = np.tile([0.0, 40.0, 120.0], (60, 1))
    tool[30:, 2] -= 0.2
    there = at_target(pk.screw.to_pose(true.forward(theta)), tool)
    data = pk.Measurements(
        theta, positions(rng, there, 0.03), "position", target=[0.0, 40.0, 120.0],
        session=["morning"] * 30 + ["afternoon"] * 30,
    )  # fmt: skip
    return Case(robot, true, data)


@scenario("other")
def worn_magnet(rng: np.random.Generator) -> Case:
    """A ball-bar reads shorter as its cup wears, 0.06 mm over 60 readings."""
    robot, true, q, poses = built("hexapod", rng, 0.3, "offset*", 60)
    fixed = np.array([250.0, -150.0, -50.0])
    there = true.forward(q, guess=poses).pose[:, :3]
    read = np.linalg.norm(there - fixed, axis=1) + rng.normal(0.0, 0.01, 60)
    read -= 0.06 * (1.0 - np.exp(-np.arange(60) / 20.0))
    return Case(robot, true, pk.Measurements(q, read, "distance", target=fixed), "offset*")


@scenario("other")
def hysteresis_of_cables(rng: np.random.Generator) -> Case:
    """Cables are 0.6 mm longer where they were paid out than where they were wound up."""
    robot = machine("cables")
    names = [f"offset{i}" for i in range(1, 9)]
    true = off(robot, rng, 2.0, names)
    poses = robot.home + rng.uniform(-1, 1, (50, 6)) * [700, 700, 400, 0.08, 0.08, 0.08]
    q = true.inverse(poses)
    q = q + 0.3 * np.sign(np.diff(q, axis=0, prepend=q[:1])) + rng.normal(0.0, 0.1, q.shape)
    read = poses + rng.normal(size=poses.shape) * [*[0.1] * 3, *[1e-4] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"), names)


@scenario("other")
def base_on_rubber(rng: np.random.Generator) -> Case:
    """The machine leans to where its platform is: 0.5 µrad for each mm."""
    free = ["base*", "platform*", "offset*"]
    robot, true, q, poses = built("hexapod", rng, 0.3, free, 50)
    there = true.forward(q, guess=poses).pose
    lean = np.zeros((50, 6))
    lean[:, 3], lean[:, 4] = -5e-7 * there[:, 1], 5e-7 * there[:, 0]
    seen = pk.screw.to_pose(pk.screw.from_pose(lean) @ pk.screw.from_pose(there))
    read = seen + rng.normal(size=there.shape) * [*[0.01] * 3, *[2e-5] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"), free)


@scenario("other")
def probe_with_three_lobes(rng: np.random.Generator) -> Case:
    """A probe's trigger depends on the side: 0.03 mm, three times around the bed."""
    robot = machine("printer")
    true = off(robot, rng, 0.5, robot.model.free)
    turn, radius = rng.uniform(0, 2 * np.pi, 40), 65 * np.sqrt(rng.uniform(0, 1, 40))
    poses = np.tile(robot.home, (40, 1))
    poses[:, 0], poses[:, 1] = radius * np.cos(turn), radius * np.sin(turn)
    q = robot.inverse(poses, match=True)
    read = true.forward(q).pose[:, 2] + rng.normal(0.0, 0.008, 40) + 0.03 * np.cos(3 * turn - 0.7)
    return Case(robot, true, pk.Measurements(q, read, "height"))


@scenario("other")
def bowed_rail(rng: np.random.Generator) -> Case:
    """A rail of a delta is bowed sideways by 0.1 mm in the middle."""
    robot, true, q, poses = built("linear-delta-6", rng, 0.1, "*", 50)
    share = (q[:, 0] - q[:, 0].min()) / np.ptp(q[:, 0])
    there = []
    for k, bow in enumerate(0.1 * np.sin(np.pi * share)):
        moved = true.replace({n: true.geometry[n] + bow for n in ("base1.y", "base2.y")})
        there.append(moved.forward(q[k : k + 1], guess=poses[k : k + 1]).pose[0, :3])
    read = positions(rng, np.array(there), 0.01)
    return Case(robot, true, pk.Measurements(q, read, "position"))


@scenario("other")
def wrist_coupling(rng: np.random.Generator) -> Case:
    """The fifth motor of an arm turns the sixth joint by 0.1 mrad a radian besides."""
    robot, true, theta = arm_of(rng, 50)
    at = theta.copy()
    at[:, 5] += 1e-4 * theta[:, 4]
    poses = pk.screw.to_pose(true.forward(at)) + rng.normal(size=(50, 6)) * [
        *[0.03] * 3,
        *[2e-5] * 3,
    ]
    return Case(robot, true, pk.Measurements(theta, poses, "pose"))
