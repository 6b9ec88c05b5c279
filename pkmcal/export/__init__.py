"""Robots for controllers, and back: `pk.export`."""

from pkmcal.export.arm_dh import dh as dh
from pkmcal.export.arm_dh import universal_robots as universal_robots
from pkmcal.export.c_header import c_header as c_header
from pkmcal.export.delta_gcode import marlin as marlin
from pkmcal.export.delta_gcode import reprap as reprap
from pkmcal.export.import_printer import Printer as Printer
from pkmcal.export.klipper import klipper as klipper
from pkmcal.export.linear_delta import Loss as Loss
from pkmcal.export.mjcf import mjcf as mjcf

__all__ = [
    "Loss",
    "Printer",
    "c_header",
    "dh",
    "klipper",
    "marlin",
    "mjcf",
    "reprap",
    "universal_robots",
]
