"""Limbs as chains of joints: what their ends miss, and how these follow the joints.

A limb is a product of exponentials with joint errors (`screws`); it ends on the platform, whose
frame it has at (C, c) while the platform has it at (R, p). The rows are what is between the two,
and the columns hybrid twists: the turning, and the velocity of the limb's own end.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .rotation import axial


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


def functions() -> list[Function]:
    """The emitted functions of chains."""
    return [_closure(), _ball(), _turn()]
