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
    places: Places = dict(zip(symbols[:3], p, strict=True))
    turns = []
    for symbol in symbols[3:]:
        h = sp.Rational(random_numbers.randint(1, 9), random_numbers.randint(1, 9))
        c, s = (1 - h**2) / (1 + h**2), 2 * h / (1 + h**2)
        places |= {sp.cos(symbol): c, sp.sin(symbol): s}
        turns.append((c, s))
    return rot_z(*turns[2]) * rot_y(*turns[1]) * rot_x(*turns[0]), p, places


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
    places |= of_target | of_anchor
    d = p + R * t - a
    (rho,) = value("measured_distance", "distance", places)
    assert rho**2 == d.dot(d)
    moved = value("measured_distance", "by_twist", places).dot(TWIST)
    assert sp.simplify(rho * moved - d.dot(V + skew(W) * R * t)) == 0
    for name, direction in (("by_target", R.T * d), ("by_anchor", -d)):
        assert (rho * value("measured_distance", name, places) - direction).is_zero_matrix


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
