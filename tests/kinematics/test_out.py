"""Results written to arrays of the caller are those written to new ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot

from ..driven import with_laws
from .test_pulleys import limb, robot_of

ROWS = 40


def framed() -> pk.Robot:
    base, tool = np.array([50.0, -20, 300, 0, 0, 1.0]), np.array([0, 0, 120.0, 0.1, 0, 0])
    return Robot(replace(pk.load("hexapod").model, base_frame=base, tool_frame=tool))


def pulled(folder: Path) -> pk.Robot:
    """A point on three cables that run over pulleys."""
    anchors = [[1500.0, 0, 2000], [-800, 1200, 2100], [-700, -1300, 1900]]
    limbs = "".join(
        limb("pulley", a, [0.0, 0.0, 0.0], radius=60.0, swivel=[0.0, 0.0, 1.0]) for a in anchors
    )
    workspace = "\n[workspace]\nx = [-200, 200]\ny = [-200, 200]\nz = [300, 700]\n"
    return robot_of(
        folder / "three.toml", limbs, 'map = "translation"\nhome = { z = 500 }', workspace
    )


MACHINES = {
    "limbs": lambda: pk.load("hexapod"),
    "cranks": lambda: pk.load("rotary-delta"),
    "more rows than coordinates": lambda: pk.load("2tpr2tps-spatial"),
    "frames": framed,
    "chains": lambda: pk.load("five-bar"),
    "chains together": lambda: pk.load("exechon"),
    "laws": lambda: with_laws(pk.load("linear-delta"), np.random.default_rng(0)),
}


@pytest.mark.parametrize("name", [*MACHINES, "pulleys"])
def test_what_is_written_to_given_arrays_is_what_new_ones_would_hold(
    name: str, tmp_path: Path
) -> None:
    robot = pulled(tmp_path) if name == "pulleys" else MACHINES[name]()
    poses = pk.sample_poses(robot, 2 * ROWS, seed=3).reshape(2, ROWS, 6)
    first, second = (robot.inverse(each) for each in poses)
    q = np.empty(first.shape)
    assert np.shares_memory(robot.inverse(poses[1], out=q), q)
    np.testing.assert_array_equal(q, second)
    second[3] = np.nan
    found, wanted = robot.forward(first), robot.forward(second)
    arrays = found.pose, found.status, found.iterations, found.residual
    again = robot.forward(second, out=found)
    for held, now, new in zip(
        arrays,
        (again.pose, again.status, again.iterations, again.residual),
        (wanted.pose, wanted.status, wanted.iterations, wanted.residual),
        strict=True,
    ):
        assert np.shares_memory(held, now)
        np.testing.assert_array_equal(now, new)
    assert again.status[3] != 0
    np.testing.assert_array_equal(again.conditioning, wanted.conditioning)


def test_grids_and_matched_poses_are_written_too() -> None:
    robot = pk.load("2tpr2tps")
    poses = pk.sample_poses(robot, 12, seed=4).reshape(3, 4, 6)
    q = np.empty((3, 4, 4))
    assert robot.inverse(poses, match=True, out=q).shape == (3, 4, 4)
    np.testing.assert_array_equal(q, robot.inverse(poses, match=True))
    found = robot.forward(q)
    assert robot.forward(q, out=found).pose.shape == (3, 4, 6)


@pytest.mark.parametrize(
    "out",
    [
        np.empty((5, 6)),
        np.empty((4, 6), dtype=np.float32),
        np.empty((6, 4)).T,
        np.broadcast_to(np.empty(6), (4, 6)),
        [[0.0] * 6] * 4,
    ],
    ids=["shape", "single", "columns", "read only", "list"],
)
def test_an_array_that_does_not_fit_is_refused(out: np.ndarray) -> None:
    robot = pk.load("hexapod")
    with pytest.raises((ValueError, TypeError), match="out must be"):
        robot.inverse(pk.sample_poses(robot, 4, seed=5), out=out)


def test_what_is_still_read_is_not_written_over() -> None:
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 4, seed=6)
    with pytest.raises(ValueError, match="out must not be where the call's own input is"):
        robot.inverse(poses, out=poses)
    found = robot.forward(robot.inverse(poses))
    with pytest.raises(ValueError, match="out must not be where the call's own input is"):
        robot.forward(robot.inverse(poses), guess=found.pose, out=found)
    with pytest.raises(ValueError, match="out must be a result of as many rows as q"):
        robot.forward(robot.inverse(poses[:3]), out=found)
    with pytest.raises(TypeError, match="out must be"):
        robot.forward(robot.inverse(poses), out=poses)


def test_results_of_robots_with_other_frames_are_refused() -> None:
    plain, moved = pk.load("hexapod"), framed()
    q = plain.inverse(pk.sample_poses(plain, 4, seed=7))
    for robot, other in ((plain, moved), (moved, plain)):
        with pytest.raises(ValueError, match="out must be a result of a robot that has base or"):
            robot.forward(q, out=other.forward(q))


@pytest.mark.parametrize("name", ["pose", "status", "iterations", "residual"])
def test_results_that_are_read_only_are_refused(name: str) -> None:
    robot = framed()
    q = robot.inverse(pk.sample_poses(robot, 4, seed=8))
    found = robot.forward(q)
    getattr(found, name).flags.writeable = False
    with pytest.raises(ValueError, match=r"out must be .* can be written to"):
        robot.forward(q, out=found)


def test_arrays_with_a_mask_are_refused() -> None:
    robot = pk.load("hexapod")
    with pytest.raises(TypeError, match="out must be an array without a mask"):
        robot.inverse(robot.home, out=np.ma.masked_all(6))


@pytest.mark.parametrize("name", MACHINES)
def test_rows_of_the_inverse_lie_one_behind_the_other(name: str) -> None:
    """So that a row's address is what C needs; what a robot keeps cannot be written to."""
    robot = MACHINES[name]()
    assert robot.inverse(np.tile(robot.home, (5, 1))).flags.c_contiguous
    for kept in (robot.own_home, robot.slots):
        with pytest.raises(ValueError, match="read-only"):
            kept[...] = 0.0
