"""A serial arm as data for the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.core.library import POSE
from pkmcal.view import memory, words

_BENT = np.radians(20.0)  # where joints start: stretched out at zero an arm may be singular
_SLIDES = 0.3  # of the arm's length


def data(arm: SerialArm) -> dict[str, Any]:
    """Return the page's data of an arm as JSON has it; mm and rad."""
    given, arm = arm, arm.rigid
    turning = np.array([unit == "rad" for unit in arm.actuator_units])
    limits = arm.limits()
    start = np.clip(np.where(turning, _BENT, 0.0), limits[:, 0], limits[:, 1])
    ends = np.where(turning, np.pi, _SLIDES * arm.length)
    size = float(np.ptp(np.vstack([np.zeros(3), arm.points, arm.home[:3, 3]]), axis=0).max())
    size = max(size, arm.length)
    moved = POSE if arm.n_actuators >= 6 else POSE[:3]
    home = arm.forward(start)
    reach = [[-1.5 * size, 1.5 * size] if name in "xyz" else [-np.pi, np.pi] for name in moved]
    return {
        "kind": "arm",
        "name": arm.name,
        "what": words.of_arm(arm) + words.of_laws(given, start),
        "moved": [POSE.index(name) for name in moved],
        "size": size,
        "length": arm.length,
        "start": start.tolist(),
        "centre": home[:3, 3].tolist(),
        "poses": reach,
        "reach": reach,
        "actuators": [
            _slider(unit, end, low, high) | {"name": name}
            for unit, end, (low, high), name in zip(
                arm.actuator_units,
                ends.tolist(),
                limits.tolist(),
                arm.actuator_names or [None] * arm.n_actuators,
                strict=True,
            )
        ],
        "shares": arm.followers.shares.tolist() if arm.followers else None,
        "joints": [
            {"kind": "P" if kind == "prismatic" else "R", "name": name}
            for kind, name in zip(arm.kinds, arm.joint_names or [None] * arm.n_joints, strict=True)
        ],
        "geometry": memory.ARM_ERRORS,
        "machine": memory.arm(arm),
    }


def _slider(unit: str, end: float, low: float, high: float) -> dict[str, Any]:
    """Range of a slider, to its joint's limits at least, where both are known."""
    if not np.isfinite([low, high]).all():
        return {"unit": unit, "range": [-end, end], "stroke": None}
    return {"unit": unit, "range": [min(-end, low), max(end, high)], "stroke": [low, high]}
