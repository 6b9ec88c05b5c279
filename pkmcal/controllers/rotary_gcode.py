"""Rotary deltas of RepRapFirmware: M669 K10 and M666.

A crank at its switch is at the greatest angle of M669 A plus its adjustment of M666, in degrees
above the horizontal; shoulders may have heights of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.controllers.gcode_words import (
    TOWERS,
    Commands,
    each,
    lines,
    number,
    numbers,
    off_towers,
    require_mm,
    require_positive,
    settings,
)
from pkmcal.controllers.rotary_delta import RotaryDelta

_KIND = 10  # K
_LEAST = -90.0  # deg: where the firmware's limit is not known


def is_rotary(text: str, place: str) -> bool:
    """Return whether a config.g has the M669 of a rotary delta."""
    found = settings(text, "M669", place, missing=True)
    return number(found, "K", "M669", place, 0.0) == _KIND


def reprap_commands(
    delta: RotaryDelta, shift: float, text: str | None = None, place: str = "M669"
) -> Commands:
    """The settings, whose adjustments have the mean `shift`; the least angle is that of `text`."""
    angles = [-float(np.degrees(elbow)) for elbow in delta.elbows]
    greatest = float(np.mean(angles)) - shift
    least = _LEAST
    if text is not None:
        least, _ = numbers(settings(text, "M669", place), "A", "M669", place, counts=(2,))
    size: dict[str, Sequence[float]] = {"U": delta.cranks, "L": delta.rods, "H": delta.heights}
    size |= {"R": [delta.radius], "A": [least, greatest], **off_towers(delta.angles)}
    return {"M669": size, "M666": each("XYZ", [angle - greatest for angle in angles])}


def reprap_lines(commands: Commands) -> str:
    """Return RepRapFirmware's two lines of a rotary delta's geometry."""
    return lines(commands, M669=_KIND)


def of_reprap(text: str, place: str = "M669") -> RotaryDelta:
    """The rotary delta of a config.g.

    Raises
    ------
    ValueError
        A number that is missing.
    """
    require_mm(text, place, "M669", "M666")
    size, ends = settings(text, "M669", place), settings(text, "M666", place)

    def three(letter: str) -> tuple[float, ...]:
        found = numbers(size, letter, "M669", place, counts=(1, 3))
        require_positive(found, letter, "M669", place)
        return tuple(found * (3 // len(found)))

    cranks, rods, heights = (three(letter) for letter in "ULH")
    radius = number(size, "R", "M669", place)
    require_positive([radius], "R", "M669", place)
    _, greatest = numbers(size, "A", "M669", place, counts=(2,))
    elbows = tuple(
        -float(np.radians(greatest + number(ends, letter, "M666", place, 0.0))) for letter in "XYZ"
    )
    angles = tuple(
        tower + number(size, letter, "M669", place, 0.0)
        for tower, letter in zip(TOWERS, "XYZ", strict=True)
    )
    return RotaryDelta(radius, heights, angles, cranks, rods, elbows, (1.0,) * len(TOWERS))
