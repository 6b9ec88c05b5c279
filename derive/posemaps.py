"""Pose maps: the m free coordinates of a machine and the frame (R, p) they stand for.

A map iterates on a `state` (no Euler angles, so no singular orientation inside Newton) by steps
`delta`, m numbers, mm and rad. Each map is nine functions of the state, all derived here from one
definition: the state's frame, its retraction, and the pose it reports.

* ``from_pose``  pose -> state
* ``frame``      state -> R, p
* ``retract``    state, delta -> state
* ``tidy``       state, off its manifold by rounding -> state
* ``angles``     state -> α β γ, the reported orientation
* ``pull``       covector of a twist at the state -> covector of delta
* ``rates``      delta -> rates of the pose x y z α β γ
* ``twist``      delta -> (ω, v) of the frame
* ``velocity``   delta -> rates of the state
* ``free``       covector of delta -> covector of the reported free coordinates
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from .emit import Function
from .rotation import quaternion_matrix, quaternion_product, rot_x, rot_y, rot_z, rpy, rpy_angles

POSE = ("x", "y", "z", "alpha", "beta", "gamma")


@dataclass(frozen=True)
class PoseMap:
    """A pose map: its states, its steps, and how they act."""

    name: str
    title: str
    state_size: int
    free: tuple[str, ...]
    from_pose: Callable[[Function, sp.Matrix], sp.Matrix]
    frame: Callable[[sp.Matrix], tuple[sp.Matrix, sp.Matrix]]
    retract: Callable[[Function, sp.Matrix, sp.Matrix], sp.Matrix]
    angles: Callable[[Function, sp.Matrix], sp.Matrix]
    quaternion: int | None = None  # where a unit quaternion of R begins in the state

    @property
    def m(self) -> int:
        """Number of free coordinates."""
        return len(self.free)

    @property
    def lengths(self) -> int:
        """How many of them are lengths: they come before the angles."""
        return sum(each in POSE[:3] for each in self.free)


def to_unit(f: Function, square: sp.Expr, name: str) -> sp.Expr:
    """1/√square by its series about 1: no root, no division, and exact once steps have died out.

    Steps of 0.5 rad leave 2e-7 of a quaternion and 2e-4 of a turned pair: the next step mends it.
    """
    e = sp.Symbol("e", real=True)
    series = sp.series(1 / sp.sqrt(1 + e), e, 0, 5).removeO()
    excess = f.let(f"e{name}", square - 1, "how far from unit length: 1/√(1 + e) by its series")
    return f.let(f"k{name}", sp.horner(series).subs(e, excess))


def turned(
    f: Function, c: sp.Expr, s: sp.Expr, step: sp.Expr, name: str
) -> tuple[sp.Expr, sp.Expr]:
    """(cos, sin) turned by atan(step), and back on the unit circle whatever rounding did."""
    x, y = f.let(f"x{name}", c - step * s), f.let(f"y{name}", s + step * c)
    k = to_unit(f, x**2 + y**2, name)
    return x * k, y * k


def _spatial_from_pose(f: Function, pose: sp.Matrix) -> sp.Matrix:
    sa, ca = f.sincos("a", pose[3] / 2, "half angles")
    sb, cb = f.sincos("b", pose[4] / 2)
    sg, cg = f.sincos("g", pose[5] / 2)
    qx, qy, qz = (
        sp.Matrix([ca, sa, 0, 0]), sp.Matrix([cb, 0, sb, 0]), sp.Matrix([cg, 0, 0, sg])
    )  # fmt: skip
    q = quaternion_product(quaternion_product(qz, qy), qx)
    return sp.Matrix([*pose[:3], *q])


def _spatial_frame(s: sp.Matrix) -> tuple[sp.Matrix, sp.Matrix]:
    return quaternion_matrix(sp.Matrix(s[3:])), sp.Matrix(s[:3])


def _spatial_retract(f: Function, s: sp.Matrix, delta: sp.Matrix) -> sp.Matrix:
    step = sp.Matrix([1, *(delta[3:, 0] / 2)])
    q = f.let("q", quaternion_product(step, sp.Matrix(s[3:])), "(1, ω/2) q, then to unit length")
    k = to_unit(f, q.dot(q), "")
    return sp.Matrix([*(sp.Matrix(s[:3]) + delta[:3, 0]), *(q * k)])


SPATIAL = PoseMap(
    name="spatial",
    title="six free coordinates; state: p and the unit quaternion of R; step: (v, ω)",
    state_size=7,
    free=POSE,
    from_pose=_spatial_from_pose,
    frame=_spatial_frame,
    retract=_spatial_retract,
    angles=lambda f, s: rpy_angles(f, _spatial_frame(s)[0]),
    quaternion=3,
)

TRANSLATION = PoseMap(
    name="translation",
    title="x y z, R = 1; state: p; step: v",
    state_size=3,
    free=("x", "y", "z"),
    from_pose=lambda f, pose: sp.Matrix(pose[:3]),
    frame=lambda s: (sp.eye(3), s),
    retract=lambda f, s, delta: s + delta,
    angles=lambda f, s: sp.zeros(3, 1),
)


def _planar_from_pose(f: Function, pose: sp.Matrix) -> sp.Matrix:
    sg, cg = f.sincos("g", pose[5])
    return sp.Matrix([pose[0], pose[1], cg, sg])


PLANAR = PoseMap(
    name="planar",
    title="x y γ in the plane z = 0; state: x, y, cos γ, sin γ; step: (vx, vy, ωz)",
    state_size=4,
    free=("x", "y", "gamma"),
    from_pose=_planar_from_pose,
    frame=lambda s: (rot_z(s[2], s[3]), sp.Matrix([s[0], s[1], 0])),
    retract=lambda f, s, delta: sp.Matrix(
        [s[0] + delta[0], s[1] + delta[1], *turned(f, s[2], s[3], delta[2], "g")]
    ),
    angles=lambda f, s: sp.Matrix([0, 0, f.angle("gamma", s[3], s[2])]),
)


def _2tpr2tps_from_pose(f: Function, pose: sp.Matrix) -> sp.Matrix:
    sa, ca = f.sincos("a", pose[3])
    sb, cb = f.sincos("b", pose[4])
    return sp.Matrix([pose[1], pose[2] / cb, ca, sa, cb, sb])


def _2tpr2tps_frame(s: sp.Matrix) -> tuple[sp.Matrix, sp.Matrix]:
    y, w, ca, sa, cb, sb = s
    return rot_y(cb, sb) * rot_x(ca, sa), sp.Matrix([w * sb, y, w * cb])


TPR2TPS = PoseMap(
    name="2tpr2tps",
    title="y z α β with x = z tan β, γ = 0 (A eq. 7); state: y, w = z / cos β, cos and sin of α, β",
    state_size=6,
    free=("y", "z", "alpha", "beta"),
    from_pose=_2tpr2tps_from_pose,
    frame=_2tpr2tps_frame,
    retract=lambda f, s, delta: sp.Matrix(
        [
            s[0] + delta[0],
            s[1] + delta[1],
            *turned(f, s[2], s[3], delta[2], "a"),
            *turned(f, s[4], s[5], delta[3], "b"),
        ]
    ),
    angles=lambda f, s: sp.Matrix([f.angle("alpha", s[3], s[2]), f.angle("beta", s[5], s[4]), 0]),
)


def _spherical_retract(f: Function, s: sp.Matrix, delta: sp.Matrix) -> sp.Matrix:
    still = sp.zeros(3, 1)
    moved = _spatial_retract(f, still.col_join(s), still.col_join(delta))
    return sp.Matrix(moved[3:])


SPHERICAL = PoseMap(
    name="spherical",
    title="α β γ about the origin, p = 0; state: the unit quaternion of R; step: ω",
    state_size=4,
    free=("alpha", "beta", "gamma"),
    from_pose=lambda f, pose: sp.Matrix(_spatial_from_pose(f, pose)[3:]),
    frame=lambda s: (quaternion_matrix(s), sp.zeros(3, 1)),
    retract=_spherical_retract,
    angles=lambda f, s: rpy_angles(f, quaternion_matrix(s)),
    quaternion=0,
)

XY = PoseMap(
    name="xy",
    title="x y in the plane z = 0, R = 1; state: x, y; step: (vx, vy)",
    state_size=2,
    free=("x", "y"),
    from_pose=lambda f, pose: sp.Matrix(pose[:2]),
    frame=lambda s: (sp.eye(3), sp.Matrix([s[0], s[1], 0])),
    retract=lambda f, s, delta: s + delta,
    angles=lambda f, s: sp.zeros(3, 1),
)

MAPS = (SPATIAL, TRANSLATION, PLANAR, TPR2TPS, SPHERICAL, XY)


def tangent(pose_map: PoseMap, s: sp.Matrix) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """∂p/∂delta (3 x m), angular velocity per delta (3 x m), ∂state/∂delta, at delta = 0."""
    f = Function("tangent", "", "")
    delta = sp.Matrix(sp.symbols(f"delta0:{pose_map.m}", real=True))
    moved = f.written_out(pose_map.retract(f, s, delta))
    zero = dict.fromkeys(delta, 0)
    # the states are on their manifold: unit quaternion, cos² + sin² = 1
    d_state = moved.jacobian(delta).subs(zero).applyfunc(lambda e: on_manifold(pose_map, e, s))
    R, p = pose_map.frame(s)
    d_p = p.jacobian(s) * d_state
    omega = []
    for k in range(pose_map.m):
        d_R = sum((R.diff(x) * d_state[i, k] for i, x in enumerate(s)), sp.zeros(3, 3))
        spin = (d_R * R.T).applyfunc(lambda e: on_manifold(pose_map, e, s))
        omega.append([spin[2, 1], spin[0, 2], spin[1, 0]])
    return d_p, sp.Matrix(omega).T, d_state


def on_manifold(pose_map: PoseMap, expr: sp.Expr, s: sp.Matrix) -> sp.Expr:
    """Reduce modulo the state's constraints (unit quaternion, unit circles)."""
    if pose_map.quaternion is not None:
        w, x, y, z = (each**2 for each in s[pose_map.quaternion :])
        unit = [w + x + y + z]
        pairs = [(w, 1 - x - y - z)]
    else:
        circles = {"planar": [(2, 3)], "2tpr2tps": [(2, 3), (4, 5)]}.get(pose_map.name, [])
        unit = [s[i] ** 2 + s[j] ** 2 for i, j in circles]
        pairs = [(s[j] ** 2, 1 - s[i] ** 2) for i, j in circles]
    expr = sp.sympify(expr).subs(dict.fromkeys(unit, 1))
    for square, value in pairs:
        root = square.base
        numerator, denominator = sp.fraction(sp.together(expr))
        numerator = sp.rem(sp.expand(numerator), square - value, root)
        expr = sp.factor(sp.expand(numerator)) / denominator
    return sp.simplify(expr)


def functions() -> list[Function]:
    """The emitted functions of every pose map."""
    return [pose_frame(), *(f for pose_map in MAPS for f in _functions(pose_map))]


def _functions(pose_map: PoseMap) -> list[Function]:
    name = "map_" + pose_map.name
    size, m = pose_map.state_size, pose_map.m

    def new(suffix: str, what: str, formula: str) -> Function:
        return Function(f"{name}_{suffix}", f"{pose_map.name}: {what}", formula)

    from_pose = new("from_pose", "the state of a pose", pose_map.title)
    pose = from_pose.vector("pose", 6, "x y z [mm], α β γ [rad]")
    from_pose.output("state", pose_map.from_pose(from_pose, pose), "of the map")

    frame = new("frame", "the frame of a state", "R = Rz(γ) Ry(β) Rx(α) (eq. 1)")
    R, p = pose_map.frame(frame.vector("state", size, "of the map"))
    frame.output("R", R, "platform to base, row by row")
    frame.output("p", p, "platform origin [mm]")

    retract = new("retract", "the state moved by a step", "state ⊕ delta")
    s = retract.vector("state", size, "of the map")
    delta = retract.vector("delta", m, "step [mm, rad]")
    retract.output("moved", pose_map.retract(retract, s, delta), "the new state")

    tidy = new("tidy", "the state without what rounding added", "state ⊕ 0")
    s = tidy.vector("state", size, "of the map, nearly")
    tidy.output("moved", pose_map.retract(tidy, s, sp.zeros(m, 1)), "the state")

    angles = new("angles", "the reported orientation", "R = Rz(γ) Ry(β) Rx(α) (eq. 1)")
    s = angles.vector("state", size, "of the map")
    angles.output("angles", pose_map.angles(angles, s), "α β γ [rad]")

    pull = new("pull", "covector of a twist to covector of a step", "λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ")
    s = pull.vector("state", size, "of the map")
    w = pull.vector("omega", 3, "rotation part of the covector")
    v = pull.vector("v", 3, "translation part of the covector")
    d_p, d_omega, _ = tangent(pose_map, s)
    pull.output("row", d_omega.T * w + d_p.T * v, "covector of the step")

    rates = new("rates", "rates of the pose for a step", "d(x y z α β γ) = M delta")
    s = rates.vector("state", size, "of the map")
    delta = rates.vector("delta", m, "step [mm, rad]")
    d_p, d_omega, d_state = tangent(pose_map, s)
    rates.output("pose", _pose_rates(rates, pose_map, s, d_p, d_omega, d_state, delta), "rates")

    twist = new("twist", "twist of the frame for a step", "ω = ∂ω/∂δ δ, v = ∂p/∂δ δ")
    s = twist.vector("state", size, "of the map")
    delta = twist.vector("delta", m, "step [mm, rad]")
    twist.output("twist", sp.Matrix([*(d_omega * delta), *(d_p * delta)]), "(ω, v), base axes")

    velocity = new("velocity", "rates of the state for a step", "∂state/∂delta delta")
    s = velocity.vector("state", size, "of the map")
    delta = velocity.vector("delta", m, "step [mm, rad]")
    velocity.output("rate", tangent(pose_map, s)[2] * delta, "rates of the state")

    free = new("free", "covector of a step to one of the free coordinates", "∂/∂free")
    s = free.vector("state", size, "of the map")
    row = free.vector("row", m, "covector of the step")
    free.output("out", _free(free, pose_map, s, row), "by " + " ".join(pose_map.free))
    return [from_pose, frame, retract, tidy, angles, pull, rates, twist, velocity, free]


def _euler(f: Function, pose_map: PoseMap, s: sp.Matrix) -> tuple[sp.Expr, ...]:
    """The sine and cosine of β and γ from the state, for the Euler rates of the spatial map."""
    R, _ = pose_map.frame(s)
    sb = f.let("sb", -R[2, 0], "sin β, cos β, and γ, from R")
    r00, r10 = f.let("r00", R[0, 0]), f.let("r10", R[1, 0])
    cb = f.let("cb", sp.sqrt(r00**2 + r10**2))
    return sb, cb, f.let("sg", r10 / cb), f.let("cg", r00 / cb)


def euler_rate_matrix(sb: sp.Expr, cb: sp.Expr, sg: sp.Expr, cg: sp.Expr) -> sp.Matrix:
    """E with ω = E (α̇, β̇, γ̇): columns Rz Ry ex, Rz ey, ez (from eq. 1)."""
    Rz, Ry = rot_z(cg, sg), rot_y(cb, sb)
    ex, ey, ez = sp.eye(3).col(0), sp.eye(3).col(1), sp.eye(3).col(2)
    return sp.Matrix.hstack(Rz * Ry * ex, Rz * ey, ez)


def _pose_rates(
    f: Function, pose_map: PoseMap, s: sp.Matrix, d_p: sp.Matrix, d_omega: sp.Matrix,
    d_state: sp.Matrix, delta: sp.Matrix,
) -> sp.Matrix:  # fmt: skip
    if pose_map.quaternion is None:  # the angles are coordinates of the state
        angles = {"alpha": 0, "beta": 0, "gamma": 0}
        angles.update({c: delta[i] for i, c in enumerate(pose_map.free) if c in angles})
        return sp.Matrix([*(d_p * delta), *(angles[c] for c in POSE[3:])])
    sb, cb, sg, cg = _euler(f, pose_map, s)
    w = d_omega * delta
    along = f.let("along", (cg * w[0] + sg * w[1]) / cb, "E⁻¹ ω, ω = E (α̇, β̇, γ̇)")
    return sp.Matrix([*(d_p * delta), along, cg * w[1] - sg * w[0], w[2] + sb * along])


def _free(f: Function, pose_map: PoseMap, s: sp.Matrix, row: sp.Matrix) -> sp.Matrix:
    if pose_map.quaternion is not None:
        E = euler_rate_matrix(*_euler(f, pose_map, s))
        return sp.Matrix([*row[:-3, 0], *(E.T * row[-3:, 0])])
    if pose_map.name == "2tpr2tps":  # w = z / cos β, so dw = dz / cos β + z sin β / cos² β dβ
        _, w, _, _, cb, sb = s
        z, c, sine = sp.symbols("z c sine", positive=True)
        inverse = f.let("k", 1 / cb)
        dw_dbeta = sp.diff(z / sp.cos(c), c).subs({sp.sin(c): sine, z: w * sp.cos(c)})
        dw_dbeta = dw_dbeta.subs(sp.cos(c), 1 / inverse).subs(sine, sb)
        return sp.Matrix([row[0], row[1] * inverse, row[2], row[3] + row[1] * dw_dbeta])
    return row


def pose_frame() -> Function:
    """R and p of a pose whose six numbers are taken as given (eq. 1)."""
    f = Function("pose_frame", "the frame of a pose", "R = Rz(γ) Ry(β) Rx(α) (A eq. 1)")
    pose = f.vector("pose", 6, "x y z [mm], α β γ [rad]")
    for i, n in enumerate("abg"):
        f.sincos(n, pose[3 + i])
    f.output("R", rpy(*pose[3:]).xreplace(f.known), "platform to base, row by row")
    f.output("p", sp.Matrix(pose[:3]), "platform origin [mm]")
    return f
