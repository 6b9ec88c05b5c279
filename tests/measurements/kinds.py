"""Measurements of every kind, with the fields that it needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.readings import Angle, At, Between, Camera, Predicted, RelativeDistance, Touch
from pkmcal.readings.registry import KINDS
from pkmcal.readings.touches import TOUCHES

PUBLIC = tuple(kind for kind in KINDS if kind != "touch-distance")  # which `identify` makes
OF_ORIENTATIONS = ("pose", "orientation")
ARTEFACTS = tuple(TOUCHES)


def width(kind: str, artefact: str | None = None) -> int:
    """Numbers of one value."""
    return len(TOUCHES[artefact] if artefact else KINDS[kind].components)


def shape(kind: str, rows: int, artefact: str | None = None) -> tuple[int, ...]:
    """Of the values."""
    k = width(kind, artefact)
    return (rows, k) if k != 1 else (rows,)


def needed(kind: str, rows: int, actuators: int, artefact: str = "point") -> dict[str, Any]:
    """The arguments of `Measurements` that a kind cannot do without."""
    names = [f"no {1 + i % 2}" for i in range(rows)]
    second = np.random.default_rng(9).uniform(300, 500, (rows, actuators))
    return {
        "distance": {"target": [0, 0, 100]},
        "between": {"instrument": Between(second)},
        "relative-distance": {"target": [0, 0, 100], "instrument": RelativeDistance(run=names)},
        "angle": {"instrument": Angle("limb1.joint2")},
        "touch": {"instrument": Touch(names, artefact)},
        "pixel": {"instrument": Camera(corner=second[:, :1] * [1, 2, 0], fx=900, fy=800)},
    }.get(kind, {})


def takes_target(kind: str) -> bool:
    """Whether rows may have a target."""
    return bool(KINDS[kind].point)


def predict(
    kind: str,
    pose: np.ndarray,
    target: np.ndarray | None = None,
    frame: np.ndarray | None = None,
    **numbers: np.ndarray,
) -> Predicted:
    """Readings of a kind at poses."""
    if target is not None:
        numbers["target"] = target
    return KINDS[kind].predict(At(pose, frame=frame), **numbers)
