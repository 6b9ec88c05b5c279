"""What an instrument measures of a platform, and how that follows its motion.

A target t is a point of the platform; seen from the base it is at p + R t. A motion of the platform
is a twist (ω, v): its turning and the velocity of its origin, in base axes. Unlike the rates of
α β γ it is regular at every orientation.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .frames import posed
from .rotation import rpy, skew


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
    """Derive the distance from a point of the base to one of the platform, less what a run adds."""
    f = Function(
        "measured_distance",
        "from a point of the base to one of the platform, less a constant",
        "‖p + R t - a‖ - z",
    )
    _, R, p = posed(f, "pose", "of the platform")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    anchor = f.vector("anchor", 3, "a, in base axes [mm]")
    (zero,) = f.vector(
        "zero", 1, "z, the zero of a relative reading or the radius of a sphere [mm]"
    )
    lever = f.let("lever", R * target, "R t")
    d = f.let("d", p + lever - anchor, "d = p + R t - a")
    distance = f.let("rho", sp.sqrt(d.dot(d)), "ρ = ‖d‖")
    by_point = f.let("u", d / distance, "u = ∂ρ/∂d")
    f.output("distance", distance - zero, "ρ - z [mm]")
    f.output("by_twist", by_point.T * _carried(lever), "u · (v + ω × R t) by (ω, v)")
    f.output("by_target", by_point.T * R, "∂ρ/∂t")
    f.output("by_anchor", -by_point, "∂ρ/∂a")
    return f


def between() -> Function:
    """Derive the distance between two places of one point of the platform."""
    f = Function(
        "measured_between",
        "between two places of one point of the platform",
        "‖p₂ + R₂ t - p₁ - R₁ t‖",
    )
    _, R1, p1 = posed(f, "pose", "of the platform, first")
    _, R2, p2 = posed(f, "other", "of the platform, then")
    target = f.vector("target", 3, "t, in platform axes [mm]")
    first, then = f.let("lever", R1 * target, "R₁ t"), f.let("reach", R2 * target, "R₂ t")
    d = f.let("d", p2 + then - p1 - first, "d = p₂ + R₂ t - p₁ - R₁ t")
    distance = f.let("rho", sp.sqrt(d.dot(d)), "ρ = ‖d‖")
    by_point = f.let("u", d / distance, "u = ∂ρ/∂d")
    f.output("distance", distance, "ρ [mm]")
    f.output("by_twist", -by_point.T * _carried(first), "-u · (v + ω × R₁ t) by (ω, v), first")
    f.output("by_other", by_point.T * _carried(then), "u · (v + ω × R₂ t) by (ω, v), then")
    f.output("by_target", by_point.T * (R2 - R1), "∂ρ/∂t")
    return f


def touched() -> Function:
    """Derive a point of the base as an artefact has it, which it lies on where some of it is 0."""
    f = Function("touched_point", "a point of the base in the axes of an artefact", "Raᵀ (x - pa)")
    artefact, R, p = posed(f, "artefact", "of the artefact, in the base")
    x = f.vector("x", 3, "in base axes [mm]")
    inside = R.T * (x - p)
    f.output("inside", inside, "in the artefact's axes [mm]")
    f.output("by_artefact", f.gradient(inside, artefact), "∂inside/∂artefact, 3 x 6 row by row")
    f.output("by_point", R.T, "∂inside/∂x, 3 x 3 row by row")
    return f


def tilt() -> Function:
    """Derive the two angles that an inclinometer on the platform reads."""
    f = Function(
        "measured_tilt",
        "how far the x and y axes of a sensor on the platform point up",
        "atan2(s_i, √(1 - s_i²)), i = x, y;  s = (R Rm)ᵀ up",
    )
    _, R, _ = posed(f, "pose", "of the platform")
    mounting = f.vector("mounting", 3, "α β γ of the sensor on the platform [rad]")
    for i, angle in enumerate("abg"):
        f.sincos(f"mounting_{angle}", mounting[i])
    Rm = f.let("Rm", rpy(*mounting).xreplace(f.known))
    up = f.vector("up", 3, "the vertical, of length one, in base axes")
    level = f.let("level", R.T * up, "the vertical in platform axes")
    s = f.let("s", Rm.T * level, "the vertical in the sensor's axes")
    across = [f.let("cx", sp.sqrt(s[1] ** 2 + s[2] ** 2), "cosines"),
              f.let("cy", sp.sqrt(s[0] ** 2 + s[2] ** 2))]  # fmt: skip
    angles = [f.angle(f"tilt_{n}", s[i], across[i]) for i, n in enumerate("xy")]
    axes = f.let("axes", R * Rm[:, :2], "x and y of the sensor in base axes")
    by_turn = [axes[:, i].cross(up).T / across[i] for i in (0, 1)]
    by_mounting = f.gradient(s, mounting)
    f.output("tilt", sp.Matrix(angles), "[rad]")
    f.output("by_turn", sp.Matrix.vstack(*by_turn), "by the turning ω, 2 x 3 row by row")
    f.output(
        "by_mounting",
        sp.Matrix.vstack(*(by_mounting[i, :] / across[i] for i in (0, 1))),
        "∂tilt/∂mounting, 2 x 3 row by row",
    )
    f.output(
        "by_up",
        sp.Matrix.vstack(*(axes[:, i].T / across[i] for i in (0, 1))),
        "∂tilt/∂up, of changes that keep its length, 2 x 3 row by row",
    )
    return f


def pixel() -> Function:
    """Derive where a camera sees a corner of a board, by five numbers of distortion."""
    f = Function(
        "measured_pixel",
        "where a camera sees a corner of a board; axes of the camera: x right, y down, z forward",
        "u = fx (x L + 2 p1 x y + p2 (r² + 2 x²)) + cx, L = 1 + k1 r² + k2 r⁴ + k3 r⁶, "
        "(x, y) = p / p_z, p = pb + Rb (1 + s) X",
    )
    _, R, origin = posed(f, "board", "of the board, as the camera has it")
    corner = f.vector("corner", 3, "X, in axes of the board [mm]")
    lens = f.vector("lens", 9, "fx fy cx cy [px], k1 k2 p1 p2 k3")
    size = f.scalar("size", "s, by which the board is larger than stated")
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    arm = f.let("arm", R * corner, "Rb X")
    p = f.let("p", origin + (1 + size) * arm, "the corner, from the camera")
    x, y = f.let("x", p[0] / p[2]), f.let("y", p[1] / p[2])
    r2 = f.let("r2", x**2 + y**2, "r²")
    L = f.let("L", 1 + r2 * (k1 + r2 * (k2 + r2 * k3)))
    bent = [
        f.let("bent_x", x * L + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)),
        f.let("bent_y", y * L + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y),
    ]
    seen = sp.Matrix([fx * bent[0] + cx, fy * bent[1] + cy])
    by_point = f.let("by_p", f.gradient(seen, p), "∂(u, v)/∂p")
    f.output("seen", seen, "u, v; (0, 0) is the centre of the first pixel [px]")
    f.output(
        "by_twist",
        by_point * sp.Matrix.hstack(-skew(p), sp.eye(3)),
        "v + ω × p by the board's turning and velocity at the camera, 2 x 6 row by row",
    )
    f.output("by_lens", f.gradient(seen, lens), "∂(u, v)/∂lens, 2 x 9 row by row")
    f.output("by_size", by_point * arm, "∂(u, v)/∂s")
    f.output("depth", p[2], "p_z; what is not before the camera is not seen [mm]")
    return f


def functions() -> list[Function]:
    """The emitted functions of what is measured."""
    return [point(), seen(), distance(), between(), touched(), tilt(), pixel()]
