"""No rotation is special, however it is written and in whichever frame a machine is described."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

from .. import generated
from ..twin import rotation
from ..workspaces import WORKSPACE, poses

STEP = np.array([1e-4] * 3 + [1e-6] * 3)  # mm, rad
SPATIAL = ("six", "redundant", "tripod", "pairs")
SEEDS = range(3)


def other_triple(at: np.ndarray) -> np.ndarray:
    """Poses (..., 6) with α + π, π - β, γ + π, which is the same rotation."""
    other = at.copy()
    other[..., 3:] = other[..., 3:] * [1, -1, 1] + np.pi
    return other


def taken(robot: pk.Robot, at: np.ndarray) -> np.ndarray:
    """Poses on the machine's manifold, with β not near ±90°."""
    at = robot.complete(at)
    return at[np.abs(np.cos(at[:, 4])) > 0.2]


def drawn(name: str, seed: int) -> tuple[pk.Robot, np.ndarray]:
    rng = np.random.default_rng([seed, 17])
    if name in generated.KINDS:
        robot = generated.machine(name, rng)
        return robot, taken(robot, robot.frames.outward(generated.poses(name, robot, 8, rng)))
    robot = pk.load(name)
    return robot, taken(robot, poses(name, 8, seed))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", [*sorted(WORKSPACE), "spherical", *SPATIAL])
def test_derivatives_are_by_the_angles_that_a_pose_is_written_in(name: str, seed: int) -> None:
    robot, at = drawn(name, seed)
    free = [generated.COORDINATES.index(each) for each in robot.coordinates]
    if not {3, 4, 5} <= set(free):
        pytest.skip("its rotations are written in one way")
    number = robot.geometry.names[seed]
    change = 1e-4 if robot.geometry.units[seed] == "mm" else 1e-6
    for written in (at, other_triple(at)):
        q = robot.inverse(written)
        assert robot.violation(written).max() < 1e-7
        again = robot.complete(written)
        assert np.abs(pk.screw.from_pose(again) - pk.screw.from_pose(written)).max() < 1e-6
        if robot.frames.trivial:
            jacobian = robot.jacobian(written)
            for k, i in enumerate(free):
                step = np.eye(6)[i] * STEP[i]
                slope = robot.nearest_turns(robot.inverse(written + step), near=q)
                slope -= robot.nearest_turns(robot.inverse(written - step), near=q)
                slope /= 2 * STEP[i]
                assert np.abs(slope - jacobian[:, :, k]).max() < 1e-5 * np.abs(jacobian).max()
            if robot.machine.rows == robot.machine.m == robot.n_actuators == len(free):
                product = robot.forward_jacobian(written) @ jacobian
                assert np.abs(product - np.eye(len(free))).max() < 1e-6
        sides = [
            robot.replace({number: robot.geometry[number] + way}).forward(q, guess=written).pose
            for way in (-change, change)
        ]
        slope = np.angle(np.exp(1j * (sides[1] - sides[0]))) / (2 * change)
        slope[:, :3] = (sides[1] - sides[0])[:, :3] / (2 * change)
        slope[np.cos(written[:, 4]) < 0, 4] *= -1  # forward gives angles with |β| below 90°
        found = robot.error_jacobian(written, q)[:, :, seed]
        assert np.abs(slope - found).max() < 1e-5 * (1e-3 + np.abs(found).max())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", SPATIAL)
def test_a_machine_that_is_described_in_a_turned_frame_is_the_same_machine(
    kind: str, seed: int
) -> None:
    """Turned so that home has β = ±90° in the machine's own frame, and the base frame undoes it."""
    rng = np.random.default_rng([seed, generated.KINDS.index(kind), 18])
    robot = generated.machine(kind, rng)
    upright = np.array([*[0.0] * 3, rng.uniform(-3, 3), np.pi / 2, rng.uniform(-3, 3)])
    upright[4] *= rng.choice([-1, 1])
    turn = rotation(upright) @ rotation(robot.own_home).T
    other = generated.written_in(robot, turn, rng.uniform(-100, 100, 3))
    at = robot.complete(robot.frames.outward(generated.poses(kind, robot, 12, rng)))
    at = at[np.isfinite(at).all(axis=1)]
    q = robot.inverse(at)
    assert np.abs(other.inverse(at, near=q) - q).max(initial=0.0) < 1e-7
    assert other.moved == robot.moved
    dexterity = [pk.dexterity(each, at).conditioning for each in (robot, other)]
    assert np.abs(dexterity[0] - dexterity[1]).max(initial=0.0) < 1e-9
    at = at[(dexterity[0] > 0.02) & (np.abs(np.cos(at[:, 4])) > 0.1)]
    if not len(at):
        pytest.skip("no pose that this machine takes")
    q = robot.inverse(at)
    for name in ("offset1", "gain2", "offset3"):  # numbers that do not turn with the frame
        place = [each.geometry.names.index(name) for each in (robot, other)]
        for call in ("error_twists", "error_jacobian"):
            one = getattr(robot, call)(at, q)[..., place[0]]
            two = getattr(other, call)(at, q)[..., place[1]]
            assert np.abs(one - two).max() < 1e-5 * np.abs(one).max(), (call, name)
    twists = [each.actuator_twists(at, q) for each in (robot, other)]
    assert np.abs(twists[0] - twists[1]).max() < 1e-5 * np.abs(twists[0]).max()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["six", "redundant"])
def test_moves_in_coordinates_have_the_speeds_of_their_actuators_through_upright(
    kind: str, seed: int
) -> None:
    """From one side of β = ±90° to the other: speeds and accelerations are derivatives."""
    rng = np.random.default_rng([seed, 19])
    while True:
        robot = generated.machine(kind, rng)
        home = robot.home
        side = np.sign(home[4]) * np.array([0, 0, 0, 0, 0.06, 0])
        start, end = home - side, home + side + [5.0, -5.0, 5.0, 0.02, 0.0, 0.03]
        upright = robot.frames.trivial and abs(abs(home[4]) - np.pi / 2) < 1e-9
        if upright and np.isfinite(robot.inverse([start, end])).all():
            break
    move = pk.trajectory.move(robot, start, end, duration=1.0, space="coordinates")
    t, h = np.linspace(0.05, 0.95, 40), 1e-5
    before, at, after = (move.sample(t + way) for way in (-h, 0, h))
    for value, rate in (("actuators", "velocities"), ("velocities", "accelerations")):
        slope = (getattr(after, value) - getattr(before, value)) / (2 * h)
        found = getattr(at, rate)
        clear = np.abs(np.cos(at.pose[:, 4])) > 0.01  # where rates of angles are known to digits
        assert clear.sum() > 25
        worst = np.abs(slope - found)[clear].max()
        assert worst < 1e-4 * np.abs(found[clear]).max(), value
