"""Robots for controllers, and back: `pk.export`."""

from pkmcal.controllers.arm_dh import dh, universal_robots
from pkmcal.controllers.c_header import c_header
from pkmcal.controllers.delta_gcode import marlin, reprap
from pkmcal.controllers.fmu import fmu
from pkmcal.controllers.hangprinter import hangprinter
from pkmcal.controllers.import_printer import Printer
from pkmcal.controllers.klipper import klipper
from pkmcal.controllers.linuxcnc import linuxcnc
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.maslow import maslow
from pkmcal.controllers.mjcf import mjcf
from pkmcal.controllers.sdf import sdf
from pkmcal.controllers.target import Target
from pkmcal.controllers.targets import register, targets
from pkmcal.controllers.urdf import urdf

__all__ = [
    "Loss",
    "Printer",
    "Target",
    "c_header",
    "dh",
    "fmu",
    "hangprinter",
    "klipper",
    "linuxcnc",
    "marlin",
    "maslow",
    "mjcf",
    "register",
    "reprap",
    "sdf",
    "targets",
    "universal_robots",
    "urdf",
]
