"""2TPR&2TPS in closed form: eq. 4 to 12 of paper A."""

from __future__ import annotations

from .emit import Function


def functions() -> list[Function]:
    return []
