"""Words of G-code, by their letters: out and in."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pkmcal.exceptions import FileError

TOWERS = (210.0, 330.0, 90.0)  # of RepRapFirmware and Marlin
_WORD = re.compile(r"([A-Z])([-+]?[\d.]+(?::[-+]?[\d.]+)*)")


def words(letters: str, values: Sequence[float]) -> str:
    """Numbers with six decimals behind their letters."""
    pairs = zip(letters, values, strict=True)
    return " ".join(f"{letter}{round(value, 6) + 0.0:.6f}" for letter, value in pairs)


def corrections(angles: Sequence[float]) -> str:
    """X Y Z: by how much towers stand off the firmware's angles, deg."""
    off = [
        (angle - tower + 180.0) % 360.0 - 180.0 for angle, tower in zip(angles, TOWERS, strict=True)
    ]
    return words("XYZ", off)


def words_of(text: str, command: str, place: str) -> dict[str, str]:
    """The words of the last such command, as text."""
    lines = re.findall(rf"^\s*(?:echo:\s*)?{command}\b([^;\n]*)", text, re.MULTILINE)
    if not lines:
        raise FileError(f"{place}: {command} is missing")
    return dict(_WORD.findall(lines[-1]))
