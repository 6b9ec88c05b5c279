"""The offset of a bed probe goes from the firmware's file through the calibration and back.

The printers here are their firmware's published models in plain NumPy: where a carriage is, how far
it has gone from its switch, at which z the probe triggers. After import, calibration and export the
nozzle of the true machine has to be where the firmware commands it, over the bed too.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pkmcal as pk

Floats = NDArray[np.float64]
GRID = np.array(
    [(x, y) for x in range(-80, 81, 40) for y in range(-80, 81, 40) if x * x + y * y < 1e4],
    dtype=float,
)


@dataclass(frozen=True)
class Delta:
    """Heights of the nozzle in the middle with each carriage at its switch: `ends`."""

    radius: float
    angles: Floats
    rod: float
    ends: Floats

    @property
    def towers(self) -> Floats:
        turned = np.radians(self.angles)
        return self.radius * np.stack([np.cos(turned), np.sin(turned)], axis=1)

    @property
    def switches(self) -> Floats:
        return self.ends + np.sqrt(self.rod**2 - self.radius**2)

    def gone(self, nozzle: Floats) -> Floats:
        """How far each carriage is below its switch, (N, 3), with the nozzle there."""
        across = ((nozzle[:, None, :2] - self.towers) ** 2).sum(axis=2)
        return self.switches - nozzle[:, 2:] - np.sqrt(self.rod**2 - across)

    def nozzle(self, gone: Floats) -> Floats:
        """Where that leads, (N, 3): Newton's method on the three lengths."""
        at = np.zeros_like(gone)
        at[:, 2] = (self.ends - gone).mean(axis=1)
        joints = np.concatenate(
            [np.broadcast_to(self.towers, (len(gone), 3, 2)), (self.switches - gone)[..., None]],
            axis=2,
        )
        for _ in range(12):
            rods = at[:, None] - joints
            missed = (rods**2).sum(axis=2) - self.rod**2
            at = at - np.linalg.solve(2 * rods, missed[..., None])[..., 0]
        return at


def triggers(true: Delta, firmware: Delta, offset: Floats) -> Floats:
    """The nozzle's x, y, z as the firmware has them when its probe touches the flat bed."""
    found = np.pad(GRID - offset[:2], ((0, 0), (0, 1)))
    for _ in range(30):  # the true height follows that of the firmware nearly one to one
        found[:, 2] += offset[2] - true.nozzle(firmware.gone(found))[:, 2]
    return found


def klipper_file(delta: Delta, offset: Floats) -> str:
    text = f"[printer]\nkinematics: delta\ndelta_radius: {delta.radius!r}\n[probe]\n"
    text += "".join(
        f"{axis}_offset: {o!r}\n" for axis, o in zip("xyz", offset.tolist(), strict=True)
    )
    for axis, angle, end in zip("abc", delta.angles.tolist(), delta.ends.tolist(), strict=True):
        text += f"[stepper_{axis}]\nrotation_distance: 40\nmicrosteps: 16\nangle: {angle!r}\n"
        text += f"arm_length: {delta.rod!r}\nposition_endstop: {end!r}\n"
    return text


def of_klipper(text: str) -> Delta:
    def numbers(option: str) -> Floats:
        return np.array([float(v) for v in re.findall(rf"^{option}: (\S+)", text, re.MULTILINE)])

    (radius,) = numbers("delta_radius")
    return Delta(radius, numbers("angle"), numbers("arm_length")[0], numbers("position_endstop"))


def marlin_file(delta: Delta, offset: Floats) -> str:
    """set_axis_is_at_home(): the nozzle is then at H - Z of M851, by its adjustment lower."""
    x, y, z = (delta.angles - [210.0, 330.0, 90.0]).tolist()
    least = float(delta.ends.min())
    px, py, pz = offset.tolist()
    a, b, c = (least - delta.ends).tolist()
    return (
        f"echo:  M665 L{delta.rod} R{delta.radius} H{least - pz!r} X{x!r} Y{y!r} Z{z!r}\n"
        f"echo:  M666 X{a!r} Y{b!r} Z{c!r}\n"
        f"echo:  M851 X{px} Y{py} Z{-pz} ; (mm)\n"
    )


def of_marlin(text: str) -> Delta:
    words = {
        command: {letter: float(value) for letter, value in re.findall(r"([A-Z])(\S+)", rest)}
        for command, rest in re.findall(r"(M\d+) (.*)", text)
    }
    size, ends, probe = words["M665"], words["M666"], words["M851"]
    assert not any(size[letter] for letter in "ABC" if letter in size)
    angles = np.array([210.0, 330.0, 90.0]) + [size[axis] for axis in "XYZ"]
    homed = size["H"] - probe["Z"]
    return Delta(size["R"], angles, size["L"], homed - np.array([ends[axis] for axis in "XYZ"]))


def reprap_file(delta: Delta, offset: Floats) -> str:
    x, y, z = (delta.angles - [210.0, 330.0, 90.0]).tolist()
    mean = float(delta.ends.mean())
    a, b, c = (delta.ends - mean).tolist()
    px, py, pz = offset.tolist()
    return (
        f"M665 L{delta.rod} R{delta.radius} H{mean!r} X{x!r} Y{y!r} Z{z!r}\n"
        f"M666 X{a!r} Y{b!r} Z{c!r}\nG31 K1 X9 Z9\n"
        f"G31 P500 X{px} Y{py} Z{pz} ; trigger height\n"
    )


def of_reprap(text: str) -> Delta:
    (size,), (ends,) = re.findall(r"M665 (.*)", text), re.findall(r"M666 (.*)", text)
    size, ends = (dict(re.findall(r"([A-Z])(\S+)", words)) for words in (size, ends))
    angles = np.array([210.0, 330.0, 90.0]) + [float(size[axis]) for axis in "XYZ"]
    ats = float(size["H"]) + np.array([float(ends[axis]) for axis in "XYZ"])
    return Delta(float(size["R"]), angles, float(size["L"].split(":")[0]), ats)


def height_map(touched: Floats, beds: Floats) -> str:
    """heightmap.csv of RepRapFirmware: a bare 0 where nothing was probed."""
    head = "RepRapFirmware height map file v2 generated at 2026-01-05 18:03, mean error 0.1\n"
    head += "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1\n"
    head += "X,Y,-80.00,80.00,-80.00,80.00,-1.00,40.00,40.00,5,5\n"
    at = {(round(x), round(y)): f"{z:.6f}" for x, y, z in beds}
    ends = range(-80, 81, 40)
    return head + "".join(",".join(at.get((x, y), "0") for x in ends) + "\n" for y in ends)


def lines_of(line: str) -> Callable[[Floats, Floats], str]:
    """A log of lines with the nozzle's place, or with that of the bed."""
    return lambda touched, beds: "\n".join(
        line.format(*a, *b) for a, b in zip(touched, beds, strict=True)
    )


# Of each firmware: its file of a delta, a delta of its file, and its log.
Log = Callable[[Floats, Floats], str]
FIRMWARES: dict[str, tuple[Callable[[Delta, Floats], str], Callable[[str], Delta], Log]] = {
    "klipper": (klipper_file, of_klipper, lines_of("// probe at {0:.6f},{1:.6f} is z={2:.6f}")),
    "marlin": (marlin_file, of_marlin, lines_of("Bed X: {3:.6f} Y: {4:.6f} Z: {5:.6f}")),
    "reprap": (reprap_file, of_reprap, height_map),
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_nozzle_is_at_its_height_after_a_calibration(
    firmware: Any, seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    offset = np.round(rng.uniform([-30.0, -30.0, 0.5], [30.0, 30.0, 9.0]), 2)
    before = Delta(
        170.0,
        np.array([210.0, 330.0, 90.0]),
        round(rng.uniform(320.0, 360.0), 1),
        np.round(300.0 - rng.uniform(0.0, 2.0, 3), 2),
    )
    true = replace(
        before,
        radius=before.radius + rng.uniform(-1.0, 1.0),
        angles=before.angles + np.append(rng.uniform(-0.3, 0.3, 2), 0.0),
        ends=before.ends + rng.uniform(-1.0, 1.0, 3),
    )
    write, parse, said = FIRMWARES[firmware]
    file, log = tmp_path / "own.cfg", tmp_path / "log.txt"
    file.write_text(write(before, offset))
    touched = triggers(true, before, offset)
    beds = touched + offset * [1, 1, -1]
    log.write_text(said(touched, beds))

    printer = pk.import_printer(file)
    assert printer.robot.model.probe == pytest.approx(offset)
    printer.robot.save(tmp_path / "robot.toml")
    robot = pk.load(tmp_path / "robot.toml")
    found = pk.identify(robot, pk.read_measurements(log, robot)).robot
    assert isinstance(found, pk.Robot)
    assert found.model.controller is not None and found.model.controller.firmware == firmware
    getattr(pk.export, firmware)(found, tmp_path / "new")
    after = parse((tmp_path / "new").read_text())
    commanded = np.column_stack([GRID, np.full(len(GRID), 0.2)])
    np.testing.assert_allclose(true.nozzle(after.gone(commanded))[:, 2], 0.2, rtol=0, atol=2e-3)
    assert abs(true.nozzle(before.gone(commanded))[:, 2] - 0.2).max() > 0.1


@pytest.mark.parametrize("z", [0.0, 0.7, 2.35])
def test_marlin_homes_to_h_less_the_offset_of_its_probe(z: float, tmp_path: Path) -> None:
    """What is written without a calibration is what was read, with the same probe."""
    delta = Delta(105.0, np.array([210.0, 330.0, 90.0]), 215.0, np.array([281.5, 281.0, 281.2]))
    file = tmp_path / "m503.txt"
    file.write_text(marlin_file(delta, np.array([0.0, -10.0, z])))
    robot = pk.import_printer(file, "marlin").robot
    down = [0.5, 0.0, 0.2]  # of Marlin's adjustments: the carriages where it calls them homed
    assert robot.forward(down).pose[2] == pytest.approx(281.0, abs=1e-9)
    pk.export.marlin(robot, tmp_path / "new.g")
    again = of_marlin((tmp_path / "new.g").read_text())
    np.testing.assert_allclose(again.ends, delta.ends, atol=1e-6)
    assert f"H{281.0 - z:.6f}" in (tmp_path / "new.g").read_text()
    unstated = pk.Robot(replace(robot.model, probe=None))
    with pytest.raises(pk.ArgumentError, match=r"does not state its bed probe: add \[probe\]"):
        pk.export.marlin(unstated, tmp_path / "x.g")
    assert not (tmp_path / "x.g").exists()


PRINTER = klipper_file(
    Delta(170.0, np.array([210.0, 330.0, 90.0]), 340.0, np.full(3, 300.0)), np.zeros(3)
)


@pytest.mark.parametrize(
    ("section", "offset"),
    [
        ("[bltouch]\nx_offset: -3\nz_offset: 2.35\n", (-3.0, 0.0, 2.35)),
        ("[probe_eddy_current my probe]\nz_offset: 1\ny_offset: 2\n", (0.0, 2.0, 1.0)),
        ("[smart_effector]\nz_offset: -0.1\n", (0.0, 0.0, -0.1)),
        ("[probe_tool]\nz_offset: 3\n[tmc z]\nx_offset: 1\n", None),
        ("", None),
    ],
)
def test_every_kind_of_probe_of_klipper_is_read(
    section: str, offset: tuple[float, ...] | None, tmp_path: Path
) -> None:
    """Also where SAVE_CONFIG wrote its offset after PROBE_CALIBRATE."""
    rest = re.sub(r"\[probe\]\n(\w_offset.*\n)+", "", PRINTER)
    header = "#*# <---------------------- SAVE_CONFIG ---------------------->\n"
    header += "#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n#*#\n"
    saved = "".join(f"#*# {line}\n" for line in section.splitlines())
    for text in (rest + section, f"{rest}\n{header}{saved}"):
        (tmp_path / "printer.cfg").write_text(text)
        found = pk.import_printer(tmp_path / "printer.cfg").robot.model.probe
        assert found is None if offset is None else found == pytest.approx(offset)


def test_a_second_probe_is_refused(tmp_path: Path) -> None:
    (tmp_path / "printer.cfg").write_text(PRINTER + "[bltouch]\nz_offset: 2\n")
    with pytest.raises(pk.FileError, match=r"\[bltouch\] z_offset is of a second probe beside"):
        pk.import_printer(tmp_path / "printer.cfg")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[probe]\n", "offset"),
        ("[probe]\noffset = { x = 1.0 }\n", r"line \d+: \[probe\]: offset: the key 'z' is missing"),
        ("[probe]\noffset = { z = -1.7 }\n", r"line \d+: .*found -1\.7 mm; it is -Z of Marlin's"),
        ("[probe]\noffset = { z = 1, w = 2 }\n", r"line \d+: .*w"),
    ],
)
def test_mistakes_in_a_robot_file_are_named(table: str, message: str, tmp_path: Path) -> None:
    text = pk.import_printer(written(tmp_path)).text
    head, limbs = text.split("[probe]")[0], text[text.index("[parameters]") :]
    (tmp_path / "robot.toml").write_text(head + table + limbs)
    with pytest.raises(pk.FileError, match=message):
        pk.load(tmp_path / "robot.toml")


def written(folder: Path) -> Path:
    (folder / "printer.cfg").write_text(PRINTER)
    return folder / "printer.cfg"
