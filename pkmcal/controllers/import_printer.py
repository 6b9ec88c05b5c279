"""A robot, and stored measurements, out of the configuration of a printer's firmware."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from pkmcal.arguments import path as as_path
from pkmcal.arguments import word
from pkmcal.controllers import hangprinter, maslow, rotary_delta, rotary_gcode
from pkmcal.controllers.delta_gcode import of_marlin, of_reprap
from pkmcal.controllers.linear_delta import FirmwareDelta, text_of
from pkmcal.controllers.printer_config import (
    ANGLES,
    STEPPERS,
    PrinterConfig,
    kinematics,
    positive,
    read,
    step_of,
)
from pkmcal.controllers.robot_files import robot_of
from pkmcal.controllers.rotary_delta import RotaryDelta, elbow_at
from pkmcal.exceptions import FileError
from pkmcal.files.text_lines import text_in
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.result import Result

_HEAD = """\
# Imported from {file} by pkmcal: the firmware's numbers of a linear delta.
# An actuator coordinate is the motor's steps down from its end stop; `offset` is the height of the
# carriage there, position_endstop + sqrt(arm_length^2 - delta_radius^2).
"""
_ROTARY_HEAD = """\
# Imported from {file} by pkmcal: the firmware's numbers of a rotary delta.
# An actuator coordinate is the motor's steps down from its end stop; `offset` is the angle of the
# crank there, below the horizontal. Radius and height are those of the shoulders less the
# effector's.
"""
_DEGREES_HEAD = """\
# Imported from {file} by pkmcal: M669 and M666 of a rotary delta.
# An actuator coordinate is the crank's way down from its end stop; `offset` is the angle of the
# crank there, below the horizontal.
"""
_GCODE_HEAD = """\
# Imported from {file} by pkmcal: M665 and M666 of a linear delta.
# An actuator coordinate is the carriage's way down from its end stop, in mm; `offset` is the height
# of the carriage there.
"""
_ANCHORS_HEAD = """\
# Imported from {file} by pkmcal: the anchors of M669.
# An actuator coordinate is the line let out since the origin, mm; `offset` is its length there.
"""
_SPOOLS_HEAD = """\
# Imported from {file} by pkmcal: the anchors of M669 and the spools of M666.
# An actuator coordinate is turns of the motor since the origin; `offset` is the length of the line
# there, `spool` the radius on which it is wound there.
"""
_BELTS_HEAD = """\
# Imported from {file} by pkmcal: the anchors of a Maslow, top left, top right, bottom left, right.
# An actuator coordinate is the length of a belt in the plane, from the anchor to the middle of the
# sled, mm. The frame begins at the anchor bottom left; the one bottom right says where x points.
"""
Firmware = Literal["klipper", "reprap", "marlin", "hangprinter", "maslow"]
_KINDS = {  # of limbs: what the machine is, and what its firmware stores
    "PUS": ("linear delta", "heights"),
    "RUS": ("rotary delta", "heights"),
    "UPS": ("Hangprinter", "heights"),
    "cable": ("Maslow", "places"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Printer(Result):
    """What a printer.cfg says, or what another firmware keeps.

    Attributes
    ----------
    robot : Robot
        The printer with the firmware's numbers. Its actuator coordinates are steps down from the
        end stops.
    measurements : Measurements or None
        Heights of the nozzle that the firmware has stored: the probe's offset, and heights
        entered by hand. Of a Maslow the belts of its log, at places that nobody measured.
    distances : int
        How many distances of a printed part are stored, which are not among the measurements.
    text : str
        The robot file.
    notes : tuple of str
        What the file says beside that and the robot has not, and included files that are not there.
    """

    robot: Robot
    measurements: Measurements | None
    distances: int
    text: str
    notes: tuple[str, ...] = ()

    def _parts(self) -> Iterator[str]:
        stored = "no" if self.measurements is None else str(len(self.measurements))
        kind, what = _KINDS[self.robot.model.limbs[0].kind]
        yield f"{self.robot.name}: a {kind}, {stored} stored {what}"
        if self.distances:
            yield (
                f"{self.distances} distances of a printed part are left out: a distance between two"
                " poses is no kind of measurement here"
            )
        yield from self.notes


def import_printer(path: str | PathLike[str], firmware: Firmware = "klipper") -> Printer:
    r"""Read a linear or rotary delta from its firmware's configuration, with stored probe results.

    Parameters
    ----------
    path : str or path
        A printer.cfg of Klipper or Kalico: the block of SAVE_CONFIG at its end and included files
        that are there are read too. Or a file with the M665 and M666 of the other firmwares;
        actuator coordinates are then mm down from the end stops. Or the M669 and M666 of a
        Hangprinter, or the maslow.yaml of a Maslow or the log of its calibration.
    firmware : {"klipper", "reprap", "marlin", "hangprinter", "maslow"}
        Whose file it is.

    Raises
    ------
    ValueError
        Other kinematics, or a number that is missing or wrong: the message names file and line.
    OSError
        A file that cannot be read.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> text = "[printer]\nkinematics: delta\ndelta_radius: 174.75\n"
    >>> for axis in "abc":
    ...     text += f"[stepper_{axis}]\nrotation_distance: 40\nmicrosteps: 16\n"
    ...     text += "position_endstop: 297\narm_length: 333\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = pathlib.Path(folder, "printer.cfg").write_text(text)
    ...     pk.import_printer(f"{folder}/printer.cfg")
    <Printer: printer: a linear delta, no stored heights>
    """
    word("firmware", firmware, get_args(Firmware))
    if firmware == "hangprinter":
        where = as_path("path", path)
        machine = hangprinter.of_text(text_in(path, "replace"), str(where))
        head = _ANCHORS_HEAD if machine.spools is None else _SPOOLS_HEAD
        text = hangprinter.robot_text(machine, where.stem, head.format(file=where.name))
        return _printer(where, text, None, 0, machine.notes)
    if firmware == "maslow":
        where = as_path("path", path)
        anchors, belts = maslow.of_text(text_in(path), str(where))
        text = maslow.robot_text(anchors, where.stem, _BELTS_HEAD.format(file=where.name))
        log = Measurements(belts, None, "closure") if len(belts) else None
        return _printer(where, text, log, 0)
    if firmware != "klipper":
        where, text = as_path("path", path), text_in(path, "replace")  # of comments
        if firmware == "reprap" and rotary_gcode.is_rotary(text, str(where)):
            crank = rotary_gcode.of_reprap(text, str(where))
            return _turning(where, crank, _DEGREES_HEAD, None, 0)
        parse = of_reprap if firmware == "reprap" else of_marlin
        found = parse(text, str(where))
        return _rising(where, found, [-1.0] * 3, _GCODE_HEAD, None, 0)
    printer = read(path)
    absent = tuple(f"{file}, included, is not there and was not read" for file in printer.absent)
    where = Path(printer.place)
    measured = (_heights(printer), _count(printer, "distance"), absent)
    if kinematics(printer) == "rotary_delta":
        return _turning(where, _rotary(printer), _ROTARY_HEAD, *measured)
    radius = positive(printer, "printer", "delta_radius")
    arms, angles, carriages, steps = [], [], [], []
    for section in STEPPERS:
        arm = _first(printer, section, "arm_length")
        if arm <= radius:
            raise printer.wrong(section, "arm_length", f"must be above delta_radius {radius:g}")
        arms.append(arm)
        angles.append(printer.number(section, "angle", ANGLES["delta"][section]))
        height = float(np.sqrt(arm**2 - radius**2))
        carriages.append(_first(printer, section, "position_endstop") + height)
        steps.append(-step_of(printer, section))
    delta = FirmwareDelta(radius, tuple(angles), tuple(arms), tuple(carriages))
    return _rising(where, delta, steps, _HEAD, *measured)


def _turning(
    file: Path,
    delta: RotaryDelta,
    head: str,
    measurements: Measurements | None,
    distances: int,
    notes: tuple[str, ...] = (),
) -> Printer:
    home = round(0.5 * max(delta.endstops), 3)
    text = rotary_delta.text_of(delta, home, file.stem, head.format(file=file.name))
    return _printer(file, text, measurements, distances, notes)


def _rotary(printer: PrinterConfig) -> RotaryDelta:
    """The numbers of a rotary delta; the end stops are above, steps lead down from there."""
    radius = positive(printer, "printer", "shoulder_radius")
    height = positive(printer, "printer", "shoulder_height")
    numbers: list[list[float]] = []
    for section in STEPPERS:
        crank = _first(printer, section, "upper_arm_length")
        rod = _first(printer, section, "lower_arm_length")
        endstop = _first(printer, section, "position_endstop")
        way = float(np.hypot(radius, height - endstop))
        if min(crank, rod) <= 0.0 or not abs(crank - rod) < way < crank + rod:
            raise printer.wrong(
                section, "position_endstop", f"{endstop:g} is nowhere the arms can reach"
            )
        elbow = elbow_at(endstop, radius, height, crank, rod)
        angle = printer.number(section, "angle", ANGLES["rotary_delta"][section])
        numbers.append([angle, crank, rod, elbow, step_of(printer, section)])
    parts = [tuple(part) for part in zip(*numbers, strict=True)]
    return RotaryDelta(radius, (height,) * 3, *parts)


def _rising(
    file: Path,
    delta: FirmwareDelta,
    gains: list[float],
    head: str,
    measurements: Measurements | None,
    distances: int,
    notes: tuple[str, ...] = (),
) -> Printer:
    text = text_of(delta, gains, file.stem, head.format(file=file.name), bed=True)
    return _printer(file, text, measurements, distances, notes)


def _printer(
    file: Path,
    text: str,
    measurements: Measurements | None,
    distances: int,
    notes: tuple[str, ...] = (),
) -> Printer:
    """With the robot of a robot file that was made of the numbers of `file`."""
    try:
        robot = robot_of(text, "robot file")
    except FileError as error:  # each number is right, and what follows from them is not
        wrong = str(error).partition(": ")[2]
        raise FileError(f"{file}: its numbers are of no machine: {wrong}") from None
    return Printer(robot, measurements, distances, text, notes)


def _first(printer: PrinterConfig, section: str, option: str) -> float:
    """A tower's number, or the first tower's where it has none."""
    return printer.number(section if printer.has(section, option) else STEPPERS[0], option)


def _count(printer: PrinterConfig, name: str) -> int:
    count = 0
    while printer.has("delta_calibrate", f"{name}{count}"):
        count += 1
    return count


def _heights(printer: PrinterConfig) -> Measurements | None:
    """The stored heights of the probe and of the hand."""
    names = [
        f"{kind}{i}" for kind in ("height", "manual_height") for i in range(_count(printer, kind))
    ]
    if not names:
        return None
    section = "delta_calibrate"
    steps = [printer.numbers(section, f"{name}_pos", 3) for name in names]
    values = [printer.number(section, name) for name in names]
    return Measurements(steps, values, "height")
