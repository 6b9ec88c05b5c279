"""Rows that are late, exchanged, copied, or of several machines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.imperfect.cases import (
    TARGETS,
    Case,
    hexapod,
    joints,
    noisy,
    off,
    poses_of,
    scenario,
)
from benchmarks.imperfect.sound import sound_hexapod_targets


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


@scenario("seen")
def moved_and_slipped(rng: np.random.Generator) -> Case:
    """The tracker was moved and a leg slipped by 0.4 mm half-way."""
    robot, true, q, read = hexapod(rng, 50)
    slipped = true.replace({"offset3": true.geometry["offset3"] + 0.4})
    read[25:] = noisy(rng, slipped.forward(q[25:]).pose)
    read[25:, :3] += rng.normal(0.0, 0.4, 3)
    return poses_of(robot, true, q, read)


@scenario("seen")
def unknown_targets_exchanged(rng: np.random.Generator) -> Case:
    """Three reflectors whose places are not known, in turn in every second pose."""
    case = sound_hexapod_targets(rng)
    read = case.data.values.reshape(-1, 3, 3).copy()
    read[::2] = read[::2][:, [1, 2, 0]]
    data = pk.Measurements(
        case.data.actuators, read.reshape(-1, 3), "position",
        target_index=case.data.target_index, target=TARGETS,
    )  # fmt: skip
    return replace(
        case, data=data, free="offset*", options={"holdout": 0.25, "unknown": ["frame", "target"]}
    )


@scenario("seen")
def left_handed_tracker(rng: np.random.Generator) -> Case:
    robot, true, q, read = hexapod(rng)
    data = pk.Measurements(q, read[:, :3] * [1, -1, 1], "position")
    return Case(robot, true, data, "offset*", {"holdout": 0.25, "unknown": "frame"})


@scenario("seen")
def sigma_in_micrometres(rng: np.random.Generator) -> Case:
    """20 µm, taken for mm."""
    robot, true, q, read = hexapod(rng)
    return poses_of(robot, true, q, read, sigma=[20, 20, 20, 5e-2, 5e-2, 5e-2])
