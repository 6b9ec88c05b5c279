"""A robot, and stored measurements, out of the configuration of a printer's firmware."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import get_args

from pkmcal.arguments import path as as_path
from pkmcal.arguments import word
from pkmcal.controllers import hangprinter, linear_delta, maslow, rotary_delta, rotary_gcode
from pkmcal.controllers.delta_gcode import (
    marlin_probe,
    of_marlin,
    of_reprap,
    reprap_bed,
    reprap_probe,
)
from pkmcal.controllers.firmwares import Firmware, firmware_of
from pkmcal.controllers.klipper_import import of_klipper
from pkmcal.controllers.linear_delta import Bed
from pkmcal.controllers.reprap_files import running
from pkmcal.controllers.robot_files import About, robot_of
from pkmcal.controllers.stored import Stored
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.reading import Input
from pkmcal.files.text_lines import text_in
from pkmcal.geometry.controller import Controller
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.result import Result

_DOWN = (-1.0, -1.0, -1.0)  # mm of a carriage for one mm of its actuator coordinate
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
_KINDS = {  # of limbs: what the machine is, and what its firmware stores
    "PUS": ("linear delta", "heights"),
    "RUS": ("rotary delta", "heights"),
    "UPS": ("Hangprinter", "heights"),
    "cable": ("Maslow", "places"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Printer(Result):
    """The settings of a printer.cfg, or those that another firmware keeps.

    Attributes
    ----------
    robot : Robot
        The printer with the firmware's numbers. Its actuator coordinates are steps down from the
        end stops.
    measurements : Measurements or None
        Heights of the nozzle that the firmware has stored: the probe's offset, and heights
        entered by hand. Of a Maslow the belts of its log, at places that nobody measured.
    distances : Measurements or None
        Distances of a printed part that the firmware has stored, of the kind "between".
    text : str
        The robot file.
    notes : tuple of str
        What the file says beside that and the robot has not, and included files that are not there.
    """

    robot: Robot
    measurements: Measurements | None
    distances: Measurements | None
    text: str
    notes: tuple[str, ...] = ()

    def _parts(self) -> Iterator[str]:
        stored = "no" if self.measurements is None else str(len(self.measurements))
        kind, what = _KINDS[self.robot.model.limbs[0].kind]
        printed = ""
        if self.distances is not None:
            many = "s" * (len(self.distances) != 1)
            printed = f", {len(self.distances)} distance{many} of a printed part"
        yield f"{self.robot.name}: a {kind}, {stored} stored {what}{printed}"
        if self.robot.model.probe is not None:
            x, y, z = self.robot.model.probe
            yield (
                f"its probe touches the bed at {x:g}, {y:g} mm from the nozzle, which is {z:g} mm"
                " above the bed then"
            )
        yield from self.notes


def import_printer(
    path: str | PathLike[str],
    firmware: Firmware | None = None,
    *,
    log: str | PathLike[str] | None = None,
) -> Printer:
    r"""Read a linear or rotary delta from its firmware's configuration, with stored probe results.

    Parameters
    ----------
    path : str or path
        A printer.cfg of Klipper or Kalico: the block of SAVE_CONFIG at its end and included files
        that are there are read too. Or a file with the M665 and M666 of the other firmwares;
        actuator coordinates are then mm down from the end stops. What a config.g of RepRapFirmware
        runs by M501 and M98 is read where it is. Marlin's M851 belongs to them: with a bed probe it
        homes by its Z. Or the M669 and M666 of a Hangprinter, or the maslow.yaml of a Maslow or the
        log of its calibration.
    firmware : {"klipper", "reprap", "marlin", "hangprinter", "maslow"}, optional
        Whose file it is; by default what stands in it tells.
    log : str or path, optional
        Of a Maslow: the log of its calibration, where `path` is its maslow.yaml.

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
    where, path = as_path("path", path), path if isinstance(path, Input) else Input(path)
    if firmware is None:
        firmware = firmware_of(text_in(path, "replace"), str(where))
    else:
        word("firmware", firmware, get_args(Firmware))
    if log is not None and firmware != "maslow":
        raise ArgumentError(f"log: only a Maslow's is read, and {where} is of {firmware}")
    found = _READERS[firmware](path) if log is None else _of_maslow(path, log)
    try:
        robot = robot_of(found.text, "robot file")
    except FileError as error:  # each number is right, and what follows from them is not
        wrong = str(error).partition(": ")[2]
        raise FileError(f"{where}: its numbers are of no machine: {wrong}") from None
    return Printer(robot, found.measurements, found.distances, found.text, found.notes)


def _of_hangprinter(path: str | PathLike[str]) -> Stored:
    """The anchors of M669, and the spools of M666."""
    started, where = running(path), as_path("path", path)
    machine = hangprinter.of_text(started.text, str(where))
    head = _ANCHORS_HEAD if machine.spools is None else _SPOOLS_HEAD
    about = _about(where, head, "hangprinter", where.name * (not started.hides))
    text = hangprinter.robot_text(machine, about)
    return Stored(text, notes=(*started.notes, *machine.notes))


def _of_maslow(path: str | PathLike[str], log: str | PathLike[str] | None = None) -> Stored:
    """The anchors of a maslow.yaml or a log, and the belts of the log."""
    where = as_path("path", path)
    text = text_in(path) + ("" if log is None else "\n" + text_in(log))
    anchors, belts = maslow.of_text(text, str(where))
    if log is not None and not len(belts):
        raise FileError(f"{as_path('log', log)}: no belts of a Maslow's calibration, CLBM:[…]")
    config = where.name * (where.suffix.lower() in (".yaml", ".yml"))
    text = maslow.robot_text(anchors, _about(where, _BELTS_HEAD, "maslow", config))
    return Stored(text, Measurements(belts, None, "closure") if len(belts) else None)


def _of_marlin(path: str | PathLike[str]) -> Stored:
    """Read the settings that M503 lists."""
    where, text = as_path("path", path), text_in(path, "replace")  # of comments
    delta, probe = of_marlin(text, str(where)), marlin_probe(text, str(where))
    about = _about(where, _GCODE_HEAD, "marlin", probe=probe)
    return Stored(linear_delta.text_of(delta, _DOWN, about, bed=Bed()))


def _of_reprap(path: str | PathLike[str]) -> Stored:
    """Read a linear or rotary delta of a config.g and the files that it runs."""
    started, where = running(path), as_path("path", path)
    text, place, notes, probe = started.text, str(where), started.notes, None
    try:
        probe = reprap_probe(text, place)
    except FileError as error:  # the geometry does not hang on it
        notes = (*notes, f"{error}: the offset of the probe was not read")
    config = where.name * (not started.hides)
    if rotary_gcode.is_rotary(text, place):
        crank = rotary_gcode.of_reprap(text, place)
        about = _about(where, _DEGREES_HEAD, "reprap", config, probe)
        robot = rotary_delta.text_of(crank, round(0.5 * max(crank.endstops), 3), about, Bed())
    else:
        about = _about(where, _GCODE_HEAD, "reprap", config, probe)
        delta, bed = of_reprap(text, place), reprap_bed(text, place)
        robot = linear_delta.text_of(delta, _DOWN, about, bed=bed)
    return Stored(robot, notes=notes)


def _about(
    where: Path,
    head: str,
    firmware: Firmware,
    config: str = "",
    probe: tuple[float, float, float] | None = None,
) -> About:
    """Return the comment of a robot file on the file it was made of."""
    controller = Controller(firmware, config)
    return About(where.stem, head.format(file=where.name), probe, controller)


_READERS: dict[Firmware, Callable[[str | PathLike[str]], Stored]] = {
    "klipper": of_klipper,
    "reprap": _of_reprap,
    "marlin": _of_marlin,
    "hangprinter": _of_hangprinter,
    "maslow": _of_maslow,
}
