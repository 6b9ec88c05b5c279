"""Models that are wrong in a way that readings may not show, and free numbers that cannot hold it."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk
from benchmarks.bench_uncertainty import ROBOT as HEXAPOD
from benchmarks.bench_uncertainty import SCENARIOS as SLIGHTLY_WRONG
from benchmarks.bench_uncertainty import drawn as slightly_wrong_machine
from benchmarks.imperfect.cases import (
    NOISE,
    Case,
    at_target,
    drawn,
    hexapod,
    joints,
    machine,
    noisy,
    off,
    poses_of,
    probed,
    register,
    scenario,
    targets_of,
)


def in_a_corner(robot: Any, rng: np.random.Generator) -> Any:
    """Twenty poses near each other, away from the middle."""
    middle = np.array([60, 60, 40, 0.1, 0.1, 0.1])
    return robot.home + middle + rng.uniform(-1, 1, (20, 6)) * [10, 10, 10, 0.03, 0.03, 0.03]


@scenario("other")
def joints_off_offsets_free(rng: np.random.Generator) -> Case:
    """All joints are off, the six offsets are free, and poses stand in a corner."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4)
    poses = in_a_corner(robot, rng)
    q = robot.inverse(poses)
    read = noisy(rng, true.forward(q, guess=poses).pose)[:, :3]
    return Case(robot, true, pk.Measurements(q, read, "position"), "offset*")


@scenario("other")
def tool_not_stated(rng: np.random.Generator) -> Case:
    """The target is 5 mm from where it is stated; poses hardly tilt."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4, [f"offset{i}" for i in range(1, 7)])
    poses = robot.home + rng.uniform(-1, 1, (45, 6)) * [80, 80, 60, 0.02, 0.02, 0.02]
    q = robot.inverse(poses)
    read = at_target(true.forward(q, guess=poses).pose, [0.0, 0.0, 5.0])
    read = read + rng.normal(0.0, NOISE, (45, 3))
    return Case(robot, true, pk.Measurements(q, read, "position"), "offset*")


@scenario("other")
def warm_up_by_height(rng: np.random.Generator) -> Case:
    """Legs grow by up to 0.3 mm with the height."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4)
    poses, q = drawn(robot, rng)
    warm = 0.3 * (poses[:, 2] - poses[:, 2].min()) / np.ptp(poses[:, 2])
    read = noisy(rng, true.forward(q + warm[:, None], guess=poses).pose)
    return poses_of(robot, true, q, read)


@scenario("other")
def sag(rng: np.random.Generator) -> Case:
    """1e-5 r² downwards."""
    robot, true, q, read = hexapod(rng)
    read[:, 2] -= 1e-5 * (read[:, :2] ** 2).sum(axis=1)
    return poses_of(robot, true, q, read)


@scenario("other")
def wander(rng: np.random.Generator) -> Case:
    """The tracker wanders by 0.03 mm, in random order."""
    robot, true, q, read = hexapod(rng, noise=0.01)
    error = np.zeros((len(q), 3))
    for i in range(1, len(q)):
        error[i] = 0.9 * error[i - 1] + rng.normal(0.0, 0.03 * np.sqrt(0.19), 3)
    read[:, :3] += error
    return poses_of(robot, true, q, read)


@scenario("other")
def eccentric_tracker(rng: np.random.Generator) -> Case:
    robot, true, q, read = hexapod(rng)
    azimuth = np.arctan2(read[:, 1] - 1500, read[:, 0] - 800)
    read[:, 0] += 0.1 * np.sin(3 * azimuth)
    read[:, 1] += 0.1 * np.cos(2 * azimuth)
    return poses_of(robot, true, q, read)


@scenario("other")
def bed_slope(rng: np.random.Generator) -> Case:
    """A bed that slopes by 0.03 mm over 60 mm, taken for heights."""
    robot, true, q, heights, poses = probed(rng)
    read = heights + poses[:, :2] @ [0.03 / 60, 0.02 / 60]
    return Case(robot, true, pk.Measurements(q, read, "height"))


@scenario("other")
def rounded_log(rng: np.random.Generator) -> Case:
    """Actuators were logged to 0.1 mm."""
    robot, true, q, read = hexapod(rng, noise=0.01, turning=3e-5)
    return poses_of(robot, true, np.round(q, 1), read)


@scenario("other")
def sessions_of_own_noise(rng: np.random.Generator) -> Case:
    """Heavy tails, and each of six sessions has its own noise."""
    robot, true, q, read = hexapod(rng, 48, noise=0.0, turning=0.0)
    size = np.repeat(NOISE * np.exp(rng.normal(size=6)), 8)[:, None]
    read += rng.standard_t(3, read.shape) * size * [1, 1, 1, 2.5e-3, 2.5e-3, 2.5e-3]
    names = [f"s{i // 8}" for i in range(48)]
    return poses_of(robot, true, q, read, session=names)


def enlarged(rng: np.random.Generator, sizes: Any) -> Any:
    """A hexapod of which base and platform are larger by factors than those of the file."""
    robot = machine("hexapod")
    names = robot.geometry.match(["base*", "platform*"])
    large = {
        name: robot.geometry[name] * size
        for name, size in zip(names, np.broadcast_to(sizes, len(names)), strict=True)
    }
    true = off(robot.replace(large), rng, 0.4)
    poses = pk.sample_poses(robot, 45, seed=int(rng.integers(1_000_000)), share=0.5)
    return robot, true, true.inverse(poses), poses


@scenario("other")
def file_wrong_by_a_tenth(rng: np.random.Generator) -> Case:
    """Each number of base and platform by up to 10 %."""
    robot, true, q, poses = enlarged(rng, rng.uniform(0.9, 1.1, 36))
    return poses_of(robot, true, q, noisy(rng, poses))


@scenario("other")
def file_a_tenth_too_small(rng: np.random.Generator) -> Case:
    """Base and platform alike, by positions of three reflectors."""
    robot, true, q, poses = enlarged(rng, 1.1)
    return targets_of(robot, true, q, poses, rng)


@scenario("other")
def corner(rng: np.random.Generator) -> Case:
    """All joints from 20 poses in a corner."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4)
    poses = in_a_corner(robot, rng)
    q = robot.inverse(poses)
    return poses_of(robot, true, q, noisy(rng, true.forward(q, guess=poses).pose))


@scenario("other")
def rounded_joints_off(rng: np.random.Generator) -> Case:
    """Positions by a display of 0.1 mm; all joints are off, and offsets are found."""
    robot, true, q, read = hexapod(rng, noise=0.005)
    data = pk.Measurements(q, np.round(read[:, :3], 1), "position")
    return Case(robot, true, data, "offset*")


@scenario("other")
def long_tool_not_stated(rng: np.random.Generator) -> Case:
    """The target is 200 mm above the platform's origin."""
    robot, true, q, read = hexapod(rng, noise=0.0, turning=0.0)
    there = at_target(read, [0.0, 0.0, 200.0]) + rng.normal(0.0, NOISE, (45, 3))
    return Case(robot, true, pk.Measurements(q, there, "position"), joints(robot))


@scenario("other")
def tool_changed(rng: np.random.Generator) -> Case:
    """A tool 0.5 mm longer in the second half; all joints are off, and offsets are found."""
    robot, true, q, read = hexapod(rng, 50, noise=0.0, turning=0.0)
    tool = np.tile([10.0, 0.0, 100.0], (50, 1))
    tool[25:, 2] += 0.5
    there = at_target(read, tool) + rng.normal(0.0, NOISE, (50, 3))
    data = pk.Measurements(q, there, "position", target=[10.0, 0.0, 100.0])
    return Case(robot, true, data, "offset*", {"holdout": 0.25, "unknown": "target"})


@scenario("other")
def other_order_of_small_angles(rng: np.random.Generator) -> Case:
    """R = Rx Ry Rz where tilts are 0.03 rad at most."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4)
    poses = robot.home + rng.uniform(-1, 1, (45, 6)) * [80, 80, 60, 0.03, 0.03, 0.03]
    q = robot.inverse(poses)
    read = noisy(rng, true.forward(q, guess=poses).pose)
    read[:, 3:] = Rotation.from_euler("xyz", read[:, 3:]).as_euler("XYZ")
    return poses_of(robot, true, q, read)


@scenario("other")
def one_side_off(rng: np.random.Generator) -> Case:
    """A fifth of the rows, all of one side, 0.2 mm too high."""
    robot, true, q, read = hexapod(rng)
    read[np.argsort(read[:, 0])[:9], 2] += 0.2
    return poses_of(robot, true, q, read)


def slightly_wrong(rng: np.random.Generator, name: str) -> Case:
    """What `bench_uncertainty` states the uncertainty of, here without the statement."""
    of = SLIGHTLY_WRONG[name]
    true, data = slightly_wrong_machine(of, rng)
    return Case(HEXAPOD, true, replace(data, actuator_sigma=None), of.free, {})


for _name in SLIGHTLY_WRONG:
    register(
        f"slightly_wrong_{re.sub(', | ', '_', _name)}", "other", partial(slightly_wrong, name=_name)
    )
