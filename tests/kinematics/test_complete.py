"""Poses completed on the machine's manifold, matched inverse kinematics, and violation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE

from .. import twin, twin_rows
from ..round_trips import errors
from ..workspaces import WORKSPACE, follow_planes, poses

CONSTRAINED = ("2tpr2tps-spatial", "3rps", "3prs")
EIGHT_ROWS = Path(__file__).parents[2] / "examples" / "2tpr2tps-eight-rows.toml"
every = pytest.mark.parametrize("name", WORKSPACE)
constrained = pytest.mark.parametrize("name", CONSTRAINED)


def with_errors(robot: pk.Robot, seed: int) -> pk.Robot:
    noise = errors(robot, np.random.default_rng(seed))
    return robot.replace(robot.geometry.values + noise)


def places(*coordinates: str) -> list[int]:
    return [POSE.index(each) for each in coordinates]


def limbwise(robot: pk.Robot, at: np.ndarray) -> np.ndarray:
    """The largest closure (mm) at each pose, with every limb at its inverse."""
    q = np.array([twin.inverse(robot.model, pose) for pose in at])
    return np.abs(twin_rows.closures(robot.model, at, q)).max(axis=1)


# complete -----------------------------------------------------------------------------------------


@every
def test_a_completed_pose_keeps_what_is_matched_and_meets_the_closures(name: str) -> None:
    robot, at = with_errors(pk.load(name), 1), poses(name, 40, seed=30)
    found = robot.complete(at)
    matched = places(*(robot.model.match or robot.coordinates))
    np.testing.assert_allclose(found[:, matched], at[:, matched], rtol=0, atol=1e-9)
    assert limbwise(robot, found).max() < 1e-9


@every
def test_a_pose_that_the_machine_can_take_is_complete(name: str) -> None:
    robot, at = pk.load(name), poses(name, 40, seed=31)
    np.testing.assert_allclose(robot.complete(at), at, rtol=0, atol=1e-9)
    assert robot.violation(at).max() < 1e-9


def test_2tpr2tps_completes_to_eq_7() -> None:
    """x = z tan(beta) and gamma = 0, whatever x and gamma were; the spatial model agrees."""
    rng = np.random.default_rng(32)
    at = poses("2tpr2tps", 40, seed=32)
    at[:, [0, 5]] += rng.uniform(-1, 1, (40, 2)) * [20.0, 0.05]
    for name in ("2tpr2tps", "2tpr2tps-spatial"):
        found = pk.load(name).complete(at)
        assert np.array_equal(found[:, 1], at[:, 1]) or np.allclose(found[:, 1], at[:, 1])
        np.testing.assert_allclose(found[:, 0], at[:, 2] * np.tan(at[:, 4]), rtol=0, atol=1e-9)
        np.testing.assert_allclose(found[:, 5], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["3rps", "3prs"])
def test_limbs_in_planes_complete_to_the_drift_of_their_planes(name: str) -> None:
    at = poses(name, 40, seed=33)
    robot, wanted = pk.load(name), at.copy()
    wanted[:, [0, 1, 5]] = 0.0
    found = robot.complete(wanted)
    follow_planes(wanted, robot.geometry["platform1.x"])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
    assert np.abs(found[:, :2]).max() > 5.0  # mm: not next to nothing


def test_other_coordinates_can_be_matched() -> None:
    robot = with_errors(pk.load("2tpr2tps-spatial"), 2)
    at = poses("2tpr2tps-spatial", 20, seed=34)
    for match in (("x", "y", "z", "alpha"), ["alpha", "y", "x", "z"], ("y", "z", "alpha", "beta")):
        found = robot.complete(at, match)
        np.testing.assert_allclose(found[:, places(*match)], at[:, places(*match)], atol=1e-9)
        assert limbwise(robot, found).max() < 1e-9


def test_shared_actuators_leave_three_coordinates_to_match() -> None:
    robot = pk.load("linear-delta-6").replace({"rod2": 215.1, "rod5": 214.95})
    at = poses("linear-delta-6", 20, seed=35)
    found = robot.complete(at, match=("x", "y", "z"))
    np.testing.assert_allclose(found[:, :3], at[:, :3], rtol=0, atol=1e-9)
    assert np.degrees(np.abs(found[:, 3:]).max()) > 0.05  # the platform tilts
    q = robot.inverse(at, match=("x", "y", "z"))
    assert np.abs(twin_rows.closures(robot.model, found, q)).max() < 1e-9
    assert robot.violation(found).max() < 1e-9 < 1e-3 < robot.violation(at).min()
    np.testing.assert_allclose(robot.inverse(found), q, rtol=0, atol=1e-9)


def test_eight_rows_lead_to_the_matched_coordinates_too() -> None:
    """No pose meets all eight rows: the one that misses them least has to be the wanted one."""
    robot = with_errors(pk.load(EIGHT_ROWS), 3)
    at = poses("2tpr2tps-spatial", 20, seed=36)
    kept = places("y", "z", "alpha", "beta")
    found = robot.forward(robot.inverse(at, match=True)).pose
    np.testing.assert_allclose(found[:, kept], at[:, kept], rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.complete(at), found, rtol=0, atol=1e-9)


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,), (2, 0)])
@pytest.mark.parametrize("name", ["3rps", "2tpr2tps", "hexapod"])
def test_completed_poses_have_the_shape_of_what_came(name: str, shape: tuple[int, ...]) -> None:
    robot = pk.load(name)
    at = np.broadcast_to(robot.home, (*shape, 6))
    assert robot.complete(at).shape == (*shape, 6)
    assert robot.violation(at).shape == shape
    assert robot.inverse(at, match=True).shape == (*shape, robot.n_actuators)


def test_a_pose_that_no_machine_takes_is_nan_and_leaves_the_others() -> None:
    robot, at = pk.load("3rps"), poses("3rps", 6, seed=37)
    expected = robot.complete(at)
    at[1], at[3, 2], at[4, 4] = np.nan, 1e300, np.inf
    found, q = robot.complete(at), robot.inverse(at, match=True)
    assert np.isnan(found[[1, 3, 4]]).all() and np.isnan(q[[1, 3, 4]]).all()
    np.testing.assert_allclose(found[[0, 2, 5]], expected[[0, 2, 5]], rtol=0, atol=1e-9)
    delta = pk.load("linear-delta")
    too_far = np.array([[0.0, 0.0, 120.0, 0, 0, 0], [500.0, 0.0, 120.0, 0, 0, 0]])
    assert (
        np.isnan(delta.complete(too_far)[1]).all() and np.isfinite(delta.complete(too_far)[0]).all()
    )


@pytest.mark.parametrize("name", [*CONSTRAINED, "linear-delta-6"])
def test_a_pose_is_found_from_any_start_where_one_is_found_from_home(name: str) -> None:
    robot, rng = with_errors(pk.load(name), 3), np.random.default_rng(38)
    matched = places(*(robot.model.match or robot.coordinates))
    at = np.tile(robot.home, (400, 1)) + rng.uniform(-1, 1, (400, 6)) * [100, 100, 100, *[0.5] * 3]
    from_home = np.tile(robot.home, (400, 1))
    from_home[:, matched] = at[:, matched]
    expected, found = robot.complete(from_home), robot.complete(at)
    known = np.isfinite(expected).all(axis=1)
    assert known.sum() > 300
    assert np.isfinite(found[known]).all()
    np.testing.assert_allclose(found[known][:, matched], at[known][:, matched], rtol=0, atol=1e-6)
    assert limbwise(robot, found[known]).max() < 1e-8
    q = robot.inverse(at, match=True, near=robot.inverse(found))  # a row of its own for each
    assert np.isfinite(q[known]).all()


# match --------------------------------------------------------------------------------------------


@constrained
def test_matched_lengths_lead_where_they_should_and_naive_ones_miss(name: str) -> None:
    robot, at = with_errors(pk.load(name), 4), poses(name, 40, seed=38)
    kept = places(*robot.model.match)
    matched = robot.forward(robot.inverse(at, match=True)).pose
    naive = robot.forward(robot.inverse(at)).pose
    scale = np.where(np.array(kept) < 3, 1.0, robot.length)
    assert np.abs((matched - at)[:, kept] * scale).max() < 1e-9
    assert np.abs((naive - at)[:, kept] * scale).max() > 0.05
    by_name = robot.inverse(at, match=robot.model.match)
    assert np.array_equal(by_name, robot.inverse(at, match=True))


@pytest.mark.parametrize("name", ["hexapod", "rotary-delta", "rbt-6t03p", "3rrr-planar", "6-rus"])
def test_where_nothing_is_constrained_matching_changes_nothing(name: str) -> None:
    robot, at = with_errors(pk.load(name), 5), poses(name, 20, seed=39)
    np.testing.assert_allclose(robot.inverse(at, match=True), robot.inverse(at), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "match", "message"),
    [
        ("3rps", ("z", "alpha", "bta"), "match: 'bta' is no coordinate.*beta"),
        ("3rps", ("z", "alpha"), "match must name 3 coordinates here, found 2"),
        ("3rps", "z", "match must name 3 coordinates here, found 1"),
        ("3rps", ("z", "alpha", "beta", "x"), "match must name 3 coordinates here, found 4"),
        ("3rps", ("z", "z", "beta"), "match: a coordinate is named twice"),
        ("3rps", False, "match must be True or names of coordinates"),
        ("linear-delta", ("x", "y", "alpha"), "match: alpha is not free on this machine"),
        ("hexapod", ("x", "y", "z"), "match must name 6 coordinates here, found 3"),
        ("linear-delta-6", "xyz", "match: 'xyz' is no coordinate"),
        ("rbt-6t03p", ("x", "y", "z"), "match must name 6 coordinates here, found 3"),
    ],
)
def test_a_wrong_match_is_named(name: str, match: Any, message: str) -> None:
    robot = pk.load(name)
    with pytest.raises(ValueError, match=message):
        robot.complete(robot.home, match)
    with pytest.raises(ValueError, match=message):
        robot.inverse(robot.home, match)


# violation ----------------------------------------------------------------------------------------


@every
def test_violation_is_the_largest_closure_that_is_left(name: str) -> None:
    robot, rng = with_errors(pk.load(name), 6), np.random.default_rng(40)
    at = poses(name, 20, seed=40)
    at = at + rng.uniform(-1, 1, at.shape) * np.where(np.any(at != at[0], axis=0), 1e-3, 0.0)
    on_map = np.array([robot.forward(q).pose for q in robot.inverse(at)])
    assert robot.violation(on_map).max() < (1.0 if name == "linear-delta-6" else 1e-9)
    if name in CONSTRAINED:
        np.testing.assert_allclose(robot.violation(at), limbwise(robot, at), rtol=1e-6)
        assert robot.violation(at).min() > 1e-2


def test_violation_of_the_3rps_is_how_far_a_joint_leaves_its_plane() -> None:
    robot = pk.load("3rps")
    pose = robot.home + np.array([0.7, -0.3, 0.0, 0.0, 0.0, 0.0])
    normals = np.array([[0.0, 1.0], [-np.sqrt(0.75), -0.5], [np.sqrt(0.75), -0.5]])
    expected = np.abs(normals @ [0.7, -0.3]).max()
    assert robot.violation(pose) == pytest.approx(expected, rel=1e-12)


def test_violation_of_a_pose_out_of_reach_is_nan() -> None:
    assert np.isnan(pk.load("linear-delta").violation([1000.0, 0, 100, 0, 0, 0]))
