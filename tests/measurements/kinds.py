"""Measurements of every kind, with the fields that it needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.measurements.components import KINDS, TOUCHES, components

PUBLIC = tuple(kind for kind in KINDS if kind != "touch-distance")  # which `identify` makes
OF_ORIENTATIONS = ("pose", "orientation")


def width(kind: str, artefact: str | None = None) -> int:
    """Numbers of one value."""
    return len(components(kind, artefact or ("point" if kind == "touch" else None)))


def shape(kind: str, rows: int, artefact: str | None = None) -> tuple[int, ...]:
    """Of the values."""
    k = width(kind, artefact)
    return (rows, k) if k != 1 else (rows,)


def needed(kind: str, rows: int, actuators: int, artefact: str = "point") -> dict[str, Any]:
    """The fields that a kind cannot do without."""
    names = [f"no {1 + i % 2}" for i in range(rows)]
    second = np.random.default_rng(9).uniform(300, 500, (rows, actuators))
    return {
        "distance": {"target": [0, 0, 100]},
        "between": {"other": second},
        "relative-distance": {"target": [0, 0, 100], "run": names},
        "angle": {"joint": "limb1.joint2"},
        "touch": {"touched": names, "artefact": artefact},
    }.get(kind, {})


def takes_target(kind: str) -> bool:
    """Whether rows may have a target."""
    return bool(KINDS[kind].point)


ARTEFACTS = tuple(TOUCHES)
