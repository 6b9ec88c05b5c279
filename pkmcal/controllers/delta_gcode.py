"""Linear deltas as M665 and M666: RepRapFirmware and Marlin, whose letters mean different things.

Both have towers at 210°, 330° and 90° plus a correction X Y Z each, and a height H of the nozzle.
RepRapFirmware: a carriage at its switch is at H + √(L² - R²) + adjustment, and adjustments have the
mean 0. Marlin: from the switch a carriage moves by its adjustment, never upwards, and is then at
H + √((L + trim)² - R²).
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

import numpy as np

from pkmcal.arguments import flag
from pkmcal.arguments import path as as_path
from pkmcal.controllers.gcode_words import TOWERS, corrections, words, words_of
from pkmcal.controllers.linear_delta import FirmwareDelta, of_robot
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.rotary_delta import is_rotary_delta
from pkmcal.controllers.rotary_delta import of_robot as rotary_of_robot
from pkmcal.controllers.rotary_gcode import reprap_text as rotary_text
from pkmcal.exceptions import FileError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot


def reprap(robot: Robot, path: str | PathLike[str], project: bool = False) -> Loss:
    """Write a delta's numbers for RepRapFirmware 3: M665 and M666 for config.g.

    Of a rotary delta M669 and M666, with the end stops at the greatest angle of the cranks.

    Parameters
    ----------
    robot : Robot
        A linear or rotary delta whose actuator coordinates are 0 at the end stops.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot; nothing is written.
    """
    path, project = as_path("path", path), flag("project", project)
    if is_rotary_delta(robot):
        turning, loss = rotary_of_robot(robot, project, one_height=False)
        write_whole(path, rotary_text(turning))
        return loss
    firmware, loss = of_robot(robot, project)
    write_whole(path, reprap_text(firmware))
    return loss


def marlin(robot: Robot, path: str | PathLike[str], project: bool = False) -> Loss:
    """Write a linear delta's numbers for Marlin 2: M665 and M666.

    Parameters
    ----------
    robot : Robot
        A linear delta whose actuator coordinates are 0 at the end stops.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot; nothing is written.
    """
    path = as_path("path", path)
    firmware, loss = of_robot(robot, flag("project", project))
    write_whole(path, marlin_text(firmware))
    return loss


def reprap_text(firmware: FirmwareDelta) -> str:
    """The two lines for RepRapFirmware."""
    height = float(np.mean(firmware.endstops))
    rods = ":".join(f"{arm:.6f}" for arm in firmware.arms)
    return (
        f"M665 L{rods} R{firmware.radius:.6f} H{height:.6f} {corrections(firmware.angles)}\n"
        f"M666 {words('XYZ', [endstop - height for endstop in firmware.endstops])}\n"
    )


def marlin_text(firmware: FirmwareDelta) -> str:
    """The two lines for Marlin."""
    height = min(firmware.endstops)
    rod = float(np.mean(firmware.arms))
    trims = words("ABC", [arm - rod for arm in firmware.arms])
    towers = corrections(firmware.angles)
    return (
        f"M665 L{rod:.6f} R{firmware.radius:.6f} H{height:.6f} {towers} {trims}\n"
        f"M666 {words('XYZ', [height - endstop for endstop in firmware.endstops])}\n"
    )


def of_reprap(text: str, place: str = "M665") -> FirmwareDelta:
    """The delta of a config.g of RepRapFirmware.

    Raises
    ------
    ValueError
        A number that is missing.
    """
    size, ends = words_of(text, "M665", place), words_of(text, "M666", place)
    radius = _one(size, "R", place)
    arms = [_number(each, "L", place) for each in _text(size, "L", place).split(":")]
    arms = arms * 3 if len(arms) == 1 else arms
    if len(arms) != 3 or min(arms) <= radius:
        raise FileError(f"{place}: L of M665 must be 1 or 3 rods longer than R, found {size['L']}")
    height = _one(size, "H", place)
    ats = [
        height + float(np.sqrt(arm**2 - radius**2)) + _one(ends, letter, place, 0.0)
        for arm, letter in zip(arms, "XYZ", strict=True)
    ]
    return FirmwareDelta(radius, _angles(size, place), tuple(arms), tuple(ats))


def of_marlin(text: str, place: str = "M665") -> FirmwareDelta:
    """The delta of M665 and M666 as Marlin's M503 lists them.

    Raises
    ------
    ValueError
        A number that is missing.
    """
    size, ends = words_of(text, "M665", place), words_of(text, "M666", place)
    radius, rod = _one(size, "R", place), _one(size, "L", place)
    arms = tuple(rod + _one(size, letter, place, 0.0) for letter in "ABC")
    if min(arms) <= radius:
        raise FileError(f"{place}: the rods of M665 must be longer than R, found {size['L']}")
    height = _one(size, "H", place)
    ats = [
        height + float(np.sqrt(arm**2 - radius**2)) - _one(ends, letter, place, 0.0)
        for arm, letter in zip(arms, "XYZ", strict=True)
    ]
    return FirmwareDelta(radius, _angles(size, place), arms, tuple(ats))


def _text(words: Mapping[str, str], letter: str, place: str) -> str:
    if letter not in words:
        raise FileError(f"{place}: {letter} of M665 is missing")
    return words[letter]


def _one(words: Mapping[str, str], letter: str, place: str, default: float | None = None) -> float:
    if letter not in words and default is not None:
        return default
    return _number(_text(words, letter, place), letter, place)


def _number(text: str, letter: str, place: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FileError(f"{place}: {letter} must be a number, found {text!r}") from None


def _angles(words: Mapping[str, str], place: str) -> tuple[float, ...]:
    pairs = zip(TOWERS, "XYZ", strict=True)
    return tuple(tower + _one(words, letter, place, 0.0) for tower, letter in pairs)
