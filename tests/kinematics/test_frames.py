"""Base and tool frames: every call in the user's frames, against frames composed by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import wrapped
from pkmcal.core.library import POSE
from pkmcal.core.poses import compose, compose_rates, invert
from pkmcal.screw import to_pose

from .. import robots, twin
from ..workspaces import WORKSPACE, poses

BASE = np.array([120.0, -45.0, 300.0, 0.4, -0.7, 2.1])
TOOL = np.array([10.0, 25.0, -80.0, -0.3, 0.5, 1.1])
FRAMES = {"base": (BASE, None), "tool": (None, TOOL), "both": (BASE, TOOL)}
framed = pytest.mark.parametrize("frames", FRAMES.values(), ids=FRAMES)
every = pytest.mark.parametrize("name", WORKSPACE)
Frame = np.ndarray | None


def matrix(pose: np.ndarray) -> np.ndarray:
    """T (4, 4), by scipy's rotations."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", pose[[5, 4, 3]]).as_matrix()
    T[:3, 3] = pose[:3]
    return T


def pose_of(T: np.ndarray) -> np.ndarray:
    gamma, beta, alpha = Rotation.from_matrix(T[:3, :3]).as_euler("ZYX")
    return np.array([*T[:3, 3], alpha, beta, gamma])


def outward(frames: tuple[Frame, Frame], at: np.ndarray) -> np.ndarray:
    """B T C by hand, row by row."""
    B, C = (np.eye(4) if frame is None else matrix(frame) for frame in frames)
    return np.array([pose_of(B @ matrix(pose) @ C) for pose in at])


def with_frames(robot: pk.Robot, frames: tuple[Frame, Frame]) -> pk.Robot:
    return pk.Robot(replace(robot.model, base_frame=frames[0], tool_frame=frames[1]))


def same_poses(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """The same points and rotations: angles may be others that describe the same turn."""
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(matrix(one), matrix(other), rtol=0, atol=tolerance)


@pytest.mark.parametrize("beta", [90.0, -90.0])
def test_rotations_are_kept_near_every_beta(beta: float) -> None:
    """Where α and γ turn about the same axis, a pose still has the angles of its rotation."""
    rng = np.random.default_rng(90)
    for power in range(1, 19):
        goal = np.array([*rng.uniform(-300, 300, 3), *rng.uniform(-3, 3, 3)])
        goal[4] = np.radians(beta) - rng.choice([-1, 0, 1]) * 10.0**-power
        one = np.array([*rng.uniform(-300, 300, 3), *rng.uniform(-3, 3, 3)])
        other = to_pose(np.linalg.inv(matrix(one)) @ matrix(goal))
        for found, expected in (
            (compose(one, other[None])[0], matrix(one) @ matrix(other)),
            (invert(to_pose(np.linalg.inv(matrix(goal)))), matrix(goal)),
            (to_pose(matrix(goal)), matrix(goal)),
        ):
            np.testing.assert_allclose(twin.rotation(found), expected[:3, :3], rtol=0, atol=2e-15)


@framed
@pytest.mark.parametrize(
    "name",
    [
        "2tpr2tps",
        "2tpr2tps-spatial",
        "3rps",
        "3prs",
        "linear-delta-6",
        "3rrr-planar",
        "linear-delta",
    ],
)
def test_matched_coordinates_are_the_users(name: str, frames: tuple[Frame, Frame]) -> None:
    plain = pk.load(name)
    robot = with_frames(plain, frames)
    own = plain.complete(poses(name, 20, seed=66))
    taken = outward(frames, own)
    same_poses(robot.complete(taken), taken, 1e-9)
    matched = [POSE.index(each) for each in robot.moved]
    aim = taken + np.random.default_rng(67).uniform(-1, 1, taken.shape) * [
        5,
        5,
        5,
        0.02,
        0.02,
        0.02,
    ]
    found = robot.complete(aim)
    known = np.isfinite(found).all(axis=1)
    assert known.mean() > 0.9
    off = found - aim
    off[:, 3:] = wrapped(off[:, 3:])
    assert np.abs(off[known][:, matched]).max() < 1e-8
    assert robot.violation(found[known]).max() < 1e-8
    driven = robot.forward(robot.inverse(aim, match=True)[known], guess=found[known])
    same_poses(driven.pose, found[known], 1e-8)


def test_upright_planar_machines_move_along_the_axes_they_stand_in() -> None:
    upright = np.array([0.0, 0.0, 0.0, np.pi / 2, 0.0, 0.0])
    robot = with_frames(pk.load("3rrr-planar"), (upright, None))
    assert robot.moved == ("x", "z", "beta")
    with pytest.raises(ValueError, match="'y' is no coordinate"):
        pk.workspace(robot, {"x": (-1, 1, 2), "y": (-1, 1, 2)})


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 90.0])
def test_a_workspace_runs_along_the_users_axes(degrees: float) -> None:
    """Of a planar machine in a tilted plane it is the area's shadow on the plane of the axes."""
    base = np.array([0.0, 0.0, 0.0, np.radians(degrees), 0.0, 0.0])
    plain = pk.load("3rrr-planar")
    robot = with_frames(plain, (base, None))
    x, y, _ = robot.moved
    share = max(np.cos(base[3]), np.sin(base[3]) if y == "z" else 0.0)
    flat = pk.workspace(plain, {"x": (-150, 150, 30), "y": (-150, 150, 30)})
    found = pk.workspace(robot, {x: (-150, 150, 30), y: (-150 * share, 150 * share, 30)})
    reached = found.inside
    assert np.array_equal(reached, flat.inside) and reached.any() and not reached.all()
    axes = np.stack(np.meshgrid(*found.values, indexing="ij"), axis=-1)
    seen = found.poses[..., [POSE.index(x), POSE.index(y)]]
    np.testing.assert_allclose(seen[reached], axes[reached], rtol=0, atol=1e-6)
    assert robot.violation(found.poses[reached]).max() < 1e-6


@framed
@every
def test_inverse_takes_the_users_poses(name: str, frames: tuple[Frame, Frame]) -> None:
    plain, at = pk.load(name), poses(name, 20, seed=60)
    robot = with_frames(plain, frames)
    q = robot.inverse(outward(frames, at))
    np.testing.assert_allclose(q, plain.inverse(at), rtol=0, atol=1e-9)
    assert robot.violation(outward(frames, at)).max() < 1e-9
    drive = robot.feasible(outward(frames, at)).drive
    np.testing.assert_allclose(drive, plain.feasible(at).drive, rtol=0, atol=1e-9)


@framed
@every
def test_forward_gives_the_users_poses_from_the_users_guess(
    name: str, frames: tuple[Frame, Frame]
) -> None:
    plain, at = pk.load(name), poses(name, 20, seed=61)
    robot, q = with_frames(plain, frames), plain.inverse(at)
    wanted = outward(frames, at)
    same_poses(robot.home[None], outward(frames, plain.home[None]), 1e-10)
    for guess in (None, robot.home, wanted):
        found = robot.forward(q, guess)
        assert found.ok.all() and found.same_side.all()
        same_poses(found.pose, wanted, 1e-9)
    np.testing.assert_allclose(found.conditioning, plain.forward(q).conditioning, rtol=1e-9)
    bad = robot.forward(q * np.nan)
    assert np.isnan(bad.pose).all() and (bad.status == 4).all()


@framed
@every
def test_error_jacobian_is_that_of_the_users_pose(name: str, frames: tuple[Frame, Frame]) -> None:
    plain, at = pk.load(name), poses(name, 2, seed=62)
    robot, wanted = with_frames(plain, frames), outward(frames, at)
    q = plain.inverse(at)
    errors = robot.error_jacobian(wanted)
    np.testing.assert_allclose(robot.error_jacobian(wanted, q), errors, rtol=0, atol=1e-6)
    steps = {"mm": 1e-3, "rad": 1e-5, "1": 1e-5}
    rng, geometry = np.random.default_rng(63), plain.geometry
    step = rng.standard_normal(len(geometry)) * [steps[unit] for unit in geometry.units]
    ends = []
    for sign in (1.0, -1.0):
        changed = plain.replace(geometry.values + sign * step)
        ends.append(outward(frames, changed.forward(q, at).pose))
    moved = (ends[0] - ends[1]) / 2.0
    np.testing.assert_allclose(errors @ step, moved, rtol=1e-4, atol=1e-9)


@framed
@every
def test_jacobians_are_of_the_free_coordinates_in_the_machines_own_frame(
    name: str, frames: tuple[Frame, Frame]
) -> None:
    plain, at = pk.load(name), poses(name, 5, seed=64)
    robot, wanted = with_frames(plain, frames), outward(frames, at)
    np.testing.assert_allclose(robot.jacobian(wanted), plain.jacobian(at), rtol=1e-8, atol=1e-8)
    by_q = plain.forward_jacobian(at)
    np.testing.assert_allclose(robot.forward_jacobian(wanted), by_q, rtol=1e-8, atol=1e-8)


@framed
def test_frames_of_a_file_survive_replacing_and_saving(
    frames: tuple[Frame, Frame], tmp_path: Any
) -> None:
    names = ("base", "tool")
    sections = {
        name: dict(zip(POSE, frame.tolist(), strict=True))
        for name, frame in zip(names, frames, strict=True)
        if frame is not None
    }
    robot = robots.hexapod(frames=sections)
    pose = outward(frames, robots.hexapod().home[None])[0]
    q = robots.hexapod().inverse(robots.hexapod().home)
    robot.save(tmp_path / "framed.toml")
    for same in (robot, pk.load(tmp_path / "framed.toml"), robot.replace({"base1.x": 1.0})):
        expected = robots.hexapod().replace(same.geometry.values)
        expected_q = expected.inverse(robots.hexapod().home)
        np.testing.assert_allclose(same.inverse(pose), expected_q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.inverse(pose), q, rtol=0, atol=1e-9)
    moved = robot.home
    moved[0] = np.nan  # a copy: the robot's own home stays
    assert np.isfinite(robot.home).all()


# composing ----------------------------------------------------------------------------------------

RNG = np.random.default_rng(67)
SOME = RNG.uniform(-1, 1, (3, 50, 6)) * [300, 300, 300, np.pi, 1.5, np.pi]


def test_poses_compose_and_invert_as_matrices_do() -> None:
    a, b, _ = SOME
    for i, (one, other) in enumerate(zip(a, b, strict=True)):
        product = matrix(one) @ matrix(other)
        np.testing.assert_allclose(matrix(compose(a, b)[i]), product, atol=1e-11)
        np.testing.assert_allclose(matrix(compose(one, b)[i]), product, atol=1e-11)
        np.testing.assert_allclose(matrix(compose(a, other)[i]), product, atol=1e-11)
        np.testing.assert_allclose(matrix(invert(one)) @ matrix(one), np.eye(4), atol=1e-11)


def test_composing_is_associative_and_inverses_undo_it() -> None:
    a, b, c = SOME
    same_poses(compose(compose(a, b), c), compose(a, compose(b, c)), 1e-11)
    same_poses(compose(invert(a[0]), compose(a[0], b)), b, 1e-11)


def test_rates_of_a_composed_pose_are_its_differences() -> None:
    a, b, c = SOME[0, 0], SOME[1, :5], SOME[2, 0]
    whole = compose(compose(a, b), c)
    rates = compose_rates(a, b, c, whole)
    for i, pose in enumerate(b):
        for k, step in enumerate(1e-4 * np.eye(6)):
            ends = [pose_of(matrix(a) @ matrix(p) @ matrix(c)) for p in (pose + step, pose - step)]
            difference = ends[0] - ends[1]
            difference[3:] = (difference[3:] + np.pi) % (2 * np.pi) - np.pi
            np.testing.assert_allclose(rates[i][:, k], difference / 2e-4, rtol=1e-5, atol=1e-6)


def test_a_rotation_by_scipy_is_the_twins() -> None:
    for pose in SOME[0, :5]:
        np.testing.assert_allclose(matrix(pose)[:3, :3], twin.rotation(pose), atol=1e-14)


@every
def test_error_twists_are_differences_of_the_motion(name: str) -> None:
    """Of the user's poses, on a wall too, where beta is 90 degrees and angles have no rates."""
    wall = np.array([100.0, 0.0, 50.0, 0.0, np.pi / 2, 0.0])
    robot = with_frames(pk.load(name), (wall, TOOL))
    at = robot.forward(pk.load(name).inverse(poses(name, 5, seed=64))).pose
    q = robot.inverse(at)
    twists = robot.error_twists(at, q)
    for place in range(0, len(robot.geometry), 3):
        step = 1e-4 * (1.0 if robot.geometry.units[place] == "mm" else 1e-2)
        ends = []
        for sign in (1, -1):
            values = robot.geometry.values.copy()
            values[place] += sign * step
            ends.append(robot.replace(values).forward(q, guess=at).pose)
        for row, (ahead, back) in enumerate(zip(*ends, strict=True)):
            turn = matrix(ahead)[:3, :3] @ matrix(back)[:3, :3].T
            moved = np.array([turn[2, 1], turn[0, 2], turn[1, 0], *(ahead - back)[:3]])
            np.testing.assert_allclose(
                twists[row, :, place], moved / (2 * step), rtol=1e-4, atol=1e-4
            )
