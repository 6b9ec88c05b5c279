"""Screws: exponential and logarithm of SE(3), their derivatives, the adjoint, and joint errors.

A twist is (ω, v), rotation first. With x = ω·ω, every function of the angle is one of

    c_k(x) = Σ_j (-x)^j / (k + 2j)!,   c_k = 1/k! - x c_{k+2},   dc_k/dx = (k c_{k+2} - c_{k+1})/2

so that c0 = cos θ, c1 = sin θ/θ, c2 = (1 - cos θ)/θ², c3 = (θ - sin θ)/θ³: entire functions,
regular at zero, where every nominal error screw sits. The equations are those of the paper on joint
structure errors (DOI 10.3969/j.issn.1673-9833.2020.05.005), called B.
"""

from __future__ import annotations

import mpmath as mp
import sympy as sp

from .emit import Function
from .rotation import axial, rot_z, rpy, rpy_angles, skew

SERIES_END = 10.0  # x up to which c4 and c5 come from their series: a little over π²
SERIES_COUNT = 14  # terms: the first left out is below 1e-17 of the sum
SIXTH = sp.Symbol("SIXTH", real=True)  # 1/6, a constant of the C

ERRORS = ("dx", "dy", "dz", "dphi", "dtheta", "dpsi")  # of a joint, mm and rad, in this order


def series(k: int) -> list[float]:
    """Coefficients of c_k, lowest power of x first."""
    with mp.workdps(60):
        return [float((-1) ** j / mp.factorial(k + 2 * j)) for j in range(SERIES_COUNT)]


def constants() -> str:
    """The C constants: the two series that the others follow from, and where they end."""
    lines = [f"#define SERIES_END {SERIES_END!r}", f"#define SERIES_COUNT {SERIES_COUNT}"]
    for k in (4, 5):
        lines.append(f"/* c{k}(x), lowest power first */")
        numbers = ",\n    ".join(c.hex() for c in series(k))
        lines.append(f"static const double C{k}_SERIES[SERIES_COUNT] = {{\n    {numbers}}};")
    lines.append(f"#define {SIXTH} {(1 / 6).hex()}")
    return "\n".join([*lines, "", ""])


def _near() -> Function:
    f = Function("angle_near", "c0 to c5 from c4 and c5", "c_k = 1/k! - x c_{k+2}")
    x = f.scalar("x", "ω·ω")
    c4, c5 = f.scalar("c4", "by its series"), f.scalar("c5", "by its series")
    c3, c2 = f.let("c3", SIXTH - x * c5), f.let("c2", sp.Rational(1, 2) - x * c4)
    c1, c0 = 1 - x * c3, 1 - x * c2
    f.output("c", sp.Matrix([c0, c1, c2, c3, c4, c5]), "c0 ... c5")
    return f


def _far() -> Function:
    f = Function("angle_far", "c0 to c5 away from zero", "c_{k+2} = (1/k! - c_k)/x")
    theta = f.scalar("theta", "√(ω·ω) [rad]")
    sine, cosine = f.sincos("t", theta)
    x = f.let("x", theta**2)
    c1 = f.let("c1", sine / theta)
    c2, c3 = f.let("c2", (1 - cosine) / x), f.let("c3", (1 - c1) / x)
    c4, c5 = (sp.Rational(1, 2) - c2) / x, (SIXTH - c3) / x
    f.output("c", sp.Matrix([cosine, c1, c2, c3, c4, c5]), "c0 ... c5")
    return f


def rotation(w: sp.Matrix, c1: sp.Expr, c2: sp.Expr) -> sp.Matrix:
    """Rodrigues (B eq. 2): R = E + c1 [ω] + c2 [ω]²."""
    return sp.eye(3) + c1 * skew(w) + c2 * skew(w) ** 2


def _twist(f: Function) -> tuple[sp.Matrix, sp.Matrix]:
    return f.vector("w", 3, "ω [rad]"), f.vector("v", 3, "v [mm]")


def _motion(f: Function, name: str = "") -> tuple[sp.Matrix, sp.Matrix]:
    R = f.matrix(f"R{name}", "rotation, row by row")
    return R, f.vector(f"p{name}", 3, "displacement [mm]")


def _coefficients(f: Function) -> list[sp.Symbol]:
    return list(f.vector("c", 6, "c0 ... c5 at ω·ω"))


def _exp() -> Function:
    f = Function(
        "screw_exp",
        "motion by a twist of any norm",
        "R = E + c1 [ω] + c2 [ω]²,  p = (E + c2 [ω] + c3 [ω]²) v   (B eq. 2, 3)",
    )
    w, v = _twist(f)
    _, c1, c2, c3, _, _ = _coefficients(f)
    m = f.let("m", w.cross(v), "ω × v")
    f.output("R", rotation(w, c1, c2), "rotation, row by row")
    f.output("p", v + c2 * m + c3 * w.cross(m), "displacement [mm]")
    return f


def _rotation_log() -> Function:
    f = Function(
        "rotation_quaternions",
        "the unit quaternion q of a rotation, scalar first, four times over",
        "rows of 4 q qᵀ: each is q times 4 q_i, good where q_i is the largest entry",
    )
    R = f.matrix("R", "rotation, row by row")
    trace = R.trace()
    turn = axial(R)
    K = sp.zeros(4, 4)
    K[0, 0] = 1 + trace
    for i in range(3):
        K[0, 1 + i] = K[1 + i, 0] = turn[i]
        for j in range(3):
            K[1 + i, 1 + j] = R[i, j] + R[j, i] if i != j else 1 + 2 * R[i, i] - trace
    f.output("K", K, "4 x 4, row by row")
    return f


def _inverse_coefficient(f: Function, c2: sp.Expr, c3: sp.Expr, c4: sp.Expr) -> sp.Expr:
    """(1/x)(1 - c1/(2 c2)) with its cancellation taken out: 1/12 at zero, 1/π² at π."""
    return f.let("k", (c3 - 2 * c4) / (2 * c2), "(1 - c1/(2 c2))/x")


def _log() -> Function:
    f = Function(
        "screw_log",
        "the twist's v from its ω and the displacement",
        "v = (E - [ω]/2 + k [ω]²) p,  k = (1 - c1/(2 c2))/x   (B eq. 13: v = G⁻¹ p)",
    )
    w, p = f.vector("w", 3, "ω [rad]"), f.vector("p", 3, "displacement [mm]")
    _, _, c2, c3, c4, _ = _coefficients(f)
    k = _inverse_coefficient(f, c2, c3, c4)
    m = f.let("m", w.cross(p), "ω × p")
    f.output("v", p - m / 2 + k * w.cross(m), "v [mm]")
    return f


def _exp_blocks(
    f: Function, w: sp.Matrix, v: sp.Matrix, c: list[sp.Symbol]
) -> tuple[sp.Matrix, sp.Matrix]:
    """J = E + c2 [ω] + c3 [ω]², and Q: its derivative by ω along v (of dual numbers the ε part)."""
    _, _, c2, c3, c4, c5 = c
    W, V = skew(w), skew(v)
    along = f.let("along", w.dot(v), "half the change of x")
    d2 = f.let("d2", (2 * c4 - c3) * along, "the change of c2")
    d3 = f.let("d3", (3 * c5 - c4) * along, "the change of c3")
    J = f.let("J", sp.eye(3) + c2 * W + c3 * W**2)
    Q = f.let("Q", c2 * V + c3 * (W * V + V * W) + d2 * W + d3 * W**2)
    return J, Q


def _six(J: sp.Matrix, Q: sp.Matrix) -> sp.Matrix:
    return sp.Matrix(sp.BlockMatrix([[J, sp.zeros(3, 3)], [Q, J]]))


def _exp_jacobian() -> Function:
    f = Function(
        "screw_exp_jacobian",
        "how a motion follows its twist",
        "dT T⁻¹ = [(J 0; Q J) dξ],  J = E + c2 [ω] + c3 [ω]²,  Q = dJ along v",
    )
    w, v = _twist(f)
    J, Q = _exp_blocks(f, w, v, _coefficients(f))
    f.output("D", _six(J, Q), "6 x 6, row by row")
    return f


def _log_jacobian() -> Function:
    f = Function(
        "screw_log_jacobian",
        "how a twist follows its motion",
        "dξ = (J⁻¹ 0; -J⁻¹ Q J⁻¹ J⁻¹) (dT T⁻¹),  J⁻¹ = E - [ω]/2 + k [ω]²",
    )
    w, v = _twist(f)
    c = _coefficients(f)
    _, Q = _exp_blocks(f, w, v, c)
    k = _inverse_coefficient(f, *c[2:5])
    W = skew(w)
    I = f.let("I", sp.eye(3) - W / 2 + k * W**2, "J⁻¹")  # noqa: E741 (the inverse)
    IQ = f.let("IQ", I * Q)
    f.output("D", _six(I, -IQ * I), "6 x 6, row by row")
    return f


def _adjoint() -> Function:
    f = Function(
        "motion_adjoint",
        "twists seen from another frame",
        "Ad = (R 0; [p] R R)   (B eq. 18)",
    )
    R, p = _motion(f)
    f.output("A", _six(R, skew(p) * R), "6 x 6, row by row")
    return f


def _moved() -> Function:
    f = Function("screw_moved", "a twist moved along", "ω' = R ω,  v' = R v + p × ω'   (B eq. 18)")
    R, p = _motion(f)
    w, v = _twist(f)
    turned = f.let("t_w", R * w, "ω'")
    f.output("moved_w", turned, "ω'")
    f.output("moved_v", R * v + p.cross(turned), "v'")
    return f


def _compose() -> Function:
    f = Function("motion_compose", "one motion after another", "R = Ra Rb,  p = pa + Ra pb")
    Ra, pa = _motion(f, "a")
    Rb, pb = _motion(f, "b")
    f.output("R", Ra * Rb, "rotation, row by row")
    f.output("p", pa + Ra * pb, "displacement [mm]")
    return f


def _invert() -> Function:
    f = Function("motion_invert", "a motion undone", "Rᵀ, -Rᵀ p")
    R, p = _motion(f)
    f.output("I", R.T, "rotation, row by row")
    f.output("d", -(R.T * p), "displacement [mm]")
    return f


def _link() -> Function:
    f = Function(
        "arm_link",
        "from the frame (Qa, ra) of one joint to that (Q, r) of the next, which has an error",
        "C = Fa⁻¹ E F:  R = Qaᵀ R_E Q,  p = Qaᵀ (r + Δ - ra)   (B eq. 19)",
    )
    e = f.vector("e", 6, "Δx Δy Δz [mm], Δφ Δθ Δψ [rad] of the next joint")
    Qa, ra = f.matrix("Qa", "axes of the joint before, row by row"), f.vector("ra", 3, "its point")
    Q, r = f.matrix("Q", "axes of the next joint, row by row"), f.vector("r", 3, "its point [mm]")
    R = f.let("R_e", _error_rotation(f, e))
    f.output("R", Qa.T * f.let("RQ", R * Q), "rotation, row by row")
    f.output("p", Qa.T * f.let("d", r + sp.Matrix(e[:3]) - ra), "displacement [mm]")
    return f


def _turned() -> Function:
    f = Function("arm_turned", "a frame turned about its z axis", "R' = R Rz(θ)   (B eq. 2)")
    R = f.matrix("R", "rotation, row by row")
    s, c = f.scalar("s", "sin θ"), f.scalar("c", "cos θ")
    f.output("turned", R * rot_z(c, s), "rotation, row by row")
    return f


def _slid() -> Function:
    f = Function("arm_slid", "a frame moved along its z axis", "p' = p + q R ez")
    R, p = _motion(f)
    f.output("slid", p + f.scalar("q", "[mm]") * R.col(2), "displacement [mm]")
    return f


def _axis_twist() -> Function:
    f = Function("arm_axis_twist", "twist of a turn about a frame's z axis", "ω = R ez,  v = p × ω")
    R, p = _motion(f)
    f.output("w", R.col(2), "ω")
    f.output("v", p.cross(R.col(2)), "v")
    return f


def _error_rotation(f: Function, e: sp.Matrix) -> sp.Matrix:
    """Rz(Δψ) Ry(Δθ) Rx(Δφ) (B eq. 10)."""
    for name, angle in zip("abg", e[3:], strict=True):
        f.sincos(name, angle)
    return rpy(*e[3:]).xreplace(f.known)


def _joint_error() -> Function:
    f = Function(
        "joint_error",
        "the error of a joint at its point r, in axes parallel to the base's at home",
        "E = Trans(Δx, Δy, Δz) Rz(Δψ) Ry(Δθ) Rx(Δφ);  R = R_E,  p = Δ + (E - R) r   (B eq. 10, 19)",
    )
    e = f.vector("e", 6, "Δx Δy Δz [mm], Δφ Δθ Δψ [rad]")
    r = f.vector("r", 3, "the joint's point [mm]")
    R = f.let("R_e", _error_rotation(f, e))
    f.output("R", R, "rotation, row by row")
    f.output("p", sp.Matrix(e[:3]) + (sp.eye(3) - R) * r, "displacement [mm]")
    return f


def _error_twists() -> Function:
    f = Function(
        "arm_error_twists",
        "twists by a joint's six errors, with the joint before it moved from axes Qa to Qx",
        "R = Qx Qaᵀ;  by Δx Δy Δz: (0, R e)\n"
        "by Δφ Δθ Δψ: ω = R Rz(Δψ) Ry(Δθ) ex, R Rz(Δψ) ey, R ez,  v = at × ω",
    )
    Qx = f.matrix("Qx", "axes of the joint before as moved, row by row")
    Qa = f.matrix("Qa", "the same at zero")
    at = f.vector("at", 3, "this joint's point as moved [mm]")
    e = f.vector("e", 6, "Δx Δy Δz [mm], Δφ Δθ Δψ [rad]")
    sb, cb = f.sincos("b", e[4])
    sg, cg = f.sincos("g", e[5])
    R = f.let("R", Qx * Qa.T, "base axes at zero, as moved")
    axes = sp.Matrix([[cg * cb, -sg, 0], [sg * cb, cg, 0], [-sb, 0, 1]])
    turns = f.let("T", R * axes, "ω in columns")
    moments = sp.Matrix.hstack(*(at.cross(turns.col(i)) for i in range(3)))
    f.output("along", R.T, "v by Δx, Δy, Δz, one row each")
    f.output("turn", turns.T, "ω by Δφ, Δθ, Δψ, one row each")
    f.output("moment", moments.T, "v, one row each")
    return f


def _pose() -> Function:
    f = Function("motion_pose", "x y z α β γ of a motion", "R = Rz(γ) Ry(β) Rx(α)")
    R, p = _motion(f)
    f.output("pose", sp.Matrix([*p, *rpy_angles(f, R)]), "x y z [mm], α β γ [rad]")
    return f


def functions() -> list[Function]:
    """The emitted functions of screws and serial arms."""
    return [
        _near(), _far(), _exp(), _rotation_log(), _log(), _exp_jacobian(), _log_jacobian(),
        _adjoint(), _moved(), _compose(), _invert(), _joint_error(), _pose(),
        _link(), _turned(), _slid(), _axis_twist(), _error_twists(),
    ]  # fmt: skip
