"""Calibrations from imperfect data: each scenario draws a true machine and what was read of it.

A scenario that is `seen` must not end "calibrated" while its intervals hold fewer true values than
they state; a `sound` one must not be doubted. Of the others the model is wrong in a way that no
residual shows, or the free numbers cannot hold what is wrong: they are printed beside them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk

Meant = Literal["sound", "seen", "other"]
NOISE, TURNING = 0.02, 5e-5  # mm, rad
TARGETS = np.array([[80.0, 0, 20], [-40, 70, 10], [-40, -70, 30]])
EXAMPLES = Path(__file__).parents[1] / "examples"


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


def scenario(meant: Meant) -> Callable[[Any], Any]:
    """Register a scenario by the name of its function."""

    def register(draw: Callable[[np.random.Generator], Case]) -> Any:
        SCENARIOS[draw.__name__] = Scenario(draw, meant)
        return draw

    return register


# machines ---------------------------------------------------------------------------------------


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


# sound data -------------------------------------------------------------------------------------


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
    places = pk.screw.from_pose(read)
    seen = np.einsum("nij,kj->nki", places[:, :3, :3], TARGETS) + places[:, None, :3, 3]
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


@scenario("sound")
def sound_printer(rng: np.random.Generator) -> Case:
    robot, true, q, heights, _ = probed(rng)
    return Case(robot, true, pk.Measurements(q, heights, "height"))


@scenario("sound")
def sound_cables(rng: np.random.Generator) -> Case:
    """Eight cables, which are more than the six ways to move."""
    robot = machine("cables")
    names = [f"offset{i}" for i in range(1, 9)]
    true = off(robot, rng, 2.0, names)
    poses = robot.home + rng.uniform(-1, 1, (40, 6)) * [900, 600, 500, 0.1, 0.1, 0.1]
    q = true.inverse(poses) + rng.normal(0.0, 0.3, (40, 8))
    data = pk.Measurements(q, noisy(rng, poses, 0.1, 1e-4), "pose")
    return Case(robot, true, data, names)


def arm_poses(rng: np.random.Generator, count: int = 60) -> Any:
    """An arm with errors of its joints: it, the true one, its angles, poses as read."""
    arm = machine("arm")
    true = arm.replace(rng.normal(size=(6, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])
    theta = rng.uniform(-1.2, 1.2, (count, 6))
    return arm, true, theta, noisy(rng, pk.screw.to_pose(true.forward(theta)))


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


# readings in steps, and at a stop -----------------------------------------------------------------


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


@scenario("seen")
def rounded_good_machine(rng: np.random.Generator) -> Case:
    return dial(rng, 0.02, 0.1)


@scenario("seen")
def rounded_half_a_step(rng: np.random.Generator) -> Case:
    return dial(rng, 0.02, 0.05)


@scenario("seen")
def rounded_a_step(rng: np.random.Generator) -> Case:
    return dial(rng, 0.1, 0.1)


@scenario("seen")
def rounded_several_steps(rng: np.random.Generator) -> Case:
    return dial(rng, 0.3, 0.1)


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


# rows ---------------------------------------------------------------------------------------------


def late(rng: np.random.Generator, share: float) -> Case:
    robot, true, q, read = hexapod(rng, 60)
    read[1:] += share * (read[:-1] - read[1:])
    return poses_of(robot, true, q, read)


@scenario("seen")
def late_readings(rng: np.random.Generator) -> Case:
    """By 0.2 % of the way from the pose before."""
    return late(rng, 2e-3)


@scenario("seen")
def hardly_late_readings(rng: np.random.Generator) -> Case:
    """By 0.05 % of the way."""
    return late(rng, 5e-4)


@scenario("seen")
def early_actuators(rng: np.random.Generator) -> Case:
    robot, true, q, read = hexapod(rng)
    log = q.copy()
    log[1:] += 3e-3 * (q[:-1] - q[1:])
    return poses_of(robot, true, log, read)


def mixed(rng: np.random.Generator, of_other: Any, **options: Any) -> tuple[Any, Any, Any, Any]:
    """Rows of two machines of one make: of the second where `of_other` (40,) says so."""
    robot, true, q, read = hexapod(rng, 40, 0.15)
    other = off(robot, rng, 0.15)
    second = noisy(rng, other.forward(q).pose)
    return robot, true, q, np.where(np.asarray(of_other)[:, None], second, read)


@scenario("seen")
def two_machines_in_turn(rng: np.random.Generator) -> Case:
    return poses_of(*mixed(rng, np.arange(40) % 2))


@scenario("seen")
def two_machines_in_turn_positions(rng: np.random.Generator) -> Case:
    robot, true, q, read = mixed(rng, np.arange(40) % 2)
    data = pk.Measurements(q, read[:, :3], "position")
    return Case(robot, true, data, joints(robot), {"holdout": 0.25, "prior": 0.5})


@scenario("seen")
def two_machines_two_files(rng: np.random.Generator) -> Case:
    robot, true, q, read = mixed(rng, np.arange(40) >= 20)
    halves = [slice(0, 20), slice(20, 40)]
    sets = [
        pk.Measurements(q[rows], read[rows], "pose", file=f"{i}.csv")
        for i, rows in enumerate(halves)
    ]
    return Case(robot, true, sets, joints(robot))


@scenario("seen")
def two_machines_halves(rng: np.random.Generator) -> Case:
    return poses_of(*mixed(rng, np.arange(40) >= 20))


@scenario("seen")
def rows_exchanged(rng: np.random.Generator) -> Case:
    """The readings of four rows stand beside the actuators of the next."""
    robot, true, q, read = hexapod(rng)
    rows = rng.choice(len(q), 4, replace=False)
    read[rows] = read[np.roll(rows, 1)]
    return poses_of(robot, true, q, read)


@scenario("seen")
def rows_equal(rng: np.random.Generator) -> Case:
    """Fifteen rows were copied below the others."""
    robot, true, q, read = hexapod(rng)
    again = np.r_[np.arange(len(q)), np.arange(15)]
    return poses_of(robot, true, q[again], read[again])


@scenario("seen")
def legs_exchanged(rng: np.random.Generator) -> Case:
    """Legs 2 and 3 exchanged in a third of the rows."""
    robot, true, q, read = hexapod(rng)
    q = q.copy()
    q[:15] = q[:15][:, [0, 2, 1, 3, 4, 5]]
    return poses_of(robot, true, q, read)


@scenario("seen")
def other_unit_in_a_session(rng: np.random.Generator) -> Case:
    robot, true, q, read = hexapod(rng, 40)
    sets = [
        pk.Measurements(q[:20], read[:20, :3], "position", session="a"),
        pk.Measurements(q[20:], read[20:, :3] / 25.4, "position", session="b"),
    ]
    return Case(robot, true, sets, "offset*", {})


@scenario("seen")
def targets_exchanged(rng: np.random.Generator) -> Case:
    """Three reflectors in turn in four poses."""
    case = sound_hexapod_targets(rng)
    data = case.data
    read = data.values.reshape(-1, 3, 3).copy()
    rows = rng.choice(len(read), 4, replace=False)
    read[rows] = read[rows][:, [1, 2, 0]]
    return replace(case, data=replace(data, values=read.reshape(-1, 3)))


# orientations -------------------------------------------------------------------------------------


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
        SCENARIOS[f"angles_{name}{of}"] = Scenario(draw, "seen")


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


# what the model or the free numbers cannot hold ---------------------------------------------------


@scenario("other")
def joints_off_offsets_free(rng: np.random.Generator) -> Case:
    """All joints are off, the six offsets are free, and poses stand in a corner."""
    robot = machine("hexapod")
    true = off(robot, rng, 0.4)
    middle = np.array([60, 60, 40, 0.1, 0.1, 0.1])
    poses = robot.home + middle + rng.uniform(-1, 1, (20, 6)) * [10, 10, 10, 0.03, 0.03, 0.03]
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
    there = pk.screw.from_pose(true.forward(q, guess=poses).pose)
    read = there[:, :3, 3] + 5.0 * there[:, :3, 2] + rng.normal(0.0, NOISE, (45, 3))
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
