"""Robots for controllers, and back: `pk.export`."""

from pkmcal.controllers.c_header import c_header
from pkmcal.controllers.delta_gcode import marlin, reprap
from pkmcal.controllers.import_printer import Printer
from pkmcal.controllers.klipper import klipper
from pkmcal.controllers.linear_delta import Loss
from pkmcal.controllers.mjcf import mjcf

__all__ = ["Loss", "Printer", "c_header", "klipper", "marlin", "mjcf", "reprap"]
