"""A plain NumPy twin of the kinematics: slow, short, and written a second time.

The tests compare the compiled core with this module. It shares no line with ``derive``,
``generated`` or ``csrc``: every formula is written here from the mathematics, one pose at a time,
with loops over limbs, and every derivative is a difference.

A model is anything with ``map``, ``home`` and ``limbs`` and, unless ``slots`` are handed over,
``geometry.slots``. Lengths are in mm, angles in rad, poses are (x, y, z, alpha, beta, gamma) with
R = Rz(gamma) Ry(beta) Rx(alpha) from platform to base.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

SLOTS = (
    *("base.x", "base.y", "base.z", "platform.x", "platform.y", "platform.z"),
    *("offset", "gain", "rod", "crank", "tilt1", "tilt2", "platform_tilt1", "platform_tilt2"),
    *("hinge_tilt1", "hinge_tilt2"),
)
LENGTH_KINDS = ("UPS", "UPR", "RPS")
SLIDER_KINDS = ("PUS", "PRS")
EX, EY, EZ = np.eye(3)

Array = np.ndarray


# --- rotations and pose maps -------------------------------------------------------------------


def rx(a: complex) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def ry(a: complex) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rz(a: complex) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def rotation(pose: Array) -> Array:
    """R (3, 3), platform to base."""
    return rz(pose[5]) @ ry(pose[4]) @ rx(pose[3])


def pose_of_free(model: Any, free: Array) -> Array:
    """The pose (6,) of the map's free coordinates; what a map does not move is zero."""
    pose = np.zeros(6, dtype=np.result_type(free, float))
    if model.map == "2tpr2tps":  # y z alpha beta, with x = z tan(beta) and gamma = 0
        y, z, alpha, beta = free
        return np.array([z * np.tan(beta), y, z, alpha, beta, 0 * beta])
    pose[free_columns(model)] = free
    return pose


def free_columns(model: Any) -> list[int]:
    """Which of x y z alpha beta gamma are the free coordinates."""
    return {
        "spatial": [0, 1, 2, 3, 4, 5],
        "translation": [0, 1, 2],
        "planar": [0, 1, 5],
        "xy": [0, 1],
        "2tpr2tps": [1, 2, 3, 4],
    }[model.map]


# --- limbs -------------------------------------------------------------------------------------


def numbers(model: Any, slots: Array | None) -> list[dict[str, float]]:
    """The named numbers of every limb."""
    rows = np.asarray(model.geometry.slots if slots is None else slots)
    return [dict(zip(SLOTS, row, strict=True)) for row in rows.reshape(-1, len(SLOTS))]


def base_point(n: dict[str, float]) -> Array:
    return np.array([n["base.x"], n["base.y"], n["base.z"]])


def platform_point(n: dict[str, float]) -> Array:
    return np.array([n["platform.x"], n["platform.y"], n["platform.z"]])


def tilted(limb: Any, n: dict[str, float]) -> Array:
    """The limb's frame after its tilts; its third column is the slider, axis, normal..."""
    return np.asarray(limb.frame) @ rx(n["tilt1"]) @ ry(n["tilt2"])


def platform_axis(limb: Any, n: dict[str, float]) -> Array:
    """The revolute axis r in platform axes."""
    return np.asarray(limb.platform_frame) @ rx(n["platform_tilt1"]) @ ry(n["platform_tilt2"]) @ EZ


def hinge(limb: Any, n: dict[str, float]) -> Array:
    """The axis that a PRS limb's rod swings about, fixed in the carriage: in base axes."""
    return np.asarray(limb.frames["hinge"]) @ rx(n["hinge_tilt1"]) @ ry(n["hinge_tilt2"]) @ EZ


def driver(limb: Any, n: dict[str, float], q: complex) -> tuple[Array, complex]:
    """Anchor point c and length rho at the actuator coordinate q."""
    moved = n["gain"] * q + n["offset"]
    if limb.kind in LENGTH_KINDS:
        return base_point(n), moved
    if limb.kind in SLIDER_KINDS:
        return base_point(n) + moved * (tilted(limb, n) @ EZ), n["rod"]
    if limb.kind == "RUS":
        return base_point(n) + n["crank"] * (tilted(limb, n) @ rz(moved) @ EX), n["rod"]
    raise ValueError(f"unknown limb kind {limb.kind!r}")


def limb_rows(limb: Any, n: dict[str, float], pose: Array, q: complex) -> list[complex]:
    """The limb's closures in mm, each zero where the limb fits; the extra ones unweighted."""
    R = rotation(pose)
    c, rho = driver(limb, n, q)
    d = pose[:3] + R @ platform_point(n) - c
    rows = [np.sqrt(d @ d) - rho]
    if limb.kind == "RPS":
        rows.append((tilted(limb, n) @ EZ) @ d)
    if limb.kind == "PRS":
        rows.append(hinge(limb, n) @ d)
    if limb.kind == "UPR":
        r = R @ platform_axis(limb, n)
        rows.append(r @ d)
        if limb.couple:
            rows.append(limb.couple * (r @ (tilted(limb, n) @ EZ)))
    return rows


def closures(model: Any, pose: Array, q: Array, slots: Array | None = None) -> Array:
    """All closures of the machine, limb by limb, extra rows times their stated weights."""
    result: list[complex] = []
    for limb, n in zip(model.limbs, numbers(model, slots), strict=True):
        sphere, *extra = limb_rows(limb, n, pose, q[limb.actuator])
        weights = tuple(limb.weights) or (1.0,) * len(extra)
        result += [sphere, *(w * row for w, row in zip(weights, extra, strict=True))]
    return np.array(result)


# --- inverse -----------------------------------------------------------------------------------


def limb_inverse(limb: Any, n: dict[str, float], pose: Array) -> float:
    """The actuator coordinate of one limb on its branch; NaN where the limb cannot reach."""
    w = pose[:3] + rotation(pose) @ platform_point(n) - base_point(n)
    if limb.kind in LENGTH_KINDS:
        moved = np.sqrt(w @ w)
    elif limb.kind in SLIDER_KINDS:  # |w - moved s| = rod; the branch: sign of (w - moved s).s
        along = w @ (tilted(limb, n) @ EZ)
        under = n["rod"] ** 2 - (w @ w - along**2)
        moved = along - limb.branch * np.sqrt(under) if under >= 0 else np.nan
    else:  # crank: h cos(moved - phi) = k; the branch is the sign of sin(phi - moved)
        x, y, _ = tilted(limb, n).T @ w
        h, phi = np.hypot(x, y), np.arctan2(y, x)
        k = (w @ w + n["crank"] ** 2 - n["rod"] ** 2) / (2 * n["crank"])
        moved = phi - limb.branch * np.arccos(k / h) if abs(k) <= h else np.nan
        moved = np.arctan2(np.sin(moved), np.cos(moved))
    return float((moved - n["offset"]) / n["gain"])


def inverse(model: Any, pose: Array, slots: Array | None = None) -> Array:
    """Actuators (n,) of a pose taken as given; a shared actuator gets the mean of its limbs.

    A crank's angle is the one from -180 to 180 degrees, those of others on it are near the first.
    """
    shares: dict[int, list[float]] = {}
    for limb, n in zip(model.limbs, numbers(model, slots), strict=True):
        mine = shares.setdefault(limb.actuator, [])
        q = limb_inverse(limb, n, np.asarray(pose, float))
        if mine and limb.kind == "RUS":
            half = np.pi / abs(n["gain"])
            q = mine[0] + (q - mine[0] + half) % (2 * half) - half
        mine.append(q)
    return np.array([np.mean(shares[i]) for i in sorted(shares)])


# --- forward -----------------------------------------------------------------------------------


def complex_step(function: Callable[[Array], Array], at: Array) -> Array:
    """d function / d at, exact to rounding: the imaginary part of a step of 1e-30 i."""
    columns = [function(at + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(at))]
    return np.stack(columns, axis=-1)


def forward(model: Any, q: Array, slots: Array | None = None, guess: Array | None = None) -> Array:
    """The pose (6,) that Gauss-Newton with step halving reaches from the guess (home); else NaN.

    Equal numbers of closures and free coordinates: Newton's method, and the closures vanish.
    """
    free = np.array(model.home if guess is None else guess, float)[free_columns(model)]
    q = np.asarray(q, float)

    def residual(u: Array) -> Array:
        return closures(model, pose_of_free(model, u), q, slots)

    for _ in range(100):
        r = residual(free)
        step = np.linalg.lstsq(complex_step(residual, free), -r, rcond=None)[0]
        while np.linalg.norm(residual(free + step)) > np.linalg.norm(r) + 1e-12:
            step = step / 2
        free = free + step
        if np.linalg.norm(step) < 1e-11:
            square = len(r) == len(free)
            solved = not square or np.linalg.norm(residual(free)) < 1e-9
            return pose_of_free(model, free) if solved else np.full(6, np.nan)
    return np.full(6, np.nan)


# --- derivatives by differences ----------------------------------------------------------------


def central_difference(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """d function / d at by the five-point central rule, one step per entry of at."""
    columns = []
    for unit, h in zip(np.eye(len(at)), steps, strict=True):
        near = function(at + h * unit) - function(at - h * unit)
        far = function(at + 2 * h * unit) - function(at - 2 * h * unit)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1)


def pose_jacobian(model: Any, pose: Array, slots: Array | None = None) -> Array:
    """d actuators / d free coordinates (n, m) by differences of the inverse."""
    columns = free_columns(model)
    steps = np.array([1e-2 if column < 3 else 1e-4 for column in columns])
    return central_difference(
        lambda free: inverse(model, pose_of_free(model, free), slots),
        np.asarray(pose, float)[columns],
        steps,
    )


def forward_jacobian(
    model: Any, q: Array, slots: Array | None = None, guess: Array | None = None
) -> Array:
    """d free coordinates / d actuators (m, n) by differences of re-solving."""
    steps = np.full(len(q), 1e-2)
    for limb in model.limbs:
        steps[limb.actuator] = 1e-4 if limb.kind == "RUS" else 1e-2
    start = forward(model, q, slots, guess)

    def solve(at: Array) -> Array:
        return forward(model, at, slots, start)[free_columns(model)]

    return central_difference(solve, np.asarray(q, float), steps)


def error_jacobian(
    model: Any, q: Array, slots: Array | None = None, guess: Array | None = None
) -> Array:
    """d pose / d slots (6, limbs * slots), actuators held, by differences of re-solving.

    With more closures than free coordinates this is the derivative of the least-squares pose; it
    is that of the linearised problem where the closures vanish.
    """
    flat = np.ravel(model.geometry.slots if slots is None else slots).astype(float)
    size = {"gain": 1e-4, "tilt1": 1e-4, "tilt2": 1e-4}
    size |= {"platform_tilt1": 1e-4, "platform_tilt2": 1e-4}
    size |= {"hinge_tilt1": 1e-4, "hinge_tilt2": 1e-4}
    steps = np.tile([size.get(name, 1e-2) for name in SLOTS], len(model.limbs))
    start = forward(model, q, flat, guess)
    return central_difference(lambda at: forward(model, q, at, start), flat, steps)
