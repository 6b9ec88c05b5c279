"""Calibrations from imperfect data: each scenario draws a true machine and what was read of it.

A scenario that is `seen` must not end "calibrated" while its intervals hold fewer true values than
they state; a `sound` one must not be doubted. Of the others the model is wrong in a way that no
residual shows, or the free numbers cannot hold what is wrong: they are printed beside them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

import pkmcal as pk

Meant = Literal["sound", "seen", "other"]
NOISE, TURNING = 0.02, 5e-5  # mm, rad
TARGETS = np.array([[80.0, 0, 20], [-40, 70, 10], [-40, -70, 30]])
EXAMPLES = Path(__file__).parents[2] / "examples"


@dataclass(frozen=True)
class Case:
    """What is calibrated, the truth, and the arguments of `identify`."""

    robot: Any
    true: Any
    data: Any
    free: Any = None
    options: dict[str, Any] = field(default_factory=lambda: {"holdout": 0.25})


class Scenario(NamedTuple):
    """How a case is drawn, and what its verdict is to be."""

    draw: Callable[[np.random.Generator], Case]
    meant: Meant


SCENARIOS: dict[str, Scenario] = {}


def register(name: str, meant: Meant, draw: Callable[[np.random.Generator], Case]) -> None:
    """Add a scenario."""
    SCENARIOS[name] = Scenario(draw, meant)


def scenario(meant: Meant) -> Callable[[Any], Any]:
    """Add a scenario by the name of the function that draws it."""

    def registered(draw: Callable[[np.random.Generator], Case]) -> Any:
        register(draw.__name__, meant, draw)
        return draw

    return registered


@cache
def machine(name: str) -> Any:
    """A built-in machine, or the printer of the examples."""
    if name == "arm":
        return arm()
    files = {"printer": "linear-delta", "cables": "cable-robot"}
    return pk.load(str(EXAMPLES / files[name] / "robot.toml") if name in files else name)


def arm() -> Any:
    """Six joints of revolution, the last three with a common point."""
    quarter = np.pi / 2
    return pk.SerialArm.from_dh(
        a=[312, 1075, 225, 0, 0, 0], d=[670, 0, 0, 1280, 0, 215],
        alpha=[-quarter, 0, -quarter, quarter, -quarter, 0], theta=[0, -quarter, 0, 0, 0, 0],
    )  # fmt: skip


def numbers(machine: Any) -> dict[str, float]:
    """The numbers of a machine by name, of an arm the errors of its joints."""
    if not isinstance(machine, pk.SerialArm):
        return dict(zip(machine.geometry.names, machine.geometry.values, strict=True))
    kinds = ("dx", "dy", "dz", "dphi", "dtheta", "dpsi")
    return {
        f"joint{i}.{kind}": value
        for i, errors in enumerate(machine.joint_errors, 1)
        for kind, value in zip(kinds, errors, strict=True)
    }


def joints(robot: Any) -> list[str]:
    """The joints and offsets of a hexapod."""
    return list(robot.geometry.match(["base*", "platform*", "offset*"]))


def off(robot: Any, rng: np.random.Generator, size: float, names: Any = None) -> Any:
    """The robot with errors of this size, mm; of angles a hundredth of it in radians."""
    names = joints(robot) if names is None else names
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    return robot.replace(
        {
            name: robot.geometry[name] + size * (0.01 if units[name] == "rad" else 1) * rng.normal()
            for name in names
        }
    )


def drawn(robot: Any, rng: np.random.Generator, count: int = 45, share: float = 0.5) -> Any:
    """Poses drawn from the workspace, and their actuators."""
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=share)
    return poses, robot.inverse(poses)


def noisy(
    rng: np.random.Generator, poses: Any, noise: float = NOISE, turning: float = TURNING
) -> Any:
    """Poses as a tracker reads them."""
    return poses + rng.normal(size=poses.shape) * [*[noise] * 3, *[turning] * 3]


def hexapod(rng: np.random.Generator, count: int = 45, size: float = 0.4, **read: float) -> Any:
    """A hexapod with errors of its joints: it, the true one, actuators, poses as read."""
    robot = machine("hexapod")
    true = off(robot, rng, size)
    poses, q = drawn(robot, rng, count)
    return robot, true, q, noisy(rng, true.forward(q, guess=poses).pose, **read)


def poses_of(robot: Any, true: Any, q: Any, read: Any, **options: Any) -> Case:
    """All joints of a hexapod by poses."""
    data = pk.Measurements(q, read, "pose", **options)
    return Case(robot, true, data, joints(robot))


def at_target(poses: Any, target: Any) -> Any:
    """Where a point of the platform (3,) or one a row (N, 3) is at poses (N, 6), in the base."""
    there = pk.screw.from_pose(poses)
    return there[:, :3, 3] + np.einsum(
        "nij,nj->ni", there[:, :3, :3], np.broadcast_to(target, (len(poses), 3))
    )


def targets_of(robot: Any, true: Any, q: Any, poses: Any, rng: np.random.Generator) -> Case:
    """All joints of a hexapod by three reflectors at each pose."""
    seen = np.stack([at_target(poses, each) for each in TARGETS], axis=1)
    seen = seen + rng.normal(0.0, NOISE, seen.shape)
    index = np.tile([0, 1, 2], len(q))
    data = pk.Measurements(
        np.repeat(q, 3, axis=0), seen.reshape(-1, 3), "position", target=TARGETS, target_index=index
    )
    return Case(robot, true, data, joints(robot))


def probed(rng: np.random.Generator, count: int = 41, size: float = 0.8) -> Any:
    """Heights of a printer's nozzle over its bed: it, the true one, actuators, heights, poses."""
    robot = machine("printer")
    true = off(robot, rng, size, robot.model.free)
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=0.6)
    poses[:, 2] = robot.home[2]
    q = robot.inverse(poses, match=True)
    return robot, true, q, true.forward(q).pose[:, 2] + rng.normal(0.0, NOISE, count), poses


def arm_poses(rng: np.random.Generator, count: int = 60) -> Any:
    """An arm with errors of its joints: it, the true one, its angles, poses as read."""
    arm = machine("arm")
    true = arm.replace(rng.normal(size=(6, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])
    theta = rng.uniform(-1.2, 1.2, (count, 6))
    return arm, true, theta, noisy(rng, pk.screw.to_pose(true.forward(theta)))
