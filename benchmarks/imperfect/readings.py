"""Readings in steps, at a stop, copied from commands, and angles that are meant otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk
from benchmarks.imperfect.cases import (
    Case,
    arm_poses,
    drawn,
    hexapod,
    machine,
    off,
    poses_of,
    probed,
    register,
    scenario,
)


def dial(rng: np.random.Generator, size: float, step: float) -> Case:
    """A printer probed at 25 points with a dial."""
    robot = machine("printer")
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    poses = np.tile(robot.home, (25, 1))
    poses[:, :2] = np.concatenate([[[0.0, 0.0]], 30.0 * ring, 60.0 * ring])
    poses[:, 2] = 0.3
    q = robot.inverse(poses, match=True)
    true = off(robot, rng, size, robot.model.free)
    read = true.forward(q).pose[:, 2] + rng.normal(0.0, 0.002, 25)
    data = pk.Measurements(q, np.round(read / step) * step, "height")
    return Case(robot, true, data, None, {})


for _name, _size, _step in (
    ("good_machine", 0.02, 0.1),
    ("half_a_step", 0.02, 0.05),
    ("a_step", 0.1, 0.1),
    ("several_steps", 0.3, 0.1),
):
    register(f"rounded_{_name}", "seen", partial(dial, size=_size, step=_step))


@scenario("seen")
def rounded_grid(rng: np.random.Generator) -> Case:
    """Heights on a small grid, a hexapod whose offsets are off."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4, [f"offset{i}" for i in range(1, 7)])
    x, y = np.meshgrid(np.linspace(-20, 20, 6), np.linspace(-20, 20, 6))
    poses = np.tile(robot.home, (36, 1))
    poses[:, :2] += np.column_stack([x.ravel(), y.ravel()])
    q = robot.inverse(poses)
    read = true.forward(q, guess=poses).pose[:, 2] + rng.normal(0.0, 0.002, 36)
    return Case(robot, true, pk.Measurements(q, np.round(read, 1), "height"), "offset*")


@scenario("seen")
def rounded_positions(rng: np.random.Generator) -> Case:
    """Positions on a grid of commands by a display of 0.1 mm, a machine good to 0.03 mm."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.01, [f"offset{i}" for i in range(1, 7)])
    poses = np.tile(robot.home, (30, 1))
    poses[:, :3] += rng.integers(-5, 6, (30, 3)) * 10.0
    q = robot.inverse(poses)
    read = true.forward(q).pose[:, :3] + rng.normal(0.0, 0.002, (30, 3))
    return Case(robot, true, pk.Measurements(q, np.round(read, 1), "position"), "offset*", {})


@scenario("seen")
def nothing_measured(rng: np.random.Generator) -> Case:
    """Commanded poses in the columns of measured ones, actuators with four decimals."""
    robot = machine("hexapod")
    poses, q = drawn(robot, rng)
    kind = ("pose", "position", "height")[int(rng.integers(3))]
    read = {"pose": poses, "position": poses[:, :3], "height": poses[:, 2]}[kind]
    return Case(robot, off(robot, rng, 0.1), pk.Measurements(np.round(q, 4), read, kind), "offset*")


@scenario("seen")
def saturated(rng: np.random.Generator) -> Case:
    """A probe with a travel of 0.8 mm either way."""
    robot, true, q, heights, poses = probed(rng)
    read = poses[:, 2] + np.clip(heights - poses[:, 2], -0.8, 0.8)
    return Case(robot, true, pk.Measurements(q, read, "height"))


def turned(change: Callable[[Any, np.random.Generator], Any], name: str) -> None:
    """Register a mistake in the angles of fitted poses (N, 3), of a hexapod and of an arm."""

    def of_hexapod(rng: np.random.Generator) -> Case:
        robot, true, q, read = hexapod(rng)
        read[:, 3:] = change(read[:, 3:], rng)
        return poses_of(robot, true, q, read)

    def of_offsets(rng: np.random.Generator) -> Case:
        return replace(of_hexapod(rng), free="offset*")

    def of_arm(rng: np.random.Generator) -> Case:
        arm, true, theta, read = arm_poses(rng)
        read[:, 3:] = change(read[:, 3:], rng)
        return Case(arm, true, pk.Measurements(theta, read, "pose"))

    for draw, of in ((of_hexapod, ""), (of_offsets, "_offsets"), (of_arm, "_arm")):
        register(f"angles_{name}{of}", "seen", draw)


def in_other_order(angles: Any, rng: np.random.Generator) -> Any:
    """Angles about x, y' and z'' in place of those about fixed axes."""
    return Rotation.from_euler("xyz", angles).as_euler("XYZ")


def transposed(angles: Any, rng: np.random.Generator) -> Any:
    """Those of the base in the platform."""
    return Rotation.from_euler("xyz", angles).inv().as_euler("xyz")


turned(lambda angles, rng: -angles, "other_sign")
turned(lambda angles, rng: angles * [1, 1, -1], "gamma_other_sign")
turned(lambda angles, rng: angles * [1, 1, 0], "gamma_zero")
turned(lambda angles, rng: angles[:, [1, 0, 2]], "exchanged")
turned(lambda angles, rng: rng.permutation(angles), "of_other_rows")
turned(in_other_order, "other_order")
turned(transposed, "transposed")
