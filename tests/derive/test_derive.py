"""Laws of the generator: what is checked in, what the emitter prints, the elementary functions."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mpmath as mp
import pytest
import sympy as sp
from pkmcal.derive import elementary, limb_functions, limbs, posemaps, rates, screws, tpr2tps
from pkmcal.derive.__main__ import GENERATED, differences
from pkmcal.derive.emit import Function

MODULES = (limb_functions, posemaps, rates, screws, tpr2tps)
FUNCTIONS = {f.name: f for module in MODULES for f in module.functions()}


# --- what is checked in ------------------------------------------------------------------------


def test_regenerating_changes_nothing() -> None:
    diff = differences()
    assert not diff, f"{diff}\nrun: python -m derive"


def test_a_header_that_was_edited_or_is_left_over_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    derived = {path.name: path.read_text(encoding="utf-8") for path in GENERATED.glob("*.h")}
    monkeypatch.setattr("pkmcal.derive.__main__.headers", lambda: derived)
    folder = Path(shutil.copytree(GENERATED, tmp_path / "generated"))
    limbs_h = folder / "limbs.h"
    limbs_h.write_text(derived["limbs.h"].replace("+", "-", 1), encoding="utf-8")
    (folder / "old.h").write_text("int old;\n", encoding="utf-8")
    diff = differences(folder).splitlines()
    shown = [line for line in diff if line.startswith("---")]
    assert shown == ["--- generated/limbs.h (checked in)", "--- generated/old.h (checked in)"]
    assert "-int old;" in diff


def test_the_text_is_the_same_in_another_process_with_another_hash_seed(tmp_path: Path) -> None:
    program = (
        "import sys; from pkmcal.derive import limb_functions, screws, tpr2tps;"
        "made = limb_functions.functions() + screws.functions() + tpr2tps.functions();"
        "sys.stdout.buffer.write(''.join(f.emit() for f in made).encode())"
    )
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    there = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONHASHSEED": seed},
        stdout=subprocess.PIPE,
        check=True,
    )
    here = [f.emit() for module in (limb_functions, screws, tpr2tps) for f in module.functions()]
    assert there.stdout.decode() == "".join(here)


# --- what the emitter prints -------------------------------------------------------------------


def plain_function() -> tuple[Function, sp.Symbol, sp.Symbol]:
    f = Function("made", "made for a test", "none")
    return f, f.scalar("x", "x"), f.scalar("y", "y")


def body(f: Function) -> str:
    """The statements between the braces, comments left out."""
    text = f.emit()
    inside = text[text.index("\n{\n") + 3 : text.rindex("\n}")]
    return re.sub(r"/\*.*?\*/", "", inside, flags=re.DOTALL)


X, Y = sp.symbols("x y", real=True)


@pytest.mark.parametrize(
    "expr",
    [X**5, X**-5, X**Y, X ** sp.Rational(1, 3), X ** sp.Rational(3, 2), X ** sp.Rational(-3, 2)],
    ids=str,
)
def test_powers_that_are_not_expanded_are_refused(expr: sp.Expr) -> None:
    f, _, _ = plain_function()
    f.output("out", expr, "a power")
    with pytest.raises(NotImplementedError, match="power"):
        f.emit()


@pytest.mark.parametrize("number", [sp.Rational(1, 3), sp.Rational(1, 10), 2**24 + 1], ids=str)
def test_numbers_that_a_float_cannot_hold_are_refused(number: sp.Rational) -> None:
    f, x, _ = plain_function()
    f.output("out", number * x, "scaled")
    with pytest.raises(NotImplementedError, match="is no float"):
        f.emit()


@pytest.mark.parametrize("expr", [sp.sin(X), sp.pi * X, 0.1 * X, sp.Abs(X), sp.exp(X)], ids=str)
def test_what_has_no_c_is_refused(expr: sp.Expr) -> None:
    f, _, _ = plain_function()
    f.output("out", expr, "not arithmetic")
    with pytest.raises(NotImplementedError, match="has no C for"):
        f.emit()


def test_a_name_is_declared_once() -> None:
    f, _, _ = plain_function()
    with pytest.raises(ValueError, match="declared twice"):
        f.let("x", sp.S.One)


def test_dead_steps_are_dropped_and_live_ones_keep_their_order() -> None:
    f, x, y = plain_function()
    first = f.let("first", x * y)
    f.let("dead", first + 1)
    last = f.let("last", first * first + x)
    f.output("out", last + y, "of last")
    assert "dead" not in body(f)
    assert body(f).index(" first = ") < body(f).index(" last = ") < body(f).index("*out = ")


def test_an_unused_sine_is_not_computed() -> None:
    f, x, y = plain_function()
    f.sincos("a", x)
    f.output("out", x + y, "no sine")
    assert "sincos" not in body(f)


def test_subexpressions_are_shared_across_outputs() -> None:
    f, x, y = plain_function()
    f.output("one", x * y + 1, "first")
    f.output("other", sp.Matrix([x * y - x, x * y * (x + y)]), "second")
    assert body(f).count("x*y") == 1


def test_structural_zeros_and_ones_cost_no_operation() -> None:
    f, x, _ = plain_function()
    zero, same = f.let("zero", sp.S.Zero), f.let("same", x)
    f.output("out", sp.Matrix([zero, zero * x + same]), "nothing to compute")
    assert "operations: 0 +, 0 *, 0 /, 0 sqrt" in f.emit()
    assert re.sub(r"\s", "", body(f)) == "out[0]=FN(fill)(0.0f);out[1]=x;"


def test_gradient_goes_through_the_names() -> None:
    f, x, y = plain_function()
    s, c = f.sincos("a", x * y)
    inner = f.let("inner", s * x + c)
    outer = inner**2 / y
    assert s in f.gradient(outer, [x]).free_symbols  # the names stay
    for u in (x, y):
        found = f.written_out(f.gradient(outer, [u])[0])
        assert sp.simplify(found - sp.diff(f.written_out(outer), u)) == 0


def test_perturbations_are_zero_in_what_is_emitted() -> None:
    f, x, y = plain_function()
    w = f.perturbation("w", 2)
    value = f.let("value", (x + w[0]) * (y + w[1]))
    f.output("value_D_w", f.gradient(value, w), "by w")
    f.output("out", value, "at w = 0")
    text = re.sub(r"\s", "", body(f))
    assert text == "constrealvalue=x*y;value_D_w[0]=y;value_D_w[1]=x;*out=value;"


@pytest.mark.parametrize("f", FUNCTIONS.values(), ids=FUNCTIONS)
def test_lines_fit_and_no_power_is_left(f: Function) -> None:
    text = f.emit()
    assert max(map(len, text.splitlines())) <= 100
    assert "pow" not in text
    assert "**" not in body(f)


@pytest.mark.parametrize("f", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_stated_operations_are_those_in_the_text(f: Function) -> None:
    text = body(f)
    angles = "".join(re.findall(r"FN\(sincos\)\((.*?), &", text))
    text = re.sub(r"FN\(sincos\)\(.*?;", "", text, flags=re.DOTALL)
    counted = {
        "+": len(re.findall(r"[\w\])]\s+[+-]\s+[\w(-]", text)),
        "*": len(re.findall(r"[\w\])]\s*\*\s*[\w(-]", text)),
        "/": text.count("/"),
        "sqrt": text.count("FN(root)"),
    }
    counted["*"] += angles.count("*")
    stated = ", ".join(f"{n} {operation}" for operation, n in counted.items())
    assert f"operations: {stated}\n" in f.emit()


def run(f: Function, values: dict[str, mp.mpf | list[mp.mpf]]) -> dict[str, list[mp.mpf]]:
    """Run the printed statements as they stand, in mpmath: every output as a list."""
    outputs = {a.name: [mp.nan] * (a.size or 1) for a, _ in f.outputs}
    known = {**dict(zip(limbs.CONSTANTS, range(99), strict=False)), **values, **outputs}
    known |= {"SIXTH": mp.mpf(1) / 6, "mpf": mp.mpf, "sqrt": mp.sqrt, "sin": mp.sin, "cos": mp.cos}
    known["arctangent2"] = mp.atan2
    for statement in body(f).split(";")[:-1]:
        line = " ".join(statement.split())
        line = re.sub(r"(\d+\.\d+(?:e[+-]?\d+)?)f\b", r"mpf('\1')", line)
        line = re.sub(r"FN\(sincos\)\((.*), &(\w+), &(\w+)\)", r"\2, \3 = sin(\1), cos(\1)", line)
        line = line.replace("FN(root)", "sqrt").replace("FN(fill)", "")
        line = re.sub(r"^\*(\w+) =", r"\1[0] =", line)
        line = re.sub(r"^const real ", "", line)
        if not line.startswith("real "):
            exec(line, {}, known)
    return outputs


@pytest.mark.parametrize("f", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_printed_c_computes_what_was_derived(f: Function) -> None:
    rng = random.Random(f.name)
    with mp.workdps(40):
        values = {
            a.name: [mp.mpf(rng.uniform(0.2, 1.5)) for _ in range(a.size or 1)] for a in f.inputs
        }
        symbols = [s for s in f.declared if s.name.split("[")[0] in values]
        arguments = [[s for s in symbols if s.name.split("[")[0] == name] for name in values]
        scalars = {a.name: values[a.name][0] for a in f.inputs if a.size is None}
        found = run(f, {**values, **scalars})
        for argument, _ in f.outputs:
            derived = sp.lambdify(
                arguments, f.result(argument.name).subs(screws.SIXTH, sp.Rational(1, 6)), "mpmath"
            )
            expected = list(mp.matrix(derived(*values.values())))
            for one, other in zip(found[argument.name], expected, strict=True):
                assert abs(one - other) < mp.mpf("1e-30") * (1 + abs(other))


# --- elementary functions ----------------------------------------------------------------------

FITTED: dict[str, tuple[Callable[[mp.mpf], mp.mpf], Callable[[mp.mpf, mp.mpf], mp.mpf], str]] = {
    "SIN": (mp.sin, lambda x, fit: x + x**3 * fit, "pi/4"),
    "COS": (mp.cos, lambda x, fit: 1 - x**2 / 2 + x**4 * fit, "pi/4"),
    "ATAN": (mp.atan, lambda x, fit: x + x**3 * fit, "tan(pi/8)"),
    "ATANH": (mp.atanh, lambda x, fit: x + x**3 * fit, "tan(pi/8)**2"),
}


@pytest.mark.parametrize("name", FITTED)
def test_fits_are_closer_than_a_quarter_of_a_last_bit_over_their_interval(name: str) -> None:
    coefficients, _ = elementary.polynomials()[name]
    exact, assembled, last = FITTED[name]
    with mp.workdps(60):
        end = eval(last, {"pi": mp.pi, "tan": mp.tan})
        descending = [mp.mpf(c) for c in reversed(coefficients)]
        worst = max(
            abs(assembled(x, mp.polyval(descending, x * x)) / exact(x) - 1)
            for x in (end * k / 500 for k in range(1, 501))
        )
        assert worst < mp.mpf(2) ** -54


def test_half_pi_parts_sum_to_half_pi() -> None:
    with mp.workdps(60):
        assert abs(mp.fsum(elementary.half_pi_parts()) - mp.pi / 2) < mp.mpf("1e-35")


def test_the_first_half_pi_parts_leave_room_for_a_factor_of_20_bits() -> None:
    for part in elementary.half_pi_parts()[:2]:
        numerator, _ = part.as_integer_ratio()
        assert numerator.bit_length() + 20 <= 53
        assert all(k * part == mp.fmul(k, part, exact=True) for k in (2**20 - 1, 777_777, 3))
