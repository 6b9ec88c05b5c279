"""Velocity and acceleration along a path: of the actuators, of the closures, of the platform.

A path of the platform is its frame (R, p) with the twist (ω, v) and the twist's derivative (ω̇, v̇);
a joint follows as h(t) = p + R b - base, and everything else by differentiating by t.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .limb_functions import directions
from .limbs import CONSTRAINTS, DRIVERS, Constraint, Driver
from .posemaps import MAPS, PoseMap, euler_rate_matrix, on_manifold, tangent
from .rotation import skew

T = sp.Symbol("t", real=True)


def _at_start(f: Function, value: sp.Expr, order: int = 0) -> sp.Expr:
    """A derivative of a path by t, at t = 0."""
    return sp.diff(value, T, order).subs(T, 0).doit().xreplace(f.known)


def _path(f: Function, name: str, what: str) -> sp.Matrix:
    """Declare a vector with its first and second derivative; returns its path."""
    zero, first, second = (
        f.vector(name + order, 3, doc)
        for order, doc in (("", what), ("1", "its velocity [/s]"), ("2", "its acceleration [/s²]"))
    )
    path: sp.Matrix = zero + first * T + second * T**2 / 2
    return path


def _limb_path(f: Function, driver: Driver, drive: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    """d(t) and ρ(t), up to a constant, of a limb whose joint and actuator move."""
    h = _path(f, "h", "p + R b - base [mm]")
    first, second = directions(f)

    def sincos(angle: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        f.sincos("q", angle.subs(T, 0))  # those at the start are known
        return sp.sin(angle), sp.cos(angle)

    rho = drive if driver.stretches else sp.S.Zero  # a rod's length stays
    return h - driver.moved(drive, first, second, sincos), rho


def _joint_path(driver: Driver) -> Function:
    """From the anchor to the joint, and its derivatives by time, for the rows beside the sphere."""
    f = Function(
        f"{driver.name}_path",
        f"{driver.name}: from the anchor to the joint as joint and actuator move",
        f"d, ḋ, d̈ of d = p + R b - c,  {driver.formula}",
    )
    qt, qt1, qt2 = _moved_drive(f)
    path, _ = _limb_path(f, driver, qt + qt1 * T + qt2 * T**2 / 2)
    for k, name in enumerate(("d", "d1", "d2")):
        f.output(name, path.applyfunc(lambda e, k=k: _at_start(f, e, k)), "[mm, /s, /s²]")
    return f


def _moved_drive(f: Function) -> list[sp.Symbol]:
    docs = (("qt", "q̃ [mm or rad]"), ("qt1", "dq̃/dt [/s]"), ("qt2", "d²q̃/dt² [/s²]"))
    return [f.scalar(name, doc) for name, doc in docs]


def _rates(driver: Driver) -> Function:
    """q̃'s velocity and acceleration: the closure, differentiated twice along a path h(t)."""
    f = Function(
        f"{driver.name}_rates",
        f"{driver.name}: velocity and acceleration of q̃ as the joint moves",
        "Φ(h(t), q̃(t)) = 0 differentiated twice by t, solved for dq̃/dt and d²q̃/dt²",
    )
    qt = f.scalar("qt", "q̃ [mm or rad]")
    speed = sp.Symbol("speed", real=True)
    path, rho = _limb_path(f, driver, qt + speed * T)

    # Φ = (d·d - ρ²)/2, its derivatives by t with dq̃/dt as it turns out and no d²q̃/dt²
    d = f.let("d", path.applyfunc(lambda e: _at_start(f, e)), "from the anchor to the joint")
    slope = d.dot(path.applyfunc(lambda e: _at_start(f, e, 1))) - qt * _at_start(f, rho, 1)
    by_q = f.let("by_q", sp.diff(slope, speed), "∂Φ/∂q̃")
    qt1 = f.let("speed", -slope.subs(speed, 0) / by_q, "dq̃/dt")
    d1, d2 = (
        f.let(name, path.applyfunc(lambda e, k=k: _at_start(f, e, k)).subs(speed, qt1), doc)
        for k, name, doc in ((1, "velocity", "of d"), (2, "bend", "d̈ without d²q̃/dt²"))
    )
    left = d1.dot(d1) + d.dot(d2) - _at_start(f, rho, 1).subs(speed, qt1) ** 2
    f.output("qt1", qt1, "dq̃/dt [mm/s or rad/s]")
    f.output("qt2", -left / by_q, "d²q̃/dt² [mm/s² or rad/s²]")
    return f


def _sphere_bend(driver: Driver) -> Function:
    """d²Φ/dt² of the sphere row along given motions of joint and actuator."""
    f = Function(
        f"{driver.name}_bend",
        f"{driver.name}: how the sphere row bends as joint and actuator move",
        f"d²Φ/dt²,  Φ = (d·d - ρ²)/2,  {driver.formula}",
    )
    qt, qt1, qt2 = _moved_drive(f)
    path, rho = _limb_path(f, driver, qt + qt1 * T + qt2 * T**2 / 2)
    d, d1, d2 = (
        f.let(name, path.applyfunc(lambda e, k=k: _at_start(f, e, k)))
        for k, name in enumerate(("d", "velocity", "acceleration"))
    )
    of_length = _at_start(f, rho, 1) ** 2 + _at_start(f, rho) * _at_start(f, rho, 2)
    f.output("phi2", d1.dot(d1) + d.dot(d2) - of_length, "d²Φ/dt² [mm²/s²]")
    return f


def _constraint_bend(row: Constraint) -> Function:
    """d²Φ/dt² of a constraint row along given motions of joint and platform-side axis."""
    f = Function(
        f"{row.name}_bend",
        f"{row.name}: how the row bends along a path",
        f"d²Φ/dt²,  {row.formula}",
    )
    d = _path(f, "h", "p + R b - c [mm]")
    n = f.vector("n", 3, "base-side axis, base frame")
    a = _path(f, "a", "platform-side axis, base frame")
    lever = f.scalar("lever", "λ [mm]")
    f.output("phi2", _at_start(f, row.phi(d, n, a, lever), 2), "d²Φ/dt² [mm/s²]")
    return f


def _map_bend(pose_map: PoseMap) -> Function:
    """The twist's derivative on the path state ⊕ δ t, whose step stays δ."""
    f = Function(
        f"map_{pose_map.name}_bend",
        f"{pose_map.name}: rate of the twist on the path state ⊕ δ t",
        "(ω̇, v̇) at t = 0",
    )
    s = f.vector("state", pose_map.state_size, "of the map")
    delta = f.vector("delta", pose_map.m, "step a second [mm/s, rad/s]")
    d_p, d_omega, d_state = tangent(pose_map, s)
    twist = sp.Matrix([*(d_omega * delta), *(d_p * delta)])
    rate = (twist.jacobian(s) * d_state * delta).applyfunc(
        lambda e: on_manifold(pose_map, e, s) if e else e
    )
    f.output("twist_rate", rate, "(ω̇, v̇), base axes")
    return f


def _frame_motion() -> Function:
    """The homogeneous matrix of a frame with its derivatives by time, from those of its twist."""
    f = Function(
        "frame_motion",
        "a frame's first three rows with their first and second derivative by time",
        "dR/dt = [ω] R,  d²R/dt² = ([ω̇] + [ω]²) R",
    )
    R, p = f.matrix("R", "platform to base, row by row"), f.vector("p", 3, "origin [mm]")
    twist, rate = f.vector("twist", 6, "(ω, v)"), f.vector("twist_rate", 6, "(ω̇, v̇)")
    spin = skew(sp.Matrix(twist[:3]))
    R1 = f.let("turn", spin * R, "[ω] R")
    R2 = skew(sp.Matrix(rate[:3])) * R + spin * R1
    for name, turned, moved in (("T", R, p), ("T1", R1, twist[3:]), ("T2", R2, rate[3:])):
        f.output(name, turned.row_join(sp.Matrix(moved)), "3 x 4, row by row")
    return f


def _pose_rates() -> Function:
    """The six numbers of a pose along a path, their first and second derivative."""
    f = Function(
        "pose_rates",
        "velocity and acceleration of x y z α β γ from those of the platform",
        "ω = E (α̇, β̇, γ̇), and differentiated once more",
    )
    pose = f.vector("pose", 6, "x y z [mm], α β γ [rad]")
    twist, rate = f.vector("twist", 6, "(ω, v)"), f.vector("twist_rate", 6, "(ω̇, v̇)")
    sb, cb = f.sincos("b", pose[4])
    sg, cg = f.sincos("g", pose[5])
    inverse = euler_rate_matrix(sb, cb, sg, cg).inv()
    inverse = inverse.applyfunc(lambda e: sp.simplify(e.subs(sg**2, 1 - cg**2)))
    inverse = f.let("inverse", inverse, "E⁻¹")
    angles = f.let("angles", inverse * sp.Matrix(twist[:3]), "(α̇, β̇, γ̇)")
    beta, gamma = pose[4], pose[5]
    E = euler_rate_matrix(sp.sin(beta), sp.cos(beta), sp.sin(gamma), sp.cos(gamma))
    E1 = (E.diff(beta) * angles[1] + E.diff(gamma) * angles[2]).xreplace(f.known)
    left = f.let("left", sp.Matrix(rate[:3]) - E1 * angles, "ω̇ - Ė (α̇, β̇, γ̇)")
    f.output("velocity", sp.Matrix([*twist[3:], *angles]), "of the pose")
    f.output("acceleration", sp.Matrix([*rate[3:], *(inverse * left)]), "of the pose")
    return f


def functions() -> list[Function]:
    """The emitted functions of paths."""
    made = [step(driver) for step in (_rates, _sphere_bend, _joint_path) for driver in DRIVERS]
    made += [_constraint_bend(row) for row in CONSTRAINTS]
    return [*made, *(_map_bend(pose_map) for pose_map in MAPS), _frame_motion(), _pose_rates()]
