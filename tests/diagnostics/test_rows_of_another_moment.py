"""Readings that are late, and rows of two machines in one calibration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..simulated import hexapod_poses, with_errors

Read = Callable[[np.ndarray], np.ndarray]  # actuators to what is read there, of a true machine
Simulated = tuple[Any, np.ndarray, Callable[[np.random.Generator], Read]]
COUNT, SIZE = 60, 0.1
NOISE = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])  # mm, rad


def hexapod(rng: np.random.Generator) -> Simulated:
    """A machine, actuators, and what draws a true machine."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, COUNT, rng))
    return robot, q, lambda r: _poses(with_errors(robot, SIZE, r), 6)


def delta(rng: np.random.Generator) -> Simulated:
    robot = pk.load("rotary-delta")
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=int(rng.integers(1000)), share=0.5))
    return robot, q, lambda r: _poses(with_errors(robot, SIZE, r), 3)


def arm(rng: np.random.Generator) -> Simulated:
    machine = pk.SerialArm.from_dh(
        a=[0, 300, 50, 0, 0, 0], d=[400, 0, 0, 350, 0, 80],
        alpha=[-np.pi / 2, 0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0], theta=np.zeros(6),
    )  # fmt: skip
    q = rng.uniform(-1.0, 1.0, (COUNT, 6))

    def true(r: np.random.Generator) -> Read:
        arm = machine.replace(SIZE * r.normal(size=(6, 6)) * [1, 1, 1, 2e-3, 2e-3, 2e-3])
        return lambda at: pk.screw.to_pose(arm.forward(at))

    return machine, q, true


def _poses(robot: pk.Robot, width: int) -> Read:
    return lambda at: robot.forward(at).pose[:, :width]


MACHINES = pytest.mark.parametrize("machine", [hexapod, delta, arm])


def noisy(exact: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return exact + rng.normal(size=exact.shape) * NOISE[: exact.shape[1]]


def measured(q: np.ndarray, read: np.ndarray, file: str = "") -> pk.Measurements:
    return pk.Measurements(q, read, "pose" if read.shape[1] == 6 else "position", file=file)


def doubts(robot: Any, *data: pk.Measurements) -> dict[str, Any]:
    found = pk.identify(robot, data, holdout=0.25)
    return {each.check: each for each in found.verdict.said if each.level == "doubt"}


NEW = {"late-readings", "two-machines", "nothing-measured", "coarse-readings", "at-stop"}


@MACHINES
def test_sound_rows_are_not_accused(machine: Callable[..., Simulated]) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        robot, q, true = machine(rng)
        assert not NEW & doubts(robot, measured(q, noisy(true(rng)(q), rng))).keys()


@MACHINES
@pytest.mark.parametrize("leaving", [False, True])
@pytest.mark.parametrize("share", [0.002, -0.002])
def test_readings_off_where_the_machine_stops_are_named(
    machine: Callable[..., Simulated], leaving: bool, share: float
) -> None:
    """Read, or logged, 0.2 % of the way from the pose before or to the next; rows are held out."""
    rng = np.random.default_rng(1)
    robot, q, true = machine(rng)
    there = np.concatenate([q[1:], q[-1:]]) if leaving else np.concatenate([q[:1], q[:-1]])
    moved = q + abs(share) * (there - q)
    at, log = (moved, q) if share > 0 else (q, moved)
    said = doubts(robot, measured(log, noisy(true(rng)(at), rng)))["late-readings"]
    assert said.finding.leaving == leaving
    assert said.finding.share == pytest.approx(share, abs=5 * said.finding.stderr)
    wanted = (
        ("to the next pose" if leaving else "settle") if share > 0 else "log both at one moment"
    )
    assert wanted in said.text


@pytest.mark.filterwarnings("ignore:.*copied, not measured again")
@MACHINES
def test_copied_rows_are_not_those_of_two_machines(machine: Callable[..., Simulated]) -> None:
    rng = np.random.default_rng(5)
    robot, q, true = machine(rng)
    read, twice = noisy(true(rng)(q), rng), np.tile(np.arange(COUNT), 2)
    said = doubts(robot, measured(q[twice], read[twice]))
    assert "copies" in said
    assert "two-machines" not in said


@MACHINES
@pytest.mark.parametrize("group", ["every second", "second half"])
def test_rows_of_two_machines_are_told_apart(machine: Callable[..., Simulated], group: str) -> None:
    rng = np.random.default_rng(2)
    robot, q, true = machine(rng)
    place = np.arange(COUNT)
    other = place % 2 == 1 if group == "every second" else place >= COUNT // 2
    mixed = noisy(np.where(other[:, None], true(rng)(q), true(rng)(q)), rng)
    assert group in doubts(robot, measured(q, mixed))["two-machines"].text


def test_two_files_of_two_machines_are_told_apart() -> None:
    rng = np.random.default_rng(3)
    robot, q, true = hexapod(rng)
    halves = [
        measured(q[rows], noisy(true(rng)(q[rows]), rng), file)
        for rows, file in ((slice(0, 30), "one.csv"), (slice(30, 60), "other.csv"))
    ]
    assert ".csv" in doubts(robot, *halves)["two-machines"].text
