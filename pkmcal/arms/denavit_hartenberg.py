"""Axes, points and home of an arm from Denavit–Hartenberg numbers, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray, as_numbers
from pkmcal.exceptions import ArgumentError

Convention = Literal["standard", "modified"]
Parallel = Literal["normal", "hayati"]
_NEARLY = 0.01  # sine of the angle up to which Hayati's parameter stands for a far common normal
_PARALLEL = 1e-10  # sine of the angle between axes of which the common normal is anyone's
_SAME = 1e-9  # mm, and of unit vectors


def screws_of(
    a: ArrayLike, alpha: ArrayLike, d: ArrayLike, theta: ArrayLike, convention: Convention
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes (n, 3), points (n, 3) and home (4, 4) at zero; the arguments are `from_dh`'s.

    A DH transform is two screws: one along x (a, α), one along the joint's axis z (d, θ).
    """
    word("convention", convention, get_args(Convention))
    given = {"a": a, "alpha": alpha, "d": d, "theta": theta}
    columns = {}
    for name, value in given.items():
        column = as_numbers(name, value, "n")
        if column.ndim > 1 or not np.isfinite(column).all():
            raise ArgumentError(f"{name} must be a number or finite numbers (n,), found {value!r}")
        columns[name] = column
    try:
        rows = np.stack(np.broadcast_arrays(*columns.values()), axis=-1, dtype=np.float64)
    except ValueError:
        shapes = ", ".join(f"{name} {column.shape}" for name, column in columns.items())
        raise ArgumentError(f"a, alpha, d and theta must have one length, found {shapes}") from None
    rows = np.atleast_2d(rows)
    twists = np.zeros((2, len(rows), 6))
    twists[0, :, [3, 0]] = rows[:, :2].T  # along x: α about it, a along it
    twists[1, :, [5, 2]] = rows[:, 2:].T  # along z: θ about it, d along it
    across, along = screw.exp(twists)
    frame = np.eye(4)
    axes, points = np.empty((len(rows), 3)), np.empty((len(rows), 3))
    for i in range(len(rows)):
        if convention == "modified":
            frame = frame @ across[i]
        axes[i], points[i] = frame[:3, 2], frame[:3, 3]
        frame = frame @ along[i]
        if convention == "standard":
            frame = frame @ across[i]
    return axes, points, frame


@dataclass(frozen=True)
class DHTable:
    """Denavit–Hartenberg numbers of an arm, between a base and a tool that hold the rest.

    Attributes
    ----------
    a, alpha, d, theta : ndarray (n,)
        mm and rad; of the variable, θ or of a prismatic joint d, the offset.
    convention : {"standard", "modified"}
    base, tool : ndarray (4, 4)
        The first frame in the base, and the tool in the last frame, mm.
    beta : ndarray (n,) or None
        Hayati's parameter of axes that are nearly parallel, rad: behind Tx(a) Rx(α) comes Ry(β).
        None where none are written with it.
    """

    a: FloatArray
    alpha: FloatArray
    d: FloatArray
    theta: FloatArray
    convention: Convention
    base: FloatArray
    tool: FloatArray
    beta: FloatArray | None = None


def table_of(
    axes: FloatArray,
    points: FloatArray,
    home: FloatArray,
    convention: Convention,
    sides: FloatArray | None = None,
    parallel: Parallel = "normal",
) -> DHTable:
    """The numbers of an arm: the inverse of `screws_of`, for any axes.

    Of each pair of neighbouring axes the common normal is x, on the side of `sides` (n, 3), without
    them where x was before; of parallel ones that through the frame before, or at last through the
    tool. Axes that are nearly parallel have it far away: a and d are then large and cancel; with
    `parallel` "hayati" they are taken as parallel ones, and a turn β about y leads to the next axis
    (S. A. Hayati, 22nd IEEE Conference on Decision and Control, 1983, p. 1477). The tool's z counts
    as an axis.
    """
    word("convention", convention, get_args(Convention))
    word("parallel", parallel, get_args(Parallel))
    limit = _NEARLY if parallel == "hayati" else _PARALLEL
    z = np.vstack([axes, home[:3, 2]])
    on = np.vstack([points, home[:3, 3]])
    x = _across(z[0], np.eye(3)[0])
    origin = on[0] - z[0] * (on[0] @ z[0])  # the point of axis 1 next to the base's origin
    base = _frame(x, z[0], origin)
    rows = np.zeros((len(axes), 5))
    for i in range(len(axes)):
        near = on[-1] if i + 1 == len(axes) else origin  # where the normal of parallel axes is
        side = x if sides is None else sides[i]
        normal, foot, end = _normal(z[i], on[i], z[i + 1], on[i + 1], side, near, limit)
        rows[i, 3] = np.arctan2(z[i] @ np.cross(x, normal), x @ normal)  # θ
        rows[i, 2] = (foot - origin) @ z[i]  # d
        rows[i, 0] = (end - foot) @ normal  # a
        rows[i, 1] = np.arctan2(normal @ np.cross(z[i], z[i + 1]), z[i] @ z[i + 1])  # α
        x, origin = normal, end
        if abs(lean := normal @ z[i + 1]) > _PARALLEL:  # only nearly parallel axes leave one
            rows[i, 4] = np.arcsin(lean)  # β
            x = _across(z[i + 1], normal)
    a, alpha, d, theta, beta = rows.T.copy()
    tool = np.linalg.inv(_frame(x, z[-1], origin)) @ home
    if convention == "modified":
        along = np.zeros((2, 6))
        along[0, 0], along[0, 3], along[1, 1] = alpha[-1], a[-1], beta[-1]
        turned = screw.exp(along)
        tool = turned[0] @ turned[1] @ tool
        a, alpha, beta = np.roll(a, 1), np.roll(alpha, 1), np.roll(beta, 1)
        a[0] = alpha[0] = beta[0] = 0.0
    return DHTable(
        a, alpha, d, theta, convention, base, tool, beta if parallel == "hayati" else None
    )


def normals(table: DHTable) -> FloatArray:
    """The x axes (n, 3) of a standard table behind its joints, in the base at zero."""
    frame = table.base[:3, :3]
    found = np.empty((len(table.theta), 3))
    for i, (theta, alpha) in enumerate(zip(table.theta, table.alpha, strict=True)):
        frame = frame @ screw.exp([0.0, 0.0, 0.0, 0.0, 0.0, theta])[:3, :3]
        found[i] = frame[:, 0]
        frame = frame @ screw.exp([0.0, 0.0, 0.0, alpha, 0.0, 0.0])[:3, :3]
    return found


def _normal(
    z: FloatArray,
    on: FloatArray,
    other: FloatArray,
    beyond: FloatArray,
    side: FloatArray,
    origin: FloatArray,
    limit: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Common normal of two axes, and where it leaves the one and meets the other.

    Of axes whose sine is below `limit`, the normal of the first one at the height of `origin`.
    """
    cross = np.cross(z, other)
    sine = np.linalg.norm(cross)
    if sine < limit:
        foot = on + z * ((origin - on) @ z)
        end = beyond + other * (((foot - beyond) @ z) / (other @ z))
        apart = end - foot
        far = np.linalg.norm(apart)
        normal = apart / far if far > _SAME else _across(z, side)
    else:
        normal = cross / sine
        ways = np.stack([z, -other, normal], axis=1)
        s, t, _ = np.linalg.solve(ways, beyond - on)
        foot, end = on + s * z, beyond + t * other
    if normal @ side < -_SAME:
        normal = -normal
    return normal, foot, end


def _across(z: FloatArray, wanted: FloatArray) -> FloatArray:
    """The direction across z that is nearest to the wanted one."""
    across = wanted - z * (z @ wanted)
    if np.linalg.norm(across) < _SAME:
        across = np.eye(3)[1] - z * z[1]
    unit: FloatArray = across / np.linalg.norm(across)
    return unit


def _frame(x: FloatArray, z: FloatArray, origin: FloatArray) -> FloatArray:
    frame = np.eye(4)
    frame[:3] = np.stack([x, np.cross(z, x), z, origin], axis=1)
    return frame
