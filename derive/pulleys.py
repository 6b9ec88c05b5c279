"""Cables whose length is none between two points, by where they end.

Over a swivelling pulley: its length, and how the pulley stands. The cable runs along the swivel
axis k onto the pulley at the entry point A, which is on the axis, follows the groove of radius r
and leaves it along the tangent to its end D. The pulley turns about k until D is in its plane.

Over several points: each part of it is straight.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .rotation import rot_x, rot_y


def pulley() -> Function:
    """Derive the length from A to D and the swivel angle, with their derivatives."""
    f = Function(
        "pulley",
        "a cable over a swivelling pulley, from its entry point A to its end D",
        "D - A = x u + y k,  f = √((x - r)² + y² - r²),  wrapped = 2 atan2(x, y + f)\n"
        "l = r wrapped + f,  swivel = atan2(e2·(D - A), e1·(D - A)),  (e1, e2, k) = F Rx Ry",
    )
    own = f.named("own", "012", "radius [mm], two tilts of the swivel axis [rad]")
    r, tilt1, tilt2 = own
    F = f.matrix("F", "frame of the swivel axis, its third column, row by row")
    h = f.vector("h", 3, "D - A [mm]")
    s1, c1 = f.sincos("1", tilt1)
    s2, c2 = f.sincos("2", tilt2)
    axes = f.let("axes", F * rot_x(c1, s1) * rot_y(c2, s2))
    across1, across2 = f.let("a", axes.col(0).dot(h)), f.let("b", axes.col(1).dot(h))
    x = f.let("x", sp.sqrt(across1**2 + across2**2), "from the axis")
    y = f.let("y", axes.col(2).dot(h), "along it")
    free = f.let("free", sp.sqrt((x - r) ** 2 + y**2 - r**2), "the straight part")
    rise = f.let("rise", y + free)
    half = f.angle("half", x, rise, "half of the wrapped angle")
    length = f.let("length", 2 * r * half + free)
    pull = f.let("pull", f.gradient(length, h).T, "∂l/∂D: the direction of the straight part")
    # turned about A the pulley carries the groove along, in its plane the straight part turns alone
    u = f.let("u", (across1 * axes.col(0) + across2 * axes.col(1)) / x, "from the axis to D")
    n = f.let("n", axes.col(2).cross(u), "normal to the plane of the groove")
    beside = f.let("beside", n.cross(pull), "in the plane, across the straight part")
    bend = n * n.T * (pull.dot(u) / x) + beside * beside.T / free
    swivel = f.angle("swivel", across2, across1)
    f.output("l", length, "l [mm]")
    f.output("by_joint", pull, "∂l/∂D")
    f.output("by_own", f.gradient(length, own).T, "∂l/∂(radius, tilts)")
    f.output("bend", bend, "∂²l/∂D², 3 x 3")
    f.output("turned", swivel, "swivel angle [rad]")
    f.output("turned_by_joint", f.gradient(swivel, h).T, "∂swivel/∂D")
    f.output("turned_by_own", f.gradient(swivel, own).T, "∂swivel/∂(radius, tilts)")
    return f


def strand() -> Function:
    """Derive the length of a straight part from a point P, with its derivatives."""
    f = Function(
        "strand",
        "a straight part of a cable, from a point P to its end D",
        "l = ‖D - P‖",
    )
    h = f.vector("h", 3, "D - P [mm]")
    length = f.let("length", sp.sqrt(h.dot(h)))
    pull = f.let("pull", h / length, "its direction")
    f.output("l", length, "l [mm]")
    f.output("by_joint", pull, "∂l/∂D")
    f.output("bend", (sp.eye(3) - pull * pull.T) / length, "∂²l/∂D², 3 x 3")
    return f


def functions() -> list[Function]:
    """The emitted functions of cables."""
    return [pulley(), strand()]
