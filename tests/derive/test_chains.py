"""The formulas of chains: what a limb's end misses, and how that follows platform and joints."""

from __future__ import annotations

import sympy as sp
from pkmcal.derive import chains
from pkmcal.derive.rotation import rpy, skew

FUNCTIONS = {f.name: f for f in chains.functions()}
T = sp.Symbol("t", real=True)


def value(name: str, output: str, **given: sp.Matrix) -> sp.Matrix:
    """An output at these inputs, in exact numbers."""
    f = FUNCTIONS[name]
    symbols, values = [], []
    for argument in f.inputs:
        entries = list(given[argument.name])
        size = argument.size or 1
        symbols += [sp.Symbol(f"{argument.name}[{i}]", real=True) for i in range(size)]
        if argument.size is None:
            symbols[-1] = sp.Symbol(argument.name, real=True)
        values += entries
    return f.result(output).subs(dict(zip(symbols, values, strict=True)))


def turned(R: sp.Matrix, omega: sp.Matrix) -> sp.Matrix:
    """R turned with ω for a time t, to first order."""
    return (sp.eye(3) + T * skew(omega)) * R


def test_a_closed_chain_misses_nothing_and_follows_the_platform_by_its_twist() -> None:
    R = rpy(sp.Rational(1, 3), sp.Rational(-1, 5), sp.Rational(2, 7))
    p, omega, v = sp.Matrix([3, -4, 5]), sp.Matrix([2, -1, 3]), sp.Matrix([7, 8, -9])
    length = sp.Matrix([11])
    still = value("chain_closure", "r", C=R, c=p, R=R, p=p, length=length)
    assert still.applyfunc(sp.simplify) == sp.zeros(6, 1)
    moved = value("chain_closure", "r", C=R, c=p, R=turned(R, omega), p=p + T * v, length=length)
    slope = moved.diff(T).subs(T, 0).applyfunc(sp.simplify)
    assert slope == -sp.Matrix([*(11 * omega), *v])


def test_a_ball_follows_the_platform_by_its_lever() -> None:
    R, p = rpy(sp.Rational(1, 2), sp.Rational(1, 4), 0), sp.Matrix([1, 2, 3])
    b, c = sp.Matrix([5, -6, 7]), sp.Matrix([9, 9, 9])
    omega, v = sp.Matrix([1, 2, -1]), sp.Matrix([0, 1, 4])
    lever = value("chain_ball", "lever", R=R, p=p, b=b, c=c)
    moved = value("chain_ball", "r", R=turned(R, omega), p=p + T * v, b=b, c=c)
    slope = moved.diff(T).subs(T, 0)
    assert (slope + v + omega.cross(lever)).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_a_turn_moves_what_is_off_its_axis() -> None:
    w, at, c = sp.Matrix([0, 0, 1]), sp.Matrix([1, 1, 0]), sp.Matrix([3, 1, 8])
    assert value("chain_turn", "v", w=w, at=at, c=c) == sp.Matrix([0, 2, 0])


def test_a_chain_that_does_not_close_follows_turns_of_end_and_platform() -> None:
    C, R = rpy(sp.Rational(1, 3), 0, sp.Rational(1, 7)), rpy(0, sp.Rational(-1, 5), 0)
    p, omega, length = sp.Matrix([1, 2, 3]), sp.Matrix([2, -1, 3]), sp.Matrix([13])
    for output, given in (
        ("by_end", {"C": turned(C, omega), "R": R}),
        ("by_platform", {"C": C, "R": turned(R, omega)}),
    ):
        moved = value("chain_closure", "r", c=p, p=p, length=length, **given)
        slope = moved[:3, :].diff(T).subs(T, 0) / 13
        by = sp.Matrix(value("chain_turned", output, C=C, R=R)).reshape(3, 3)
        assert (slope - by * omega).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_what_moves_the_end_moves_a_column_behind_it_rigidly_and_lifts_one_before_it() -> None:
    """Of a joint that turns, by the velocity of the end, against its own formula."""
    w, at, c = sp.Matrix([2, -1, 2]) / 3, sp.Matrix([1, 5, -2]), sp.Matrix([4, 0, 7])
    u, omega, v = sp.Matrix([3, 1, -2, 5, -1, 4]), sp.Matrix([1, -2, 2]), sp.Matrix([2, 7, -3])
    length = 11

    def column(axis: sp.Matrix, at: sp.Matrix, end: sp.Matrix) -> sp.Matrix:
        return sp.Matrix([*axis, *(axis.cross(end - at) / length)])

    given = {"x": column(w, at, c), "u": u, "length": sp.Matrix([length])}
    by_turn, by_shift = (
        sp.Matrix(value("chain_pairing", name, **given)) for name in ("by_turn", "by_shift")
    )
    lifted = column(w, at, c + T * v).dot(u).diff(T)
    assert sp.simplify(lifted - by_shift.dot(v)) == 0
    carried = column(turned(sp.eye(3), omega) * w, c + turned(sp.eye(3), omega) * (at - c), c)
    assert sp.simplify(carried.dot(u).diff(T).subs(T, 0) - by_turn.dot(omega)) == 0


def test_what_a_joint_yields_follows_its_lever() -> None:
    """A turn of the joint by the moment about it, and a shift by the force: K = B Bᵀ + (0, 1)."""
    d, change = sp.Matrix([3, -2, 5]), sp.Matrix([1, 4, -2])
    u = sp.Matrix([2, 1, -3, 4, -1, 2])
    B = sp.Matrix.vstack(sp.eye(3), -skew(d + T * change))
    yielded = B * (B.T * u) + sp.Matrix([0, 0, 0, *u[3:]])
    bent = sp.Matrix(value("chain_bend", "bent", d=d, change=change, u=u))
    assert (yielded.diff(T).subs(T, 0) - bent).applyfunc(sp.simplify) == sp.zeros(6, 1)
