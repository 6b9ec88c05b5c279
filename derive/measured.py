"""What an instrument measures of a platform: a point that it carries, and how far that is away.

A target t is a point of the platform; seen from the base it is at p + R t. The same formula gives a
point of the base in the frame of the instrument.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .frames import posed


def _point() -> Function:
    f = Function("measured_point", "a point that the platform carries", "p + R t")
    pose, R, p = posed(f, "pose", "of the platform")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    point = p + R * target
    f.output("point", point, "in base axes [mm]")
    f.output("by_pose", f.gradient(point, pose), "∂point/∂pose, 3 x 6 row by row")
    f.output("by_target", f.gradient(point, target), "∂point/∂t, 3 x 3 row by row")
    return f


def _distance() -> Function:
    f = Function(
        "measured_distance", "from a point of the base to one of the platform", "‖p + R t - a‖"
    )
    pose, R, p = posed(f, "pose", "of the platform")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    anchor = f.vector("anchor", 3, "a, in base axes [mm]")
    d = f.let("d", p + R * target - anchor, "d = p + R t - a")
    distance = f.let("rho", sp.sqrt(d.dot(d)), "ρ = ‖d‖")
    f.output("distance", distance, "ρ [mm]")
    f.output("by_pose", f.gradient(distance, pose), "∂ρ/∂pose")
    f.output("by_target", f.gradient(distance, target), "∂ρ/∂t")
    f.output("by_anchor", f.gradient(distance, anchor), "∂ρ/∂a")
    return f


def functions() -> list[Function]:
    """The emitted functions of what is measured."""
    return [_point(), _distance()]
