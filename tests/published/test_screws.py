"""Eq. 1 to 20, Tables 3 and 4 and the figures of the paper on joint structure errors, as printed.

Yang, Li, Zhang, Ma, Xiao, "An analysis method based on screw theory of the influence of joint
structure error on the precision of robots", DOI 10.3969/j.issn.1673-9833.2020.05.005. Where the
print is right the formulas are equal; where it is wrong a test states the misprint and how much it
is off.
"""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from pkmcal.derive import screws as derived
from pkmcal.derive.rotation import rot_x, rot_y, rot_z, skew

import pkmcal as pk
from pkmcal import screw

ARM = pk.load("3r")
TABLE_3 = np.tile([0.1, 0.1, 0.1, *np.radians([0.01, 0.01, 0.01])], (3, 1))
DISTINCT = np.array(
    [[0.13, -0.07, 0.22, 3e-4, -1e-4, 2e-4], [-0.31, 0.11, 0.05, -2e-4, 4e-4, 1e-4],
     [0.08, 0.27, -0.19, 1e-4, 2e-4, -5e-4]]
)  # fmt: skip
ENDS = np.radians([[0.0] * 3, [-15.0] * 3, [-30.0] * 3])  # of the path, and its middle
PATH = np.linspace(ENDS[0], ENDS[2], 61)
TIP_ERRORS = [
    (0.137778, 0.209148, 0.553090), (0.144354, 0.341002, 0.473784), (0.226745, 0.413024, 0.360550),
]  # fmt: skip
JOINT_2 = (0.109259, 520.199984, 0.290773)  # in the order of Table 4: y, z, x
JOINT_2_PRINTED = (0.1093, 520.1999, 0.2908)
JOINT_3 = (0.268632, 350.209216, 520.422168)
JOINT_3_PRINTED = (0.3297, 350.2092, 520.3611)  # in the order x, y, z of JOINT_3
ADAMS = 3e-4  # mm

a, b, g, theta = sp.symbols("a b g theta", real=True)
W = sp.Matrix(sp.symbols("w0:3", real=True))
V = sp.Matrix(sp.symbols("v0:3", real=True))


def functions() -> dict[str, derived.Function]:
    return {f.name: f for f in derived.functions()}


def derived_motion() -> tuple[sp.Matrix, sp.Matrix]:
    """The derived exponential of θ (ω, v) for a unit ω, in sin θ and cos θ."""
    s, c = sp.sin(theta), sp.cos(theta)
    values = [c, s / theta, (1 - c) / theta**2, (theta - s) / theta**3, 0, 0]
    places = {sp.Symbol(f"c[{k}]", real=True): value for k, value in enumerate(values)}
    for name, entries in (("w", W), ("v", V)):
        places |= {sp.Symbol(f"{name}[{i}]", real=True): theta * entries[i] for i in range(3)}
    made = functions()["screw_exp"]
    R, p = made.result("R").subs(places).reshape(3, 3), made.result("p").subs(places)
    return R, p


def is_zero(matrix: sp.Matrix) -> bool:
    """For every θ and every ω of length 1: ω2² gives way to 1 - ω0² - ω1²."""
    unit = W[2] ** 2 - (1 - W[0] ** 2 - W[1] ** 2)
    return all(
        sp.rem(sp.expand(sp.cancel(entry)), unit, W[2]) == 0
        for entry in matrix.applyfunc(sp.expand)
    )


def tip(joint_errors: np.ndarray | None, angles: np.ndarray = PATH) -> np.ndarray:
    return ARM.forward(angles, joint_errors)[..., :3, 3]


def joints(errors: np.ndarray) -> np.ndarray:
    """Where eq. 19 puts the joints' points at zero, (3, 3)."""
    place, points = np.eye(4), []
    for motion, point in zip(ARM.replace(errors).error_motions(), ARM.points, strict=True):
        place = place @ motion
        points.append(place[:3, :3] @ point + place[:3, 3])
    return np.array(points)


# --- eq. 1 to 3 -------------------------------------------------------------------------------


def test_eq_1_gives_the_unit_screws_of_the_joints() -> None:
    assert ARM.axes.tolist() == [[0, 0, 1], [1, 0, 0], [1, 0, 0]]  # Table 1
    assert ARM.points.tolist() == [[0, 0, 0], [0, 0, 520], [0, 350, 520]]  # Table 2
    assert (ARM.screws == np.hstack([ARM.axes, np.cross(ARM.points, ARM.axes)])).all()


def test_eq_1_with_a_pitch_moves_points_of_the_axis_along_it() -> None:
    r, s, h = np.array([10.0, -20.0, 30.0]), np.array([2.0, -1.0, 2.0]) / 3, 7.0
    moved = screw.exp([*s, *(np.cross(r, s) + h * s)], 1.5) @ [*r, 1.0]
    assert moved[:3] == pytest.approx(r + 1.5 * h * s, abs=1e-13)


def test_eq_2_is_the_derived_rotation() -> None:
    R, _ = derived_motion()
    printed = sp.eye(3) + skew(W) * sp.sin(theta) + skew(W) ** 2 * (1 - sp.cos(theta))
    assert is_zero(R - printed)


def test_eq_3_lacks_a_v_in_its_last_term() -> None:
    R, p = derived_motion()
    printed_last = theta * W * W.T
    assert printed_last.shape == (3, 3)  # beside a vector: cannot be added
    assert is_zero(p - ((sp.eye(3) - R) * W.cross(V) + printed_last * V))


# --- eq. 10 to 18 -----------------------------------------------------------------------------


def test_eq_10_shifts_along_z_alone_as_printed() -> None:
    printed = sum(np.array([0.0, 0.0, shift]) for shift in (0.1, 0.1, 0.1))
    meant = ARM.replace(TABLE_3).error_motions()[0][:3, 3]
    assert meant == pytest.approx([0.1, 0.1, 0.1])
    assert np.linalg.norm(printed - meant) == pytest.approx(0.245, abs=5e-4)  # √0.06 mm


def test_eq_10_turns_about_x_then_y_then_z() -> None:
    made = functions()["joint_error"].result("R").reshape(3, 3)
    entries = [sp.Symbol(f"e[{k}]", real=True) for k in (3, 4, 5)]
    wanted = rot_z(*_circle(entries[2])) * rot_y(*_circle(entries[1])) * rot_x(*_circle(entries[0]))
    assert (made - wanted).applyfunc(sp.expand) == sp.zeros(3, 3)


def _circle(angle: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    return sp.cos(angle), sp.sin(angle)


def test_eq_11_and_12_lose_half_the_digits_that_the_logarithm_keeps() -> None:
    R = screw.from_pose([0, 0, 0, 1e-4, 0, 0])[:3, :3]
    angle = math.acos((np.trace(R) - 1) / 2)  # eq. 11
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2 / np.sin(angle)
    assert 1e-10 < abs(angle / 1e-4 - 1) < 1e-7
    assert 1e-10 < abs(axis[0] - 1) < 1e-7  # eq. 12
    found = screw.joint_error(dphi=1e-4)
    assert abs(found.magnitude / 1e-4 - 1) <= 3e-16
    assert found.twist[0] == 1.0


def test_eq_11_to_13_of_table_3_against_50_digits() -> None:
    found = screw.joint_error(*TABLE_3[0])
    assert found.kind == "helical"
    with mp.workdps(50):
        motion = mp.eye(4)
        for i, axis in ((2, 5), (1, 4), (0, 3)):
            turn = mp.matrix(4)
            j, k = (i + 1) % 3, (i + 2) % 3
            turn[k, j], turn[j, k] = mp.mpf(TABLE_3[0, axis]), -mp.mpf(TABLE_3[0, axis])
            motion = motion * mp.expm(turn, "taylor")
        for i in range(3):
            motion[i, 3] = mp.mpf(TABLE_3[0, i])
        generator = mp.logm(motion)
        exact = [
            generator[2, 1],
            generator[0, 2],
            generator[1, 0],
            *(generator[i, 3] for i in range(3)),
        ]
        for value, wanted in zip(found.twist * found.magnitude, exact, strict=True):
            assert abs(value / wanted - 1) < 1e-15


@pytest.mark.parametrize(
    "errors, kind, equation",
    [
        ([0.1, -0.2, 0.3, 1e-4, 2e-4, 3e-4], "helical", 6),  # skew
        ([0, 0, 0, 1e-4, 2e-4, 3e-4], "rotation", 7),  # intersecting
        ([0.1, -0.2, 0, 0, 0, 0], "translation", 8),  # parallel
        ([0, 0, 0.3, 0, 0, 0], "translation", 9),  # along the axis
        ([0.1, -0.2, 0.3, 0, 0, 0], "translation", 9),  # neither along nor across
    ],
)
def test_errors_are_of_the_kinds_of_eq_6_to_9(
    errors: list[float], kind: str, equation: int
) -> None:
    found = screw.joint_error(*errors)
    assert found.kind == kind
    if kind == "translation":  # eq. 14 to 16
        assert found.magnitude == pytest.approx(np.linalg.norm(errors[:3]), rel=1e-15)
        assert found.twist == pytest.approx(
            [0, 0, 0, *np.divide(errors[:3], found.magnitude)], abs=1e-15
        )


def test_intersecting_axes_have_no_v_only_with_the_origin_where_they_intersect() -> None:
    error = screw.joint_error(dtheta=2e-4)
    assert error.twist[3:].tolist() == [0, 0, 0]
    joint_2 = screw.from_pose([*ARM.points[1], 0, 0, 0])
    outside = error.seen_from(joint_2)  # eq. 18
    assert outside.kind == "rotation"
    assert np.linalg.norm(outside.twist[3:]) == pytest.approx(520.0, rel=1e-12)


# --- eq. 19 and 20, the path, Table 4 -----------------------------------------------------------


def plain_tip(angles: np.ndarray, errors: np.ndarray, error_first: bool = True) -> np.ndarray:
    """Eq. 20 with plain matrices, or with the error behind its joint's own motion."""

    def about(axis: int, angle: float) -> np.ndarray:
        j, k = (axis + 1) % 3, (axis + 2) % 3
        matrix = np.eye(4)
        matrix[j, j] = matrix[k, k] = math.cos(angle)
        matrix[k, j] = math.sin(angle)
        matrix[j, k] = -matrix[k, j]
        return matrix

    def shift(by: np.ndarray) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, 3] = by
        return matrix

    total = np.eye(4)
    for axis, point, error, angle in zip((2, 0, 0), ARM.points, errors, angles, strict=True):
        E = shift(error[:3]) @ about(2, error[5]) @ about(1, error[4]) @ about(0, error[3])
        pair = [E, about(axis, angle)] if error_first else [about(axis, angle), E]
        total = total @ shift(point) @ pair[0] @ pair[1] @ shift(-point)
    return (total @ [0.0, 600.0, 520.0, 1.0])[:3]


@pytest.mark.parametrize("errors", [TABLE_3, DISTINCT], ids=["Table 3", "distinct"])
def test_eq_20_has_the_error_before_the_joint(errors: np.ndarray) -> None:
    plain = np.array([plain_tip(angles, errors) for angles in PATH])
    assert np.abs(tip(errors) - plain).max() < 1e-12
    behind = np.array([plain_tip(angles, errors, error_first=False) for angles in PATH])
    assert np.abs(tip(errors) - behind)[0].max() < 1e-12  # at zero there is no difference
    assert np.abs(tip(errors) - behind)[-1].max() > 0.05


def test_the_path_ends_where_it_is_printed() -> None:
    ends = tip(None, ENDS)
    assert ends[0].tolist() == [0, 600, 520]
    assert ends[2] == pytest.approx([214.054446, 370.753175, 128.493649], abs=5e-7)
    assert ends[2] == pytest.approx([214.05, 370.75, 128.49], abs=5e-3)  # as printed


def test_the_error_curves_of_fig_8() -> None:
    assert tip(TABLE_3, ENDS) - tip(None, ENDS) == pytest.approx(np.array(TIP_ERRORS), abs=5.1e-7)


def test_table_4_joint_2_is_right_in_the_order_y_z_x() -> None:
    found = joints(TABLE_3)[1][[1, 2, 0]]
    assert found == pytest.approx(JOINT_2, abs=5.1e-7)
    assert found == pytest.approx(JOINT_2_PRINTED, abs=1e-4)


def test_table_4_joint_3_is_off_by_350_mm_times_a_hundredth_of_a_degree() -> None:
    found = joints(TABLE_3)[2]
    assert found == pytest.approx(JOINT_3, abs=5.1e-7)
    off = np.array(JOINT_3_PRINTED) - found
    arc = 350.0 * math.radians(0.01)
    assert arc == pytest.approx(0.0611, abs=5e-5)
    assert off == pytest.approx([arc, 0, -arc], abs=1e-4)


def test_table_4_joint_3_leaves_out_the_rotation_errors_of_joints_2_and_3() -> None:
    without = TABLE_3.copy()
    without[1:, 3:] = 0.0
    assert joints(without)[2] == pytest.approx(JOINT_3_PRINTED, abs=5e-5)


def test_the_adams_model_of_table_4_cannot_agree_to_3e_4_mm() -> None:
    modelled = TABLE_3.copy()
    modelled[1, 3:] = 0.0  # joint 3 stands where Table 4 has it
    off = np.linalg.norm(tip(modelled) - tip(TABLE_3), axis=1)
    assert off.min() > 100 * ADAMS


# --- what the equal errors of Table 3 hide --------------------------------------------------------


def test_equal_errors_do_not_tell_the_axes_apart_and_distinct_ones_do() -> None:
    def swapped(errors: np.ndarray) -> np.ndarray:
        return errors[:, [2, 1, 0, 5, 4, 3]]  # x for z

    assert np.abs(tip(swapped(TABLE_3)) - tip(TABLE_3)).max() == 0
    assert np.abs(tip(swapped(DISTINCT)) - tip(DISTINCT)).max() > 0.1
    wrong_order = np.array([[*e[:3], *_angles_in_reverse(e[3:])] for e in TABLE_3])
    assert np.abs(tip(wrong_order) - tip(TABLE_3)).max() < ADAMS  # Rx Ry Rz would have passed


def _angles_in_reverse(angles: np.ndarray) -> np.ndarray:
    """The angles whose Rz Ry Rx is Rx Ry Rz of these."""
    motion = np.eye(4)
    for i in range(3):
        motion = motion @ screw.exp(np.eye(6)[i], angles[i])
    return screw.to_pose(motion)[3:]


@pytest.mark.parametrize(
    "kinds, rank", [(["revolute"] * 3, 14), (["prismatic", "revolute", "revolute"], 12)]
)
def test_six_errors_a_joint_are_more_than_can_be_told(kinds: list[str], rank: int) -> None:
    """What commutes with a joint may be the next one's error: four are left of a revolute joint,
    two of a prismatic one; the last joint of the chain keeps all six."""
    arm = pk.SerialArm(ARM.axes, ARM.points, ARM.home, kinds=kinds)
    rng = np.random.default_rng(0)
    angles = rng.uniform(-2, 2, (200, 3)) * [100 if kind == "prismatic" else 1 for kind in kinds]
    J = arm.error_jacobian(angles, frame="tip")
    J[:, :3] *= 300.0  # mm
    columns = J.reshape(-1, 18) / np.linalg.norm(J.reshape(-1, 18), axis=0)
    values = np.linalg.svd(columns, compute_uv=False)
    assert (values > 1e-10 * values[0]).sum() == rank
