"""What an instrument measures of a platform, and how that follows its motion.

A target t is a point of the platform; seen from the base it is at p + R t. A motion of the platform
is a twist (ω, v): its turning and the velocity of its origin, in base axes. Unlike the rates of
α β γ it is regular at every orientation.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .frames import posed
from .rotation import skew


def point() -> Function:
    """Derive a point that the platform carries."""
    f = Function("measured_point", "a point that the platform carries", "p + R t")
    _, R, p = posed(f, "pose", "of the platform")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    lever = f.let("lever", R * target, "R t")
    f.output("point", p + lever, "in base axes [mm]")
    f.output("by_twist", _carried(lever), "v + ω × R t by (ω, v), 3 x 6 row by row")
    f.output("by_target", R, "∂point/∂t, 3 x 3 row by row")
    return f


def _carried(lever: sp.Matrix) -> sp.Matrix:
    """Velocity by (ω, v) of a point that is `lever` from the platform's origin."""
    return sp.Matrix.hstack(-skew(lever), sp.eye(3))


def seen() -> Function:
    """Derive a point of the base as an instrument has it."""
    f = Function("seen_point", "a point of the base in the frame of an instrument", "pf + Rf x")
    frame, R, p = posed(f, "frame", "of the base, as the instrument has it")
    x = f.vector("x", 3, "in base axes [mm]")
    inside = p + R * x
    f.output("seen", inside, "in the instrument's axes [mm]")
    f.output("by_frame", f.gradient(inside, frame), "∂seen/∂frame, 3 x 6 row by row")
    f.output("by_point", R, "∂seen/∂x, 3 x 3 row by row")
    return f


def distance() -> Function:
    """Derive the distance from a point of the base to one of the platform."""
    f = Function(
        "measured_distance", "from a point of the base to one of the platform", "‖p + R t - a‖"
    )
    _, R, p = posed(f, "pose", "of the platform")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    anchor = f.vector("anchor", 3, "a, in base axes [mm]")
    lever = f.let("lever", R * target, "R t")
    d = f.let("d", p + lever - anchor, "d = p + R t - a")
    distance = f.let("rho", sp.sqrt(d.dot(d)), "ρ = ‖d‖")
    by_point = f.let("u", d / distance, "u = ∂ρ/∂d")
    f.output("distance", distance, "ρ [mm]")
    f.output("by_twist", by_point.T * _carried(lever), "u · (v + ω × R t) by (ω, v)")
    f.output("by_target", by_point.T * R, "∂ρ/∂t")
    f.output("by_anchor", -by_point, "∂ρ/∂a")
    return f


def functions() -> list[Function]:
    """The emitted functions of what is measured."""
    return [point(), seen(), distance()]
