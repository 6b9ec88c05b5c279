"""Rotary deltas of RepRapFirmware: M669 K10 and M666.

A crank at its switch is at the greatest angle of M669 A plus its adjustment of M666, in degrees
above the horizontal; shoulders may have heights of their own.
"""

from __future__ import annotations

import numpy as np

from pkmcal.controllers.gcode_words import (
    TOWERS,
    corrections,
    number,
    numbers,
    settings,
    words,
    written,
)
from pkmcal.controllers.rotary_delta import RotaryDelta

_KIND = 10  # K
_LEAST = -90.0  # deg: where the firmware's limit is not known


def is_rotary(text: str, place: str) -> bool:
    """Whether a config.g has the M669 of a rotary delta."""
    found = settings(text, "M669", place, missing=True)
    return number(found, "K", "M669", place, 0.0) == _KIND


def reprap_text(delta: RotaryDelta) -> str:
    """The two lines."""
    angles = [-float(np.degrees(elbow)) for elbow in delta.elbows]
    greatest = float(np.mean(angles))
    three = {"U": delta.cranks, "L": delta.rods, "H": delta.heights}
    lengths = " ".join(letter + written(*values) for letter, values in three.items())
    return (
        f"M669 K{_KIND} {lengths} R{written(delta.radius)} A{_LEAST:g}:{written(greatest)}"
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
    size, ends = settings(text, "M669", place), settings(text, "M666", place)

    def three(letter: str) -> tuple[float, ...]:
        found = numbers(size, letter, "M669", place, counts=(1, 3))
        return tuple(found * (3 // len(found)))

    cranks, rods, heights = (three(letter) for letter in "ULH")
    radius = number(size, "R", "M669", place)
    _, greatest = numbers(size, "A", "M669", place, counts=(2,))
    elbows = tuple(
        -float(np.radians(greatest + number(ends, letter, "M666", place, 0.0))) for letter in "XYZ"
    )
    angles = tuple(
        tower + number(size, letter, "M669", place, 0.0)
        for tower, letter in zip(TOWERS, "XYZ", strict=True)
    )
    return RotaryDelta(radius, heights, angles, cranks, rods, elbows, (1.0,) * len(TOWERS))
