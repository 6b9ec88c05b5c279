"""Rotations: the RPY matrix of eq. 1, unit quaternions, and tilted axes."""

from __future__ import annotations

import sympy as sp

from .emit import Function


def rot_x(c: sp.Expr, s: sp.Expr) -> sp.Matrix:
    """Rotation about x, by its cosine and sine."""
    return sp.Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def rot_y(c: sp.Expr, s: sp.Expr) -> sp.Matrix:
    """Rotation about y, by its cosine and sine."""
    return sp.Matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rot_z(c: sp.Expr, s: sp.Expr) -> sp.Matrix:
    """Rotation about z, by its cosine and sine."""
    return sp.Matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def rpy(alpha: sp.Expr, beta: sp.Expr, gamma: sp.Expr) -> sp.Matrix:
    """R = Rz(γ) Ry(β) Rx(α), platform to base (eq. 1)."""
    return (
        rot_z(sp.cos(gamma), sp.sin(gamma))
        * rot_y(sp.cos(beta), sp.sin(beta))
        * rot_x(sp.cos(alpha), sp.sin(alpha))
    )


def rpy_angles(f: Function, R: sp.Matrix) -> sp.Matrix:
    """α, β, γ of R = Rz(γ) Ry(β) Rx(α), which R gives back near β = ±90° too.

    There α and γ are angles of numbers that are rounding alone, and only their sum or difference is
    one of R: γ is taken first, and α from Rz(γ)ᵀ R = Ry(β) Rx(α).
    """
    R = f.let("R", R)
    gamma = f.angle("gamma", R[1, 0], R[0, 0])
    s, c = f.sincos("g", gamma, "α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90°")
    alpha = f.angle("alpha", s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    beta = f.angle("beta", -R[2, 0], sp.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2))
    return sp.Matrix([alpha, beta, gamma])


def axial(R: sp.Matrix) -> sp.Matrix:
    """Twice the vector of the skew part of R; of a rotation 2 sin φ times its axis."""
    return sp.Matrix([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def skew(v: sp.Matrix) -> sp.Matrix:
    """[v], the matrix of v × (.)."""
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def quaternion_product(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Hamilton product, scalar part first."""
    av, bv = sp.Matrix(a[1:]), sp.Matrix(b[1:])
    scalar = a[0] * b[0] - av.dot(bv)
    vector = a[0] * bv + b[0] * av + av.cross(bv)
    return sp.Matrix([scalar, *vector])


def quaternion_matrix(q: sp.Matrix) -> sp.Matrix:
    """Rotation matrix of a unit quaternion (scalar part first)."""
    w, x, y, z = q
    return sp.Matrix([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
