"""Eq. 1 to 13 of the 2TPR&2TPS paper, as printed, against what is derived and what is compiled.

Chen et al., "Research on pose error modeling and compensation of 2TPR & 2TPS parallel mechanism",
DOI 10.19650/j.cnki.cjsi.J2210079. Where the print is right the two are equal as formulas; where it
is wrong a test states the misprint and how much it is off.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from pkmcal.derive import tpr2tps as derived
from pkmcal.derive.rotation import rpy

import pkmcal as pk

Array = NDArray[np.float64]

a, b, c, d, e, f = derived.SIZE
x, y, z, alpha, beta, gamma = derived.POSE
n = derived.n
sa, ca, sb, cb = sp.sin(alpha), sp.cos(alpha), sp.sin(beta), sp.cos(beta)
sg, cg = sp.sin(gamma), sp.cos(gamma)

TABLE_1 = {a: 140.0, b: 80.0, c: 200.0, d: 292.4, e: 384.7, f: 278.5}
JOINTS_D = 294.2  # T1 and T2 of Table 2
LEVEL, TILTED = (0.0, 400.0, 0.0, 0.0), (25.0, 380.0, 0.12, -0.08)  # y z α β
LENGTHS = {
    (292.4, LEVEL): (454.352597109338, 454.352597109338, 401.921089892033, 401.921089892033),
    (294.2, LEVEL): (454.959517429848, 454.959517429848, 401.921089892033, 401.921089892033),
    (292.4, TILTED): (462.963307455999, 454.775423459028, 393.475313335163, 374.920120345963),
    (294.2, TILTED): (463.677487536096, 455.505465837323, 393.475313335163, 374.920120345963),
}
FORWARD_LENGTHS = (450.0, 452.0, 400.0, 405.0)  # d = 292.4
FORWARD_POSE = (
    6.00092002071403, -6.205857532186, 400.479518293888, -0.031217451630, 0.014983215564, 0.0,
)  # fmt: skip


# eq. 8 and the numerators of eq. 12 (times 2 L_i) as printed, for i = 1, 2 and for i = 3, 4
PRINTED_EQ_8 = (
    (e**2 + b**2 + 4 * a**2) / 4 + y**2 + z**2 + e * n * y + (z * sp.tan(beta) - d) ** 2
    - b * n * z * sa / cb - b * (e / 2 + n * y) * ca + d * b * n * sa * sb - 2 * a * d * cb,
    (f**2 + c**2) / 4 + y**2 + z**2 - f * n * y + (z * sp.tan(beta)) ** 2
    + c * n * z * sa / cb - c * (f / 2 - n * y) * ca,
)  # fmt: skip
PRINTED_EQ_12 = (
    (
        2 * y + n * e - b * n * ca,
        2 * z / cb**2 - (2 * d * sb + b * n * sa) / cb,
        b * ((e / 2 + n * y) * sa + d * n * sb * ca - n * z * ca / cb),
        2 * a * d * sb + d * b * n * sa * cb - n * z * (b * sa * sb + 2 * d * n) / cb**2
        + 2 * z**2 * sb / cb**3,
    ),
    (
        2 * y - n * f + c * n * ca,
        2 * z / cb**2 + c * n * sa / cb,
        c * ((f / 2 - n * y) * sa + n * z * ca / cb),
        z * (c * sa * sb / cb**2 + 2 * n * z * sb / cb**3),
    ),
)  # fmt: skip
LIMBS = list(zip(derived.PAIRS, derived.SIGNS, strict=True))


def vanishes(expr: sp.Expr) -> bool:
    """Whether an expression is zero for all sizes and poses: sines and cosines on their circle."""
    sines, cosines = sp.symbols("s0:3"), sp.symbols("c0:3")
    circles = {}
    for angle, s, c_ in zip((alpha, beta, gamma), sines, cosines, strict=True):
        circles.update({sp.sin(angle): s, sp.cos(angle): c_, sp.tan(angle): s / c_})
    numerator, _ = sp.fraction(sp.together(sp.sympify(expr).xreplace(circles)))
    for s, c_ in zip(sines, cosines, strict=True):
        numerator = sp.rem(sp.expand(numerator), s**2 + c_**2 - 1, s)
    return sp.expand(numerator) == 0


def printed_rotation() -> sp.Matrix:
    return sp.Matrix([
        [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
        [sg * cb, sg * sb * sa + cg * ca, sg * sb * sa - sa * cg],
        [-sb, sa * cb, ca * cb],
    ])  # fmt: skip


def printed_joints(i: int) -> tuple[sp.Matrix, sp.Matrix]:
    """T_i and S1, S2, R2, R1 of eq. 2, with T3 and T4 as Table 2 has them."""
    base = [(d, -e / 2, 0), (d, e / 2, 0), (0, f / 2, 0), (0, -f / 2, 0)]
    platform = [(a, -b / 2, 0), (a, b / 2, 0), (0, c / 2, 0), (0, -c / 2, 0)]
    return sp.Matrix(base[i]), sp.Matrix(platform[i])


def sizes(d_value: float) -> dict[sp.Symbol, float]:
    return {**TABLE_1, d: d_value}


def at(free: tuple[float, ...]) -> dict[sp.Symbol, float]:
    return dict(zip(derived.FREE, free, strict=True))


@cache
def in_doubles() -> tuple[Any, Any]:
    """Eq. 8 and eq. 12 as derived, of (size, free)."""
    squares = [derived.squared_length(pair).subs(n, sign) for pair, sign in LIMBS]
    rows = [derived.jacobian(pair).subs(n, sign) for pair, sign in LIMBS]
    arguments = [derived.SIZE, derived.FREE]
    return sp.lambdify(arguments, squares), sp.lambdify(arguments, sp.Matrix.vstack(*rows))


def leg_lengths(free: Any, d_value: float) -> Array:
    """Eq. 8 as derived."""
    return np.sqrt(in_doubles()[0](sizes(d_value).values(), free))


def jacobian(free: Any, d_value: float) -> Array:
    """Eq. 12 as derived."""
    return np.asarray(in_doubles()[1](sizes(d_value).values(), free))


def on_map(free: Any) -> Array:
    """Poses x y z α β γ on eq. 7."""
    y_, z_, alpha_, beta_ = np.moveaxis(np.asarray(free, float), -1, 0)
    return np.stack([z_ * np.tan(beta_), y_, z_, alpha_, beta_, np.zeros_like(y_)], axis=-1)


def machine(d_value: float) -> pk.Robot:
    return pk.load("2tpr2tps").replace({"base1.x": d_value, "base2.x": d_value})


def newton(start: Any, lengths: Any, d_value: float, sign_of_j44: int = 1) -> tuple[Array, int]:
    """Eq. 13 until the legs fit to 1e-9 mm; the free coordinates and how many steps it took."""
    free = np.array(start, float)
    for step in range(100):
        missing = np.asarray(lengths) - leg_lengths(free, d_value)
        if np.abs(missing).max() < 1e-9:
            return free, step
        by_free = jacobian(free, d_value)
        by_free[3, 3] *= sign_of_j44
        free = free + np.linalg.solve(by_free, missing)
    return free, 100


# --- Tables 1 and 2 ----------------------------------------------------------------------------


def test_tables_1_and_2_contradict_each_other_in_d_by_up_to_0_73_mm_of_leg() -> None:
    for pose in (LEVEL, TILTED):
        moved = leg_lengths(pose, JOINTS_D) - leg_lengths(pose, TABLE_1[d])
        assert np.all((moved[:2] > 0.54) & (moved[:2] < 0.7301))
        assert np.all(moved[2:] == 0)


def test_the_built_in_machine_has_the_joints_of_table_2() -> None:
    geometry = pk.load("2tpr2tps").geometry
    values = sizes(JOINTS_D)
    for i in range(4):
        for joint, point in zip(("base", "platform"), printed_joints(i), strict=True):
            found = [geometry[f"{joint}{i + 1}.{axis}"] for axis in "xyz"]
            assert found == [float(entry.subs(values)) for entry in point]


# --- eq. 1, 2, 3 -------------------------------------------------------------------------------


def test_eq_1_is_right_but_for_its_entry_2_3() -> None:
    right, printed = rpy(alpha, beta, gamma), printed_rotation()
    differing = [i for i in range(9) if not vanishes(right[i] - printed[i])]
    assert differing == [5]  # row 2, column 3
    assert vanishes(right[1, 2] - (sg * sb * ca - sa * cg))


def test_eq_1_as_printed_is_no_rotation_off_by_sin_gamma_sin_beta() -> None:
    printed = printed_rotation()
    off = printed[1, 2] - rpy(alpha, beta, gamma)[1, 2]
    assert vanishes(off - sg * sb * (sa - ca))
    assert vanishes(off.subs(gamma, 0))  # the machine itself never sees it
    size = float(off.subs({alpha: 0.12, beta: -0.08, gamma: 0.1}))
    assert size == pytest.approx(0.0070, abs=5e-5)
    assert not vanishes((printed * printed.T - sp.eye(3))[1, 1])


def test_eq_2_prints_t3_twice_and_t4_not_at_all() -> None:
    for i, (pair, sign) in enumerate(LIMBS):
        for right, found in zip(printed_joints(i), derived.joints(pair), strict=True):
            assert right == found.subs(n, sign)
    # the first of the two lines for T3, (d, e/2, 0), is T2: leg 3 would be 102 mm too long
    joint, anchor = (0, 100, 400), (292.4, 192.35, 0)
    off = math.dist(joint, anchor) - leg_lengths(LEVEL, TABLE_1[d])[2]
    assert off == pytest.approx(102.1, abs=0.05)


@pytest.mark.parametrize("limb", range(4))
def test_eq_3_is_what_the_derivation_starts_from(limb: int) -> None:
    T, joint = printed_joints(limb)
    u = rpy(alpha, beta, gamma) * joint + sp.Matrix([x, y, z])
    pair, sign = LIMBS[limb]
    reach, turned = derived.leg(pair)
    assert all(vanishes(entry) for entry in u - T - (reach + turned).subs(n, sign))


# --- eq. 4 to 7: the coupling ------------------------------------------------------------------


def test_eq_4_says_that_o1_s12_is_square_to_both_t4_o1_and_t3_o1() -> None:
    o1, s12 = sp.Matrix([x, y, z]), derived.midpoint()
    for closure, limb in zip(derived.right_angles(), (3, 2), strict=True):
        T, _ = printed_joints(limb)
        assert vanishes(closure - 2 * (T - o1).dot(s12 - o1))


def test_eq_5_and_6_have_sin_gamma_where_sin_beta_is_meant() -> None:
    printed = sp.Matrix([a * cg * cb + x, a * sg * cb + y, -a * sg + z])
    off = printed - derived.midpoint()
    assert vanishes(off[0])
    assert vanishes(off[1])
    assert vanishes(off[2] - a * (sb - sg))
    turn, lean = derived.decoupled()
    assert vanishes(turn - sg * cb)
    printed_lean = x * cg * cb + y * sg * cb - z * sg
    assert vanishes(printed_lean - lean - z * (sb - sg))
    # s12 would be 11.2 mm too low at γ = 0, β = -0.08 and the platform 30.5 mm off, at x = 0
    pose = {**TABLE_1, **at(TILTED), gamma: 0.0}
    assert float(off[2].subs(pose)) == pytest.approx(-11.188, abs=1e-3)
    assert sp.solve(printed_lean.subs(gamma, 0), x) == [0]
    assert float(derived.coupling()[x].subs(pose)) == pytest.approx(-30.465, abs=1e-3)


def test_eq_7_follows_from_eq_4() -> None:
    assert derived.coupling() == {gamma: 0, x: z * sp.tan(beta)}
    assert all(vanishes(line.subs(derived.coupling())) for line in derived.right_angles())


def test_eq_7_keeps_both_tpr_legs_square_to_the_revolute_axis() -> None:
    axis = rpy(alpha, beta, gamma).col(0)  # of R1 and R2: along o1 s12
    for limb in (2, 3):
        T, joint = printed_joints(limb)
        leg = rpy(alpha, beta, gamma) * joint + sp.Matrix([x, y, z]) - T
        assert vanishes(leg.dot(axis).subs(derived.coupling()))


# --- eq. 8 to 12 -------------------------------------------------------------------------------


@pytest.mark.parametrize("limb", range(4))
def test_eq_8_and_9_are_right_and_follow_from_eq_3_and_7(limb: int) -> None:
    pair, sign = LIMBS[limb]
    T, joint = printed_joints(limb)
    leg = (rpy(alpha, beta, gamma) * joint + sp.Matrix([x, y, z]) - T).subs(derived.coupling())
    printed = PRINTED_EQ_8[pair].subs(n, sign)
    assert vanishes(printed - leg.dot(leg))
    assert vanishes(printed - derived.squared_length(pair).subs(n, sign))


def test_eq_9_gives_limbs_1_and_3_the_sign_plus() -> None:
    assert derived.SIGNS == (1, -1, 1, -1)


@pytest.mark.parametrize("limb", range(4))
@pytest.mark.parametrize("column", range(4))
def test_eq_12_is_right_in_all_entries_but_j_44(limb: int, column: int) -> None:
    pair, sign = LIMBS[limb]
    printed = PRINTED_EQ_12[pair][column].subs(n, sign)
    by_differentiating = sp.diff(PRINTED_EQ_8[pair].subs(n, sign), derived.FREE[column])
    assert vanishes(by_differentiating - derived.slopes(pair)[column].subs(n, sign))
    assert vanishes(printed - by_differentiating) == ((limb, column) != (3, 3))


@pytest.mark.parametrize("pair", range(2))
def test_eq_12_is_the_derivative_of_the_length_itself(pair: int) -> None:
    length = sp.sqrt(PRINTED_EQ_8[pair])
    values = {**TABLE_1, **at(TILTED), n: -1}
    values = {symbol: sp.Rational(str(value)) for symbol, value in values.items()}
    for u, entry in zip(derived.FREE, derived.jacobian(pair), strict=True):
        assert abs(sp.N((sp.diff(length, u) - entry).subs(values), 30)) < 1e-25


def test_eq_12_prints_i_3_4_on_both_lines_of_j_i2_and_means_1_2_on_the_first() -> None:
    first, second = PRINTED_EQ_12[0][1], PRINTED_EQ_12[1][1]
    for sign in (1, -1):
        assert vanishes((first - derived.slopes(derived.FRONT)[1]).subs(n, sign))
        assert not vanishes((first - derived.slopes(derived.BACK)[1]).subs(n, sign))
        assert vanishes((second - derived.slopes(derived.BACK)[1]).subs(n, sign))


def test_eq_12_prints_j_44_with_the_opposite_sign_which_is_60_mm_per_rad_off() -> None:
    printed = PRINTED_EQ_12[derived.BACK][3].subs(n, -1)
    right = derived.slopes(derived.BACK)[3].subs(n, -1)
    assert vanishes(right - z * (-c * sa * sb / cb**2 + 2 * z * sb / cb**3))  # n by the other term
    assert vanishes(printed + right)
    length = leg_lengths(TILTED, JOINTS_D)[3]
    values = {**sizes(JOINTS_D), **at(TILTED)}
    off = float((printed - right).subs(values)) / (2 * length)
    assert off == pytest.approx(60.2, abs=0.05)
    # by lengths alone, without any derivation: leg 4 gets shorter as β grows
    moved = [leg_lengths((25, 380, 0.12, -0.08 + h), JOINTS_D)[3] for h in (-1e-4, 1e-4)]
    assert (moved[1] - moved[0]) / 2e-4 == pytest.approx(-off / 2, rel=1e-6)


# --- eq. 13 and the reference digits -----------------------------------------------------------


def test_eq_13_converges_as_newton_does() -> None:
    free, steps = newton(LEVEL, FORWARD_LENGTHS, TABLE_1[d])
    assert steps <= 4
    np.testing.assert_allclose(on_map(free), FORWARD_POSE, rtol=0, atol=1e-9)


def test_eq_13_with_j_44_as_printed_takes_ten_times_the_steps() -> None:
    target = (25.0, 380.0, 0.12, 0.3)
    lengths = leg_lengths(target, JOINTS_D)
    free, steps = newton(LEVEL, lengths, JOINTS_D)
    np.testing.assert_allclose(free, target, rtol=0, atol=1e-9)
    _, misled = newton(LEVEL, lengths, JOINTS_D, sign_of_j44=-1)
    assert misled >= 10 * steps


@pytest.mark.parametrize(("d_value", "free"), LENGTHS)
def test_reference_lengths(d_value: float, free: tuple[float, ...]) -> None:
    expected = LENGTHS[d_value, free]
    np.testing.assert_allclose(leg_lengths(free, d_value), expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(machine(d_value).inverse(on_map(free)), expected, rtol=0, atol=1e-9)


def test_reference_forward_solution() -> None:
    solved = machine(TABLE_1[d]).forward(FORWARD_LENGTHS)
    assert bool(solved.ok)
    np.testing.assert_allclose(solved.pose, FORWARD_POSE, rtol=0, atol=1e-9)


# --- the compiled closed forms -----------------------------------------------------------------

SPREAD = np.array([60.0, 60.0, 0.5, 0.5])


@pytest.mark.parametrize("d_value", [TABLE_1[d], JOINTS_D])
def test_compiled_eq_8_and_12_agree_with_the_general_core(d_value: float) -> None:
    from pkmcal import published

    free = np.array(LEVEL) + SPREAD * np.random.default_rng(12).uniform(-1, 1, (1000, 4))
    size = [sizes(d_value)[symbol] for symbol in derived.SIZE]
    robot = machine(d_value)
    lengths = published.leg_lengths(free, size=size)
    np.testing.assert_allclose(lengths, robot.inverse(on_map(free)), rtol=1e-12)
    by_free = published.jacobian(free, size=size)
    general = robot.jacobian(on_map(free))
    scale = np.abs(general).max(axis=(0, 1))  # of each column: mm/mm, mm/rad
    np.testing.assert_allclose(by_free / scale, general / scale, rtol=1e-12, atol=1e-12)


def test_compiled_eq_8_and_12_are_the_derived_ones() -> None:
    from pkmcal import published

    size = [TABLE_1[symbol] for symbol in derived.SIZE]
    for free in (LEVEL, TILTED):
        lengths = published.leg_lengths(free, size=size)
        by_free = published.jacobian(free, size=size)
        assert lengths.shape == (4,)
        assert by_free.shape == (4, 4)
        np.testing.assert_allclose(lengths, leg_lengths(free, TABLE_1[d]), rtol=1e-13)
        np.testing.assert_allclose(by_free, jacobian(free, TABLE_1[d]), rtol=1e-12, atol=1e-11)
