"""Linear deltas as M665 and M666: RepRapFirmware and Marlin, whose letters mean different things.

Both have towers at 210°, 330° and 90° plus a correction X Y Z each, and a height H of the nozzle.
RepRapFirmware: a carriage at its switch is at H + √(L² - R²) + adjustment, and adjustments have the
mean 0. Marlin: from the switch a carriage moves by its adjustment, never upwards, and is then at
H - Z + √((L + trim)² - R²), where Z of M851 is the bed probe's offset, 0 without a probe
(set_axis_is_at_home in its module/motion.cpp): H and M851 belong together.

Offsets of a bed probe are Klipper's in a robot file: z is the nozzle's height when it triggers.
That is Z of RepRapFirmware's G31, and -Z of M851.

RepRapFirmware's M666 A B tilts the bed: carriages go by z + A x + B y, in percent. A robot file has
no such numbers; the bed of an exported robot is level.
"""

from __future__ import annotations

from functools import partial
from os import PathLike

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers.gcode_words import (
    TOWERS,
    Commands,
    Settings,
    changed,
    commanded,
    each,
    lines,
    number,
    numbers,
    off_towers,
    place_of,
    require_mm,
    require_positive,
    settings,
)
from pkmcal.controllers.linear_delta import Bed, FirmwareDelta, of_robot
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.own_file import Wanted, write_for
from pkmcal.controllers.reprap_files import own_config
from pkmcal.controllers.rotary_delta import is_rotary_delta
from pkmcal.controllers.rotary_delta import of_robot as rotary_of_robot
from pkmcal.controllers.rotary_gcode import reprap_commands as rotary_commands
from pkmcal.controllers.rotary_gcode import reprap_lines as rotary_lines
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.text_lines import text_in
from pkmcal.kinematics.robot import Robot


def reprap(
    robot: Robot,
    path: str | PathLike[str],
    project: bool = False,
    config: str | PathLike[str] | None = None,
) -> Loss:
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
    config : str or path, optional
        The printer's own config.g: it is written with the changed numbers, and not a character
        else of it. By default the two lines alone are written.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot, or the file has no such lines; nothing is written.
    OSError
        A file that cannot be read or written.
    """
    return write_for(path, project, config, own_config, partial(_reprap, robot))


def _reprap(robot: Robot, wanted: Wanted, text: str | None) -> tuple[str, Loss]:
    """The lines, or the printer's file with the changed numbers."""
    place = wanted.place
    shift = 0.0 if text is None else mean_adjustment(text, place)
    if is_rotary_delta(robot):
        turning, loss = rotary_of_robot(robot, wanted.project, one_height=False)
        commands = rotary_commands(turning, shift, text, place)
        new = rotary_lines(commands)
    else:
        firmware, loss = of_robot(robot, wanted.project)
        commands = reprap_commands(firmware, shift)
        new = lines(commands)
    return new if text is None else changed(text, place, commands), loss


def marlin(robot: Robot, path: str | PathLike[str], project: bool = False) -> Loss:
    """Write a linear delta's numbers for Marlin 2: M665, M666, and the M851 that H goes with.

    Parameters
    ----------
    robot : Robot
        A linear delta whose actuator coordinates are 0 at the end stops, and whose file states the
        offset of its bed probe.
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
        The firmware cannot hold the robot, or the offset is not stated; nothing is written.
    """
    return write_for(path, project, None, text_in, partial(_marlin, robot))


def _marlin(robot: Robot, wanted: Wanted, text: str | None) -> tuple[str, Loss]:
    """Return Marlin's three lines of a delta's geometry."""
    firmware, loss = of_robot(robot, wanted.project)
    if robot.model.probe is None:
        raise ArgumentError(
            f"robot: {robot.name}: Marlin homes the nozzle to H - Z of M851 above the bed, and the"
            " robot file does not state its bed probe: add [probe] and offset = { z = Z } to it,"
            " the nozzle's height in mm when the probe triggers, which is -Z of M851; z = 0 for a"
            " printer without a bed probe"
        )
    return marlin_text(firmware, robot.model.probe), loss


def reprap_commands(firmware: FirmwareDelta, shift: float) -> Commands:
    """The settings of RepRapFirmware, whose adjustments have the mean `shift`."""
    height = float(np.mean(firmware.endstops)) - shift
    size = {"L": firmware.arms, "R": [firmware.radius], "H": [height]}
    ends = each("XYZ", [endstop - height for endstop in firmware.endstops])
    return {"M665": size | off_towers(firmware.angles), "M666": ends | each("AB", [0.0, 0.0])}


def mean_adjustment(text: str, place: str) -> float:
    """The mean of X Y Z of M666."""
    ends = settings(text, "M666", place)
    return float(np.mean([number(ends, letter, "M666", place, 0.0) for letter in "XYZ"]))


def marlin_text(firmware: FirmwareDelta, probe: FloatArray) -> str:
    """The three lines for Marlin: it homes to H less Z of M851."""
    height, rod = min(firmware.endstops), float(np.mean(firmware.arms))
    x, y, z = probe.tolist()
    size = each("LRH", [rod, firmware.radius, height - z]) | off_towers(firmware.angles)
    trims = each("ABC", [arm - rod for arm in firmware.arms])
    ends = each("XYZ", [height - endstop for endstop in firmware.endstops])
    return lines({"M665": size | trims, "M666": ends, "M851": each("XYZ", [x, y, -z])})


def of_reprap(text: str, place: str = "M665") -> FirmwareDelta:
    """The delta of a config.g of RepRapFirmware.

    Raises
    ------
    ValueError
        A number that is missing, or a bed that the firmware takes to be tilted.
    """
    require_mm(text, place, "M665", "M666")
    size, ends = settings(text, "M665", place), settings(text, "M666", place)
    for letter in "AB":
        if number(ends, letter, "M666", place, 0.0):
            raise FileError(
                f"{place}: {letter} of M666 tilts the bed by {ends[letter].value} %, which a robot"
                " file cannot hold: set A0 B0 and let the calibration find the end stops"
            )
    radius = number(size, "R", "M665", place)
    arms = numbers(size, "L", "M665", place, counts=(1, 3))
    arms *= 3 // len(arms)
    height = number(size, "H", "M665", place)
    ats = [height + number(ends, letter, "M666", place, 0.0) for letter in "XYZ"]
    return _delta(size, radius, arms, ats, place)


def reprap_bed(text: str, place: str) -> Bed:
    """Return the bed of RepRapFirmware, within B of M665 where that is stated.

    Raises
    ------
    ValueError
        A radius that is none.
    """
    size = settings(text, "M665", place)
    if "B" not in size:
        return Bed()
    radius = number(size, "B", "M665", place)
    require_positive([radius], "B", "M665", place)
    return Bed(radius)


def of_marlin(text: str, place: str = "M665") -> FirmwareDelta:
    """The delta of M665, M666 and M851 as Marlin's M503 lists them.

    Raises
    ------
    ValueError
        A number that is missing, or one that Marlin does not take.
    """
    require_mm(text, place, "M665", "M666", "M851")
    _require_no_home_offset(text, place)
    size, ends = settings(text, "M665", place), settings(text, "M666", place)
    radius, rod = number(size, "R", "M665", place), number(size, "L", "M665", place)
    arms = [rod + number(size, letter, "M665", place, 0.0) for letter in "ABC"]
    height = number(size, "H", "M665", place) + marlin_probe(text, place)[2]
    adjustments = [number(ends, letter, "M666", place, 0.0) for letter in "XYZ"]
    for letter, adjustment in zip("XYZ", adjustments, strict=True):
        if adjustment > 0.0:
            raise FileError(
                f"{place_of(text, ends[letter], place)}: {letter} of M666 must not be above 0,"
                f" found {adjustment:g}: Marlin takes no such number"
            )
    ats = [height - adjustment for adjustment in adjustments]
    return _delta(size, radius, arms, ats, place)


def marlin_probe(text: str, place: str) -> tuple[float, float, float]:
    """The offset of Marlin's bed probe.

    Raises
    ------
    ValueError
        There is no M851, without which H does not say where the nozzle homes.
    """
    found = settings(text, "M851", place, missing=True)
    if not found:
        raise FileError(
            f"{place}: M851 is missing: with a bed probe Marlin homes to H - Z of M851, so that H"
            " alone does not say where the nozzle is; add the line M851 of M503, or M851 Z0 if"
            " M503 lists none: then there is no bed probe"
        )
    x, y = (number(found, letter, "M851", place, 0.0) for letter in "XY")
    return x, y, 0.0 - number(found, "Z", "M851", place)


def _require_no_home_offset(text: str, place: str) -> None:
    """Refuse M206, by which some versions home elsewhere than to H."""
    for letter, offset in settings(text, "M206", place, missing=True).items():
        if letter in "XYZ" and number({letter: offset}, letter, "M206", place):
            raise FileError(
                f"{place_of(text, offset, place)}: {letter} of M206 moves where Marlin homes to,"
                " which a robot file does not hold: set M206 X0 Y0 Z0, home, and list the settings"
                " again"
            )


def reprap_probe(text: str, place: str) -> tuple[float, float, float] | None:
    """The offset of RepRapFirmware's bed probe K0; None where the text sets no height of a probe.

    M851 of RepRapFirmware is the Z of G31 with the other sign, and no more.

    Raises
    ------
    ValueError
        It is no plain number, in inches, set under a condition, or of other probes than K0.
    """
    require_mm(text, place, "G31", "M851")
    found = settings(text, "G31", place, missing=True, kind="0")
    marlin = settings(text, "M851", place, missing=True)
    if "Z" not in found and "Z" not in marlin:
        if commanded(text, "G31"):
            raise FileError(f"{place}: G31 sets no height Z of the probe K0")
        return None
    x, y = (number(found, letter, "G31", place, 0.0) for letter in "XY")
    last = max(each["Z"].start for each in (found, marlin) if "Z" in each)
    if "Z" in marlin and marlin["Z"].start == last:
        return x, y, 0.0 - number(marlin, "Z", "M851", place)
    return x, y, number(found, "Z", "G31", place)


def _delta(
    size: Settings, radius: float, arms: list[float], endstops: list[float], place: str
) -> FirmwareDelta:
    """The delta whose nozzle is at `endstops` with a carriage at its switch."""
    require_positive([radius], "R", "M665", place)
    if not radius < min(arms):
        found = size["L"].value
        raise FileError(f"{place}: L of M665 must be rods longer than R, found {found}")
    pairs = zip(TOWERS, "XYZ", strict=True)
    angles = tuple(tower + number(size, letter, "M665", place, 0.0) for tower, letter in pairs)
    ats = [
        endstop + float(np.sqrt(arm**2 - radius**2))
        for endstop, arm in zip(endstops, arms, strict=True)
    ]
    return FirmwareDelta(radius, angles, tuple(arms), tuple(ats))
