"""Laws of serial arms: the product of exponentials with joint errors, its derivatives, its inverse.

Two multibody engines that know nothing of screws stand beside it.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import pkmcal as pk
from pkmcal import screw
from pkmcal.core.library import ISAS, lib
from pkmcal.core.screws import Arm

from ..multibody import ENGINES

STEP = 1e-6  # of central differences


def mixed(joints: int = 6, seed: int = 0, kinds: bool = True) -> pk.SerialArm:
    """An arm with axes in all directions, every third joint prismatic."""
    rng = np.random.default_rng(seed)
    home = np.concatenate([rng.normal(size=3) * 800, rng.uniform(-3, 3, 3)])
    words = ["prismatic" if kinds and i % 3 == 2 else "revolute" for i in range(joints)]
    return pk.SerialArm(
        rng.normal(size=(joints, 3)), rng.normal(size=(joints, 3)) * 500, home, kinds=words
    )


def errors_of(arm: pk.SerialArm, seed: int = 1, rows: tuple[int, ...] = ()) -> np.ndarray:
    """Distinct, signed errors of about 1 mm and 10 mrad."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(*rows, arm.n_joints, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]


def coordinates(arm: pk.SerialArm, count: int = 50, seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    scale = [3.0 if unit == "rad" else 200.0 for unit in arm.actuator_units]
    return rng.uniform(-1, 1, (count, arm.n_joints)) * scale


ARMS = {
    "3r": pk.load("3r"),
    **{"six joints": mixed(), "seven": mixed(7, 3), "70": mixed(70, 4), "one": mixed(1, 5)},
}
arms = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())


# --- forward kinematics -----------------------------------------------------------------------


@arms
def test_forward_is_the_product_of_exponentials(arm: pk.SerialArm) -> None:
    theta, errors = coordinates(arm), errors_of(arm)
    product = np.tile(np.eye(4), (len(theta), 1, 1))
    for i, unit in enumerate(arm.screws):
        point = screw.from_pose([*arm.points[i], 0, 0, 0])
        error = screw.joint_error(*errors[i]).seen_from(point)  # eq. 18
        product = product @ screw.exp(error.twist, error.magnitude) @ screw.exp(unit, theta[:, i])
    off = np.abs(product @ arm.home - arm.forward(theta, errors))
    assert off.max() < 2e-12 * arm.n_joints


def test_forward_agrees_with_50_digits() -> None:
    arm = mixed()
    theta, errors = coordinates(arm, 3), errors_of(arm)
    found = arm.forward(theta, errors)
    with mp.workdps(50):
        for row, tool in zip(theta, found, strict=True):
            exact = mp.eye(4)
            for i, unit in enumerate(arm.screws):
                exact = exact * _exact_error(errors[i], arm.points[i]) * _exact_exp(unit * row[i])
            exact = exact * mp.matrix(arm.home.tolist())
            for i in range(3):
                for j in range(4):
                    assert abs(tool[i, j] - exact[i, j]) < (3e-12 if j == 3 else 4e-15)


def _exact_exp(twist: np.ndarray) -> mp.matrix:
    x, y, z, *v = (mp.mpf(float(number)) for number in twist)
    return mp.expm(
        mp.matrix([[0, -z, y, v[0]], [z, 0, -x, v[1]], [-y, x, 0, v[2]], [0, 0, 0, 0]]), "taylor"
    )


def _exact_error(errors: np.ndarray, point: np.ndarray) -> mp.matrix:
    there, back = mp.eye(4), mp.eye(4)
    for i in range(3):
        there[i, 3], back[i, 3] = mp.mpf(point[i]) + mp.mpf(errors[i]), -mp.mpf(point[i])
    turns = [_exact_exp(np.eye(6)[k] * errors[3 + k]) for k in (2, 1, 0)]
    return there * turns[0] * turns[1] * turns[2] * back


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["3r", "six joints", "seven"])
def test_multibody_engines_agree(engine: str, name: str) -> None:
    arm = ARMS[name]
    theta, errors = coordinates(arm, 200), errors_of(arm)
    off = np.abs(ENGINES[engine](arm, errors)(theta) - arm.forward(theta, errors))
    assert off[:, :3, 3].max() < 3e-12 * max(1.0, np.abs(arm.forward(theta)).max() / 1120.0)
    assert off[:, :3, :3].max() < 1e-14


def test_a_prismatic_joint_slides_along_its_axis() -> None:
    arm = pk.SerialArm([[0, 3, 4]], [[1, 2, 3]], [5, 6, 7, 0, 0, 0], kinds="prismatic")
    assert arm.forward([10])[:3, 3].tolist() == [5, 12, 15]
    assert arm.screws.tolist() == [[0, 0, 0, 0, 0.6, 0.8]]


@arms
def test_errors_of_each_row_are_those_of_a_loop(arm: pk.SerialArm) -> None:
    theta, errors = coordinates(arm, 11), errors_of(arm, rows=(11,))
    alone = [arm.forward(row, own) for row, own in zip(theta, errors, strict=True)]
    assert (arm.forward(theta, errors) == alone).all()
    for find in (arm.jacobian, arm.error_jacobian):
        alone = [find(row, own, "tip") for row, own in zip(theta, errors, strict=True)]
        assert (find(theta, errors, "tip") == alone).all()


@arms
def test_corrected_moves_like_the_arm_with_its_errors(arm: pk.SerialArm) -> None:
    theta, erring = coordinates(arm), arm.replace(errors_of(arm))
    off = np.abs(erring.corrected().forward(theta) - erring.forward(theta))
    assert off.max() < 2e-12 * arm.n_joints
    assert not erring.corrected().joint_errors.any()


def test_errors_of_a_call_stand_in_for_the_arms_own() -> None:
    arm = mixed()
    erring = arm.replace(errors_of(arm))
    theta, other = coordinates(arm), errors_of(arm, seed=9)
    assert (erring.forward(theta) == arm.forward(theta, errors_of(arm))).all()
    assert (erring.forward(theta, other) == arm.forward(theta, other)).all()
    assert (erring.forward(theta, np.zeros((6, 6))) == arm.forward(theta)).all()
    assert (erring.screws == arm.screws).all()


# --- derivatives ------------------------------------------------------------------------------


def twist_between(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(ω, v) per step, seen in the base, from two tools 2 STEP apart."""
    return screw.log(high @ np.linalg.inv(low)) / (2 * STEP)


@arms
def test_the_space_jacobian_is_the_derivative(arm: pk.SerialArm) -> None:
    theta, errors = coordinates(arm, 5), errors_of(arm)
    J = arm.jacobian(theta, errors)
    scale = 1.0 + np.abs(J).max()
    for i in range(min(arm.n_joints, 10)):
        step = STEP * np.eye(arm.n_joints)[i]
        low, high = arm.forward(theta - step, errors), arm.forward(theta + step, errors)
        assert np.abs(twist_between(low, high) - J[:, :, i]).max() < 1e-6 * scale


@arms
def test_the_error_jacobian_is_the_derivative(arm: pk.SerialArm) -> None:
    theta, errors = coordinates(arm, 5), errors_of(arm) * [1, 1, 1, 30, 30, 30]
    J = arm.error_jacobian(theta, errors)
    scale = 1.0 + np.abs(J).max()
    assert J.shape == (5, 6, 6 * arm.n_joints)
    for k in range(min(6 * arm.n_joints, 42)):
        step = STEP * np.eye(6 * arm.n_joints)[k].reshape(-1, 6)
        low, high = arm.forward(theta, errors - step), arm.forward(theta, errors + step)
        assert np.abs(twist_between(low, high) - J[:, :, k]).max() < 1e-6 * scale


@pytest.mark.parametrize("name", ["jacobian", "error_jacobian"])
def test_frames_are_views_of_one_twist(name: str) -> None:
    arm = mixed()
    theta, errors = coordinates(arm), errors_of(arm)
    space, body, tip = (
        getattr(arm, name)(theta, errors, frame) for frame in ("space", "body", "tip")
    )
    tool = arm.forward(theta, errors)
    assert np.allclose(screw.adjoint(tool) @ body, space, rtol=0, atol=1e-9)
    assert np.allclose(tip[:, :3], space[:, :3], rtol=0, atol=1e-12)
    velocity = tool[:, :3, :3] @ body[:, 3:]
    assert np.allclose(tip[:, 3:], velocity, rtol=0, atol=1e-9)


def test_the_nominal_jacobian_starts_with_the_screws() -> None:
    arm = mixed()
    assert np.abs(arm.jacobian(np.zeros(6)) - arm.screws.T).max() == 0
    r, w = arm.points[0], arm.axes[0]
    assert arm.screws[0] == pytest.approx([*w, *np.cross(r, w)], rel=1e-12)


# --- inverse ------------------------------------------------------------------------------------


def test_inverse_comes_back_to_the_tool() -> None:
    arm = mixed()
    theta, errors = coordinates(arm, 300), errors_of(arm)
    target = arm.forward(theta, errors)
    rng = np.random.default_rng(5)
    near = theta + rng.uniform(-0.2, 0.2, theta.shape)
    found = arm.inverse(target, near, errors)
    assert found.ok.mean() > 0.98
    again = arm.forward(found.theta[found.ok], errors)
    assert np.abs(again - target[found.ok])[:, :3, 3].max() < 2e-9
    assert np.isnan(found.theta[~found.ok]).all()


def test_inverse_takes_errors_of_each_row() -> None:
    arm = mixed()
    theta, errors = coordinates(arm, 40), errors_of(arm, rows=(40,))
    target = arm.forward(theta, errors)
    found = arm.inverse(target, theta + 0.02, errors)
    assert found.ok.all()
    again = arm.forward(found.theta, errors)
    assert np.abs(again - target)[:, :3, 3].max() < 2e-9


def test_inverse_stays_within_half_a_turn_of_its_guess() -> None:
    arm = ARMS["six joints"]
    theta = coordinates(arm, 200)
    rng = np.random.default_rng(3)
    for guess in (np.zeros(6), rng.uniform(-20, 20, theta.shape)):
        found = arm.inverse(arm.forward(theta), guess)
        assert found.ok.mean() > 0.8
        turning = np.array(arm.kinds) == "revolute"
        away = (found.theta - guess)[found.ok][:, turning]
        assert np.abs(away).max() <= math.pi * (1 + 1e-15)
        off = arm.forward(found.theta[found.ok]) - arm.forward(theta[found.ok])
        assert np.abs(off)[:, :3, 3].max() < 2e-9


def test_inverse_of_the_position_alone_needs_no_orientation() -> None:
    arm = pk.load("3r")
    target = arm.forward(coordinates(arm))
    found = arm.inverse(target, guess=[0.1, -0.2, -0.3], parts="position")
    assert found.ok.all()
    assert np.abs(arm.forward(found.theta) - target)[:, :3, 3].max() < 2e-9
    assert str(found).startswith("50 rows: 50 ok\n")


def test_what_is_out_of_reach_is_said_and_nan() -> None:
    arm = pk.load("3r")
    target = np.tile(arm.home, (3, 1, 1))
    target[1, :3, 3] *= 3.0
    target[2] = np.nan
    found = arm.inverse(target, parts="position")
    assert found.status.tolist() == [0, 1, 4]
    assert np.isnan(found.theta[1:]).all()
    assert found.residual[1] > 1.0


# --- batches, bits ------------------------------------------------------------------------------


def test_every_isa_gives_the_same_bits() -> None:
    arm = mixed(7)
    theta, errors = coordinates(arm, 37), errors_of(arm)
    made = arm.core
    wanted = [arm.forward(theta, errors)]
    wanted += [arm.jacobian(theta, errors, f) for f in ("space", "body", "tip")]
    wanted += [arm.error_jacobian(theta, errors, f) for f in ("space", "body", "tip")]
    for isa in range(len(ISAS)):
        if isa > lib.pkm_best_isa():
            pytest.skip(f"this processor has no {ISAS[isa]}")
        other = Arm(*made.arrays, isa)
        links = other.links(errors)
        found = [other.forward(theta, links, 1)]
        found += [other.jacobian(theta, links, f) for f in range(3)]
        found += [other.error_jacobian(theta, links, f) for f in range(3)]
        assert all((a == b).all() for a, b in zip(found, wanted, strict=True))


def test_threads_give_the_same_bits() -> None:
    arm = mixed()
    theta, own = coordinates(arm, 25_000), errors_of(arm, rows=(25_000,))
    assert (arm.forward(theta, own, threads=3) == arm.forward(theta, own, threads=1)).all()


def test_a_row_that_is_not_finite_is_nan_and_alone() -> None:
    arm = mixed()
    theta = coordinates(arm, 20)
    theta[3, 0], theta[5, 2], theta[7, 4] = math.nan, math.inf, 1e6
    found = arm.forward(theta)
    assert np.isnan(found[[3, 5, 7]]).all()
    assert np.isfinite(np.delete(found, [3, 5, 7], axis=0)).all()


def test_any_leading_shape() -> None:
    arm = mixed()
    theta = coordinates(arm, 6).reshape(2, 3, 6)
    assert arm.forward(theta).shape == (2, 3, 4, 4)
    assert arm.jacobian(theta).shape == (2, 3, 6, 6)
    assert arm.error_jacobian(theta[0, 0]).shape == (6, 36)
    assert arm.forward(np.empty((0, 6))).shape == (0, 4, 4)
    assert arm.inverse(arm.forward(theta), theta).theta.shape == (2, 3, 6)


# --- files and conventions --------------------------------------------------------------------


@arms
def test_files_come_back_to_the_last_bit(arm: pk.SerialArm, tmp_path: Path) -> None:
    for made in (arm, arm.replace(errors_of(arm)), arm.replace(errors_of(arm)).corrected()):
        made.save(tmp_path / "arm.toml")
        again = pk.load(tmp_path / "arm.toml")
        assert isinstance(again, pk.SerialArm)
        assert (again.kinds, again.name) == (made.kinds, made.name)
        for name in ("axes", "points", "home", "joint_errors"):
            assert (getattr(again, name) == getattr(made, name)).all()


FILE = """
name = "an arm"
units = { length = "m", angle = "deg" }
[tool]
home = { x = 1.5, gamma = 90.0 }
[[joint]]
kind = "prismatic"
axis = [0, 0, 2]
point = [0.1, 0.0, 0.0]
error = { dz = 0.001, dpsi = 180.0 }
"""


def read(text: str, folder: Path) -> pk.SerialArm:
    (folder / "arm.toml").write_text(text, encoding="utf-8")
    return pk.load(folder / "arm.toml")


def test_files_are_in_the_units_they_state(tmp_path: Path) -> None:
    arm = read(FILE, tmp_path)
    assert arm.home[:3, 3].tolist() == [1500, 0, 0]
    assert arm.home[:3, 0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert (arm.axes.tolist(), arm.points.tolist()) == ([[0, 0, 1]], [[100, 0, 0]])
    assert arm.joint_errors.tolist() == [[0, 0, 1, 0, 0, math.pi]]


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("axis =", "axes =", r"\[\[joint\]\] 1: unknown key 'axes'; did you mean 'axis'"),
        ("axis = [0, 0, 2]", "axis = [0, 0, 0]", "axis: must be a direction"),
        ("[0.1, 0.0, 0.0]", "[0.1, 0.0]", "point: must be three coordinates"),
        ('"prismatic"', '"prismatc"', "kind: 'prismatc' is no kind of joint; did you mean"),
        ("dpsi", "dpsy", "unknown key 'dpsy'; did you mean 'dpsi'"),
        ("dpsi = 180.0", "dpsi = 1e9", "arm.toml: .* joint_errors are too large"),
        ("gamma", "gama", "unknown key 'gama'; did you mean 'gamma'"),
        ("{ x = 1.5, gamma = 90.0 }", "[[1, 0, 0, 1]]", "home: must be a pose, or three rows"),
        (
            "{ x = 1.5, gamma = 90.0 }",
            "[[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 2, 0]]",
            "home: must be rigid motions",
        ),
        ("[tool]", "[tools]", "unknown key 'tools' of a serial arm; did you mean 'tool'"),
    ],
)
def test_mistakes_in_files_are_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in FILE
    with pytest.raises(ValueError, match=message) as raised:
        read(FILE.replace(old, new), tmp_path)
    assert str(raised.value).startswith(str(tmp_path / "arm.toml"))


def test_dh_numbers_give_the_chain_of_their_transforms() -> None:
    rng = np.random.default_rng(4)
    a, d = rng.normal(size=(2, 5)) * 300
    alpha, offset = rng.uniform(-3, 3, (2, 5))
    kinds = ["revolute", "revolute", "prismatic", "revolute", "prismatic"]
    theta = rng.uniform(-2, 2, 5)
    tool = screw.from_pose([1, 2, 3, 0.1, 0.2, 0.3])
    for convention in ("standard", "modified"):
        arm = pk.SerialArm.from_dh(
            a, alpha, d, offset, convention=convention, kinds=kinds, tool=tool
        )
        total = np.eye(4)
        for i in range(5):
            slides = kinds[i] == "prismatic"
            angle, way = offset[i] + theta[i] * (not slides), d[i] + theta[i] * slides
            total = total @ _dh(a[i], alpha[i], way, angle, convention)
        assert np.abs(arm.forward(theta) - total @ tool).max() < 1e-11


def _dh(a: float, alpha: float, d: float, theta: float, convention: str) -> np.ndarray:
    """The matrices as the textbooks print them."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    if convention == "standard":
        rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d]]
    else:
        rows = [[c, -s, 0, a], [s * ca, c * ca, -sa, -sa * d], [s * sa, c * sa, ca, ca * d]]
    return np.array([*rows, [0, 0, 0, 1]])


# --- mistakes -----------------------------------------------------------------------------------

AXES, POINTS, HOME = [[0, 0, 1], [1, 0, 0]], [[0, 0, 0], [0, 0, 100]], np.eye(4)


def _arm() -> pk.SerialArm:
    return pk.SerialArm(AXES, POINTS, HOME)


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: pk.SerialArm([], POINTS, HOME), ValueError, r"axes must have shape \(..., 3\)"),
        (lambda: pk.SerialArm(AXES, POINTS[:1], HOME), ValueError, r"points must have shape \(2, "),
        (lambda: pk.SerialArm([[0, 0, 0], [0, 0, 1]], POINTS, HOME), ValueError, "0 for joint 1"),
        (lambda: pk.SerialArm(AXES, POINTS, np.eye(3)), ValueError, "home must have shape"),
        (lambda: pk.SerialArm(AXES, POINTS, 2 * np.eye(4)), ValueError, "home must be rigid"),
        (lambda: pk.SerialArm(AXES, POINTS, HOME * np.nan), ValueError, "home must be a finite"),
        (
            lambda: pk.SerialArm(AXES, [[0, 0, math.nan]] * 2, HOME),
            ValueError,
            "points must be fin",
        ),
        (
            lambda: pk.SerialArm(AXES, POINTS, HOME, kinds="revolut"),
            ValueError,
            "did you mean 'revolute'",
        ),
        (
            lambda: pk.SerialArm(AXES, POINTS, HOME, kinds=["revolute"]),
            ValueError,
            "each of 2 joints",
        ),
        (
            lambda: pk.SerialArm(AXES, POINTS, HOME, kinds=1),
            TypeError,
            "kinds must be a name or several",
        ),
        (
            lambda: pk.SerialArm(AXES, np.array([[1e308], [-1e308]]) * np.ones(3), HOME),
            ValueError,
            "points, home or joint_errors are too large",
        ),
        (lambda: _arm().replace(np.full((2, 6), 1e6)), ValueError, "joint_errors are too large"),
        (
            lambda: _arm().inverse(HOME, parts=["pose"]),
            ValueError,
            "parts must be one of pose",
        ),
        (
            lambda: _arm().inverse([HOME] * 3, joint_errors=np.zeros((2, 2, 6))),
            ValueError,
            r"joint_errors must have shape \(2, 6\) or \(3, 2, 6\)",
        ),
        (lambda: _arm().forward([1, 2, 3]), ValueError, r"theta must have shape \(..., 2\)"),
        (
            lambda: _arm().forward([0, 0], np.zeros((3, 6))),
            ValueError,
            r"must have shape \(2, 6\),",
        ),
        (lambda: _arm().forward([0, 0], np.full((2, 6), np.inf)), ValueError, "must be finite"),
        (
            lambda: _arm().jacobian([0, 0], frame="tool"),
            ValueError,
            "frame must be .* 'tool'",
        ),
        (lambda: _arm().inverse(HOME, parts="poses"), ValueError, "did you mean 'pose'"),
        (lambda: _arm().inverse(HOME, guess=[[0, 0]]), ValueError, "guess must have shape"),
        (lambda: _arm().replace(np.zeros(6)), ValueError, "joint_errors must have shape"),
        (lambda: pk.SerialArm.from_dh([1, 2], 0, [1, 2, 3]), ValueError, "must have one length"),
        (lambda: pk.SerialArm.from_dh(1, 0, 0, convention="classic"), ValueError, "must be one of"),
        (lambda: pk.SerialArm.from_dh("a", 0, 0), TypeError, "a must be an array of numbers"),
        (lambda: pk.load("3R"), ValueError, "unknown machine '3R'; known: .*, 3r"),
    ],
)
def test_mistakes_are_named(call: Callable[[], object], error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("name", ["name", "kinds", "axes", "points", "home", "joint_errors"])
def test_an_arm_cannot_be_changed(name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(_arm(), name, getattr(_arm(), name))


@pytest.mark.parametrize("size", [1e-300, 1e160, 1e300])
def test_the_characteristic_length_has_any_size(size: float) -> None:
    arm = pk.SerialArm(AXES, [[0, 0, 3 * size], [0, 4 * size, 0]], np.eye(4))
    assert arm.length == pytest.approx(size * math.sqrt(25 / 2), rel=1e-15)


def test_what_is_given_and_returned_is_not_shared() -> None:
    points = np.array(POINTS, dtype=float)
    arm = pk.SerialArm(AXES, points, HOME)
    before = arm.forward([0.3, 0.4])
    points += 1.0
    for name in ("axes", "points", "home", "joint_errors"):
        getattr(arm, name)[:] = 9.0
    assert (arm.forward([0.3, 0.4]) == before).all()


# --- what is written about it -----------------------------------------------------------------


def test_the_example_prints_the_numbers_of_its_page_and_draws_the_curves(tmp_path: Path) -> None:
    folder = Path(__file__).parents[2] / "examples" / "3r-joint-errors"
    curves = tmp_path / "curves.png"
    command = [sys.executable, folder / "joint_errors.py", curves]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    page = (folder / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [0−].*?° \| (.*) \| (.*) \| (.*) \|$", page, re.MULTILINE)
    assert len(rows) == 3
    printed = [float(number) for number in re.findall(r"\d+\.\d+", done.stdout)]
    for number in (float(cell) for row in rows for cell in row):
        assert number in printed
    assert curves.stat().st_size > 10_000
