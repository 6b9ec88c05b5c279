"""Proofs of the formulas of what is measured, exact: at random rational points."""

from __future__ import annotations

import random

import pytest
import sympy as sp
from pkmcal.derive import frames, measured, posemaps
from pkmcal.derive.posemaps import PoseMap
from pkmcal.derive.rotation import rot_x, rot_y, rot_z, rpy, skew

FUNCTIONS = {
    f.name: f for module in (frames, measured, posemaps) for f in module.functions()
}  # fmt: skip
random_numbers = random.Random(11)
Places = dict[sp.Expr, sp.Expr]


def rational() -> sp.Rational:
    return sp.Rational(random_numbers.randint(-9, 9), random_numbers.randint(1, 9))


def entries(name: str, count: int) -> list[sp.Symbol]:
    return [sp.Symbol(f"{name}[{i}]", real=True) for i in range(count)]


def vector(name: str) -> tuple[sp.Matrix, Places]:
    """A random vector, and where an emitted function takes it."""
    given = sp.Matrix([rational() for _ in range(3)])
    return given, dict(zip(entries(name, 3), given, strict=True))


def pose(name: str) -> tuple[sp.Matrix, sp.Matrix, Places]:
    """R, p and the places of a random pose whose sines and cosines are rational."""
    symbols, p = entries(name, 6), sp.Matrix([rational() for _ in range(3)])
    R, places = turned(symbols[3:])
    return R, p, dict(zip(symbols[:3], p, strict=True)) | places


def turned(angles: list[sp.Symbol]) -> tuple[sp.Matrix, Places]:
    """R of random angles α β γ whose sines and cosines are rational."""
    places: Places = {}
    turns = []
    for symbol in angles:
        h = sp.Rational(random_numbers.randint(1, 9), random_numbers.randint(1, 9))
        c, s = (1 - h**2) / (1 + h**2), 2 * h / (1 + h**2)
        places |= {sp.cos(symbol): c, sp.sin(symbol): s}
        turns.append((c, s))
    return rot_z(*turns[2]) * rot_y(*turns[1]) * rot_x(*turns[0]), places


def value(name: str, output: str, places: Places) -> sp.Matrix:
    return FUNCTIONS[name].result(output).subs(places)


TWIST = sp.Matrix([rational() for _ in range(6)])
W, V = TWIST[:3, 0], TWIST[3:, 0]


def test_a_point_moves_with_the_platform() -> None:
    R, p, places = pose("pose")
    t, of_target = vector("target")
    places |= of_target
    assert value("measured_point", "point", places) == p + R * t
    assert value("measured_point", "by_twist", places).reshape(3, 6) * TWIST == V + skew(W) * R * t
    assert value("measured_point", "by_target", places).reshape(3, 3) == R


def test_a_distance_changes_by_what_its_end_moves_along_it() -> None:
    R, p, places = pose("pose")
    t, of_target = vector("target")
    a, of_anchor = vector("anchor")
    z = rational()
    places |= of_target | of_anchor | {sp.Symbol("zero[0]", real=True): z}
    d = p + R * t - a
    rho = value("measured_distance", "distance", places)[0] + z
    assert rho**2 == d.dot(d)
    moved = value("measured_distance", "by_twist", places).dot(TWIST)
    assert sp.simplify(rho * moved - d.dot(V + skew(W) * R * t)) == 0
    for name, direction in (("by_target", R.T * d), ("by_anchor", -d)):
        assert (rho * value("measured_distance", name, places) - direction).is_zero_matrix


def test_a_distance_between_two_places_changes_by_what_either_end_moves_along_it() -> None:
    R1, p1, places = pose("pose")
    R2, p2, of_other = pose("other")
    t, of_target = vector("target")
    places |= of_other | of_target
    d = p2 + R2 * t - p1 - R1 * t
    (rho,) = value("measured_between", "distance", places)
    assert rho**2 == d.dot(d)
    for name, R, sign in (("by_twist", R1, -1), ("by_other", R2, 1)):
        moved = value("measured_between", name, places).dot(TWIST)
        assert sp.simplify(rho * moved - sign * d.dot(V + skew(W) * R * t)) == 0
    by_target = value("measured_between", "by_target", places)
    assert (rho * by_target - (R2 - R1).T * d).is_zero_matrix


def test_a_touched_point_is_in_the_axes_of_the_artefact() -> None:
    R, p, places = pose("artefact")
    x, of_point = vector("x")
    places |= of_point
    assert R * value("touched_point", "inside", places) + p == x
    assert value("touched_point", "by_point", places).reshape(3, 3) == R.T
    symbols = entries("artefact", 6)
    inside = rpy(*symbols[3:]).T * (x - sp.Matrix(symbols[:3]))
    by_artefact = value("touched_point", "by_artefact", places).reshape(3, 6)
    assert by_artefact == inside.jacobian(symbols).subs(places)


def test_a_tilt_is_how_far_an_axis_of_the_sensor_points_up() -> None:
    R, _, places = pose("pose")
    symbols = entries("mounting", 3)
    Rm, of_mounting = turned(symbols)
    up = (lambda A: A[:, 2])(turned(entries("unused", 3))[0])  # of length one, and rational
    places |= of_mounting | dict(zip(entries("up", 3), up, strict=True))
    s = (R * Rm).T * up
    tilts = value("measured_tilt", "tilt", places)
    whole = (R * rpy(*symbols)).T * up
    for i in range(2):
        assert sp.simplify(sp.tan(tilts[i]) ** 2 - s[i] ** 2 / (1 - s[i] ** 2)) == 0
        assert sp.sign(tilts[i]) == sp.sign(s[i])
        cosine = sp.sqrt(1 - s[i] ** 2)
        rates = {
            "by_turn": (skew(W) * R * Rm)[:, i].dot(up)
            - cosine * _row("by_turn", i, places).dot(W),
            "by_up": (R * Rm)[:, i].T - cosine * _row("by_up", i, places),
            "by_mounting": sp.Matrix([whole[i]]).jacobian(symbols).subs(places)
            - cosine * _row("by_mounting", i, places),
        }
        for name, off in rates.items():
            assert all(sp.simplify(entry) == 0 for entry in sp.Matrix([off])), name


def _row(output: str, i: int, places: Places) -> sp.Matrix:
    return value("measured_tilt", output, places).reshape(2, 3)[i, :]


def test_a_point_seen_from_a_frame_follows_point_and_frame() -> None:
    R, p, places = pose("frame")
    x, of_point = vector("x")
    places |= of_point
    assert value("seen_point", "seen", places) == p + R * x
    assert value("seen_point", "by_point", places).reshape(3, 3) == R
    symbols = entries("frame", 6)
    seen = sp.Matrix(symbols[:3]) + rpy(*symbols[3:]) * x
    assert value("seen_point", "by_frame", places).reshape(3, 6) == seen.jacobian(symbols).subs(
        places
    )


def test_a_camera_sees_a_corner_by_its_lens() -> None:
    R, origin, places = pose("board")
    X, of_corner = vector("corner")
    lens, size = entries("lens", 9), sp.Symbol("size", real=True)
    places |= of_corner | {x: rational() for x in (*lens, size)}
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens

    def seen(p: sp.Matrix) -> sp.Matrix:
        x, y = p[0] / p[2], p[1] / p[2]
        r = sp.sqrt(x**2 + y**2)
        radial = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
        return sp.Matrix([
            fx * (x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2)) + cx,
            fy * (y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y) + cy,
        ])  # fmt: skip

    p = origin + (1 + places[size]) * R * X
    moved = sp.Matrix(sp.symbols("m0:3", real=True))
    at_rest = places | dict(zip(moved, p, strict=True))
    u_v, by_point = seen(moved), seen(moved).jacobian(moved).subs(at_rest)
    assert (value("measured_pixel", "seen", places) - u_v.subs(at_rest)).is_zero_matrix
    by_lens = value("measured_pixel", "by_lens", places).reshape(2, 9)
    assert (by_lens - u_v.jacobian(lens).subs(at_rest)).is_zero_matrix
    by_twist = value("measured_pixel", "by_twist", places).reshape(2, 6)
    assert (by_twist * TWIST - by_point * (V + skew(W) * p)).is_zero_matrix
    assert (value("measured_pixel", "by_size", places) - by_point * R * X).is_zero_matrix
    assert value("measured_pixel", "depth", places)[0] == p[2]


def test_a_twist_is_carried_from_the_machines_own_pose_to_the_users() -> None:
    A, _, places = pose("a")
    R, _, of_pose = pose("b")
    c, of_tool = vector("c")
    twist = value("pose_compose_twists", "twists", places | of_pose | of_tool).reshape(6, 6) * TWIST
    assert twist[:3, 0] == A * W
    assert twist[3:, 0] == A * (V + skew(W) * R * c)


@pytest.mark.parametrize("pose_map", posemaps.MAPS, ids=lambda pose_map: str(pose_map.name))
def test_twist_of_a_step_is_what_pulls_covectors_back(pose_map: PoseMap) -> None:
    size, m = pose_map.state_size, pose_map.m
    places = {x: rational() for x in (*entries("state", size), *entries("delta", m))}
    covector = {x: rational() for x in (*entries("omega", 3), *entries("v", 3))}
    name = f"map_{pose_map.name}"
    twist = value(f"{name}_twist", "twist", places)
    row = value(f"{name}_pull", "row", places | covector)
    step = sp.Matrix([places[x] for x in entries("delta", m)])
    assert sp.Matrix(list(covector.values())).dot(twist) == row.dot(step)
