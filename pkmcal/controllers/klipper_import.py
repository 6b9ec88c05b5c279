"""A printer.cfg of Klipper or Kalico as a robot file, with the probe results stored in it."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from pkmcal.controllers import klipper_bed, linear_delta, rotary_delta
from pkmcal.controllers.linear_delta import FirmwareDelta
from pkmcal.controllers.printer_config import (
    ANGLES,
    CALIBRATE,
    STEPPERS,
    PrinterConfig,
    kinematics,
    positive,
    read,
    step_of,
)
from pkmcal.controllers.robot_files import About
from pkmcal.controllers.rotary_delta import RotaryDelta, elbow_at
from pkmcal.controllers.stored import Stored
from pkmcal.geometry.controller import Controller
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.distances import Between

_LINEAR_HEAD = """\
# Imported from {file} by pkmcal: the firmware's numbers of a linear delta.
# An actuator coordinate is the motor's steps down from its end stop; `offset` is the height of the
# carriage there, position_endstop + sqrt(arm_length^2 - delta_radius^2). Above `[workspace]` the
# firmware allows less than its radius.
"""
_ROTARY_HEAD = """\
# Imported from {file} by pkmcal: the firmware's numbers of a rotary delta.
# An actuator coordinate is the motor's steps down from its end stop; `offset` is the angle of the
# crank there, below the horizontal. Radius and height are those of the shoulders less the
# effector's. Above `[workspace]` the firmware allows less than its radius.
"""
# Sections with the offsets of a bed probe; of an eddy current probe its own name follows.
_PROBES = ("probe", "bltouch", "smart_effector", "load_cell_probe", "dockable_probe")
_NAMED_PROBE = "probe_eddy_current "


def of_klipper(path: str | PathLike[str]) -> Stored:
    """The robot file of a printer.cfg, and what DELTA_CALIBRATE and DELTA_ANALYZE stored.

    Raises
    ------
    ValueError
        Other kinematics, or a number that is missing or wrong.
    OSError
        A file that cannot be read.
    """
    printer = read(path)
    notes = tuple(f"{file}, included, is not there and was not read" for file in printer.absent)
    where, (probe, unread) = Path(printer.place), _probe(printer)
    controller = Controller("klipper", where.name)
    heights, distances = _heights(printer), _distances(printer)
    if kinematics(printer) == "rotary_delta":
        crank = _rotary(printer)
        home = round(0.5 * max(crank.endstops), 3)
        about = About(where.stem, _ROTARY_HEAD.format(file=where.name), probe, controller)
        text = rotary_delta.text_of(crank, home, about, klipper_bed.of_rotary(printer, crank))
    else:
        delta, steps = _linear(printer)
        about = About(where.stem, _LINEAR_HEAD.format(file=where.name), probe, controller)
        rods = heights is not None and distances is not None
        bed = klipper_bed.of_linear(printer, delta)
        text = linear_delta.text_of(delta, steps, about, bed=bed, rods=rods)
    if heights is None:
        unread = (*unread, "DELTA_CALIBRATE, then SAVE_CONFIG, store heights in it")
    return Stored(text, heights, distances, (*notes, *unread))


def _linear(printer: PrinterConfig) -> tuple[FirmwareDelta, list[float]]:
    """The numbers of a linear delta; steps lead down from the end stops."""
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
    return FirmwareDelta(radius, tuple(angles), tuple(arms), tuple(carriages)), steps


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


def _first(printer: PrinterConfig, section: str, option: str) -> float:
    """A tower's number, or the first tower's where it has none."""
    return printer.number(section if printer.has(section, option) else STEPPERS[0], option)


def _probe(
    printer: PrinterConfig,
) -> tuple[tuple[float, float, float] | None, tuple[str, ...]]:
    """The offset of the bed probe, None where it cannot be read; and notes on what was not read.

    Raises
    ------
    ValueError
        Two probes: the firmware takes one.
    """
    offsets = ("x_offset", "y_offset", "z_offset")
    found = printer.sections(*offsets)
    known = [each for each in found if each in _PROBES or each.startswith(_NAMED_PROBE)]
    others = [each for each in found if each not in known]
    notes = tuple(
        f"{printer.place}: [{section}] has offsets and is no probe that is known: they were not"
        " read; state the offset of the probe in the robot file"
        for section in others
        if {"x_offset", "y_offset"} <= {each for each in offsets if printer.has(section, each)}
    )
    if not known:
        return None, notes
    if len(known) > 1:
        option = next(each for each in offsets if printer.has(known[1], each))
        raise printer.wrong(known[1], option, f"is of a second probe beside [{known[0]}]")
    (section,) = known
    if not printer.has(section, "z_offset"):
        unread = f"{printer.place}: [{section}] has no z_offset: the offset of the probe was not"
        return None, (*notes, f"{unread} read; state it in the robot file")
    x, y = (printer.number(section, option, 0.0) for option in ("x_offset", "y_offset"))
    return (x, y, printer.number(section, "z_offset")), notes


def _count(printer: PrinterConfig, name: str) -> int:
    count = 0
    while printer.has(CALIBRATE, f"{name}{count}"):
        count += 1
    return count


def _heights(printer: PrinterConfig) -> Measurements | None:
    """The stored heights of the probe and of the hand."""
    names = [
        f"{kind}{i}" for kind in ("height", "manual_height") for i in range(_count(printer, kind))
    ]
    if not names:
        return None
    steps = [printer.numbers(CALIBRATE, f"{name}_pos", 3) for name in names]
    values = [printer.number(CALIBRATE, name) for name in names]
    return Measurements(steps, values, "height")


def _distances(printer: PrinterConfig) -> Measurements | None:
    """The stored distances of a printed part, each between where two rows of steps lead."""
    names = [f"distance{i}" for i in range(_count(printer, "distance"))]
    if not names:
        return None
    first, then = (
        [printer.numbers(CALIBRATE, f"{name}_pos{end}", 3) for name in names] for end in (1, 2)
    )
    values = [printer.number(CALIBRATE, name) for name in names]
    return Measurements(first, values, Between(then))
