"""Klipper and Kalico: the numbers of a linear delta as lines of printer.cfg."""

from __future__ import annotations

from os import PathLike

from pkmcal.arguments import flag
from pkmcal.arguments import path as as_path
from pkmcal.controllers.linear_delta import FirmwareDelta, Loss, gains, of_robot
from pkmcal.controllers.printer_config import (
    DELTA_ANGLES,
    SAME,
    STEPPERS,
    PrinterConfig,
    read,
    require_delta,
    step_of,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot


def klipper(
    robot: Robot,
    path: str | PathLike[str],
    config: str | PathLike[str] | None = None,
    project: bool = False,
) -> Loss:
    """Write a linear delta's numbers for Klipper or Kalico.

    Parameters
    ----------
    robot : Robot
        A linear delta whose actuator coordinates are 0 at the end stops, in mm or in steps.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    config : str or path, optional
        The printer's own printer.cfg: it is written with the changed numbers, and not a character
        else of it. By default the lines alone are written.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot: towers that lean, or
        are not equally far.

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
    path, project = as_path("path", path), flag("project", project)
    firmware, loss = of_robot(robot, project)
    values = _values(firmware)
    if config is None:
        write_whole(path, _lines(values))
        return loss
    printer = read(config)
    require_delta(printer)
    values = _as_in_the_file(values, printer) | _rotations(printer, robot)
    write_whole(path, printer.changed(values))
    return loss


def _values(firmware: FirmwareDelta) -> dict[tuple[str, str], float]:
    """The firmware's options by section and name."""
    values = {("printer", "delta_radius"): firmware.radius}
    for i, section in enumerate(STEPPERS):
        values[section, "position_endstop"] = firmware.endstops[i]
        values[section, "arm_length"] = firmware.arms[i]
        values[section, "angle"] = firmware.angles[i]
    return values


def _as_in_the_file(
    values: dict[tuple[str, str], float], printer: PrinterConfig
) -> dict[tuple[str, str], float]:
    """Without what the firmware takes from elsewhere, and with angles in the file's turn."""
    kept = {}
    for (section, option), value in values.items():
        default = DELTA_ANGLES.get(section) if option == "angle" else None
        if option in ("arm_length", "position_endstop") and section != STEPPERS[0]:
            default = values[STEPPERS[0], option]
        if printer.has(section, option):
            if option == "angle":
                value += 360.0 * round((printer.number(section, option) - value) / 360.0)
        elif default is not None and abs(value - default) <= SAME:
            continue
        kept[section, option] = value
    return kept


def _lines(values: dict[tuple[str, str], float]) -> str:
    text, last = "", ""
    for (section, option), value in values.items():
        text += "" if section == last else f"[{section}]\n"
        text, last = text + f"{option}: {value:.6f}\n", section
    return text


def _rotations(printer: PrinterConfig, robot: Robot) -> dict[tuple[str, str], float]:
    """Rotation distances where the robot's gains are not those of the file."""
    changed = {}
    for section, gain in zip(STEPPERS, gains(robot), strict=True):
        step = step_of(printer, section)
        ratio = min((abs(gain), abs(gain) / step), key=lambda one: abs(one - 1.0))
        if abs(ratio - 1.0) > 0.1:
            raise ArgumentError(
                f"robot: a unit of its actuator moves a carriage by {abs(gain):.6g} mm; in"
                f" {printer.place} a step of [{section}] is {step:.6g} mm"
            )
        if abs(ratio - 1.0) > 1e-9:
            distance = printer.number(section, "rotation_distance")
            changed[section, "rotation_distance"] = distance * ratio
    return changed
