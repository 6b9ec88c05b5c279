"""Machines with more closures than coordinates: what moves is the pose that misses them least."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

from .. import generated
from ..driven import with_laws

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
