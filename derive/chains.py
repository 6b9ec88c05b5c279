"""Limbs as chains of joints: what their ends miss, and how these follow the joints.

A limb is a product of exponentials with joint errors (`screws`); it ends on the platform, whose
frame it has at (C, c) while the platform has it at (R, p). The rows are what is between the two,
and the columns hybrid twists: the turning, and the velocity of the limb's own end.

Where limbs cannot close, joints yield, and the pose depends on how rows and columns turn as well: a
column x pairs with a wrench u as x·u, and what a joint moves behind it turns and shifts rigidly.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .rotation import axial, skew


def _closure() -> Function:
    f = Function(
        "chain_closure",
        "what a limb's end misses the platform by",
        "r = (λ vee(C Rᵀ), c - p),  vee(D) = ½ (D32 - D23, D13 - D31, D21 - D12)",
    )
    C = f.matrix("C", "platform's axes as the limb has them")
    c = f.vector("c", 3, "its origin [mm]")
    R, p = f.matrix("R", "platform to base, row by row"), f.vector("p", 3, "its origin [mm]")
    D = C * R.T
    half = f.let("half", f.scalar("length", "λ [mm]") / 2)
    f.output("r", sp.Matrix([*(half * axial(D)), *(c - p)]), "[mm]")
    return f


def _ball() -> Function:
    f = Function(
        "chain_ball",
        "what a limb that ends in a ball misses the platform's joint by, and that joint's lever",
        "r = c - p - R b;  ∂(p + R b) = v - (R b) × ω",
    )
    R, p = f.matrix("R", "platform to base, row by row"), f.vector("p", 3, "its origin [mm]")
    b, c = f.vector("b", 3, "joint on the platform [mm]"), f.vector("c", 3, "end of the limb [mm]")
    arm = f.let("arm", R * b, "R b")
    f.output("r", c - p - arm, "[mm]")
    f.output("lever", arm, "R b [mm]")
    return f


def _turn() -> Function:
    f = Function(
        "chain_turn",
        "hybrid twist of a turn about an axis through `at`, of the limb's end c",
        "v = ω × (c - at)",
    )
    w, at = f.vector("w", 3, "ω, base axes"), f.vector("at", 3, "on the axis [mm]")
    c = f.vector("c", 3, "end of the limb [mm]")
    f.output("v", w.cross(c - at), "velocity of the end")
    return f


def _turned() -> Function:
    f = Function(
        "chain_turned",
        "how a limb's vee follows turns of its end and of the platform, per arc",
        "∂vee([ω] C Rᵀ), ∂vee(C Rᵀ [ω]ᵀ) by ω",
    )
    C = f.matrix("C", "platform's axes as the limb has them")
    R = f.matrix("R", "platform to base, row by row")
    w = f.perturbation("w", 3)
    D = f.let("D", C * R.T)
    for name, product, doc in (
        ("by_end", skew(w) * D, "by the limb's end, row by row"),
        ("by_platform", D * skew(w).T, "by the platform"),
    ):
        f.output(name, (axial(product) / 2).jacobian(w), doc)
    return f


def _pairing() -> Function:
    f = Function(
        "chain_pairing",
        "how x·u of a joint's column x follows what moves the joint and the end",
        "∂(x·u) = ω·by_turn where joint and end turn with ω, v·by_shift where the end alone moves",
    )
    x = f.vector("x", 6, "column: turning as arc, velocity of the end")
    u = f.vector("u", 6, "wrench")
    inverse = 1 / f.scalar("length", "λ [mm]")
    w, v = f.perturbation("w", 3), f.perturbation("v", 3)
    carried = sp.Matrix([*w.cross(x[:3, :]), *w.cross(x[3:, :])])
    lifted = sp.Matrix([0, 0, 0, *(inverse * x[:3, :].cross(v))])
    f.output("by_turn", sp.Matrix([carried.dot(u)]).jacobian(w), "by ω")
    f.output("by_shift", sp.Matrix([lifted.dot(u)]).jacobian(v), "by v")
    return f


def _bend() -> Function:
    f = Function(
        "chain_bend",
        "how what a joint yields to a wrench u follows its lever d to the end, both as arcs",
        "K u = (t, t × d + f), t = m + d × f, of u = (m, f): ∂(K u) as d changes by δ",
    )
    d, change = f.vector("d", 3, "lever over λ"), f.vector("change", 3, "δ")
    u = f.vector("u", 6, "wrench (m, f)")
    at = f.perturbation("t", 1)
    lever = d + at[0] * change
    turned = u[:3, :] + lever.cross(u[3:, :])
    yielded = sp.Matrix([*turned, *(turned.cross(lever) + u[3:, :])])
    f.output("bent", yielded.jacobian(at), "∂(K u)")
    return f


def functions() -> list[Function]:
    """The emitted functions of chains."""
    return [_closure(), _ball(), _turn(), _turned(), _pairing(), _bend()]
