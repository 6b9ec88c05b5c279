"""Rotary deltas of RepRapFirmware: M669 K10 and M666.

A crank at its switch is at the greatest angle of M669 A plus its adjustment of M666, in degrees
above the horizontal; shoulders may have heights of their own.
"""

from __future__ import annotations

import re

import numpy as np

from pkmcal.controllers.gcode_words import TOWERS, corrections, words, words_of
from pkmcal.controllers.rotary_delta import RotaryDelta
from pkmcal.exceptions import FileError

_LEAST = -90.0  # deg: where the firmware's limit is not known


def is_rotary(text: str) -> bool:
    """Whether a config.g has the M669 of a rotary delta."""
    return re.search(r"^\s*M669\b[^;\n]*\bK10\b", text, re.MULTILINE) is not None


def reprap_text(delta: RotaryDelta) -> str:
    """The two lines."""
    angles = [-float(np.degrees(elbow)) for elbow in delta.elbows]
    greatest = float(np.mean(angles))
    three = {"U": delta.cranks, "L": delta.rods, "H": delta.heights}
    numbers = " ".join(
        letter + ":".join(f"{value:.6f}" for value in values) for letter, values in three.items()
    )
    return (
        f"M669 K10 {numbers} R{delta.radius:.6f} A{_LEAST:g}:{greatest:.6f}"
        f" {corrections(delta.angles)}\n"
        f"M666 {words('XYZ', [angle - greatest for angle in angles])}\n"
    )


def of_reprap(text: str, place: str = "M669") -> RotaryDelta:
    """The rotary delta of a config.g.

    Raises
    ------
    ValueError
        A number that is missing.
    """
    size, ends = words_of(text, "M669", place), words_of(text, "M666", place)

    def several(letter: str, count: int) -> list[float]:
        try:
            found = [float(each) for each in size[letter].split(":")]
        except (KeyError, ValueError):
            found = []
        if len(found) == 1 and count == len(TOWERS):
            found *= count
        if len(found) != count:
            wanted = f"{count} numbers" if count > 1 else "a number"
            raise FileError(
                f"{place}: {letter} of M669 must be {wanted}, found {size.get(letter)!r}"
            )
        return found

    cranks, rods, heights = (several(letter, len(TOWERS)) for letter in "ULH")
    (radius,), (_, greatest) = several("R", 1), several("A", 2)
    try:
        elbows = [-np.radians(greatest + float(ends.get(letter, 0.0))) for letter in "XYZ"]
        angles = [
            tower + float(size.get(letter, 0.0))
            for tower, letter in zip(TOWERS, "XYZ", strict=True)
        ]
    except ValueError:
        raise FileError(f"{place}: X Y Z of M669 and M666 must be numbers") from None
    parts = (tuple(heights), tuple(angles), tuple(cranks), tuple(rods))
    return RotaryDelta(radius, *parts, tuple(map(float, elbows)), (1.0,) * len(TOWERS))
