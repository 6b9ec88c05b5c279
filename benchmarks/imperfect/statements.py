"""Ten causes of an outsider's own, on machines that no test has: without a statement and with one.

Each is drawn twice with the same errors: as it is, and with what somebody who knows the machine
would state of it (`uncertainty`, sessions, or the deviation of the actuators).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import Case, at_target, machine, off, register

Draw = Callable[[np.random.Generator], tuple[Case, dict[str, Any]]]


def enlarged(name: str, by: float, begin: str = "") -> Any:
    """A built-in machine with all lengths of its joints larger, or some of them."""
    robot = machine(name)
    every = zip(robot.geometry.names, robot.geometry.units, strict=True)
    lengths = [n for n, unit in every if unit == "mm" and n.startswith(begin)]
    lengths = [n for n in lengths if not n.startswith("offset")]
    return robot.replace({n: by * robot.geometry[n] for n in lengths})


def wrong(
    rng: np.random.Generator, robot: Any, free: list[str], errors: dict[str, float], size: float
) -> Any:
    """The true machine: free numbers are off by `size` mm, others as stated."""
    true = off(robot, rng, size, list(robot.geometry.match(free)))
    names = {n: by for pattern, by in errors.items() for n in robot.geometry.match(pattern)}
    return true.replace({n: true.geometry[n] + by * rng.normal() for n, by in names.items()})


def places(robot: Any, rng: np.random.Generator, count: int, share: float = 0.5) -> Any:
    poses = pk.sample_poses(robot, count, seed=int(rng.integers(1_000_000)), share=share)
    return poses, robot.inverse(poses, match=True if robot.model.match else None)


def noise(rng: np.random.Generator, there: Any, size: float, turning: float = 4e-5) -> Any:
    """Poses (N, 6) or positions (N, 3) as they are read."""
    return there + rng.normal(size=there.shape) * [*[size] * 3, *[turning] * 3][: there.shape[1]]


def rods_from_a_drawing(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Six rods of a delta, 0.03 mm off, are taken as drawn; frame and zeros are found."""
    robot = enlarged("linear-delta-6", 0.7)
    free = [name for name in robot.model.free if not name.startswith("rod")]
    true = wrong(rng, robot, free, {"rod*": 0.03}, 0.2)
    poses, q = places(robot, rng, 50)
    data = pk.Measurements(q, noise(rng, true.forward(q, guess=poses).pose, 0.01), "pose")
    return Case(robot, true, data, free), {"uncertainty": {"rod*": 0.03}}


def ball_bar_of_another_scale(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """A ball-bar that reads 0.1 per mille too long, to three sockets, at an enlarged hexapod."""
    robot = enlarged("hexapod", 1.6)
    true = wrong(rng, robot, ["offset*"], {}, 0.3)
    poses, q = places(robot, rng, 60)
    there, scale = true.forward(q, guess=poses).pose[:, :3], 1.0 + 1e-4 * rng.normal()
    sockets = np.array([[500.0, 100, -50], [-300, 450, -50], [-200, -500, -50]])
    sets = [
        pk.Measurements(
            q[k::3], scale * np.linalg.norm(there[k::3] - sockets[k], axis=1)
            + rng.normal(0.0, 0.005, 20), "distance", target=sockets[k],
        )
        for k in range(3)
    ]  # fmt: skip
    return Case(robot, true, sets, "offset*", {}), {"uncertainty": {"scale": 1e-4}}


def frame_from_a_fixture(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """The tracker's frame is taken from a fixture that is good to 0.03 mm and 0.05 mrad."""
    robot = enlarged("hexapod", 1.3)
    true = wrong(rng, robot, ["offset*"], {}, 0.3)
    poses, q = places(robot, rng, 40)
    frame = pk.screw.from_pose([*rng.normal(0, 0.03, 3), *rng.normal(0, 5e-5, 3)])
    seen = pk.screw.to_pose(frame @ pk.screw.from_pose(true.forward(q, guess=poses).pose))
    data = pk.Measurements(q, noise(rng, seen, 0.02), "pose")
    turns = {f"frame.{angle}": 5e-5 for angle in ("alpha", "beta", "gamma")}
    return Case(robot, true, data, "offset*"), {"uncertainty": {"frame.?": 0.03, **turns}}


def nests_glued_by_hand(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Four reflectors sit 0.04 mm beside their places, each by itself."""
    robot = enlarged("hexapod", 0.6)
    free = ["base*", "platform*", "offset*"]
    true = wrong(rng, robot, free, {}, 0.2)
    poses, q = places(robot, rng, 40)
    nests = np.array([[60.0, 10, 15], [-50, 40, 25], [-10, -60, 20], [5, 5, 70]])
    there = true.forward(q, guess=poses).pose
    glued = nests + rng.normal(0.0, 0.04, nests.shape)
    seen = np.stack([at_target(there, each) for each in glued], axis=1).reshape(-1, 3)
    data = pk.Measurements(
        np.repeat(q, 4, axis=0), noise(rng, seen, 0.01), "position", target=nests,
        target_index=np.tile(np.arange(4), 40),
    )  # fmt: skip
    return Case(robot, true, data, free), {"uncertainty": {"target*": 0.04}}


def rails_by_a_square(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Three rails stand within 0.15 mrad, taken as upright; other numbers are found."""
    robot = enlarged("linear-delta", 1.1, "rod")
    free = [name for name in robot.model.free if not name.startswith("slider")]
    true = wrong(rng, robot, free, {"slider*": 1.5e-4}, 0.3)
    poses, q = places(robot, rng, 50)
    data = pk.Measurements(
        q, noise(rng, true.forward(q, guess=poses).pose[:, :3], 0.02), "position"
    )
    return Case(robot, true, data, free), {"uncertainty": {"slider*": 1.5e-4}}


def axes_of_cranks(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """The axes of six cranks lean by 0.3 mrad; zeros and rods are found."""
    robot = enlarged("6-rus", 0.9, "crank")
    free = ["offset*", "rod*"]
    true = wrong(rng, robot, free, {"axis*": 3e-4}, 0.2)
    poses, q = places(robot, rng, 50)
    data = pk.Measurements(q, noise(rng, true.forward(q, guess=poses).pose, 0.015), "pose")
    return Case(robot, true, data, free), {"uncertainty": {"axis*": 3e-4}}


def gimbals_off_their_centres(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """The two axes of each gimbal of a Tricept miss each other by 0.02 mm; zeros are found."""
    robot = machine("tricept")
    true = wrong(rng, robot, ["offset*"], {"limb?.joint1b.d[xyz]": 0.02}, 0.2)
    poses, q = places(robot, rng, 45)
    read = noise(rng, true.forward(q, guess=poses).pose[:, :3], 0.01)
    data = pk.Measurements(q, read, "position")
    return Case(robot, true, data, "offset*"), {"uncertainty": {"limb?.joint1b.d[xyz]": 0.02}}


def loose_belts(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """Belts of a planar machine: the cranks stop 0.2 mrad to either side, by chance."""
    robot = enlarged("3rrr-planar", 1.4)
    free = ["base*", "offset*"]
    true = wrong(rng, robot, free, {}, 0.1)
    poses, q = places(robot, rng, 40)
    there = true.forward(q + 2e-4 * rng.choice([-1.0, 1.0], q.shape), guess=poses).pose
    data = pk.Measurements(q, noise(rng, there[:, :3], 0.01), "position")
    return Case(robot, true, data, free), {"actuator_sigma": 2e-4}


def worn_pulleys(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """The grooves of eight pulleys are 0.3 mm deeper than stated; zeros are found, by poses."""
    robot = machine("cables")
    true = off(robot, rng, 2.0, robot.geometry.match("offset*")).replace({"wheel": 40.3})
    poses = robot.home + rng.uniform(-1, 1, (45, 6)) * [800, 600, 450, 0.1, 0.1, 0.1]
    q = true.inverse(poses) + rng.normal(0.0, 0.1, (45, 8))
    data = pk.Measurements(q, noise(rng, poses, 0.1, 1e-4), "pose")
    return Case(robot, true, data, "offset*"), {"uncertainty": {"wheel": 0.3}}


def links_of_a_catalogue(rng: np.random.Generator) -> tuple[Case, dict[str, Any]]:
    """An arm of five joints: link lengths are 0.1 mm off a catalogue, zeros are found."""
    quarter = np.pi / 2
    arm = pk.SerialArm.from_dh(
        a=[50, 380, 310, 0, 0], d=[360, 0, 0, 0, 140],
        alpha=[-quarter, 0, 0, -quarter, 0], theta=[0, -quarter, 0, -quarter, 0],
    )  # fmt: skip
    errors = np.zeros((5, 6))
    errors[:, 5] = rng.normal(0.0, 1e-3, 5)
    errors[1:4, :3] = rng.normal(0.0, 0.1, (3, 3))
    true = arm.replace(errors)
    theta = rng.uniform(-1.2, 1.2, (60, 5))
    there = at_target(pk.screw.to_pose(true.forward(theta)), [30.0, 0.0, 60.0])
    data = pk.Measurements(
        theta, noise(rng, there, 0.03), "position", target=[30.0, 0.0, 60.0]
    )  # fmt: skip
    stated = {f"joint{i}.d?": 0.1 for i in (2, 3, 4)}
    return Case(arm, true, data, ["joint*.dpsi"]), {"uncertainty": stated}


def with_statement(rng: np.random.Generator, of: Draw) -> Case:
    case, stated = of(rng)
    if "actuator_sigma" in stated:
        return replace(case, data=replace(case.data, **stated))
    return replace(case, options={**case.options, **stated})


def as_it_is(rng: np.random.Generator, of: Draw) -> Case:
    return of(rng)[0]


CAUSES: tuple[Draw, ...] = (
    rods_from_a_drawing, ball_bar_of_another_scale, frame_from_a_fixture, nests_glued_by_hand,
    rails_by_a_square, axes_of_cranks, gimbals_off_their_centres, loose_belts, worn_pulleys,
    links_of_a_catalogue,
)  # fmt: skip
for _of in CAUSES:
    register(_of.__name__, "other", partial(as_it_is, of=_of))
    register(f"{_of.__name__}_stated", "other", partial(with_statement, of=_of))
