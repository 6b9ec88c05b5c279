"""Sound measurements, which must not be doubted."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import (
    Case,
    arm_poses,
    drawn,
    hexapod,
    machine,
    noisy,
    off,
    poses_of,
    probed,
    scenario,
    targets_of,
)
from benchmarks.imperfect.unseen import built


@scenario("sound")
def sound_hexapod(rng: np.random.Generator) -> Case:
    return poses_of(*hexapod(rng))


@scenario("sound")
def sound_hexapod_positions(rng: np.random.Generator) -> Case:
    robot = machine("hexapod")
    true = off(robot, rng, 0.4, [f"offset{i}" for i in range(1, 7)])
    poses, q = drawn(robot, rng)
    read = noisy(rng, true.forward(q, guess=poses).pose)
    return Case(robot, true, pk.Measurements(q, read[:, :3], "position"), "offset*")


@scenario("sound")
def sound_hexapod_targets(rng: np.random.Generator) -> Case:
    robot, true, q, read = hexapod(rng, noise=0.0, turning=0.0)
    return targets_of(robot, true, q, read, rng)


@scenario("sound")
def sound_printer(rng: np.random.Generator) -> Case:
    robot, true, q, heights, _ = probed(rng)
    return Case(robot, true, pk.Measurements(q, heights, "height"))


@scenario("sound")
def sound_cables(rng: np.random.Generator) -> Case:
    """Eight cables, which are more than the six ways to move."""
    return cables(rng, 0.3)


@scenario("sound")
def sound_cables_exact(rng: np.random.Generator) -> Case:
    """The same, lengths without any noise."""
    return cables(rng, 0.0)


@scenario("sound")
def sound_hexapod_noisy_actuators(rng: np.random.Generator) -> Case:
    """Actuators have a stated deviation, poses none."""
    robot, true, q, read = hexapod(rng)
    log = q + rng.normal(0.0, 0.03, q.shape)
    return poses_of(robot, true, log, read, actuator_sigma=0.03)


def cables(rng: np.random.Generator, noise: float) -> Case:
    robot = machine("cables")
    names = [f"offset{i}" for i in range(1, 9)]
    true = off(robot, rng, 2.0, names)
    poses = robot.home + rng.uniform(-1, 1, (40, 6)) * [900, 600, 500, 0.1, 0.1, 0.1]
    q = true.inverse(poses) + rng.normal(0.0, noise, (40, 8))
    data = pk.Measurements(q, noisy(rng, poses, 0.1, 1e-4), "pose")
    return Case(robot, true, data, names)


@scenario("sound")
def sound_arm(rng: np.random.Generator) -> Case:
    arm, true, theta, read = arm_poses(rng)
    return Case(arm, true, pk.Measurements(theta, read, "pose"))


@scenario("sound")
def sound_rounded_finely(rng: np.random.Generator) -> Case:
    """No noise, positions written to 1 µm and angles to 0.0001 deg."""
    robot, true, q, read = hexapod(rng, noise=0.0, turning=0.0)
    read[:, :3] = np.round(read[:, :3], 3)
    read[:, 3:] = np.radians(np.round(np.degrees(read[:, 3:]), 4))
    return poses_of(robot, true, q, read)


@scenario("sound")
def sound_display(rng: np.random.Generator) -> Case:
    """A display of 0.01 mm, half of the noise."""
    robot, true, q, read = hexapod(rng)
    read[:, :3] = np.round(read[:, :3], 2)
    return poses_of(robot, true, q, read)


@scenario("sound")
def sound_wrist(rng: np.random.Generator) -> Case:
    """Three axes through one point, poses of the tool there: no length says how large it is."""
    axes = rng.normal(size=(3, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    arm = pk.SerialArm(axes, np.zeros((3, 3)), np.eye(4))
    true = arm.replace(rng.normal(size=(3, 6)) * [0.3, 0.3, 0.3, 1e-3, 1e-3, 1e-3])
    theta = rng.uniform(-1.2, 1.2, (45, 3))
    read = noisy(rng, pk.screw.to_pose(true.forward(theta)))
    return Case(arm, true, pk.Measurements(theta, read, "pose"))


@scenario("sound")
def sound_exechon(rng: np.random.Generator) -> Case:
    """Forty-two numbers by poses: those of some of its joints are told only together."""
    robot, true, q, poses = built("exechon", rng, 0.2, 60)
    read = noisy(rng, true.forward(q, guess=poses).pose)
    return Case(robot, true, pk.Measurements(q, read, "pose"))
