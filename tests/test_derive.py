"""Proofs of the derivation: limb rows, pose maps, the emitter, and the elementary functions.

Limb rows are compared with plain differentiation of their closures, exactly, at random rational
points: rational rotations, and sines and cosines from rational points of the circle.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mpmath as mp
import pytest
import sympy as sp
from pkmcal.derive import limbs, posemaps, tpr2tps
from pkmcal.derive.__main__ import GENERATED, differences, headers
from pkmcal.derive.emit import Function

FUNCTIONS = {
    f.name: f for module in (limbs, posemaps, tpr2tps) for f in module.functions()
}  # fmt: skip


def symbols(name: str, size: int) -> sp.Matrix:
    """The entries of an emitted function's vector."""
    return sp.Matrix([sp.Symbol(f"{name}[{i}]", real=True) for i in range(size)])


def inputs(f: Function) -> dict[str, list[sp.Symbol]]:
    """The symbols of each input, by its name."""
    return {
        a.name: [s for s in f.declared if s.name == a.name or s.name.startswith(f"{a.name}[")]
        for a in f.inputs
    }


# --- what is checked in ------------------------------------------------------------------------


def test_regenerating_changes_nothing() -> None:
    assert differences() == "", "run: python -m derive"


def test_a_header_that_was_edited_or_is_left_over_is_shown(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(GENERATED, tmp_path / "generated"))
    (folder / "limbs.h").write_text((folder / "limbs.h").read_text().replace("+", "-", 1))
    (folder / "old.h").write_text("int old;\n")
    diff = differences(folder)
    assert {line for line in diff.splitlines() if line.startswith("---")} == {
        "--- generated/limbs.h (checked in)",
        "--- generated/old.h (checked in)",
    }
    assert "-int old;" in diff


def test_the_text_is_the_same_in_another_process_with_another_hash_seed() -> None:
    program = (
        "import hashlib; from pkmcal.derive.__main__ import headers;"
        "print(hashlib.sha256(repr(sorted(headers().items())).encode()).hexdigest())"
    )
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    there = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    here = hashlib.sha256(repr(sorted(headers().items())).encode()).hexdigest()
    assert there.stdout.strip() == here


# --- limbs -------------------------------------------------------------------------------------

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


def closures() -> dict[str, sp.Expr]:
    """Φ of each emitted row, at a platform moved by the twist (omega, v)."""

    def sphere(joint: sp.Matrix, centre: sp.Matrix, square: sp.Expr) -> sp.Expr:
        d = p + v + small * R * joint - centre
        return (d.dot(d) - square) / 2

    made = {"sphere_row": sphere(b, c, rho2)}
    for driver in ("length", "slider", "crank"):
        centre, rho = anchor(driver, g["gain"] * q + g["offset"])
        made[f"{driver}_derivatives"] = sphere(platform, centre, rho**2)
    known = (b, c, symbols("n", 3), symbols("a", 3))
    tilts = (platform, base, tilted(F, "tilt").col(2), tilted(P, "platform_tilt").col(2))
    for suffix, (joint, foot, n, a) in {"row": known, "derivatives": tilts}.items():
        d, axis = p + v + small * R * joint - foot, small * R * a
        made[f"base_plane_{suffix}"] = n.dot(d)
        made[f"platform_plane_{suffix}"] = axis.dot(d)
        made[f"couple_{suffix}"] = lever * axis.dot(n)
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


def column(entries: Any) -> sp.Matrix:
    return sp.Matrix(list(entries))


def test_every_limb_derivative_has_its_closure_here() -> None:
    rows = {f.name for f in limbs.functions() if {a.name for a, _ in f.outputs} & set(VARIABLES)}
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


@pytest.mark.parametrize("driver", ["slider", "crank"])
def test_the_anchor_moves_in_the_prepared_directions(driver: str) -> None:
    directions, made = FUNCTIONS[f"{driver}_directions"], FUNCTIONS[f"{driver}_anchor"]
    prepared = dict(zip(symbols("base", 3), base, strict=True))
    for name in ("first", "second"):
        prepared.update(zip(symbols(name, 3), directions.result(name), strict=True))
    assert_equal(made.result("c").xreplace(prepared), anchor(driver, qt)[0])


def test_axes_are_the_third_columns_of_the_tilted_frames() -> None:
    assert_equal(FUNCTIONS["base_axis"].result("axis"), tilted(F, "tilt").col(2))
    assert_equal(FUNCTIONS["platform_axis"].result("axis"), tilted(P, "platform_tilt").col(2))


def test_command_undoes_drive() -> None:
    (drive,), (command,) = (
        FUNCTIONS["limb_drive"].result("qt"),
        FUNCTIONS["limb_command"].result("q"),
    )
    assert sp.cancel(command.subs(qt, drive)) == q


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("driver", ["length", "slider", "crank"])
def test_inverse_puts_the_limb_at_its_length_on_its_branch(driver: str, branch: int) -> None:
    made = FUNCTIONS[f"{driver}_inverse"]
    rest = column([g["rod"], *anchor(driver, qt)[0], *h])
    values = rational_point(rest.xreplace(rational_point(sp.Matrix([0]), 1)), 1)
    values |= rational_point(sp.Matrix([0]), 1)
    values |= dict(zip(h, (180, -90, 150), strict=True)) | {g["rod"]: 260, g["crank"]: 120}
    values = {s: value for s, value in values.items() if s.is_Symbol and s != qt}
    if driver != "length":
        directions = FUNCTIONS[f"{driver}_directions"]
        for name in ("first", "second"):
            values.update(zip(symbols(name, 3), directions.result(name).subs(values), strict=True))
    values[sp.Symbol("branch", real=True)] = branch
    if driver == "crank":
        sine, cosine = (made.result(name).subs(values) for name in ("sine", "cosine"))
        angles = [sp.atan2(s, c) for s, c in zip(sine, cosine, strict=True)]
        solution = sp.N(angles[0] - branch * angles[1], 40)
    else:
        solution = sp.N(made.result("qt").subs(values)[0], 40)
    centre, rho = anchor(driver, qt)
    d = base + h - centre
    at = {**values, qt: solution}
    assert abs(sp.N((d.dot(d) - rho**2).subs(at), 30)) < 1e-20
    if driver != "length":
        assert sp.sign(sp.N(d.dot(centre.diff(qt)).subs(at), 30)) == branch


# --- pose maps ---------------------------------------------------------------------------------

DIGITS = 50
STEP = mp.mpf(10) ** -12  # of central differences, which are then good to 1e-24
POSES = {
    "spatial": ("12", "-25", "410", "0.3", "-0.4", "2.5"),
    "translation": ("12", "-25", "30", "0", "0", "0"),
    "planar": ("12", "-25", "0", "0", "0", "2.5"),
    "2tpr2tps": ("0", "-25", "410", "0.3", "-0.4", "0"),
}
MAPS = [pose_map.name for pose_map in posemaps.MAPS]


@cache
def compiled(name: str, output: str) -> Callable[..., Any]:
    f = FUNCTIONS[name]
    return sp.lambdify(list(inputs(f).values()), f.result(output), "mpmath")


def call(name: str, output: str, *arguments: Any) -> mp.matrix:
    values = [list(a) if hasattr(a, "__len__") else [a] for a in arguments]
    return mp.matrix(compiled(name, output)(*values))


def pose_of(name: str) -> mp.matrix:
    pose = mp.matrix(POSES[name])
    if name == "2tpr2tps":
        pose[0] = pose[2] * mp.tan(pose[4])  # eq. 7
    return pose


def free_indices(name: str) -> list[int]:
    (pose_map,) = (m for m in posemaps.MAPS if m.name == name)
    return [posemaps.POSE.index(coordinate) for coordinate in pose_map.free]


def frame(name: str, state: mp.matrix) -> tuple[mp.matrix, mp.matrix]:
    flat = call(f"map_{name}_frame", "R", state)
    return mp.matrix(3, 3) + mp.matrix([list(flat[3 * i : 3 * i + 3]) for i in range(3)]), call(
        f"map_{name}_frame", "p", state
    )


def twist(name: str, state_at: Callable[[mp.mpf], mp.matrix]) -> tuple[mp.matrix, mp.matrix]:
    """(ω, v) of the frame at 0 along a path of states, by a central difference."""
    (R0, p0), (R1, p1) = frame(name, state_at(-STEP)), frame(name, state_at(STEP))
    spin = (R1 - R0) / (2 * STEP) * frame(name, state_at(mp.mpf(0)))[0].T
    return mp.matrix([spin[2, 1], spin[0, 2], spin[1, 0]]), (p1 - p0) / (2 * STEP)


def reported(name: str, state: mp.matrix) -> mp.matrix:
    """The pose x y z α β γ that a state is reported as."""
    sine, cosine = (call(f"map_{name}_angles", part, state) for part in ("sine", "cosine"))
    return mp.matrix([*frame(name, state)[1], *map(mp.atan2, sine, cosine)])


def moved(name: str, state: mp.matrix, step: mp.matrix) -> mp.matrix:
    return call(f"map_{name}_retract", "moved", state, step)


def unit(size: int, k: int) -> mp.matrix:
    return mp.matrix([int(i == k) for i in range(size)])


def dot(a: Any, b: Any) -> mp.mpf:
    return mp.fsum(x * y for x, y in zip(a, b, strict=True))


def assert_close(found: Any, expected: Any, tolerance: float = 1e-20) -> None:
    assert mp.norm(mp.matrix(found) - mp.matrix(expected), mp.inf) < tolerance


@pytest.fixture
def digits() -> Any:
    with mp.workdps(DIGITS):
        yield


WORDS = mp.matrix(["0.7", "-1.3", "0.4", "2.1", "-0.6", "1.9"])  # a covector (ω, v)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_the_state_of_a_pose_has_the_frame_of_eq_1_and_reports_the_pose(name: str) -> None:
    pose = pose_of(name)
    state = call(f"map_{name}_from_pose", "state", pose)
    R_, p_ = frame(name, state)
    assert_close(list(R_), call("pose_frame", "R", pose))
    assert_close(p_, call("pose_frame", "p", pose))
    assert_close(reported(name, state), pose)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_retract_by_nothing_changes_nothing_and_mends_a_state_off_its_manifold(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    nothing = mp.zeros(len(free_indices(name)), 1)
    assert_close(moved(name, state, nothing), state)
    lengths = {"spatial": [slice(3, 7)], "planar": [slice(2, 4)]}
    lengths["2tpr2tps"] = [slice(2, 4), slice(4, 6)]
    for part in lengths.get(name, []):
        off = mp.matrix(state)
        for i in range(part.start, part.stop):
            off[i] *= 1 + mp.mpf("1e-6")
        assert_close(moved(name, off, nothing), state, 1e-20)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_pull_is_the_tangent_of_retract(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    row = call(f"map_{name}_pull", "row", state, WORDS[:3], WORDS[3:])
    for k in range(len(row)):
        spin, slide = twist(name, lambda t, k=k: moved(name, state, t * unit(len(row), k)))
        assert_close([row[k]], [dot(WORDS, [*spin, *slide])])


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_rates_are_those_of_the_reported_pose_along_a_step(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    step = WORDS[: len(free_indices(name))]
    later, earlier = (reported(name, moved(name, state, t * step)) for t in (STEP, -STEP))
    expected = (later - earlier) / (2 * STEP)
    assert_close(call(f"map_{name}_rates", "pose", state, step), expected)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_free_after_pull_differentiates_by_the_free_coordinates(name: str) -> None:
    pose = pose_of(name)
    state = call(f"map_{name}_from_pose", "state", pose)
    row = call(f"map_{name}_pull", "row", state, WORDS[:3], WORDS[3:])
    by_free = call(f"map_{name}_free", "out", state, row)
    for found, k in zip(by_free, free_indices(name), strict=True):

        def state_at(t: mp.mpf, k: int = k) -> mp.matrix:
            return call(f"map_{name}_from_pose", "state", pose + t * unit(6, k))

        spin, slide = twist(name, state_at)
        assert_close([found], [dot(WORDS, [*spin, *slide])])
