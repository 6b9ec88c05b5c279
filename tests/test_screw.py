"""Laws of screws: exponential, logarithm, their derivatives, the adjoint, and joint errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal import screw
from pkmcal.core import library, screws
from pkmcal.core.library import ISAS

ANGLES = [
    1e-300, 1e-200, 1e-162, 1e-154, 1e-100, 1e-30, 1e-16, 1e-9, 1e-8, 1e-6, 1e-4, 1e-3, 0.01, 0.1,
    0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.1, math.pi - 1e-3, math.pi - 1e-6, math.pi - 1e-9,
    math.pi - 1e-12,
]  # fmt: skip
BEYOND = [math.pi + 1e-9, 3.2, 5.0, 6.0, 2 * math.pi, 40.0, 100.0]
DIGITS = 60  # of the oracle
EPS = np.finfo(float).eps
numbers = st.floats(-1e3, 1e3)


def twists(angle: float, count: int = 8) -> np.ndarray:
    """Twists (count, 6) of this angle in directions of all kinds."""
    rng = np.random.default_rng(len(str(angle)))
    w = rng.normal(size=(count, 3))
    w[:3] = np.eye(3)
    w[3] = [1.0, -1.0, 0.0]
    w *= angle / np.linalg.norm(w, axis=1, keepdims=True)
    return np.hstack([w, rng.normal(size=(count, 3)) * 300.0])


# --- the oracle: series and inverses with 60 digits, no formula of the code's -------------------


def hat(w: mp.matrix) -> mp.matrix:
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def series(matrix: mp.matrix, first: int) -> mp.matrix:
    """Σ Mᵏ/(k + first)!: the exponential for 0, the mean of exponentials for 1."""
    total, power, k = mp.zeros(matrix.rows), mp.eye(matrix.rows), 0
    while k < 12 or mp.mnorm(power) > mp.mpf(10) ** -DIGITS * mp.factorial(k):
        total += power / mp.factorial(k + first)
        power, k = power * matrix, k + 1
    return total


def exact_exp(twist: np.ndarray) -> mp.matrix:
    w, v = mp.matrix(twist[:3].tolist()), mp.matrix(twist[3:].tolist())
    generator = mp.zeros(4)
    generator[:3, :3] = hat(w)
    generator[:3, 3] = v
    return series(generator, 0)


def exact_jacobian(twist: np.ndarray) -> mp.matrix:
    w, v = mp.matrix(twist[:3].tolist()), mp.matrix(twist[3:].tolist())
    ad = mp.zeros(6)
    ad[:3, :3] = ad[3:, 3:] = hat(w)
    ad[3:, :3] = hat(v)
    return series(ad, 1)


def off(found: np.ndarray, exact: mp.matrix) -> float:
    """Largest difference."""
    rows, columns = found.shape
    return float(
        max(abs(mp.mpf(found[i, j]) - exact[i, j]) for i in range(rows) for j in range(columns))
    )


def size(exact: mp.matrix) -> float:
    return float(max(abs(entry) for entry in exact))


@pytest.fixture(autouse=True)
def _digits() -> Iterator[None]:
    with mp.workdps(DIGITS + 50):  # the terms of the series reach 10^43 at 100 rad
        yield


# --- exponential and logarithm -------------------------------------------------------------------


@pytest.mark.parametrize("angle", [*ANGLES, *BEYOND])
def test_exp_has_full_precision(angle: float) -> None:
    for twist in twists(angle):
        exact, found = exact_exp(twist), screw.exp(twist)
        turn = exact[:3, :3] - mp.eye(3)  # what is left where the rotation is small
        away = found[:3, :3] - np.eye(3)
        np.fill_diagonal(away, 0.0)
        for i in range(3):  # 1 - R_ii is below what a double next to 1 can hold
            assert abs(found[i, i] - 1.0 - float(turn[i, i])) <= 8 * EPS * max(1.0, angle)
            turn[i, i] = 0
        assert off(away, turn) <= 4 * EPS * min(max(1.0, angle), 1.0 + angle) * min(1.0, angle)
        assert off(found[:3, 3:], exact[:3, 3]) <= 4 * EPS * max(1.0, angle) * size(
            mp.matrix(twist[3:].tolist())
        )


@pytest.mark.parametrize("angle", ANGLES)
def test_log_undoes_exp(angle: float) -> None:
    given = twists(angle)
    found = screw.log(screw.exp(given))
    assert np.abs(found[:, :3] / angle - given[:, :3] / angle).max() <= 1e-14
    assert np.abs(found[:, 3:] - given[:, 3:]).max() <= 1e-14 * np.abs(given[:, 3:]).max()


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_undoes_log(angle: float) -> None:
    motion = screw.exp(twists(angle))
    again = screw.exp(screw.log(motion))
    assert np.abs(again - motion)[:, :3, :3].max() <= 1e-14
    assert np.abs(again - motion)[:, :3, 3].max() <= 1e-14 * np.abs(motion[:, :3, 3]).max()


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 1, 0], [1, -2, 3]], ids=str)
def test_half_a_turn_has_a_logarithm(axis: list[float]) -> None:
    w = np.array(axis) / np.linalg.norm(axis)
    motion = np.eye(4)
    motion[:3, :3] = 2 * np.outer(w, w) - np.eye(3)
    motion[:3, 3] = [10.0, -20.0, 30.0]
    twist = screw.log(motion)
    assert np.linalg.norm(twist[:3]) == pytest.approx(math.pi, abs=1e-14)
    assert np.abs(np.cross(twist[:3], w)).max() <= 1e-14
    assert np.abs(screw.exp(twist) - motion).max() <= 1e-13


def test_a_translation_has_no_rotation() -> None:
    twist = [0, 0, 0, 3, -4, 5]
    assert screw.exp(twist)[:3, 3].tolist() == [3, -4, 5]
    assert screw.exp(twist)[:3, :3].tolist() == np.eye(3).tolist()
    assert screw.log(screw.exp(twist)).tolist() == twist


def test_rotation_matrices_are_rotations() -> None:
    R = screw.exp(np.concatenate([twists(angle) for angle in [*ANGLES, *BEYOND]]))[:, :3, :3]
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() <= 1e-13  # 100 rad: ω² is rounded
    assert (np.linalg.det(R) > 0).all()


@given(st.tuples(*[numbers] * 6), st.floats(-3, 3))
def test_the_angle_scales_the_twist(twist: tuple[float, ...], angle: float) -> None:
    w = np.array(twist) / 1e3
    assert (screw.exp(w, angle) == screw.exp(w * angle)).all()


def test_angles_and_twists_broadcast() -> None:
    given = twists(0.3, 4)
    angles = np.linspace(0, 1, 5)[:, None]
    motions = screw.exp(given, angles)
    assert motions.shape == (5, 4, 4, 4)
    assert (motions[3, 2] == screw.exp(given[2], angles[3, 0])).all()


@pytest.mark.parametrize("dtype", ["i1", "u1", "f2", "f4"])
def test_short_numbers_do_not_overflow_in_the_product(dtype: str) -> None:
    found = screw.exp(np.array([0, 0, 1, 0, 0, 120], dtype), np.array(100, dtype))
    assert (found == screw.exp([0.0, 0.0, 100.0, 0.0, 0.0, 12000.0])).all()


@pytest.mark.parametrize("angle", [math.inf, -math.inf, 1e300, math.nan])
def test_an_angle_that_is_too_large_makes_its_row_nan(angle: float) -> None:
    found = screw.exp([[0, 0, 1e300, 0, 0, 0], [0, 0, 1, 0, 0, 0]], [angle, 0.5])
    assert np.isnan(found[0]).all() and np.isfinite(found[1]).all()


def test_one_parameter_groups_add_up() -> None:
    given = twists(1.0)
    both = screw.exp(given, 0.4) @ screw.exp(given, 0.9)
    assert np.abs(both - screw.exp(given, 1.3)).max() <= 1e-12


# --- derivatives ----------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [*ANGLES, *BEYOND[:3]])
def test_derivatives_have_full_precision(angle: float) -> None:
    for twist in twists(angle, 5):
        exact = exact_jacobian(twist)
        scale = np.ones((6, 6))
        scale[3:, :3] = np.linalg.norm(twist[3:])  # the block in mm
        close = mp.matrix((1 / scale).tolist())
        for found, matrix in (
            (screw.exp_jacobian(twist), exact),
            (screw.log_jacobian(twist), mp.inverse(exact)),
        ):
            scaled = mp.matrix(6)
            for i in range(6):
                for j in range(6):
                    scaled[i, j] = matrix[i, j] * close[i, j]
            assert off(found / scale, scaled) <= 20 * EPS


def test_small_rotations_keep_the_digits_of_their_derivatives() -> None:
    for twist in twists(1e-300):
        change = screw.exp_jacobian(twist) - np.eye(6)
        assert change[4, 0] == pytest.approx(twist[5] / 2, rel=4 * EPS)  # [v]/2
        assert change[1, 0] == pytest.approx(twist[2] / 2, rel=4 * EPS)  # [ω]/2


# --- the adjoint ----------------------------------------------------------------------------------


def test_the_adjoint_moves_twists_as_motions_do() -> None:
    frames, given = screw.exp(twists(1.1)), twists(0.7)[::-1]
    moved = (screw.adjoint(frames) @ given[:, :, None])[:, :, 0]
    assert (
        np.abs(screw.exp(moved) - frames @ screw.exp(given) @ np.linalg.inv(frames)).max() < 1e-10
    )


def test_the_adjoint_of_a_product_is_the_product() -> None:
    a, b = screw.exp(twists(1.1)), screw.exp(twists(2.2))
    assert np.allclose(screw.adjoint(a @ b), screw.adjoint(a) @ screw.adjoint(b), rtol=0, atol=1e-9)


# --- poses ----------------------------------------------------------------------------------------


@given(
    st.tuples(*[numbers] * 3), st.floats(-math.pi, math.pi),
    st.floats(-math.pi / 2, math.pi / 2), st.floats(-math.pi, math.pi),
)  # fmt: skip
def test_poses_come_back(p: tuple[float, ...], a: float, b: float, c: float) -> None:
    motion = screw.from_pose([*p, a, b, c])
    assert np.abs(screw.from_pose(screw.to_pose(motion)) - motion).max() <= 2e-15 * 1e3


@pytest.mark.parametrize("beta", [math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-9])
def test_poses_near_upright_keep_their_rotation(beta: float) -> None:
    motion = screw.from_pose([1.0, 2.0, 3.0, 0.7, beta, -1.1])
    assert np.abs(screw.from_pose(screw.to_pose(motion)) - motion).max() <= 1e-15


def test_poses_turn_about_x_then_y_then_z() -> None:
    angles = np.array([0.3, -0.4, 0.5])
    one_by_one = [screw.exp([*np.eye(3)[i], 0, 0, 0], angles[i]) for i in range(3)]
    together = screw.from_pose([0, 0, 0, *angles])
    assert np.abs(one_by_one[2] @ one_by_one[1] @ one_by_one[0] - together).max() <= 1e-15


# --- joint errors ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "errors, kind",
    [
        ({}, "none"),
        ({"dz": -0.2}, "translation"),
        ({"dx": 0.1, "dy": -0.3}, "translation"),
        ({"dphi": 1e-4}, "rotation"),
        ({"dphi": 1e-4, "dtheta": -2e-4, "dpsi": 3e-4}, "rotation"),
        ({"dx": 0.1, "dpsi": 1e-4}, "rotation"),  # about an axis elsewhere
        ({"dx": 0.1, "dphi": 1e-4}, "helical"),
        ({"dx": 0.1, "dy": 0.2, "dz": 0.3, "dphi": 1e-4, "dtheta": 2e-4, "dpsi": 4e-4}, "helical"),
    ],
)
def test_joint_errors_are_of_their_kind(errors: dict[str, float], kind: str) -> None:
    found = screw.joint_error(**errors)
    assert found.kind == kind
    motion = screw.from_pose(
        [errors.get(k, 0.0) for k in ("dx", "dy", "dz", "dphi", "dtheta", "dpsi")]
    )
    assert np.abs(screw.exp(found.twist, found.magnitude) - motion).max() <= 1e-15
    part = found.twist[3:] if kind == "translation" else found.twist[:3]
    assert np.linalg.norm(part) == pytest.approx(float(kind != "none"), abs=1e-15)


def test_the_pitch_is_the_way_per_angle() -> None:
    assert screw.joint_error(dx=-0.1, dphi=1e-4).pitch == pytest.approx(-1000.0, rel=1e-12)
    assert screw.joint_error(dphi=1e-4).pitch == 0.0
    assert screw.joint_error(dx=1.0).pitch == math.inf


@pytest.mark.parametrize("angle", [1e-300, 1e-12, 1e-6])
def test_tiny_errors_keep_their_digits(angle: float) -> None:
    found = screw.joint_error(dpsi=angle)
    assert (found.magnitude, found.twist[2]) == (angle, 1.0)


def test_seen_from_outside_an_error_is_the_same_motion() -> None:
    error = screw.joint_error(0.1, -0.2, 0.3, 1e-3, 2e-3, -3e-3)
    frame = screw.from_pose([100.0, -200.0, 300.0, 0.3, -0.8, 1.9])
    outside = error.seen_from(frame)
    motion = screw.exp(error.twist, error.magnitude)
    assert (outside.kind, outside.magnitude) == (error.kind, error.magnitude)
    assert outside.pitch == pytest.approx(error.pitch, rel=1e-9)
    there = frame @ motion @ np.linalg.inv(frame)
    assert np.abs(screw.exp(outside.twist, outside.magnitude) - there).max() <= 1e-12


def test_errors_print_what_they_do() -> None:
    assert str(screw.joint_error()) == "no error"
    assert str(screw.joint_error(dx=3, dy=4)) == "translation by 5 mm along (0.6, 0.8, 0)"
    assert str(screw.joint_error(dphi=math.radians(2))).startswith("rotation of 2° about (1, 0, 0)")
    assert str(screw.joint_error(dx=1, dphi=0.5)).endswith("pitch 2 mm/rad")


# --- batches, bits, mistakes ----------------------------------------------------------------------


def test_every_isa_gives_the_same_bits() -> None:
    given = np.concatenate([twists(angle) for angle in [*ANGLES, *BEYOND]])
    motions = screws.exp(given)
    poses = screw.to_pose(motions.reshape(-1, 4, 4))
    for isa in range(len(ISAS)):
        if isa > library.lib.pkm_best_isa():
            pytest.skip(f"this processor has no {ISAS[isa]}")
        assert (screws.exp(given, isa) == motions).all()
        assert (screws.log(motions, isa) == screws.log(motions)).all()
        assert (screws.adjoint(motions, isa) == screws.adjoint(motions)).all()
        assert (screws.pose(motions, isa) == poses).all()
        for inverse in (False, True):
            found = screws.exp_jacobian(given, inverse, isa)
            assert np.array_equal(found, screws.exp_jacobian(given, inverse), equal_nan=True)


def test_a_row_does_not_depend_on_its_neighbours() -> None:
    given = np.concatenate([twists(angle) for angle in [*ANGLES, *BEYOND]])
    alone = np.array([screw.exp(twist) for twist in given])
    assert (screw.exp(given) == alone).all()
    assert (screw.log(alone[:40]) == [screw.log(motion) for motion in alone[:40]]).all()


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_number_that_is_not_finite_makes_its_row_nan(place: int, value: float) -> None:
    given = twists(0.5)[:3]
    given[1, place] = value
    motions = screw.exp(given)
    assert np.isnan(motions[1]).all()
    assert np.isfinite(motions[[0, 2]]).all()
    twist = screw.log(motions)
    assert np.isnan(twist[1]).all()
    assert np.isfinite(twist[[0, 2]]).all()


def test_angles_beyond_what_can_be_reduced_are_nan() -> None:
    assert np.isnan(screw.exp([0, 0, 1.1e5, 0, 0, 0])).all()
    assert np.isfinite(screw.exp([0, 0, 0.9e5, 0, 0, 0])).all()


def test_empty_batches_stay_empty() -> None:
    assert screw.exp(np.empty((0, 6))).shape == (0, 4, 4)
    assert screw.log(np.empty((0, 4, 4))).shape == (0, 6)
    assert screw.adjoint(np.empty((3, 0, 4, 4))).shape == (3, 0, 6, 6)


def _stretched(factor: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 0] = factor
    return matrix


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: screw.exp([1, 2, 3]), ValueError, r"twist must have shape \(..., 6\)"),
        (lambda: screw.exp(np.ones((2, 6)), [1, 2, 3]), ValueError, "angle has shape"),
        (lambda: screw.exp([1] * 6, "1"), TypeError, "angle must be an array of numbers"),
        (lambda: screw.exp(["a"] * 6), TypeError, "twist must be an array of numbers"),
        (lambda: screw.log(np.eye(3)), ValueError, r"motion must have shape \(..., 4, 4\)"),
        (lambda: screw.log(_stretched(1.01)), ValueError, "rigid motions, found another"),
        (lambda: screw.log(_stretched(-1.0)), ValueError, "a reflection"),
        (lambda: screw.adjoint([np.eye(4), 2 * np.eye(4)]), ValueError, "in row 1"),
        (lambda: screw.joint_error(dx=math.nan), ValueError, "dx must be finite"),
        (lambda: screw.joint_error(dx=10**400), ValueError, "dx must be finite"),
        (lambda: screw.joint_error(dpsi="1"), TypeError, "dpsi must be a number"),
        (
            lambda: screw.joint_error().seen_from(np.eye(4) * np.nan),
            ValueError,
            "frame must be fin",
        ),
        (lambda: screw.joint_error().seen_from([np.eye(4)] * 2), ValueError, "frame must have"),
    ],
)
def test_mistakes_are_named(call: Callable[[], object], error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_the_module_is_part_of_the_package() -> None:
    assert pk.screw is screw
