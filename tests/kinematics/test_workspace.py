"""Conditioning, singularities and limits over the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.workspace import reach

from .. import twin, twin_rows
from ..workspaces import WORKSPACE, poses

MACHINES = sorted(WORKSPACE)
SQUARE = [name for name in MACHINES if name != "linear-delta-6"]

BALL = """
name = "ball"
units = {{ length = "mm", angle = "deg" }}
[pose]
map = "translation"
home = {{ x = 30.0, y = 30.0, z = 100.0 }}
[[limb]]
kind = "SPS"
base = [0, 0, 0]
platform = [0, 0, 0]
stroke = [{least}, {most}]
[[limb]]
kind = "SPS"
base = [200, 0, 0]
platform = [0, 0, 0]
[[limb]]
kind = "SPS"
base = [0, 200, 0]
platform = [0, 0, 0]
"""


def ball(tmp_path: Path, least: float, most: float) -> pk.Robot:
    file = tmp_path / "ball.toml"
    file.write_text(BALL.format(least=least, most=most), encoding="utf-8")
    return pk.load(file)


# --- how well poses are held -----------------------------------------------------------------


@pytest.mark.parametrize("name", MACHINES)
def test_conditioning_is_that_of_forward(name: str) -> None:
    robot = pk.load(name)
    at = robot.complete(poses(name, 5))
    found = pk.dexterity(robot, at)
    solved = robot.forward(robot.inverse(at), guess=at)
    np.testing.assert_allclose(found.conditioning, solved.conditioning, rtol=1e-6)
    assert (found.sigma_min > 0).all() and (found.conditioning <= 1).all()


@pytest.mark.parametrize("name", SQUARE)
def test_the_determinant_is_the_manipulability_with_a_sign(name: str) -> None:
    found = pk.dexterity(pk.load(name), poses(name, 5))
    np.testing.assert_allclose(np.abs(found.determinant), found.manipulability, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "coordinate", "low", "high"),
    [
        ("2tpr2tps", "alpha", 0.5, 1.55),
        ("rbt-6t03p", "gamma", 1.0, 2.2),
        ("hexapod", "gamma", 1, 2),
    ],
)
def test_the_machine_is_singular_where_the_determinant_changes_sign(
    name: str, coordinate: str, low: float, high: float
) -> None:
    """At the zero of the determinant the inverse of a second model loses its last rank."""
    robot = pk.load(name)
    column = ("x", "y", "z", "alpha", "beta", "gamma").index(coordinate)

    def pose(value: float) -> np.ndarray:
        at = robot.home.copy()
        at[column] = value
        at[1] += 30.0  # not in the plane of symmetry
        return at  # beta is 0, so that x = z tan(beta) holds

    ends = [low, high]
    signs = [np.sign(pk.dexterity(robot, pose(v)).determinant) for v in ends]
    assert signs[0] == -signs[1]
    for _ in range(60):
        middle = (ends[0] + ends[1]) / 2
        ends[int(np.sign(pk.dexterity(robot, pose(middle)).determinant) == signs[1])] = middle
    scale = np.array([1.0 if c < 3 else robot.length for c in twin.free_columns(robot.model)])
    sigma = np.linalg.svd(twin.pose_jacobian(robot.model, pose(ends[0])) / scale, compute_uv=False)
    assert sigma[-1] < 1e-7 * sigma[0]
    assert pk.dexterity(robot, pose(ends[0])).conditioning < 1e-9


def test_a_hexapod_is_singular_after_a_quarter_turn_about_the_vertical() -> None:
    """Fichter's: base and platform parallel, centred, similar hexagons of three symmetries."""
    robot = pk.load("hexapod")
    at = robot.home + np.array([0, 0, 0, 0, 0, np.pi / 2])
    assert pk.dexterity(robot, at).conditioning < 1e-6
    at[5] -= 0.1
    assert pk.dexterity(robot, at).conditioning > 1e-3


def side(robot: pk.Robot, pose: list[float]) -> float:
    return float(np.sign(pk.dexterity(robot, pose).determinant))


def test_published_strokes_do_not_keep_the_machines_from_their_singularities() -> None:
    """What docs/workspace.md says of the two machines."""
    robot = pk.load("2tpr2tps")
    for y, degrees in ((0.0, 84.2), (160.0, 63.8), (-160.0, -63.8)):
        before, after = ([0, y, 400, np.radians(degrees + d), 0, 0] for d in (-0.1, 0.1))
        assert side(robot, before) == -side(robot, after)
        assert robot.feasible([before, after]).ok.all()
    robot = pk.load("rbt-6t03p")
    for z in (-20.0, 20.0, 30.0, 45.0):
        before, after = ([0, 0, z, 0, 0, np.radians(106.93 + d)] for d in (-0.1, 0.1))
        assert side(robot, before) == -side(robot, after)
        assert robot.feasible([before, after]).ok.all() == (z >= 30.0)
    ends = (-130.0, 130.0, 52)
    grid = pk.workspace(robot, {"x": ends, "y": ends, "z": (-60.0, 60.0, 40)})
    assert grid.volume == pytest.approx(1.73e6, rel=0.01)


def test_conditioning_does_not_suffer_from_euler_angles() -> None:
    robot = pk.load("hexapod")
    at = robot.home + np.array([0, 0, 0, 0, np.radians(89.9), 0])
    near, further = (pk.dexterity(robot, at - [0, 0, 0, 0, b, 0]).conditioning for b in (0, 0.02))
    assert near == pytest.approx(further, rel=0.1)
    by_rates = robot.jacobian(at) / np.array([1, 1, 1, *[robot.length] * 3])
    sigma = np.linalg.svd(by_rates, compute_uv=False)
    assert sigma[-1] / sigma[0] < 0.01 * near


def test_transmission_is_the_cosine_between_rod_and_slider() -> None:
    robot = pk.load("rbt-6t03p")
    rods = robot.geometry["rod1"]
    joints = robot.geometry.slots
    far = np.hypot(*(joints[:, 3:5] - joints[:, 0:2]).T)  # sliders are vertical
    found = pk.dexterity(robot, robot.home).transmission
    assert found == pytest.approx(np.sqrt(1 - (far.max() / rods) ** 2), rel=1e-6)


def test_transmission_vanishes_at_the_edge_of_reach() -> None:
    robot = pk.load("linear-delta")
    joints = robot.geometry.slots
    inwards = joints[0, :2] - joints[0, 3:5]
    rod = robot.geometry["rod1"]
    edge = inwards - (rod - 1e-6) * inwards / np.hypot(*inwards)  # limb 1 lies flat
    found = pk.dexterity(robot, [*edge, 100.0, 0, 0, 0])
    out = pk.dexterity(robot, [*(edge - 2e-6 * inwards / np.hypot(*inwards)), 100.0, 0, 0, 0])
    assert found.transmission < 1e-3
    assert np.isnan(out.transmission)


def test_a_length_is_driven_along_itself() -> None:
    np.testing.assert_allclose(
        pk.dexterity(pk.load("2tpr2tps"), poses("2tpr2tps", 4)).transmission, 1.0, atol=1e-6
    )


def test_measures_have_the_leading_shape_of_the_poses() -> None:
    robot = pk.load("hexapod")
    assert pk.dexterity(robot, robot.home).conditioning.shape == ()
    found = pk.dexterity(robot, poses("hexapod", 6).reshape(2, 3, 6))
    assert found.determinant.shape == found.transmission.shape == (2, 3)
    assert pk.dexterity(robot, np.empty((0, 6))).conditioning.shape == (0,)


# --- where the machine goes ----------------------------------------------------------------------


def test_volume_is_that_of_a_half_ball(tmp_path: Path) -> None:
    """One limb's stroke ends the workspace; below the plane of the base joints is another mode."""
    robot = ball(tmp_path, 60.0, 160.0)
    ends = (-180.0, 180.0, 60)
    found = pk.workspace(robot, {"x": ends, "y": ends, "z": ends})
    exact = 2 / 3 * np.pi * (160.0**3 - 60.0**3)
    assert found.volume == pytest.approx(exact, rel=0.01)
    assert not found.inside[..., found.values[2] < 0].any()


def test_slices_of_a_ball_are_its_discs(tmp_path: Path) -> None:
    robot = ball(tmp_path, 60.0, 160.0)
    ends = (-180.0, 180.0, 180)
    for height in (30.0, 100.0):
        found = pk.workspace(robot, {"x": ends, "y": ends}, at=[0, 0, height, 0, 0, 0])
        area = np.pi * (160.0**2 - height**2) - np.pi * max(60.0**2 - height**2, 0.0)
        assert found.volume == pytest.approx(area, rel=0.01)


def test_inside_are_the_poses_that_keep_all_limits() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.workspace(robot, {"y": (-200, 200, 20), "z": (280, 500, 22)})
    q = robot.inverse(found.poses)
    within = ((q >= 300) & (q <= 520)).all(axis=-1)
    assert found.inside.any() and not found.inside.all()
    assert not (found.inside & ~within).any()
    np.testing.assert_array_equal(found.inside, robot.feasible(found.poses).ok)


def test_a_grid_is_of_poses_that_the_machine_can_take() -> None:
    robot = pk.load("3rps")
    found = pk.workspace(robot, {"alpha": (-0.3, 0.3, 5), "z": (1600, 1700, 4)})
    assert found.poses.shape == (5, 4, 6)
    assert robot.violation(found.poses).max() < 1e-6
    alphas = found.values[0][:, None].repeat(4, axis=1)
    np.testing.assert_allclose(found.poses[..., 3], alphas, atol=1e-12)
    np.testing.assert_allclose(found.values[1], [1612.5, 1637.5, 1662.5, 1687.5])


@pytest.mark.parametrize("name", MACHINES)
def test_poses_that_are_drawn_are_good(name: str) -> None:
    robot = pk.load(name)
    drawn = pk.sample_poses(robot, 12, seed=3)
    assert drawn.shape == (12, 6)
    assert robot.feasible(drawn).ok.all()
    assert robot.violation(drawn).max() < 1e-6
    least = pk.dexterity(robot, robot.home).conditioning
    assert (pk.dexterity(robot, drawn).conditioning > 0.1 * least).all()
    np.testing.assert_array_equal(drawn, pk.sample_poses(robot, 12, seed=3))
    assert (drawn != pk.sample_poses(robot, 12, seed=4)).any()


def test_reach_ends_where_a_limit_is_broken() -> None:
    robot = pk.load("2tpr2tps")
    low, high = reach(robot)["z"]
    step = 2 * (high - low)  # of the search: below
    for end, sign in ((low, -1), (high, 1)):
        assert robot.feasible([0, 0, end, 0, 0, 0]).ok
        assert not robot.feasible([0, 0, end + sign * min(step, 20.0), 0, 0, 0]).ok


def test_a_machine_that_is_singular_everywhere_has_no_good_poses() -> None:
    robot = pk.load("rbt-6t03p-printed")
    with pytest.raises(ValueError, match="as printed: home is singular"):
        pk.sample_poses(robot)


def test_the_report_says_how_much_is_inside() -> None:
    robot = pk.load("2tpr2tps")
    text = str(pk.workspace(robot, {"y": (-200, 200, 20), "z": (280, 500, 22)}))
    assert "20 x 22 poses" in text and "mm²" in text and "conditioning" in text
    assert "mm rad" in str(pk.workspace(robot, {"y": (-20, 20, 2), "alpha": (-0.1, 0.1, 2)}))


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"x": (0, 1, 4)}, "'x' is no coordinate that 2TPR&2TPS moves"),
        ({"ypsilon": (0, 1, 4)}, "no coordinate"),
        ({"y": (1, -1, 4)}, "y must run from low to high"),
        ({"y": (0, 1, 1)}, "y must have two cells"),
    ],
)
def test_wrong_axes_are_named(axes: dict[str, tuple[float, float, int]], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pk.workspace(pk.load("2tpr2tps"), axes)


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({}, "axes names no coordinate"),
        ([1, 2], "axes must map coordinates to numbers, found list"),
        ({"y": (0, 1, 2.5)}, "y must have a whole number of cells, found 2.5"),
        ({"y": (0, 1, np.nan)}, "y must have a whole number of cells, found nan"),
        ({"y": (0, 1)}, r"y must be \(low, high, cells\), found \(0, 1\)"),
        ({"y": "abc"}, r"y must be \(low, high, cells\), found 'abc'"),
        ({"y": (0, np.inf, 3)}, "y must run from low to high, found 0.0 to inf"),
    ],
)
def test_axes_that_span_no_grid_are_refused(axes: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        pk.workspace(pk.load("2tpr2tps"), axes)


@pytest.mark.parametrize(
    "odd", [{"count": -1}, {"count": 1.5}, {"share": 2.0}, {"share": np.nan}, {"seed": -1}]
)
def test_odd_draws_of_poses_name_the_argument(odd: Any) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(odd))} must be"):
        pk.sample_poses(pk.load("hexapod"), **odd)


def test_an_arm_is_no_parallel_machine_wherever_one_is_needed() -> None:
    arm: Any = pk.load("3r")
    pose = np.zeros((1, 6))
    calls = {
        "tolerance": lambda: pk.tolerance(arm, pose, 0.1),
        "sensitivity": lambda: pk.sensitivity(arm, pose),
        "allocate_tolerance": lambda: pk.allocate_tolerance(arm, pose, 0.1),
        "workspace": lambda: pk.workspace(arm, {"y": (0, 1, 3)}),
        "dexterity": lambda: pk.dexterity(arm, pose),
        "sample_poses": lambda: pk.sample_poses(arm),
        "compensate": lambda: pk.compensate(arm, pose, pose),
        "move": lambda: pk.trajectory.move(arm, pose[0], pose[0], duration=1.0),
    }
    for call in calls.values():
        with pytest.raises(TypeError, match="robot must be a Robot, a parallel machine, found Ser"):
            call()


def test_a_pose_of_another_assembly_mode_has_the_same_actuators() -> None:
    robot = pk.load("3rrr-planar")
    wanted = pk.sample_poses(robot, 200)
    q = robot.inverse(wanted)
    cold = robot.forward(q)
    assert cold.ok.all()
    other = np.abs(cold.pose - wanted).max(axis=1) > 1e-6
    assert 0 < other.sum() <= 20
    assert np.abs(twin_rows.closures(robot.model, cold.pose, q)).max() < 1e-9
    assert np.abs(robot.forward(q, guess=wanted).pose - wanted).max() < 1e-9
