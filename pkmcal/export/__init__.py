"""Robots for controllers, and back: `pk.export`."""

from pkmcal.export.c_header import c_header as c_header
from pkmcal.export.delta_gcode import marlin as marlin
from pkmcal.export.delta_gcode import reprap as reprap
from pkmcal.export.hangprinter import hangprinter as hangprinter
from pkmcal.export.import_printer import Printer as Printer
from pkmcal.export.klipper import klipper as klipper
from pkmcal.export.linuxcnc import linuxcnc as linuxcnc
from pkmcal.export.loss import Loss as Loss
from pkmcal.export.mjcf import mjcf as mjcf
from pkmcal.export.urdf import urdf as urdf

__all__ = [
    "Loss",
    "Printer",
    "c_header",
    "hangprinter",
    "klipper",
    "linuxcnc",
    "marlin",
    "mjcf",
    "reprap",
    "urdf",
]
