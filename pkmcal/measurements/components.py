"""What one measured value of each kind consists of, and on what it depends."""

from __future__ import annotations

from typing import Literal

from pkmcal.readings.reading import Components, Reading
from pkmcal.readings.registry import KINDS
from pkmcal.readings.touches import TOUCHES, Artefact

Kind = Literal[
    "pose", "position", "height", "distance", "closure",
    "between", "relative-distance", "orientation", "tilt", "angle", "touch", "touch-distance",
]  # fmt: skip
__all__ = ["KINDS", "TOUCHES", "Artefact", "Components", "Kind", "Reading", "components", "noun"]


def components(kind: Kind, artefact: Artefact | None = None) -> Components:
    """Names and units of the numbers of one value."""
    return KINDS[kind].components if artefact is None else TOUCHES[artefact]


def noun(kind: Kind, count: int = 2) -> str:
    """What one, or several, are called."""
    one, several = KINDS[kind].nouns or (kind, f"{kind}s")
    return one if count == 1 else several
