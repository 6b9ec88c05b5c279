"""Makes probe.csv and printer.cfg: what a bed probe reads on a simulated linear delta.

The printer goes where robot.toml, its geometry before any calibration, puts the bed (z = 0). Its
true geometry is another, so the nozzle ends up a little above or below: that height is the log.
printer.cfg is the same printer and log as Klipper keeps them.

    python examples/linear-delta/make_log.py
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
TRUE = {
    "radius": 171.4,
    "angle1": math.radians(209.7),
    "angle2": math.radians(330.2),
    "offset1": 624.2,
    "offset2": 625.6,
    "offset3": 624.7,
}
NOISE = 0.03  # mm, of the probe
STEP = 60 / 6400  # mm a microstep of a carriage
RINGS = {0.0: 1, 30.0: 6, 60.0: 10, 90.0: 12, 120.0: 12}  # radius in mm: points on it


def bed() -> np.ndarray:
    """Poses of the 41 points on the bed, (41, 6)."""
    angles = {radius: np.arange(count) * 2 * np.pi / count for radius, count in RINGS.items()}
    points = [(r * np.cos(a), r * np.sin(a)) for r, turns in angles.items() for a in turns]
    return np.pad(points, ((0, 0), (0, 4)))


def log() -> pk.Measurements:
    """Carriage travels from the end stops in whole microsteps, and heights to 1 µm."""
    robot = pk.load(HERE / "robot.toml")
    travels = np.round(robot.inverse(bed()) / STEP) * STEP
    printer = pk.VirtualMachine(robot.replace(TRUE), noise=NOISE, seed=41)
    read = printer.measure(travels, kind="height")
    return pk.Measurements(
        travels.round(6), read.values.round(3), "height", sigma=read.sigma, actuator_units="mm"
    )


def printer_config(measured: pk.Measurements) -> str:
    """The printer before its calibration as a printer.cfg, the log where SAVE_CONFIG puts it."""
    endstop = 625.0 - math.sqrt(340.0**2 - 170.0**2)
    text = "# A simulated linear delta, before its calibration.\n"
    for i, axis in enumerate("abc"):
        text += f"[stepper_{axis}]\nstep_pin: gpio{3 * i}\ndir_pin: gpio{3 * i + 1}\n"
        text += f"enable_pin: gpio{3 * i + 2}\nendstop_pin: gpio{9 + i}\n"
        text += "rotation_distance: 60\nmicrosteps: 32\n"
        text += f"position_endstop: {endstop:.6f}\narm_length: 340\n\n"
    text += "[printer]\nkinematics: delta\nmax_velocity: 300\nmax_accel: 3000\n"
    text += (
        "delta_radius: 170 # towers less the joint offsets\n\n[delta_calibrate]\nradius: 120\n\n"
    )
    text += "#*# <---------------------- SAVE_CONFIG ---------------------->\n"
    text += "#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n#*#\n"
    text += "#*# [delta_calibrate]\n"
    for i, (travels, height) in enumerate(zip(measured.actuators, measured.values, strict=True)):
        steps = ",".join(f"{-travel / STEP:.3f}" for travel in travels)
        text += f"#*# height{i} = {height}\n#*# height{i}_pos = {steps}\n"
    return text


if __name__ == "__main__":
    log().write(sys.argv[1] if len(sys.argv) > 1 else HERE / "probe.csv")
    if len(sys.argv) == 1:
        (HERE / "printer.cfg").write_text(printer_config(log()))
