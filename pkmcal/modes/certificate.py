"""Proof that a solution of the closures is one: the theorem of Newton and Kantorovich.

The unknowns are the nine entries of R and p: the closures and R Rᵀ = 1 are then twelve quadratic
equations F(u) = 0. With A near F'(u)⁻¹, and in the largest-entry norm, let ‖A F(u)‖ ≤ Y,
‖1 - A F'(u)‖ ≤ Z0, and let Z2 bound how fast A F' changes, which for quadratic F is a number. The
step u - A F(u) maps the ball of radius r around u into itself and contracts there if
Y + Z0 r + Z2 r²/2 ≤ r and Z0 + Z2 r < 1: then there is exactly one solution in it. It holds in real
numbers as in complex ones. Near a singular pose Z2 grows beyond bounds, and nothing is certified.

Every bound is raised by what rounding can have done: `ROUNDING` times the same expression with
absolute values, where the longest chain of operations is below 60. The closures are written here a
second time, in the form the proof needs; the core's own are not taken on trust.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.core.library import AXES
from pkmcal.result import Result

Array = Any  # of real or complex numbers
ROUNDING = 64 * np.finfo(float).eps
UP = 1.0 + 1e-9  # what the rounding of a sum of bounds is far below
DOWN = 1.0 - 1e-13
R, P = slice(0, 9), slice(9, 12)
PLANES = {"base_plane": "base", "hinge_plane": "hinge"}  # fixed in the base, each with its normal


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Result):
    """Certificate of N approximate solutions.

    Attributes
    ----------
    ok : ndarray of bool (N,)
        There is a solution near, with R a rotation.
    error : ndarray (N,)
        How far it is at most, mm: for the entries of p, and those of R times the characteristic
        length, of the platform in the machine's own frames: the origin of a tool frame is further
        off by its lever. NaN where nothing is proven.
    unique : ndarray (N,)
        It is the only one within this distance, in the same measure; NaN likewise.
    """

    ok: BoolArray
    error: FloatArray
    unique: FloatArray

    def _parts(self) -> Iterator[str]:
        worst = f"; error at most {np.nanmax(self.error):.1e} mm" if self.ok.any() else ""
        yield f"{int(self.ok.sum())} of {self.ok.size} rows certified{worst}"

    def reshape(self, shape: tuple[int, ...]) -> Certificate:
        """Return the certificate for a batch of this shape."""
        return Certificate(
            self.ok.reshape(shape), self.error.reshape(shape), self.unique.reshape(shape)
        )


class Closures:
    """The twelve quadratic equations of a machine at given actuator coordinates.

    Parameters
    ----------
    map : str
        Pose map.
    rows : sequence of sequences of str
        Of each limb, its rows beside the sphere.
    spheres : ndarray (limbs, 7 + 3 axes) or (N, limbs, 7 + 3 axes)
        The limbs, as `Machine.spheres` gives them, for all rows or for each.
    length : float
        Characteristic length, mm: p is measured in it.
    size : float
        What rounding of the limbs' numbers is measured against, mm.
    levers : sequence of float
        Of the couple rows, mm.
    """

    def __init__(
        self,
        map: str,
        rows: list[tuple[str, ...]],
        spheres: FloatArray,
        length: float,
        size: float,
        levers: list[float],
    ) -> None:
        self.map, self.rows, self.length, self.size = map, rows, length, size
        one = spheres.reshape(-1, *spheres.shape[-2:])[0]  # actuators change anchors and lengths
        self.b, self.levers = one[:, 0:3], levers
        self.axis = {axis: one[:, 7 + 3 * k : 10 + 3 * k] for k, axis in enumerate(AXES)}
        self.c, self.rho = spheres[..., 3:6], spheres[..., 6]

    def __call__(self, u: Array) -> tuple[Array, Array, FloatArray, FloatArray, FloatArray]:
        """Evaluate the closures at u (N, 12).

        Returns F (N, 12), F' (N, 12, 12), what both are below if every term counts with its
        absolute value, and how fast each row of F' changes at most (12,).
        """
        f, df, f_abs, df_abs, change = [], [], [], [], []
        turn, p = u[:, R].reshape(-1, 3, 3), self.length * u[:, P]
        spread = np.abs(turn)
        for i, kinds in enumerate(self.rows):
            b, reach = self.b[i], np.abs(self.b[i]).sum() + self.length
            c, rho = self.c[..., i, :], self.rho[..., i]
            d = p + turn @ b - c
            far = np.abs(p) + spread @ np.abs(b) + np.abs(c) + self.size
            f.append((np.sum(d * d, axis=1) - rho * rho) / 2.0)
            f_abs.append(np.sum(far * far, axis=1) + (rho + self.size) ** 2)
            df.append(self._row(d, b))
            df_abs.append(self._row(far, np.abs(b)))
            change.append(3.0 * reach**2)
            for kind in kinds:
                if kind in PLANES:
                    n = np.broadcast_to(self.axis[PLANES[kind]][i], d.shape)
                    f.append(np.sum(n * d, axis=1))
                    f_abs.append(np.sum(far, axis=1))
                    df.append(self._row(n, b))
                    df_abs.append(self._row(np.ones(d.shape), np.abs(b)))
                    change.append(0.0)
                elif kind == "platform_plane":
                    a, Ra = self.axis["platform"][i], turn @ self.axis["platform"][i]
                    Ra_abs = spread.sum(axis=2)
                    f.append(np.sum(Ra * d, axis=1))
                    f_abs.append(np.sum(Ra_abs * far, axis=1))
                    df.append(self._row(Ra, b) + self._row(d, a, by_p=False))
                    by_turn = self._row(far, np.ones(3), by_p=False)
                    df_abs.append(self._row(Ra_abs, np.abs(b)) + by_turn)
                    change.append(6.0 * np.abs(a).sum() * reach)
                elif kind == "couple":
                    n = np.broadcast_to(self.axis["base"][i], d.shape)
                    lever = self.levers[i]
                    a = lever * self.axis["platform"][i]
                    f.append(np.sum(n * (turn @ a), axis=1))
                    f_abs.append(np.sum(spread, axis=(1, 2)) * lever)
                    df.append(self._row(n, a, by_p=False))
                    df_abs.append(self._row(np.ones(d.shape), np.full(3, lever), by_p=False))
                    change.append(0.0)
                else:
                    raise ValueError(f"no certificate has the row {kind!r}")
        for row in self._pose_rows(u):
            for into, entry in zip((f, df, f_abs, df_abs, change), row, strict=True):
                into.append(entry)
        shape = (len(u), len(f))
        return (
            np.stack(f, axis=1).reshape(shape),
            np.stack(df, axis=1),
            np.stack(f_abs, axis=1).reshape(shape),
            np.stack(df_abs, axis=1),
            np.array(change),
        )

    def _row(self, left: Array, right: FloatArray, by_p: bool = True) -> Array:
        """The derivative left · (dR right + dp), by u."""
        by_turn = (left[:, :, None] * right).reshape(-1, 9)
        return np.concatenate([by_turn, left * (self.length * by_p)], axis=1)

    def _pose_rows(self, u: Array) -> list[tuple[Array, ...]]:
        """Return the rows that make (R, p) a pose of the map: F, F', absolute terms and change."""
        if self.map == "spatial":
            return _orthonormal(u)
        if self.map == "translation":
            return [_linear(u, {k: 1.0}, float(k % 4 == 0)) for k in range(9)]
        if self.map == "xy":  # z = 0, R = 1
            fixed = [_linear(u, {k: 1.0}, float(k % 4 == 0)) for k in range(9)]
            return [*fixed, _linear(u, {11: 1.0}, 0.0)]
        if self.map == "planar":  # z = 0, R = Rz
            fixed = [_linear(u, {k: 1.0}, float(k == 8)) for k in (2, 5, 6, 7, 8, 11)]
            fixed += [_linear(u, {1: 1.0, 3: 1.0}, 0.0), _linear(u, {0: 1.0, 4: -1.0}, 0.0)]
            return [*fixed, _product(u, (0, 3), (0, 3), 1.0)]
        if self.map == "spherical":  # p = 0
            return [*_orthonormal(u), *(_linear(u, {k: 1.0}, 0.0) for k in (9, 10, 11))]
        if self.map != "2tpr2tps":
            raise ValueError(f"no certificate has the pose map {self.map!r}")
        # R = Ry Rx has no entry (2, 1), and p lies along (-R31, 0, R11)
        return [*_orthonormal(u), _linear(u, {3: 1.0}, 0.0), _product(u, (0, 6), (9, 11), 0.0)]


def _linear(u: Array, factors: dict[int, float], value: float) -> tuple[Array, ...]:
    """Σ factor u_k - value = 0."""
    row = np.zeros(u.shape)
    for k, factor in factors.items():
        row[:, k] = factor
    total = sum(factor * u[:, k] for k, factor in factors.items())
    absolute = sum(np.abs(u[:, k]) for k in factors)
    return total - value, row + 0 * u, absolute + value, np.abs(row), 0.0


def _product(
    u: Array, left: tuple[int, ...], right: tuple[int, ...], value: float
) -> tuple[Array, ...]:
    """Σ u_i u_j - value = 0 over pairs i of `left` and j of `right`."""
    row, row_abs = np.zeros_like(u), np.zeros(u.shape)
    for i, j in zip(left, right, strict=True):
        row[:, i] += u[:, j]
        row[:, j] += u[:, i]
        row_abs[:, i] += np.abs(u[:, j])
        row_abs[:, j] += np.abs(u[:, i])
    terms = u[:, left] * u[:, right]
    return (
        terms.sum(axis=1) - value, row, np.abs(terms).sum(axis=1) + value, row_abs,
        2.0 * len(left),
    )  # fmt: skip


def _orthonormal(u: Array) -> list[tuple[Array, ...]]:
    """RᵀR = 1, six rows: columns of R are unit vectors and square to each other."""
    columns = [(k, k + 3, k + 6) for k in range(3)]
    return [
        _product(u, columns[i], columns[j], float(i == j)) for i in range(3) for j in range(i, 3)
    ]


def newton(closures: Closures, u: Array, steps: int) -> Array:
    """Newton's method on (R, p/length), (N, 12); a row that turns singular stays as it is."""
    for _ in range(steps):
        f, df = closures(u)[:2]
        u = u - (_inverses(df) @ f[..., None])[..., 0]
    return u


def kantorovich(
    f: Array, df: Array, f_abs: FloatArray, df_abs: FloatArray, change: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Bound the error of N solutions of k equations, and the ball in which each is alone.

    Parameters
    ----------
    f, df : ndarray (N, k), (N, k, k)
        F and F' where the solutions are to be near.
    f_abs, df_abs : ndarray (N, k), (N, k, k)
        What both are below if every term counts with its absolute value.
    change : ndarray (k,) or (N, k)
        How fast each row of F' changes at most.
    """
    A = _inverses(df)
    A_abs = np.abs(A)
    Y = UP * (A_abs @ (np.abs(f) + ROUNDING * f_abs)[..., None])[..., 0].max(axis=1)
    off = np.abs(np.eye(df.shape[1]) - A @ df) + A_abs @ (2.0 * ROUNDING * df_abs)
    Z0 = UP * off.sum(axis=2).max(axis=1)
    Z2 = UP * (A_abs @ change[..., None])[..., 0].max(axis=1)
    with np.errstate(invalid="ignore"):
        room = (1.0 - Z0) ** 2 - 2.0 * Y * Z2
        error = UP * 2.0 * Y / (1.0 - Z0 + np.sqrt(np.where(room > 0, room, np.nan)))
        unique = np.where(Z2 > 0, (1.0 - Z0) / (UP * np.where(Z2 > 0, Z2, 1.0)), np.inf)
        holds = (Y + Z0 * error + Z2 * error**2 / 2.0 <= error * DOWN) & (error < unique)
        holds &= (Z0 < 1.0) & A_abs.any(axis=(1, 2))
    return error, unique, np.asarray(holds, dtype=bool)


def certify(closures: Closures, u: Array) -> Certificate:
    """Test u (N, 12), R row by row and p/length: real or complex."""
    error, unique, holds = kantorovich(*closures(u))
    with np.errstate(invalid="ignore"):
        turn = u[:, R].reshape(-1, 3, 3)
        # of the solution it is 1 or -1, and it changes by less than 18 (|R| + r)² r
        largest = np.abs(turn).max(axis=(1, 2)) + error
        holds &= np.abs(np.linalg.det(turn) - 1.0) + 18.0 * largest**2 * error < 1.0
    length = closures.length
    return Certificate(
        holds, np.where(holds, length * error, np.nan), np.where(holds, length * unique, np.nan)
    )


def _inverses(matrices: Array) -> Array:
    """Invert each matrix; 0 where it has no inverse, or not all of it is finite."""
    out = np.zeros_like(matrices)
    good = np.isfinite(matrices).all(axis=(1, 2))
    good[good] = np.linalg.slogdet(matrices[good])[0] != 0  # otherwise a pivot is exactly 0
    out[good] = np.linalg.inv(matrices[good])
    return out
