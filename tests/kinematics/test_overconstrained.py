"""Machines with more closures than coordinates: what moves is the pose that misses them least."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests import generated, solved_again
from tests.calibration.test_redundant_chains import eight_legs, four_cranks, four_planes
from tests.chain_files import as_chains
from tests.driven import with_laws
from tests.kinematics.test_chains import loaded
from tests.robots import made, ring

SEEDS = range(3)


def redundant(seed: int, errors: float) -> tuple[pk.Robot, np.ndarray]:
    """A machine, half of them with drive laws, and poses that it takes."""
    rng = np.random.default_rng([seed, 23])
    while True:
        robot = generated.machine("redundant", rng, errors=errors)
        if seed % 2:
            robot = with_laws(robot, rng, ("quadratic", "spool", "harmonics", "backlash"))
        at = robot.complete(robot.frames.outward(generated.poses("redundant", robot, 12, rng)))
        at = at[np.isfinite(at).all(axis=1) & (np.abs(np.cos(at[:, 4])) > 0.3)]
        if len(at) > 3:
            return robot, at


@pytest.mark.parametrize("seed", SEEDS)
def test_twists_by_actuators_that_contradict_each_other_are_those_of_solving_again(
    seed: int,
) -> None:
    robot, at = redundant(seed, 0.0)
    rng = np.random.default_rng(seed)
    q = robot.inverse(at)
    unit = 0.6 / np.abs(robot.machine.slopes(robot.slots, q))  # of each limb, mm
    unit[:, [each == "rad" for each in robot.actuator_units]] *= 0.005
    q = q + unit * rng.uniform(-1, 1, q.shape)
    solved = robot.forward(q, guess=at)
    at, q, unit = solved.pose[solved.ok], q[solved.ok], unit[solved.ok]
    assert solved.residual[solved.ok].min() > 0.01
    twists = robot.actuator_twists(at, q)
    for a in range(robot.n_actuators):
        step = 5e-3 * unit[:, a : a + 1] * np.eye(robot.n_actuators)[a]
        before, after = (robot.forward(q + way * step, guess=at).pose for way in (-1, 1))
        slope = (after - before)[:, :3] / (2 * step[:, a : a + 1])
        assert np.abs(slope - twists[:, 3:, a]).max() < 1e-3 * np.abs(twists[:, 3:]).max()


@pytest.mark.parametrize("space", ["joint", "coordinates", "pose"])
@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_move_states_of_motion_are_derivatives_of_what_it_states_of_places(
    seed: int, space: str
) -> None:
    robot, at = redundant(seed, 0.5)
    move = pk.trajectory.move(robot, at[0], at[1], duration=1.0, space=space)
    t, h = np.linspace(0.02, 0.98, 25), 1e-3
    before, now, after = (move.sample(t + way) for way in (-h, 0, h))
    known = np.isfinite(now.pose).all(axis=1)
    assert known.sum() > 10
    for value, rate, digits in (
        ("actuators", "velocities", 1e-3),
        ("velocities", "accelerations", 1e-2),
        ("twist", "twist_rate", 1e-2),
    ):
        slope = (getattr(after, value) - getattr(before, value)) / (2 * h)
        found = getattr(now, rate)
        assert np.abs(slope - found)[known].max() < digits * np.abs(found[known]).max(), value
    slope = (after.pose - before.pose)[:, :3] / (2 * h)
    off = np.abs(slope - now.twist[:, 3:])[known]
    assert off.max() < 1e-3 * np.abs(now.twist[known]).max()


def eight_rows() -> pk.Robot:
    return pk.load(Path(__file__).parents[2] / "examples" / "2tpr2tps-eight-rows.toml")


def eight_cables() -> pk.Robot:
    """A body on four tackles, two pulleys and two cables, which turn it both ways."""
    limbs = []
    for i, a in enumerate((20.0, 70.0, 100.0, 160.0, 200.0, 250.0, 280.0, 340.0)):
        limb = {"kind": "cable", "base": [*ring(1500.0, a)[:2], 2500.0 * (i % 4 > 1)]}
        limb["platform"] = ring(500.0, a + (45.0 if i % 2 else -45.0), 200.0 * (i % 3 - 1))
        if i < 4:
            limb |= {"kind": "tackle", "over": [[*ring(1590.0, a + 2.0)[:2], limb["base"][2]]]}
            limb["parts"] = [1, 1 + i % 2]
        elif i < 6:
            up = 1.0 if limb["base"][2] == 0.0 else -1.0
            limb |= {"kind": "pulley", "radius": 40.0, "swivel": [0.0, 0.0, up]}
        limbs.append(limb)
    return made("spatial", {"z": 1200.0}, limbs)


OVER = (eight_rows, eight_legs, four_planes, four_cranks, eight_cables)


def contradicting(robot: pk.Robot) -> tuple[pk.Robot, np.ndarray, np.ndarray]:
    """The machine with errors, and poses and actuators at which its closures contradict."""
    rng = np.random.default_rng(0)
    sigma = {"mm": 0.3, "rad": 1e-3, "1": 1e-5}
    wrong = [sigma[unit] * rng.normal() for unit in robot.geometry.units]
    unit = np.where(np.array(robot.actuator_units) == "mm", 1.0, 5e-3)
    q = robot.inverse(robot.home) + unit * rng.normal(0, 0.4, (5, robot.n_actuators))
    robot = robot.replace(robot.geometry.values + wrong)
    found = robot.forward(q)
    assert found.ok.all() and found.residual.min() > 3e-3
    return robot, robot.own_rows(found.pose)[0], q


@pytest.mark.parametrize("made_of", OVER)
def test_the_pose_moves_as_solving_again_says(made_of: Callable[[], pk.Robot]) -> None:
    """With numbers and with actuators, also by what the closures miss times their curvature."""
    robot, at, q = contradicting(made_of())
    arcs = np.repeat([robot.length, 1.0], 3)[:, None]
    columns = robot.geometry.slot_index.astype(np.int32)
    found = robot.machine.error_jacobian(robot.slots, at, q, columns, twists=True)
    solved = solved_again.by_numbers(robot, at, q)
    assert np.abs((found - solved) * arcs).max() < 1e-9 * np.abs(solved * arcs).max()
    found = robot.machine.forward_jacobian(robot.slots, at, q, twists=True)
    solved = solved_again.by_actuators(robot, at, q)
    assert np.abs((found - solved) * arcs).max() < 1e-9 * np.abs(solved * arcs).max()


@pytest.mark.parametrize("made_of", [eight_legs, four_planes, four_cranks])
def test_redundant_chains_move_as_solving_again_says(
    made_of: Callable[[], pk.Robot], tmp_path: Path
) -> None:
    """In space and in the plane, with balls and with real joints."""
    robot, at, q = contradicting(loaded(as_chains(made_of()), tmp_path))
    arcs = np.repeat([robot.length, 1.0], 3)[:, None]
    columns = robot.geometry.slot_index.astype(np.int32)
    found = robot.machine.error_jacobian(robot.slots, at, q, columns, twists=True)
    solved = solved_again.by_numbers(robot, at, q)
    assert np.abs((found - solved) * arcs).max() < 1e-9 * np.abs(solved * arcs).max()


@pytest.mark.parametrize("made_of", [eight_rows, eight_cables, lambda: pk.load("exechon")])
def test_where_a_machine_does_not_close_nothing_is_said_of_how_it_moves(
    made_of: Callable[[], pk.Robot],
) -> None:
    robot, at, q = contradicting(made_of())
    machine = robot.machine.with_tolerance(1e-3)
    assert (machine.forward(robot.slots, q, at, None)[1] == 5).all()
    columns = robot.geometry.slot_index.astype(np.int32)
    assert np.isnan(machine.error_jacobian(robot.slots, at, q, columns)).all()
    assert np.isnan(machine.forward_jacobian(robot.slots, at, q)).all()
