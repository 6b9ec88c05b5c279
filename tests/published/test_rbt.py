"""The RBT-6T03P paper: eq. 1 to 6, Tables 1 and 2, and the listing's six curves, as printed.

Xiao, Zhu, "Coordinate transformation method of parallel robot based on position inverse solution
algorithm". Where the print is right it equals what is computed, to its last digit; where it is
wrong a test states the misprint and how much it is off.
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from pkmcal.derive.rotation import rpy

import pkmcal as pk

Array = NDArray[np.float64]

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "rbt-6t03p"
# Table 1: x = y of the upper and of the lower joints; the upper ones stand at 208.897 mm.
UPPER = (77.92, 102.08, -162.08, -137.92, -42.08, -17.92)
LOWER = (50.1, 129.9, 170.1, -110.1, -69.9, 9.9)
HEIGHT, ROD, UPPER_CIRCLE, LOWER_CIRCLE = 208.897, 223.0, 129.74, 65.5
STROKE = (158.8966, 258.8966)
LENGTH, LENGTH_UP, LENGTH_DOWN = 212.57, 163.61, 232.25  # as printed for all six legs
CHANGE_UP, CHANGE_DOWN = 48.96, 19.68
# The listing: coefficients of t³, t², 1.
CURVES = (
    (-4.48, 13.43, 38.74), (-4.98, 14.93, 42.90), (-0.98, -2.93, -2.81),
    (0.7, -2.10, -1.12), (-3.75, 11.24, 32.84), (-3.0, 9.0, 26.95),
)  # fmt: skip
FIVE = [0, 1, 3, 4, 5]  # the legs but the third


@pytest.fixture(scope="module")
def printed() -> pk.Robot:
    return pk.load("rbt-6t03p-printed")


@pytest.fixture(scope="module")
def robot() -> pk.Robot:
    return pk.load("rbt-6t03p")


def as_printed(value: float, printed: float, places: int = 2) -> bool:
    return round(float(value), places) == printed


def joints(robot: pk.Robot, side: str) -> Array:
    return np.array([[robot.geometry[f"{side}{i}.{axis}"] for axis in "xyz"] for i in range(1, 7)])


# --- eq. 1 and 2: the rotation -----------------------------------------------------------------


def test_eq_2_as_printed_is_the_rotation_but_for_two_entries() -> None:
    al, be, ga, la = sp.symbols("alpha beta gamma lambda", real=True)
    ca, sa, cb, sb = sp.cos(al), sp.sin(al), sp.cos(be), sp.sin(be)
    cg, sg = sp.cos(ga), sp.sin(ga)
    eq_2 = sp.Matrix([
        [cg * cb, cg * sb * sp.sin(la) - sg * ca, cg * sb * ca + sg * sa],
        [cg * cb, sg * sb * sa - cg * ca, sg * sb * ca - cg * sa],
        [-sb, cb * sa, cb * ca],
    ])  # fmt: skip
    off = (eq_2.subs(la, al) - rpy(al, be, ga)).applyfunc(sp.simplify)
    wrong = {(1, 0): cg * cb - sg * cb, (1, 1): -2 * cg * ca}  # sin γ cos β; + cos γ cos α
    for i in range(3):
        for j in range(3):
            assert sp.simplify(off[i, j] - wrong.get((i, j), 0)) == 0
    # and λ stands for α: no angle of that name is defined
    assert (eq_2 - eq_2.subs(la, al)).applyfunc(sp.simplify)[0, 1] != 0


def test_eq_2_as_printed_is_no_rotation() -> None:
    """At the home orientation d22 = -1 and d21 = 1: y is turned over and mixed with x."""
    at_home = np.array([[1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.linalg.det(at_home) == pytest.approx(-1.0)
    assert np.abs(at_home @ at_home.T - np.eye(3)).max() == pytest.approx(1.0)


def test_homogeneous_coordinates_carry_points_with_1_and_directions_with_0() -> None:
    """Fourth entry 1: R r + p, eq. 1. Fourth entry 0: R r alone."""
    pose = np.array([12.0, -7.0, 30.0, 0.2, -0.3, 0.4])
    T = pk.screw.from_pose(pose)
    R = np.array(rpy(*pose[3:]).evalf(), dtype=float)
    r = np.array([50.1, -3.0, 8.0])
    np.testing.assert_allclose(T @ [*r, 1.0], [*(R @ r + pose[:3]), 1.0], atol=1e-12)
    np.testing.assert_allclose(T @ [*r, 0.0], [*(R @ r), 0.0], atol=1e-12)
    np.testing.assert_allclose(pk.screw.to_pose(T), pose, atol=1e-14)


# --- eq. 4 to 6: the legs ------------------------------------------------------------------------


def test_eq_5_as_printed_drops_the_height_and_mistakes_a_joint(printed: pk.Robot) -> None:
    """Row 3 has d31 B_ix where d31 b_ix is right, and all rows leave out b_iz and B_iz."""
    pose = np.array([5.0, -3.0, -20.0, 0.05, 0.1, -0.2])
    d = pk.screw.from_pose(pose)[:3, :3]
    b, B = joints(printed, "platform"), joints(printed, "base")
    right = b @ d.T + pose[:3] - B
    eq_5 = b[:, :2] @ d[:, :2].T + pose[:3] - B
    eq_5[:, 2] = d[2, 0] * B[:, 0] + d[2, 1] * b[:, 1] + pose[2]
    np.testing.assert_allclose(eq_5[:, :2], right[:, :2], atol=1e-12)
    np.testing.assert_allclose(
        eq_5[:, 2] - right[:, 2], d[2, 0] * (B[:, 0] - b[:, 0]) + B[:, 2], atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.norm(right, axis=1), printed.inverse(pose), rtol=1e-14)


def test_six_decimals_of_eq_6_with_the_literal_numbers(printed: pk.Robot) -> None:
    """√(2 (X - x)² + 208.897²) leg by leg; all but leg 3 have X - x = ±27.82."""
    lengths = printed.inverse(printed.home)
    by_hand = [np.sqrt(2 * (X - x) ** 2 + HEIGHT**2) for X, x in zip(UPPER, LOWER, strict=True)]
    np.testing.assert_allclose(lengths, by_hand, rtol=1e-14)
    np.testing.assert_allclose(np.abs(np.subtract(UPPER, LOWER))[FIVE], 27.82, atol=1e-12)


# --- Table 1 -------------------------------------------------------------------------------------


def test_coordinates_of_table_1(printed: pk.Robot) -> None:
    for side, table in (("base", UPPER), ("platform", LOWER)):
        points = joints(printed, side)
        np.testing.assert_array_equal(points[:, 0], table)
        np.testing.assert_array_equal(points[:, 1], table)
    np.testing.assert_array_equal(joints(printed, "base")[:, 2], HEIGHT)
    np.testing.assert_array_equal(joints(printed, "platform")[:, 2], 0.0)


@pytest.mark.parametrize("leg", FIVE)
def test_length_of_table_1(printed: pk.Robot, leg: int) -> None:
    assert as_printed(printed.inverse(printed.home)[leg], LENGTH)


def test_length_of_leg_3_in_table_1_is_off_by_302_mm(printed: pk.Robot) -> None:
    found = printed.inverse(printed.home)[2]
    assert found == pytest.approx(514.1255, abs=5e-5)
    assert found - LENGTH == pytest.approx(301.56, abs=5e-3)


# --- Table 2 -------------------------------------------------------------------------------------


@pytest.mark.parametrize("leg", FIVE)
def test_table_2_at_minus_20(printed: pk.Robot, leg: int) -> None:
    lengths = printed.inverse([[0, 0, -20, 0, 0, 0], [0, 0, 0, 0, 0, 0]])[:, leg]
    assert as_printed(lengths[0], LENGTH_DOWN)
    assert as_printed(lengths[0] - lengths[1], CHANGE_DOWN)


@pytest.mark.parametrize("leg", FIVE)
def test_table_2_at_50_is_off_by_0_085_mm(printed: pk.Robot, leg: int) -> None:
    """163.695 and -48.874 are what eq. 6 gives; 163.61 and 48.96 are printed."""
    lengths = printed.inverse([[0, 0, 50, 0, 0, 0], [0, 0, 0, 0, 0, 0]])[:, leg]
    change = lengths[0] - lengths[1]
    assert lengths[0] == pytest.approx(163.6953, abs=1e-4)
    assert change == pytest.approx(-48.8744, abs=1e-4)
    assert lengths[0] - LENGTH_UP == pytest.approx(0.0853, abs=1e-4)
    assert abs(change) - CHANGE_UP == pytest.approx(-0.0856, abs=1e-4)
    assert abs(LENGTH - CHANGE_UP - LENGTH_UP) < 1e-9  # the print agrees with itself


def test_leg_3_of_table_2_is_off_too(printed: pk.Robot) -> None:
    lengths = printed.inverse([[0, 0, 50, 0, 0, 0], [0, 0, -20, 0, 0, 0]])[:, 2]
    by_hand = np.sqrt(2 * (170.1 + 162.08) ** 2 + (HEIGHT - np.array([50, -20])) ** 2)
    np.testing.assert_allclose(lengths, by_hand, rtol=1e-14)
    off = lengths - [LENGTH_UP, LENGTH_DOWN]
    np.testing.assert_allclose(off, [332.31, 290.32], atol=5e-3)


@pytest.mark.parametrize("height", [50.0, -20.0])
def test_joints_of_table_2(printed: pk.Robot, height: float) -> None:
    """The lower joints move with the platform, the upper ones stay."""
    T = pk.screw.from_pose([0, 0, height, 0, 0, 0])
    moved = np.column_stack([joints(printed, "platform"), np.ones(6)]) @ T.T
    np.testing.assert_array_equal(moved[:, :3], np.transpose([LOWER, LOWER, [height] * 6]))


# --- what the numbers mean -----------------------------------------------------------------------


def circle(radius: float, degrees: tuple[float, ...]) -> Array:
    angle = np.radians(degrees)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def test_read_as_polar_angles_the_rod_is_the_stated_223_mm() -> None:
    legs = circle(UPPER_CIRCLE, UPPER) - circle(LOWER_CIRCLE, LOWER)
    legs[:, 2] += HEIGHT
    np.testing.assert_allclose(np.linalg.norm(legs, axis=1), 223.00035, atol=2e-6)
    assert as_printed(np.linalg.norm(legs, axis=1)[0], ROD, 3)


def test_angles_between_upper_and_lower_joints_are_the_same_on_every_limb() -> None:
    between = np.mod(np.subtract(UPPER, LOWER) + 180, 360) - 180
    np.testing.assert_allclose(np.abs(between), 27.82, atol=1e-12)


def test_the_circles_are_given_by_radius_not_by_diameter() -> None:
    """With half of them, or one of them halved, no rod is near 223 mm at the printed height."""
    for upper, lower in ((0.5, 0.5), (0.5, 1.0), (1.0, 0.5)):
        legs = circle(upper * UPPER_CIRCLE, UPPER) - circle(lower * LOWER_CIRCLE, LOWER)
        legs[:, 2] += HEIGHT
        length = np.linalg.norm(legs, axis=1)
        assert np.ptp(length) < 1e-9 and abs(length[0] - ROD) > 1


def test_slides_stand_in_the_middle_of_the_stated_stroke(robot: pk.Robot) -> None:
    at_home = robot.inverse(robot.home)
    np.testing.assert_allclose(at_home, 208.8966245, atol=5e-8)
    assert as_printed(at_home[0], HEIGHT, 3)
    assert as_printed(at_home[0] - 50, STROKE[0], 4) and as_printed(at_home[0] + 50, STROKE[1], 4)
    assert all(limb.stroke == STROKE for limb in robot.model.limbs)


@pytest.mark.parametrize("branch", [-1, 1])
def test_slides_in_closed_form_on_both_branches(robot: pk.Robot, branch: int) -> None:
    """h = h_z ± √(223² - across²) over the platform joint; forward kinematics brings it back."""
    from dataclasses import replace

    limbs = tuple(replace(limb, branch=branch) for limb in robot.model.limbs)
    machine = pk.Robot(replace(robot.model, limbs=limbs))
    poses = np.random.default_rng(0).uniform(-1, 1, (200, 6)) * [20, 20, 20, 0.15, 0.15, 0.15]
    T = pk.screw.from_pose(poses)
    points = np.column_stack([joints(robot, "platform"), np.ones(6)])
    reach = (T @ points.T).transpose(0, 2, 1)[..., :3] - joints(robot, "base")
    root = np.sqrt(ROD**2 - reach[..., 0] ** 2 - reach[..., 1] ** 2)
    np.testing.assert_allclose(machine.inverse(poses), reach[..., 2] - branch * root, atol=1e-11)
    back = machine.forward(machine.inverse(poses))
    assert back.ok.all()
    np.testing.assert_allclose(back.pose, poses, atol=1e-9)


def test_lifting_the_platform_lifts_the_sliders_as_far(robot: pk.Robot) -> None:
    """Table 2's moves on the true machine: 50 up and 20 down, within the stroke."""
    moved = robot.inverse([[0, 0, 50, 0, 0, 0], [0, 0, -20, 0, 0, 0]]) - robot.inverse(robot.home)
    np.testing.assert_allclose(moved, [[50.0] * 6, [-20.0] * 6], atol=1e-11)


# --- the listing ---------------------------------------------------------------------------------


@pytest.mark.parametrize("curve", [0, 1, 3, 4, 5])
def test_curves_are_rest_to_rest_cubics(curve: int) -> None:
    """a t³ + b t² + c stops at t = 2 where b = -3 a; printed to two decimals it is within 0.03."""
    a, b, c = CURVES[curve]
    assert abs(b + 3 * a) <= 0.0151
    end = 8 * a + 4 * b + c
    law = pk.trajectory.cubic(c, end, 2.0)
    t = np.arange(0.0, 2.05, 0.1)
    position, _, _ = law.sample(t)
    np.testing.assert_allclose(position, a * t**3 + b * t**2 + c, atol=0.02)


def test_third_curve_has_the_sign_of_its_cubic_wrong() -> None:
    """As printed y3 ends at -22.37 at 23.5 mm/s; with +0.98 it stops, at -6.69."""
    a, b, c = CURVES[2]
    assert 8 * a + 4 * b + c == pytest.approx(-22.37)
    assert 12 * a + 4 * b == pytest.approx(-23.48)
    assert -8 * a + 4 * b + c == pytest.approx(-6.69)
    assert abs(-12 * a + 4 * b) <= 0.05
    t = np.arange(0.0, 2.05, 0.1)
    position, _, _ = pk.trajectory.cubic(c, -6.69, 2.0).sample(t)
    np.testing.assert_allclose(position, -a * t**3 + b * t**2 + c, atol=0.02)
    printed_curve = a * t**3 + b * t**2 + c
    assert np.abs(position - printed_curve).max() == pytest.approx(15.68, abs=0.02)


def test_the_cubic_jumps_in_acceleration_which_the_paper_set_out_to_avoid() -> None:
    """2 b mm/s² at the start, from rest; the quintic starts and ends at 0."""
    for a, b, c in CURVES:
        end = 4 * b / 3 + c  # with a = -b/3
        jump = pk.trajectory.cubic(c, end, 2.0).sample(0.0)[2]
        assert jump == pytest.approx(2 * b, abs=1e-9)
        smooth = pk.trajectory.quintic(c, end, 2.0).sample(np.array([0.0, 2.0]))
        np.testing.assert_allclose(smooth[1:], 0.0, atol=1e-12)
        assert a != 0


# --- the example ---------------------------------------------------------------------------------


def test_example_walks_through_the_eight_steps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runpy.run_path(str(FOLDER / "eight_steps.py"))["main"](tmp_path)
    said = capsys.readouterr().out
    for step in range(1, 9):
        assert len(re.findall(rf"^{step} ", said, re.MULTILINE)) >= 2
    rods = re.search(r"as polar angles: rods of \[(.*?)\] mm; stated are 223", said)
    assert rods and {f"{float(rod):.3f}" for rod in rods[1].split()} == {"223.000"}
    assert {path.name for path in tmp_path.iterdir()} == {"listing.png", "move.png", "space.png"}


def test_numbers_of_the_examples_readme(printed: pk.Robot, robot: pk.Robot) -> None:
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    poses = [[0, 0, height, 0, 0, 0] for height in (0.0, 50.0, -20.0)]
    legs, sliders = printed.inverse(poses), robot.inverse(poses)
    for k, start in enumerate(("4, pose 0", "7, (0, 0, 50)", "7, (0, 0, −20)")):
        row = next(line for line in text.splitlines() if line.startswith(f"| {start}"))
        assert f"| {legs[k, 0]:.4f}; leg 3: {legs[k, 2]:.4f} | {sliders[k, 0]:.4f} |" in row
