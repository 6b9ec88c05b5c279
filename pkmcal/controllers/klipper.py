"""Klipper and Kalico: the numbers of a linear or rotary delta as lines of printer.cfg."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from os import PathLike

from pkmcal.controllers import linear_delta, rotary_delta
from pkmcal.controllers.gcode_words import SAME
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.own_file import Wanted, write_for
from pkmcal.controllers.printer_config import (
    ANGLES,
    STEPPERS,
    PrinterConfig,
    kinematics,
    read,
    step_of,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot

Values = dict[tuple[str, str], float]
_SHARED = ("arm_length", "upper_arm_length", "lower_arm_length", "position_endstop")


def klipper(
    robot: Robot,
    path: str | PathLike[str],
    config: str | PathLike[str] | None = None,
    project: bool = False,
) -> Loss:
    """Write the numbers of a linear or rotary delta for Klipper or Kalico.

    Parameters
    ----------
    robot : Robot
        A linear or rotary delta whose actuator coordinates are 0 at the end stops, in mm, rad or
        steps.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    config : str or path, optional
        The printer's own printer.cfg: it is written with the changed numbers, and not a character
        else of it. By default the lines alone are written.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot: towers that lean, or
        are not equally far, cranks that turn in other planes.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot; nothing is written.
    OSError
        A file that cannot be read or written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("linear-delta").replace({f"offset{i}": 400.0 for i in (1, 2, 3)})
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     loss = pk.export.klipper(robot, f"{folder}/lines.cfg")
    ...     print(pathlib.Path(folder, "lines.cfg").read_text().split()[:3])
    ['[printer]', 'delta_radius:', '105.600000']
    """
    return write_for(path, project, config, read, partial(_made, robot))


def _made(robot: Robot, wanted: Wanted, printer: PrinterConfig | None) -> tuple[str | bytes, Loss]:
    """The lines, or the printer's file with the changed numbers."""
    turning = rotary_delta.is_rotary_delta(robot)
    values, gains, loss = (_rotary if turning else _linear)(robot, wanted.project)
    if printer is None:
        return _lines(values), loss
    kind = "rotary_delta" if turning else "delta"
    if kinematics(printer) != kind:
        raise printer.wrong("printer", "kinematics", f"must be {kind}, as {robot.name} is")
    values = _as_in_the_file(values, printer, ANGLES[kind])
    values |= _gearing(printer, gains, turning)
    return printer.changed(values), loss


def _linear(robot: Robot, project: bool) -> tuple[Values, tuple[float, ...], Loss]:
    """The firmware's options by section and name, mm a step, and what is lost."""
    firmware, loss = linear_delta.of_robot(robot, project)
    values = {("printer", "delta_radius"): firmware.radius}
    for i, section in enumerate(STEPPERS):
        values[section, "position_endstop"] = firmware.endstops[i]
        values[section, "arm_length"] = firmware.arms[i]
        values[section, "angle"] = firmware.angles[i]
    return values, linear_delta.gains(robot), loss


def _rotary(robot: Robot, project: bool) -> tuple[Values, tuple[float, ...], Loss]:
    """Return the settings of a rotary delta, rad a step."""
    firmware, loss = rotary_delta.of_robot(robot, project, one_height=True)
    values = {("printer", "shoulder_radius"): firmware.radius}
    values["printer", "shoulder_height"] = firmware.heights[0]
    for i, section in enumerate(STEPPERS):
        values[section, "position_endstop"] = firmware.endstops[i]
        values[section, "upper_arm_length"] = firmware.cranks[i]
        values[section, "lower_arm_length"] = firmware.rods[i]
        values[section, "angle"] = firmware.angles[i]
    return values, firmware.gains, loss


def _as_in_the_file(values: Values, printer: PrinterConfig, angles: Mapping[str, float]) -> Values:
    """Drop what the firmware takes from elsewhere; give angles in the file's turn."""
    kept = {}
    for (section, option), value in values.items():
        default = angles.get(section) if option == "angle" else None
        if option in _SHARED and section != STEPPERS[0]:
            default = values[STEPPERS[0], option]
        if printer.has(section, option):
            if option == "angle":
                value += 360.0 * round((printer.number(section, option) - value) / 360.0)
        elif default is not None and abs(value - default) <= SAME:
            continue
        kept[section, option] = value
    return kept


def _lines(values: Values) -> str:
    text, last = "", ""
    for (section, option), value in values.items():
        text += "" if section == last else f"[{section}]\n"
        text, last = text + f"{option}: {value:.6f}\n", section
    return text


def _gearing(printer: PrinterConfig, gains: tuple[float, ...], turning: bool) -> Values:
    """Rotation distances where the robot's gains are not those of the file."""
    changed = {}
    unit = "rad" if turning else "mm"
    for section, gain in zip(STEPPERS, gains, strict=True):
        step = step_of(printer, section)
        ratio = min((abs(gain), abs(gain) / step), key=lambda one: abs(one - 1.0))
        if abs(ratio - 1.0) > (1e-9 if turning else 0.1):
            what = "crank" if turning else "carriage"
            raise ArgumentError(
                f"robot: a unit of its actuator moves a {what} by {abs(gain):.6g} {unit}; in"
                f" {printer.place} a step of [{section}] is {step:.6g} {unit}"
            )
        if abs(ratio - 1.0) > 1e-9:
            distance = printer.number(section, "rotation_distance")
            changed[section, "rotation_distance"] = distance * ratio
    return changed
