"""Passive joints of chains that nobody drew: found where the platform is, or nothing is said.

A chain has several postures at one pose, and a search for its passive joints may rest where it does
not close. What is said of a solved row is of joints that close, or NaN.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from tests.chain_files import BOOMS, as_chains, drawn, leg_on_leg
from tests.chain_twin import Twin, posed
from tests.kinematics.test_chains import loaded
from tests.workspaces import CHAINS

CLOSED = 1e-7  # mm
STEP = 1e-5  # rad, and of 500 mm
SEEDS = range(8)
each_map = pytest.mark.parametrize("map", ["spatial", "planar", "spherical"])


def machine(map: str, seed: int, folder: Path) -> tuple[pk.Robot, np.random.Generator]:
    """One that is well conditioned at home."""
    rng = np.random.default_rng([seed, len(map)])
    while True:
        file = folder / "drawn.toml"
        file.write_text(drawn(map, rng))
        robot = pk.load(file)
        if pk.dexterity(robot, robot.home).conditioning > 0.03:
            return robot, rng


def commands(robot: pk.Robot, rng: np.random.Generator, count: int) -> np.ndarray:
    """From near home to far from it."""
    way = np.where(np.array(robot.actuator_units) == "mm", 500.0, 1.0)
    far = rng.choice([0.02, 0.1, 0.3, 1.0], (count, 1))
    return robot.inverse(robot.home) + far * way * rng.uniform(-1, 1, (count, robot.n_actuators))


def solved(robot: pk.Robot, rng: np.random.Generator, count: int) -> tuple[pk.Forward, np.ndarray]:
    q = commands(robot, rng, count)
    first = robot.forward(q)
    held = first.ok & ~(first.conditioning < 1e-2)
    return robot.forward(q[held]), q[held]


def off(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How far poses (N, 6) are apart, mm, turnings as arcs at 500 mm."""
    turned = np.abs(pk.screw.from_pose(one) - pk.screw.from_pose(other))
    return np.maximum(turned[:, :3, 3].max(axis=1), 500.0 * turned[:, :3, :3].max(axis=(1, 2)))


def missed(robot: pk.Robot, pose: np.ndarray, q: np.ndarray, passive: np.ndarray) -> float:
    """What the worst chain misses with these passive joints, mm: by a twin in NumPy."""
    twin = Twin(robot)
    theta = np.array([passive[robot.passive_names.index(name)] for name in twin.passive])
    return float(np.abs(twin.misses(posed(pose), q, theta)).max())


@each_map
@pytest.mark.parametrize("seed", SEEDS)
def test_passive_joints_of_a_solved_row_close_or_are_not_known(
    map: str, seed: int, tmp_path: Path
) -> None:
    robot, rng = machine(map, seed, tmp_path)
    found, q = solved(robot, rng, 40)
    known = np.isfinite(found.passive).all(axis=1)
    assert known.sum() > 0.9 * len(q)
    for pose, row, passive in zip(found.pose[known], q[known], found.passive[known], strict=True):
        assert missed(robot, pose, row, passive) < CLOSED


@each_map
@pytest.mark.parametrize("seed", SEEDS)
def test_forward_stays_at_a_pose_that_it_found_by_any_turn(
    map: str, seed: int, tmp_path: Path
) -> None:
    robot, rng = machine(map, seed, tmp_path)
    found, q = solved(robot, rng, 40)
    known = np.isfinite(found.passive).all(axis=1)
    turns = np.where(np.isfinite(robot.turns), robot.turns, 0.0)
    sent = (q + turns * rng.integers(-2, 3, q.shape))[known]
    again = robot.forward(sent, guess=found.pose[known])
    assert again.ok.all() and off(again.pose, found.pose[known]).max() < 1e-6
    home = robot.forward(sent)
    assert home.ok.all() and off(home.pose, found.pose[known]).max() < 1e-6


@each_map
@pytest.mark.parametrize("seed", SEEDS)
def test_twists_by_actuators_are_those_of_small_steps_or_nan(
    map: str, seed: int, tmp_path: Path
) -> None:
    robot, rng = machine(map, seed, tmp_path)
    found, q = solved(robot, rng, 12)
    twists = robot.actuator_twists(found.pose, q)
    scale = np.where(np.array(robot.actuator_units) == "mm", 500.0, 1.0)
    arms = np.array([500.0] * 3 + [1.0] * 3)
    for a in range(robot.n_actuators):
        step = STEP * scale[a] * np.eye(robot.n_actuators)[a] * found.conditioning[:, None]
        ends = [robot.forward(q + way * step, guess=found.pose) for way in (1, -1)]
        before, after = (pk.screw.from_pose(end.pose) for end in ends)
        turn = (before[:, :3, :3] @ after[:, :3, :3].swapaxes(1, 2))[:, [2, 0, 1], [1, 2, 0]]
        moved = np.hstack([turn, (before - after)[:, :3, 3]]) / 2
        by_steps = moved / step[:, [a]]
        known = np.isfinite(twists[:, :, a]).all(axis=1) & ends[0].ok & ends[1].ok
        assert known.sum() > 0.9 * len(q)
        apart = np.abs((twists[:, :, a] - by_steps) * arms)[known].max(axis=1)
        size = np.abs(by_steps * arms)[known].max(axis=1)
        assert (apart < 1e-3 * size + 1e-4).all()


@pytest.mark.parametrize("name", CHAINS)
def test_forward_of_builtin_chains_stays_at_a_pose_that_it_found(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, 60, share=0.9), match=True)
    found = robot.forward(q)
    ok = found.ok & (found.residual < 1e-9)
    again = robot.forward(q[ok], guess=found.pose[ok])
    assert ok.sum() > 50 or name in ("exechon", "tripteron", "2tpr2tps-chains")
    assert again.ok.all() and (off(again.pose, found.pose[ok]) < 1e-6).all()


@pytest.mark.parametrize("boom", BOOMS)
def test_passive_joints_close_where_a_chain_is_held_by_another(boom: str, tmp_path: Path) -> None:
    """Also the boom, which the third chain has not."""
    robot = loaded(leg_on_leg(boom), tmp_path)
    rng = np.random.default_rng(4)
    poses = robot.home + rng.uniform(-1, 1, (30, 6)) * [40, 40, 0, 0, 0, 0.2]
    q = robot.inverse(poses)
    found = robot.forward(q)
    assert found.ok.all()
    assert found.iterations.mean() < 7.0
    for pose, row, passive in zip(found.pose, q, found.passive, strict=True):
        assert missed(robot, pose, row, passive) < CLOSED


@pytest.mark.parametrize("name", ("6-rus", "3rrr-planar"))
def test_cranks_as_chains_come_from_home_to_the_side_of_the_closed_form(
    name: str, tmp_path: Path
) -> None:
    """Passive joints far from home are on the way there from it, not beyond a stretched leg."""
    robot = pk.load(name)
    chained = loaded(as_chains(robot), tmp_path)
    rng = np.random.default_rng(0)
    way = [75.0] * 3 + [0.22] * 3
    poses = robot.home + rng.uniform(-1, 1, (500, 6)) * way * np.isin(POSE, robot.coordinates)
    q = robot.inverse(poses)
    reached = np.isfinite(q).all(axis=1)
    assert reached.sum() > 200
    assert np.abs(chained.inverse(poses[reached]) - q[reached]).max() < 1e-7
