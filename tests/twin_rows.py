"""The twin's closures for many rows at once: what round trips by the million are judged by.

Written from the mathematics as `twin` is, with the same conventions; no line of it is shared with
``derive``, ``generated`` or ``csrc``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .twin import EZ, LENGTH_KINDS, SLIDER_KINDS, SLOTS

Array = np.ndarray


def rotations(poses: Array) -> Array:
    """R (N, 3, 3) of poses (N, 6), platform to base."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(poses[:, 3:].T), np.sin(poses[:, 3:].T)
    rows = [
        [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
        [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
        [-sb, cb * sa, cb * ca],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def turned(frame: Array, tilt1: Array, tilt2: Array, vector: Array) -> Array:
    """frame Rx(tilt1) Ry(tilt2) vector, (N, 3), of one vector (3,) or of N."""
    x, y, z = np.broadcast_arrays(*np.moveaxis(vector, -1, 0), tilt1)[:3]
    c, s = np.cos(tilt2), np.sin(tilt2)
    x, z = c * x + s * z, c * z - s * x
    c, s = np.cos(tilt1), np.sin(tilt1)
    return np.stack([x, c * y - s * z, s * y + c * z], axis=-1) @ np.asarray(frame).T


def closures(model: Any, poses: Array, q: Array, slots: Array | None = None) -> Array:
    """All closures (N, rows) in mm at poses (N, 6) and coordinates (N, n), limb by limb.

    `slots` is one geometry or one per row. Extra rows are without their weights.
    """
    given = np.asarray(model.geometry.slots if slots is None else slots, float)
    each = np.broadcast_to(given, (len(poses), len(model.limbs), len(SLOTS)))
    R = rotations(poses)
    result = []
    for i, limb in enumerate(model.limbs):
        n = dict(zip(SLOTS, each[:, i].T, strict=True))
        base = np.stack([n["base.x"], n["base.y"], n["base.z"]], axis=-1)
        b = np.stack([n["platform.x"], n["platform.y"], n["platform.z"]], axis=-1)
        moved = n["gain"] * q[:, limb.actuator] + n["offset"]
        axis = turned(limb.frame, n["tilt1"], n["tilt2"], EZ)
        if limb.kind in LENGTH_KINDS:
            anchor, radius = base, moved
        elif limb.kind in SLIDER_KINDS:
            anchor, radius = base + moved[:, None] * axis, n["rod"]
        elif limb.kind != "RUS":
            raise ValueError(f"unknown limb kind {limb.kind!r}")
        else:
            direction = np.stack([np.cos(moved), np.sin(moved), 0.0 * moved], axis=-1)
            crank = turned(limb.frame, n["tilt1"], n["tilt2"], direction)
            anchor, radius = base + n["crank"][:, None] * crank, n["rod"]
        d = poses[:, :3] + np.einsum("nij,nj->ni", R, b) - anchor
        result.append(np.linalg.norm(d, axis=1) - radius)
        if limb.kind == "RPS":
            result.append(np.einsum("ni,ni->n", axis, d))
        if limb.kind == "PRS":
            hinge = turned(limb.frames["hinge"], n["hinge_tilt1"], n["hinge_tilt2"], EZ)
            result.append(np.einsum("ni,ni->n", hinge, d))
        if limb.kind == "UPR":
            r = turned(limb.platform_frame, n["platform_tilt1"], n["platform_tilt2"], EZ)
            r = np.einsum("nij,nj->ni", R, r)
            result.append(np.einsum("ni,ni->n", r, d))
            if limb.couple:
                result.append(limb.couple * np.einsum("ni,ni->n", r, axis))
    return np.stack(result, axis=-1)
