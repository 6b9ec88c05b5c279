"""Causes of attacks by strangers that were calibrated with too few true values inside.

Eight that no statement can hold, and four that one can: each of these without it and with it.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import Case, machine, register, scenario
from benchmarks.imperfect.statements import as_it_is, with_statement


def small_errors(
    robot: Any, rng: np.random.Generator, size: float, wrong: dict[str, float] | None = None
) -> Any:
    """The true machine: free numbers off by `size` mm and 3 mrad a mm, others as in `wrong`."""
    geometry = robot.geometry
    units = dict(zip(geometry.names, geometry.units, strict=True))
    of_unit = {"mm": size, "rad": 0.003 * size, "1": 0.0}
    errors = {name: of_unit[units[name]] for name in robot.model.free}
    for pattern, by in (wrong or {}).items():
        errors |= dict.fromkeys(geometry.match(pattern), by)
    return robot.replace({name: geometry[name] + by * rng.normal() for name, by in errors.items()})


def built(
    name: str, rng: np.random.Generator, size: float, count: int, share: float = 0.6,
    wrong: dict[str, float] | None = None,
) -> Any:  # fmt: skip
    """A machine, the true one, actuators, and poses that it was driven to."""
    robot = machine(name)
    true = small_errors(robot, rng, size, wrong)
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=share)
    return robot, true, robot.inverse(poses, match=True if robot.model.match else None), poses


def reached(true: Any, q: Any, near: Any) -> Any:
    """Poses (N, 6) where the true machine is."""
    found = true.forward(q, guess=near)
    assert (np.asarray(found.status) == 0).all()
    return found.pose


def posed(
    rng: np.random.Generator, robot: Any, true: Any, q: Any, there: Any, size: float = 0.02
) -> Case:
    """A case of poses that were read with noise."""
    read = there + rng.normal(size=there.shape) * [*[size] * 3, *[5e-5] * 3]
    return Case(robot, true, pk.Measurements(q, read, "pose"))


def placed(
    rng: np.random.Generator, robot: Any, true: Any, q: Any, there: Any, size: float,
    moving: Any = (1.0, 1.0, 1.0),
) -> Case:  # fmt: skip
    """A case of positions that were read with noise, along the axes along which it moves."""
    read = there[:, :3] + rng.normal(0.0, size, (len(q), 3)) * moving
    return Case(robot, true, pk.Measurements(q, read, "position"))


@scenario("other")
def lens_of_a_camera(rng: np.random.Generator) -> Case:
    """A camera over a five-bar has barrel distortion: 0.1 mm at 130 mm from its axis."""
    robot, true, q, poses = built("five-bar", rng, 0.3, 40)
    there = reached(true, q, poses)[:, :3].copy()
    off = there[:, :2] - [10.0, 310.0]
    there[:, :2] -= 0.1 * off * (off**2).sum(axis=1, keepdims=True) / 130.0**3
    return placed(rng, robot, true, q, there, 0.015, [1, 1, 0])


@scenario("other")
def encoders_of_a_rotary_delta(rng: np.random.Generator) -> Case:
    """Encoder discs of a rotary delta read 0.1 mrad too much and too little, twice a turn."""
    robot, true, q, poses = built("rotary-delta", rng, 0.3, 50)
    at = q + 1e-4 * np.sin(2.0 * q + rng.uniform(0.0, 2.0 * np.pi, 3))
    return placed(rng, robot, true, q, reached(true, at, poses), 0.03)


@scenario("other")
def droop_of_a_column(rng: np.random.Generator) -> Case:
    """The column of a Trivariant droops where the platform is out, 0.08 mm at the end."""
    robot, true, q, poses = built("trivariant", rng, 0.2, 45)
    there = reached(true, q, poses).copy()
    far = np.linalg.norm(there[:, :3], axis=1)
    out = (there[:, :2] ** 2).sum(axis=1) / 250.0**2
    there[:, 2] -= 0.08 * out * (far / 1000.0) ** 2
    return posed(rng, robot, true, q, there)


@scenario("other")
def legs_that_yield_as_they_lean(rng: np.random.Generator) -> Case:
    """Legs of an Exechon yield under the spindle's weight, the more the further out it is."""
    robot, true, q, poses = built("exechon", rng, 0.2, 50)
    there = reached(true, q, poses)
    lean = 0.2 * np.c_[there[:, 1], -there[:, 1], there[:, 0]] / 800.0
    return posed(rng, robot, true, q, reached(true, q + lean, there))


@scenario("other")
def legs_by_the_side_of_the_lean(rng: np.random.Generator) -> Case:
    """Legs of a 3-RPS are 0.05 mm longer or shorter by the side to which the platform leans."""
    robot, true, q, poses = built("3rps", rng, 0.3, 45)
    alpha, beta = poses[:, 3], poses[:, 4]
    side = np.sign(np.c_[beta, alpha - beta, -alpha])
    return posed(rng, robot, true, q, reached(true, q + 0.025 * side, poses))


@scenario("other")
def side_play_of_revolute_joints(rng: np.random.Generator) -> Case:
    """Rods of a 3-PRS go sideways by 0.05 mm with the lean of the platform."""
    robot, true, q, poses = built("3prs", rng, 0.3, 45)
    there = np.empty_like(poses)
    for k, (alpha, beta) in enumerate(np.sign(poses[:, 3:5])):
        by = {"base1.y": alpha, "base2.x": beta, "base3.x": -beta}
        moved = {name: true.geometry[name] + 0.05 * side for name, side in by.items()}
        there[k] = reached(true.replace(moved), q[k : k + 1], poses[k : k + 1])[0]
    return posed(rng, robot, true, q, there)


@scenario("other")
def pixels_that_are_not_square(rng: np.random.Generator) -> Case:
    """The camera of a planar 3-RRR reads x 0.4 per mille too long."""
    robot, true, q, poses = built("3rrr-planar", rng, 0.2, 45, 0.4)
    there = reached(true, q, poses) * [1.0004, 1, 1, 1, 1, 1]
    return posed(rng, robot, true, q, there, 0.01)


@scenario("other")
def heavy_cables(rng: np.random.Generator) -> Case:
    """Eight cables hang through: they are shorter by up to 1 mm, by the cube of their length."""
    robot = machine("cables")
    true = small_errors(robot, rng, 2.0)
    poses = robot.home + rng.uniform(-1, 1, (50, 6)) * [800, 600, 450, 0.08, 0.08, 0.08]
    q = true.inverse(poses)
    read = poses + rng.normal(size=poses.shape) * [*[0.1] * 3, *[1e-4] * 3]
    log = q + (q / q.max()) ** 3 + rng.normal(0.0, 0.1, q.shape)
    return Case(robot, true, pk.Measurements(log, read, "pose"))


def gears_of_a_rotary_delta(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Gains of a rotary delta are wrong by 0.3 per mille; all else is found, by positions."""
    stated = {"gain*": 3e-4}
    robot, true, q, poses = built("rotary-delta", rng, 0.3, 50, wrong=stated)
    case = placed(rng, robot, true, q, reached(true, q, poses), 0.03)
    return case, {"uncertainty": stated}


def worse_gears_of_a_rotary_delta(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """The same by 1 per mille."""
    stated = {"gain*": 1e-3}
    robot, true, q, poses = built("rotary-delta", rng, 0.2, 45, 0.4, wrong=stated)
    case = placed(rng, robot, true, q, reached(true, q, poses), 0.02)
    return case, {"uncertainty": stated}


def gears_that_are_wrong_alike(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Both gains of a five-bar are wrong by the same, 1 per mille."""
    robot, true, q, poses = built("five-bar", rng, 0.3, 40)
    gain = 1.0 + 1e-3 * rng.normal()
    true = true.replace({"gain1": gain, "gain2": gain})
    case = placed(rng, robot, true, q, reached(true, q, poses), 0.015, [1, 1, 0])
    return case, {"uncertainty": {"common": {"gain*": 1e-3}}}


def tracker_and_gears(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """A Trivariant with gains wrong by 0.2 per mille, a tracker by 50 parts in a million."""
    robot, true, q, poses = built("trivariant", rng, 0.2, 45, wrong={"gain*": 2e-4})
    there = reached(true, q, poses).copy()
    there[:, :3] *= 1.0 + 50e-6 * rng.normal()
    case = posed(rng, robot, true, q, there)
    return case, {"uncertainty": {"scale": 50e-6, "gain*": 2e-4}}


for _of in (
    gears_of_a_rotary_delta, worse_gears_of_a_rotary_delta, gears_that_are_wrong_alike,
    tracker_and_gears,
):  # fmt: skip
    register(_of.__name__, "other", partial(as_it_is, of=_of))
    register(f"{_of.__name__}_stated", "other", partial(with_statement, of=_of))
