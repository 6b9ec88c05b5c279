"""Proofs of the limb rows: emitted derivatives against plain differentiation of the closures.

They are compared exactly, at random rational points: rational rotations, and sines and cosines from
rational points of the circle.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterable
from functools import cache

import pytest
import sympy as sp
from pkmcal.derive import limb_functions, limbs, rates

DRIVERS = [driver.name for driver in limbs.DRIVERS]
ROWS = [row.name for row in limbs.CONSTRAINTS]
FUNCTIONS = {f.name: f for module in (limb_functions, rates) for f in module.functions()}


def symbols(name: str, size: int) -> sp.Matrix:
    """The entries of an emitted function's vector."""
    return sp.Matrix([sp.Symbol(f"{name}[{i}]", real=True) for i in range(size)])


g = {s: sp.Symbol(f"g[{c}]", real=True) for s, c in zip(limbs.SLOTS, limbs.CONSTANTS, strict=True)}
q, qt, lever, rho2 = sp.symbols("q qt lever rho2", real=True)
R, F, P = (symbols(name, 9).reshape(3, 3) for name in "RFP")
p, b, c, h = (symbols(name, 3) for name in "pbch")
omega, v = sp.Matrix(sp.symbols("w0:3", real=True)), sp.Matrix(sp.symbols("v0:3", real=True))
VARIABLES = {"omega": omega, "v": v, "by_q": [q], "by_g": list(g.values())}
base, platform = sp.Matrix(list(g.values())[:3]), sp.Matrix(list(g.values())[3:6])
small = sp.rot_ccw_axis3(omega[2]) * sp.rot_ccw_axis2(omega[1]) * sp.rot_ccw_axis1(omega[0])


def tilted(frame: sp.Matrix, name: str) -> sp.Matrix:
    return frame * sp.rot_ccw_axis1(g[f"{name}1"]) * sp.rot_ccw_axis2(g[f"{name}2"])


def anchor(driver: str, drive: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    """Where the anchor stands at q̃ = drive, and the length from there."""
    first, _, axis = (tilted(F, "tilt").col(i) for i in range(3))
    if driver == "length":
        return base, drive
    if driver == "slider":
        return base + drive * axis, g["rod"]
    turned = sp.cos(drive) * first + sp.sin(drive) * axis.cross(first)
    return base + g["crank"] * turned, g["rod"]


@cache
def closures() -> dict[str, sp.Expr]:
    """Φ of each emitted row, at a platform moved by the twist (omega, v)."""

    def sphere(joint: sp.Matrix, centre: sp.Matrix, square: sp.Expr) -> sp.Expr:
        d = p + v + small * R * joint - centre
        return (d.dot(d) - square) / 2

    made = {"sphere_row": sphere(b, c, rho2)}
    for driver in DRIVERS:
        centre, rho = anchor(driver, g["gain"] * q + g["offset"])
        made[f"{driver}_derivatives"] = sphere(platform, centre, rho**2)
        made[f"{driver}_carry"] = symbols("pull", 3).dot(centre)
    known = (b, c, symbols("n", 3), symbols("a", 3))
    tilts = (platform, c, tilted(F, "tilt").col(2), tilted(P, "platform_tilt").col(2))
    hinges = {"row": known[2], "derivatives": tilted(F, "hinge_tilt").col(2)}
    for suffix, (joint, foot, n, a) in {"row": known, "derivatives": tilts}.items():
        d, axis = p + v + small * R * joint - foot, small * R * a
        made[f"base_plane_{suffix}"] = n.dot(d)
        made[f"platform_plane_{suffix}"] = axis.dot(d)
        made[f"couple_{suffix}"] = lever * axis.dot(n)
        made[f"hinge_plane_{suffix}"] = hinges[suffix].dot(d)
    return made


def rational_point(exprs: sp.Matrix, seed: int) -> dict[sp.Expr, sp.Expr]:
    """Random rational values of all symbols, sines and cosines; R, F and P are rotations."""
    rng = random.Random(seed)

    def number() -> sp.Rational:
        return sp.Rational(rng.randint(-99, 99), rng.randint(1, 20))

    point: dict[sp.Expr, sp.Expr] = {}
    for matrix in (R, F, P):
        x, y, z = number(), number(), number()
        skew = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = (sp.eye(3) - skew).inv() * (sp.eye(3) + skew)
        point.update(zip(matrix, rotation, strict=True))
    for angle in sorted({call.args[0] for call in exprs.atoms(sp.sin, sp.cos)}, key=str):
        half = number()
        point[sp.sin(angle)] = 2 * half / (1 + half**2)
        point[sp.cos(angle)] = (1 - half**2) / (1 + half**2)
    for symbol in sorted(exprs.free_symbols - set(point), key=str):
        point[symbol] = number()
    return point


def assert_equal(found: sp.Matrix, expected: sp.Matrix) -> None:
    for seed in range(3):
        point = rational_point(found.col_join(expected), seed)
        assert found.xreplace(point) == expected.xreplace(point)


def column(entries: Iterable[sp.Expr]) -> sp.Matrix:
    return sp.Matrix(list(entries))


def test_every_limb_derivative_has_its_closure_here() -> None:
    rows = {
        name for name, f in FUNCTIONS.items() if {a.name for a, _ in f.outputs} & set(VARIABLES)
    }
    assert rows == set(closures())


@pytest.mark.parametrize("name", closures())
def test_limb_derivatives_are_those_of_the_closure(name: str) -> None:
    still = dict.fromkeys([*omega, *v], 0)
    phi = closures()[name]
    for argument, _ in FUNCTIONS[name].outputs:
        if argument.name == "phi":
            expected = column([phi.subs(still)])
        else:
            expected = column(sp.diff(phi, u).subs(still) for u in VARIABLES[argument.name])
        assert_equal(FUNCTIONS[name].result(argument.name), expected)


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_anchor_moves_in_the_prepared_directions(driver: str) -> None:
    directions, made = FUNCTIONS[f"{driver}_directions"], FUNCTIONS[f"{driver}_anchor"]
    prepared: dict[sp.Expr, sp.Expr] = {}
    for name in ("first", "second"):
        prepared.update(zip(symbols(name, 3), directions.result(name), strict=True))
    centre, rho = anchor(driver, qt)
    assert_equal(made.result("c").xreplace(prepared), centre)
    assert_equal(FUNCTIONS[f"{driver}_radius"].result("rho"), column([rho]))


@pytest.mark.parametrize("driver", limbs.DRIVERS)
def test_what_is_said_to_depend_on_the_actuator_does(driver: limbs.Driver) -> None:
    centre, rho = anchor(driver.name, qt)
    assert driver.moves == (qt in centre.free_symbols)
    assert driver.stretches == (qt in rho.free_symbols)


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_path_of_the_joint_from_the_anchor_is_differentiated_by_time(driver: str) -> None:
    t, qt1, qt2 = sp.symbols("t qt1 qt2", real=True)
    first, second, h1, h2 = (symbols(name, 3) for name in ("first", "second", "h1", "h2"))
    drive = qt + qt1 * t + qt2 * t**2 / 2
    carried = {
        "length": sp.zeros(3, 1),
        "slider": drive * first,
        "crank": sp.cos(drive) * first + sp.sin(drive) * second,
    }[driver]
    path = h + h1 * t + h2 * t**2 / 2 - carried
    for order, name in enumerate(("d", "d1", "d2")):
        expected = path.applyfunc(lambda e, order=order: sp.diff(e, t, order).subs(t, 0))
        assert_equal(FUNCTIONS[f"{driver}_path"].result(name), expected)


def test_an_anchor_may_go_round_a_circle_by_a_way_in_mm(monkeypatch: pytest.MonkeyPatch) -> None:
    def moved(qt: sp.Expr, first: sp.Matrix, second: sp.Matrix, sincos: limbs.SinCos) -> sp.Matrix:
        sine, cosine = sincos(qt / sp.sqrt(first.dot(first)))
        return cosine * first + sine * second

    arc = dataclasses.replace(limbs.CRANK, name="arc", unit="mm", moved=moved)
    monkeypatch.setattr(rates, "DRIVERS", (arc,))
    made = {f.name: f for f in rates.functions() if f.name.startswith("arc_")}
    assert all("sincos" in f.emit() for f in made.values())
    t, qt1, qt2 = sp.symbols("t qt1 qt2", real=True)
    first, second, h1, h2 = (symbols(name, 3) for name in ("first", "second", "h1", "h2"))
    angle = (qt + qt1 * t + qt2 * t**2 / 2) / sp.sqrt(first.dot(first))
    path = h + h1 * t + h2 * t**2 / 2 - sp.cos(angle) * first - sp.sin(angle) * second
    exprs = column([*h, *h1, *h2, *first, *second, qt, qt1, qt2])
    numbers = rational_point(exprs, seed=3)
    for order, name in enumerate(("d", "d1", "d2")):
        for found, entry in zip(made["arc_path"].result(name), path, strict=True):
            expected = sp.diff(entry, t, order).subs(t, 0)
            assert abs((found - expected).subs(numbers).n(30)) < 1e-20


def test_axes_are_the_third_columns_of_the_tilted_frames() -> None:
    assert_equal(FUNCTIONS["base_axis"].result("axis"), tilted(F, "tilt").col(2))
    assert_equal(FUNCTIONS["platform_axis"].result("axis"), tilted(F, "platform_tilt").col(2))
    assert_equal(FUNCTIONS["hinge_axis"].result("axis"), tilted(F, "hinge_tilt").col(2))


def test_command_undoes_drive() -> None:
    (drive,) = FUNCTIONS["limb_drive"].result("qt")
    (command,) = FUNCTIONS["limb_command"].result("q")
    per_gain = sp.Symbol("per_gain", real=True)
    gain = sp.Symbol("g[GAIN]", real=True)
    assert sp.cancel(command.subs(qt, drive).subs(per_gain, 1 / gain)) == q


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("driver", DRIVERS)
def test_inverse_puts_the_limb_at_its_length_on_its_branch(driver: str, branch: int) -> None:
    made = FUNCTIONS[f"{driver}_inverse"]
    numbers = rational_point(column([*anchor(driver, qt)[0], g["rod"], *h]), seed=1)
    values = {s: value.n(40) for s, value in numbers.items() if s.is_Symbol and s != qt}
    values |= dict(zip(h, (180, -90, 150), strict=True)) | {g["rod"]: 260, g["crank"]: 120}
    if driver != "length":
        directions = FUNCTIONS[f"{driver}_directions"]
        for name in ("first", "second"):
            values.update(
                zip(symbols(name, 3), directions.result(name).subs(values).n(40), strict=True)
            )
    values[sp.Symbol("branch", real=True)] = branch
    solution = sp.N(made.result("qt").subs(values)[0], 40)
    centre, rho = anchor(driver, qt)
    d = base + h - centre
    at = {**values, qt: solution}
    assert abs((d.dot(d) - rho**2).xreplace(at).n(30)) < 1e-20
    if driver != "length":
        assert sp.sign(d.dot(centre.diff(qt)).xreplace(at).n(30)) == branch


@pytest.mark.parametrize("driver", DRIVERS)
def test_rates_keep_the_closure_to_second_order(driver: str) -> None:
    """With q̃ + qt1 t + qt2 t²/2 the closure along h + h1 t + h2 t²/2 has no t and no t²."""
    made = FUNCTIONS[f"{driver}_rates"]
    t = sp.Symbol("t", real=True)
    first, second, h1, h2 = (symbols(name, 3) for name in ("first", "second", "h1", "h2"))
    numbers = rational_point(column([*h, *h1, *h2, *first, *second, qt]), seed=5)
    qt1, qt2 = (made.result(name)[0].subs(numbers).n(40) for name in ("qt1", "qt2"))
    drive = qt + qt1 * t + qt2 * t**2 / 2
    joint = h + h1 * t + h2 * t**2 / 2
    if driver == "length":  # at a q̃ that is the length: elsewhere Φ is another constant
        phi = joint.dot(joint) - drive**2
    else:
        carried = drive * first
        if driver == "crank":
            carried = sp.cos(drive) * first + sp.sin(drive) * second
        phi = (joint - carried).dot(joint - carried)
    for order in (1, 2):
        assert abs(sp.diff(phi, t, order).subs(t, 0).subs(numbers).n(30)) < 1e-20


@pytest.mark.parametrize("row", ["sphere", *ROWS])
def test_rate_of_a_row_is_its_derivative_while_the_limb_changes(row: str) -> None:
    still = dict.fromkeys([*omega, *v], 0)
    phi = closures()[f"{row}_row"].subs(still)
    changing = {sp.Symbol("rho2", real=True): sp.Symbol("rho2_rate", real=True)}
    for name in "bcna":
        changing.update(zip(symbols(name, 3), symbols(f"{name}_rate", 3), strict=True))
    expected = sum(sp.diff(phi, x) * rate for x, rate in changing.items())
    assert_equal(FUNCTIONS[f"{row}_rate"].result("rate"), column([expected]))


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_closure_does_not_bend_where_the_actuator_follows_the_joint(driver: str) -> None:
    """`*_bend`, which takes any path, vanishes on the one that `*_rates` gives, and only there."""
    first, second, h1, h2 = (symbols(name, 3) for name in ("first", "second", "h1", "h2"))
    numbers = rational_point(column([*h, *h1, *h2, *first, *second, qt]), seed=7)
    at = {}
    for name in ("qt1", "qt2"):
        value = FUNCTIONS[f"{driver}_rates"].result(name)[0].subs(numbers)
        at[sp.Symbol(name, real=True)] = value.n(40)
    bend = FUNCTIONS[f"{driver}_bend"].result("phi2")[0].subs(numbers)
    assert abs(bend.subs(at).n(30)) < 1e-20
    at[sp.Symbol("qt2", real=True)] += 1
    assert abs(bend.subs(at).n(30)) > 1e-3
