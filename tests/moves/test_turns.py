"""Angles of a move go on from its start, whatever the drive laws; strokes are the actuators'."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from tests import driven, generated
from tests.robots import made

LAWS: list[dict[str, Any]] = [
    {},
    {"drive": {"quadratic": 0.02}},
    {"drive": {"quadratic": 0.02, "backlash": 0.001}},
    {"drive": {"harmonics": [{"k": 1.5, "cos": 0.02, "sin": 0.01}]}},
    {"drive": {"harmonics": [{"k": 1.5, "cos": 0.02, "sin": 0.01}]}, "stroke": [-2.5, 2.5]},
]


def behind(branch: int, law: dict[str, Any]) -> pk.Robot:
    """A crank that looks away from home where the machine is behind its axis, and a leg."""
    crank = {
        "kind": "RUS", "base": [0.0, 0.0, 0.0], "platform": [0.0, 0.0, 0.0],
        "axis": [0.0, 0.0, 1.0], "zero": [1.0, 0.0, 0.0], "crank": 100.0, "rod": 250.0,
        "branch": branch, "gain": 1.0,
    }  # fmt: skip
    leg = {"kind": "UPS", "base": [0.0, -700.0, 0.0], "platform": [0.0, 0.0, 0.0]}
    return made("xy", {"x": 250.0, "y": 10.0}, [crank | law, leg])


def integrated(move: pk.Move, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much coordinates and speeds miss the integrals of speeds and accelerations."""
    at, h = move.sample(t), t[1] - t[0]
    missed = []
    for value, rate in ((at.actuators, at.velocities), (at.velocities, at.accelerations)):
        simpson = h / 3 * (rate[:-2:2] + 4 * rate[1:-1:2] + rate[2::2])
        missed.append(np.abs(value[2::2] - value[:-2:2] - simpson))
    return missed[0], missed[1]


@pytest.mark.parametrize("space", ["pose", "coordinates"])
@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("law", LAWS)
def test_angles_go_on_from_the_start_of_a_move(law: Any, branch: int, space: Any) -> None:
    robot = behind(branch, law)
    start, end = np.zeros((2, 6))
    start[:2], end[:2] = (-250.0, 60.0), (-250.0, -60.0)
    move = pk.trajectory.move(robot, start, end, duration=1.0, space=space)
    t = np.linspace(0.0, 1.0, 1001)
    at = move.sample(t)
    np.testing.assert_allclose(at.actuators[0], robot.inverse(start), atol=1e-9)
    found = robot.forward(at.actuators, guess=at.pose)
    assert found.ok.all()
    np.testing.assert_allclose(found.pose[:, :2], at.pose[:, :2], atol=1e-8)
    by_speed, by_acceleration = integrated(move, t)
    assert by_speed.max() < 1e-9 and by_acceleration.max() < 1e-9
    if not law.get("stroke"):  # or the start is on the other side of the axis anyhow
        assert abs(robot.inverse(end)[0] - at.actuators[-1, 0]) > 4.0  # another turn, by itself


def test_rates_are_those_at_the_turn_that_is_meant() -> None:
    robot = behind(1, {"drive": {"quadratic": 0.02}})
    pose = np.array([-250.0, 60.0, 0.0, 0.0, 0.0, 0.0])
    q = robot.inverse(pose)
    there = robot.inverse(pose, near=q - [2 * np.pi, 0.0])
    assert abs(there - q)[0] > 4.0
    motion = np.zeros((3, 4, 4))
    motion[0], motion[1, 0, 3] = pk.screw.from_pose(pose), 1.0
    step = np.array([1e-4, 0.0, 0.0, 0.0, 0.0, 0.0])
    for each in (q, there):
        moved = robot.inverse(pose + step, near=each)
        back = robot.inverse(pose - step, near=each)
        velocity, _ = robot.rates(motion, near=each)
        np.testing.assert_allclose(velocity, (moved - back) / 2e-4, rtol=1e-6)


@pytest.mark.parametrize("kind", generated.KINDS)
def test_strokes_of_a_move_are_broken_where_its_actuators_break_them(kind: str) -> None:
    rng = np.random.default_rng(5)
    moves = 0
    while moves < 2:
        robot = generated.machine(kind, rng)
        data = driven.content(robot)
        home = robot.machine.drives(robot.slots, robot.inverse(robot.home)[None])[0]
        for limb, way in zip(data["limb"], home.tolist(), strict=True):
            room = (0.8 if limb["kind"] == "RUS" else 150.0) * rng.uniform(0.1, 1.0)
            limb["stroke"] = [way - room, way + room]
        robot = driven.parsed(data)
        own = robot.own_home + 3.0 * (generated.poses(kind, robot, 2, rng) - robot.own_home)
        ends = robot.frames.outward(own)
        if robot.model.match:
            ends = robot.complete(ends)
        if not np.isfinite(ends).all() or not np.isfinite(robot.inverse(ends)).all():
            continue
        try:
            move = pk.trajectory.move(robot, ends[0], ends[1], duration=1.0, space="joint")
        except pk.ArgumentError as refused:
            assert "assembly mode" in str(refused)
            continue
        moves += 1
        t, events = np.linspace(0.0, 1.0, 501), move.events()
        at = move.sample(t)

        def said(what: str, limb: int | None, t: Any = t, events: Any = events) -> np.ndarray:
            spans = [(e.time, e.until) for e in events if (e.what, e.limb) == (what, limb)]
            return np.array([any(a <= each <= b for a, b in spans) for each in t])

        actuators = [limb.actuator for limb in robot.model.limbs]
        for i, (limb, a) in enumerate(zip(data["limb"], actuators, strict=True), 1):
            drive = limb.get("offset", 0.0) + limb.get("gain", 1.0) * at.actuators[:, a]
            inside = np.minimum(drive - limb["stroke"][0], limb["stroke"][1] - drive)
            clear = np.abs(inside) > 1e-6
            np.testing.assert_array_equal(said("stroke", i)[clear], (inside < 0)[clear])
        lost = ~np.isfinite(at.pose).all(axis=1)
        np.testing.assert_array_equal(said("pose", None), lost)
        for i in range(1, 1 + len(robot.model.limbs)):
            assert not (said("reach", i) & lost).any()  # of which nothing is known there


def test_a_pose_that_is_not_found_is_no_broken_stroke() -> None:
    """Cranks whose elbows come too near on the way for rods of unlike lengths to meet."""
    rods, rng = (400.0, 100.0), np.random.default_rng(3)
    limbs: list[dict[str, Any]] = [
        {
            "kind": "RUS", "base": [x, 0.0, 0.0], "platform": [0.0, 0.0, 0.0], "crank": 200.0,
            "axis": [0.0, 0.0, 1.0], "zero": [1.0, 0.0, 0.0], "rod": rod, "branch": branch,
            "stroke": [-6.0, 6.0],
        }
        for x, rod, branch in ((-300.0, rods[0], -1), (300.0, rods[1], 1))
    ]  # fmt: skip
    robot = made("xy", {"x": 187.5, "y": 270.0}, limbs)
    t = np.linspace(0.0, 1.0, 201)
    while True:
        ends = np.zeros((2, 6))
        ends[:, :2] = rng.uniform(-450.0, 450.0, (2, 2))
        if not np.isfinite(robot.inverse(ends)).all():
            continue
        move = pk.trajectory.move(robot, ends[0], ends[1], duration=1.0, space="joint")
        angle = move.sample(t).actuators
        elbows = 200.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        gap = np.linalg.norm(elbows[:, 1] - elbows[:, 0] + [600.0, 0.0], axis=1)
        beyond = (gap < rods[0] - rods[1]) | (gap > sum(rods))
        if beyond.sum() > 20:
            break
    lost = [event for event in move.events() if event.what == "pose"]
    assert lost and "no pose found" in str(move) and lost[0].limb is None
    for each in t[beyond]:
        assert any(event.time <= each <= event.until for event in lost)
    assert "stroke" not in {event.what for event in move.events()}


@pytest.mark.parametrize("name", ["2tpr2tps-chains", "exechon", "tripteron"])
@pytest.mark.parametrize("space", ["coordinates", "joint"])
def test_machines_that_do_not_quite_close_move_between_poses_that_they_take(
    name: str, space: Any
) -> None:
    """More closures than coordinates, numbers that are not exact: as after a calibration."""
    robot, rng = pk.load(name), np.random.default_rng(1)
    values = robot.geometry.values.copy()
    lengths = np.array(robot.geometry.units) == "mm"
    values += np.where(lengths, 0.3, 5e-4) * rng.normal(size=len(values))
    robot = robot.replace(values)
    ends = np.tile(robot.home, (2, 1))
    moved = [generated.COORDINATES.index(each) for each in robot.moved]
    room = np.array([20, 20, 20, 0.1, 0.1, 0.1])[moved]
    ends[:, moved] += room * rng.uniform(-1, 1, (2, len(moved)))
    ends = robot.complete(ends)
    assert robot.violation(ends).min() > 1e-4  # limb by limb
    way = pk.trajectory.move(robot, *ends, duration=1.0, space=space)
    at = way.sample(np.linspace(0.0, 1.0, 11))
    np.testing.assert_allclose(at.pose[[0, -1]], ends, atol=1e-8)
    np.testing.assert_allclose(robot.forward(at.actuators).pose, at.pose, atol=1e-8)
    with pytest.raises(pk.ArgumentError, match="cannot follow"):
        pk.trajectory.move(robot, *ends, duration=1.0)
    with pytest.raises(pk.ArgumentError, match=r"end: .* cannot take this pose"):
        pk.trajectory.move(robot, ends[0], ends[1] + 0.01, duration=1.0, space=space)
