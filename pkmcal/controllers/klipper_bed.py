"""The cylinder to which Klipper and Kalico confine the nozzle of a delta, for a robot file.

Their `check_move` (klippy/kinematics/delta.py, rotary_delta.py) narrows the radius near the top: to
what a carriage below its end stop allows if its tower stands in the direction in which the nozzle
goes, for cranks to a cone of 45 degrees. The cylinder ends where that begins to cut it, so it holds
no pose that the firmware refuses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.controllers.linear_delta import Bed, FirmwareDelta
from pkmcal.controllers.printer_config import CALIBRATE, PrinterConfig, positive
from pkmcal.controllers.rotary_delta import RotaryDelta

_LEAST, _NARROWER = 0.1, 0.95  # of the height that is kept at least, and of the radius until it is


def of_linear(printer: PrinterConfig, delta: FirmwareDelta) -> Bed:
    """Return the bed of a linear delta: within the print radius, or where DELTA_CALIBRATE probes.

    Raises
    ------
    ValueError
        A radius that is none.
    """
    arm = min(delta.arms)
    tapered = min(at - each for at, each in zip(delta.carriages, delta.arms, strict=True))

    def highest(radius: float) -> float:
        inward = max(delta.radius - radius, 0.0)
        return tapered + arm - float(np.sqrt(arm**2 - inward**2))

    return _bed(printer, delta.radius, min(delta.endstops), highest)


def of_rotary(printer: PrinterConfig, delta: RotaryDelta) -> Bed:
    """Return the bed of a rotary delta.

    Raises
    ------
    ValueError
        A radius that is none.
    """
    limbs = zip(delta.heights, delta.cranks, delta.elbows, delta.rods, strict=True)
    tapered = min(height - crank * np.sin(elbow) - rod for height, crank, elbow, rod in limbs)
    top = min(delta.endstops)
    return _bed(printer, delta.across, top, lambda radius: max(float(tapered), top - radius))


def _bed(
    printer: PrinterConfig, across: float, top: float, highest: Callable[[float], float]
) -> Bed:
    """Return the bed; of a smaller radius where the firmware narrows the stated one from there on.

    Parameters
    ----------
    printer : PrinterConfig
        What states its radius and its least height.
    across, top : float
        The radius where the file states none, and the greatest height in the middle; mm.
    highest : callable
        The greatest height at which the firmware lets the nozzle go to a radius, mm.
    """
    stated = None
    for section, option in (("printer", "print_radius"), (CALIBRATE, "radius")):
        if stated is None and printer.has(section, option):
            stated = positive(printer, section, option)
    lowest = printer.number("printer", "minimum_z_position", 0.0)
    floor = max(0.0, lowest)
    start = radius = across if stated is None else stated
    while across > 0.0 and top > floor and highest(radius) < floor + _LEAST * (top - floor):
        radius *= _NARROWER
    return Bed(radius if radius < start else stated, lowest, highest(radius))
