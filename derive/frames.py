"""Base and tool frames: poses composed, inverted, and how their rates follow.

A pose T = (R, p) in the user's frames is T = B T_machine C, with B the machine's base frame in the
user's and C the tool in the platform's own frame.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .posemaps import euler_rate_matrix
from .rotation import rpy, rpy_angles, skew


def posed(f: Function, name: str, doc: str) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """Declare a pose and name its R and p; returns all three."""
    pose = f.vector(name, 6, f"{doc}: x y z [mm], α β γ [rad]")
    for i, angle in enumerate("abg"):
        f.sincos(f"{name}_{angle}", pose[3 + i])
    R = f.let(f"{name}_R", rpy(*pose[3:]).xreplace(f.known))
    return pose, R, sp.Matrix(pose[:3])


def _give(f: Function, R: sp.Matrix, p: sp.Matrix) -> None:
    f.output("pose", sp.Matrix([*p, *rpy_angles(f, R)]), "x y z [mm], α β γ [rad]")


def compose() -> Function:
    """Derive one pose after another."""
    f = Function("pose_compose", "one pose after another", "T = A B: R = Ra Rb, p = pa + Ra pb")
    _, Ra, pa = posed(f, "a", "first")
    _, Rb, pb = posed(f, "b", "second")
    _give(f, Ra * Rb, pa + Ra * pb)
    return f


def invert() -> Function:
    """Derive the inverse of a pose."""
    f = Function("pose_invert", "the inverse of a pose", "T⁻¹: Rᵀ, -Rᵀ p")
    _, R, p = posed(f, "a", "pose")
    _give(f, R.T, -(R.T * p))
    return f


def rates() -> Function:
    """Derive the rates of A T C by those of T."""
    f = Function(
        "pose_compose_rates",
        "rates of A T C by those of T, all as x y z α β γ",
        "ω' = A ω, v' = A (v + ω × R c);  ω = E (α̇, β̇, γ̇)",
    )
    _, Ra, _ = posed(f, "a", "A")
    _, R, _ = posed(f, "b", "T")
    pose = f.vector("c", 6, "C; only its origin matters")
    moved = f.vector("d", 6, "A T C")
    arm = f.let("arm", R * sp.Matrix(pose[:3]), "R c")
    known = f.known
    E = euler_rate_matrix(known[sp.sin(sp.Symbol("b[4]", real=True))],
                          known[sp.cos(sp.Symbol("b[4]", real=True))],
                          known[sp.sin(sp.Symbol("b[5]", real=True))],
                          known[sp.cos(sp.Symbol("b[5]", real=True))])  # fmt: skip
    spin = f.let("spin", Ra * E, "ω' by the angles of T")
    sb, cb = f.sincos("d_b", moved[4])
    sg, cg = f.sincos("d_g", moved[5])
    inverse = sp.simplify(euler_rate_matrix(sb, cb, sg, cg).inv())
    inverse = inverse.applyfunc(lambda e: sp.simplify(e.subs({sb**2: 1 - cb**2, sg**2: 1 - cg**2})))
    tangent, secant = f.let("tangent", sb / cb), f.let("secant", 1 / cb)
    inverse = inverse.applyfunc(lambda e: sp.expand(e).subs(sb / cb, tangent).subs(1 / cb, secant))
    angles = inverse * spin
    along = -(Ra * skew(arm) * E)
    matrix = sp.Matrix.vstack(sp.Matrix.hstack(Ra, along), sp.Matrix.hstack(sp.zeros(3, 3), angles))
    f.output("rates", matrix, "6 x 6, row by row")
    return f


def twists() -> Function:
    """Derive the twist of A T C by that of T."""
    f = Function(
        "pose_compose_twists",
        "the twist (ω, v) of A T C by that of T, each of its own origin and in its own base axes",
        "ω' = A ω, v' = A (v + ω × R c)",
    )
    _, Ra, _ = posed(f, "a", "A")
    _, R, _ = posed(f, "b", "T")
    pose = f.vector("c", 6, "C; only its origin matters")
    arm = f.let("arm", R * sp.Matrix(pose[:3]), "R c")
    matrix = sp.Matrix.vstack(
        sp.Matrix.hstack(Ra, sp.zeros(3, 3)), sp.Matrix.hstack(-(Ra * skew(arm)), Ra)
    )
    f.output("twists", matrix, "6 x 6, row by row")
    return f


def functions() -> list[Function]:
    """The emitted functions of frames."""
    return [compose(), invert(), rates(), twists()]
