"""What a firmware's file says of its probe, or of where it homes, is read or said not to be."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pkmcal as pk

SIZE = "M665 L250 R125 H300\nM666 X0 Y0 Z0\n"
KLIPPER = "[printer]\nkinematics: delta\ndelta_radius: 174.75\n"
for _axis in "abc":
    KLIPPER += f"[stepper_{_axis}]\nrotation_distance: 40\nmicrosteps: 16\n"
    KLIPPER += "position_endstop: 297\narm_length: 333\n"


def imported(folder: Path, text: str, firmware: str) -> pk.Printer:
    path = folder / ("printer.cfg" if firmware == "klipper" else "config.g")
    path.write_text(text)
    return pk.import_printer(path, firmware)  # type: ignore[arg-type]


def probe_of(printer: pk.Printer) -> list[float] | None:
    probe = printer.robot.model.probe
    return None if probe is None else probe.tolist()


@pytest.mark.parametrize(
    ("lines", "probe"),
    [
        ("G31 X5 Y6 Z1.5\n", [5.0, 6.0, 1.5]),
        ("M851 Z-1.5\n", [0.0, 0.0, 1.5]),
        ("G31 X5 Y6 Z2\nM851 Z-1.5\n", [5.0, 6.0, 1.5]),
        ("M851 Z-1.5\nG31 X5 Y6 Z2\n", [5.0, 6.0, 2.0]),
        ("M851 Z-1.5\nG31 X5 Y6\n", [5.0, 6.0, 1.5]),
        ("M851 Z-1.5\nG31 K1 X9 Y9 Z9\n", [0.0, 0.0, 1.5]),
    ],
)
def test_m851_of_a_duet_is_the_height_of_g31(
    tmp_path: Path, lines: str, probe: list[float]
) -> None:
    """The last one counts, as in HandleMcode of GCodes2.cpp."""
    assert probe_of(imported(tmp_path, SIZE + lines, "reprap")) == probe


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("G31 K1 X5 Z1.5\n", "no height Z of the probe K0"),
        ("G31 P500 X5\n", "no height Z of the probe K0"),
        ("G31 P500 Z{global.height}\n", "Z of G31 must be a number"),
        ("G31 P500 X{var.x + 1} Y2 Z1.5\n", "X of G31 must be a number"),
        ("G20\nG31 Z0.1\nG21\n", "line 4: .*behind G20"),
        ("if true\n  G31 Z1.5\n", "under a condition"),
        ("M851 Z{global.height}\n", "Z of M851 must be a number"),
    ],
)
def test_an_offset_of_a_duet_that_is_not_read_is_said(tmp_path: Path, lines: str, why: str) -> None:
    printer = imported(tmp_path, SIZE + lines, "reprap")
    assert probe_of(printer) is None
    (note,) = printer.notes
    assert "the offset of the probe was not read" in note
    assert re.search(why, note), note


@pytest.mark.parametrize("text", [f"G20\n{SIZE}G21\n", f"G20\n{SIZE}"])
@pytest.mark.parametrize("firmware", ["reprap", "marlin"])
def test_numbers_in_inches_are_refused(tmp_path: Path, text: str, firmware: str) -> None:
    with pytest.raises(pk.FileError, match=r"line 2: .*M665.*behind G20, in inches"):
        imported(tmp_path, text + "M851 X0 Y0 Z-1\n", firmware)


def test_marlin_homes_elsewhere_with_m206(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="line 4: Z of M206 moves where Marlin homes"):
        imported(tmp_path, SIZE + "M851 Z0\nM206 X0 Y0 Z1.2\n", "marlin")
    printer = imported(tmp_path, SIZE + "M851 Z0\nM206 X0 Y0 Z0\n", "marlin")
    assert "-0" not in str(printer)
    with pytest.raises(pk.FileError, match=r"line 2: Y of M666 .* above 0, found 0.3"):
        imported(tmp_path, SIZE.replace("Y0", "Y0.3") + "M851 Z0\n", "marlin")


@pytest.mark.parametrize(
    ("section", "why"),
    [
        ("[probe]\nx_offset: 5\ny_offset: 6\n", r"\[probe\] has no z_offset"),
        ("[probe_eddy_current a]\nx_offset: 5\n", "a] has no z_offset"),
        ("[beacon]\nx_offset: 5\ny_offset: 6\n", "is no probe that is known"),
    ],
)
def test_a_probe_of_klipper_that_is_not_read_is_said(
    tmp_path: Path, section: str, why: str
) -> None:
    printer = imported(tmp_path, KLIPPER + section, "klipper")
    assert probe_of(printer) is None
    note, heights = printer.notes
    assert re.search(why, note), note
    assert "DELTA_CALIBRATE, then SAVE_CONFIG, store heights" in heights  # it has none


def test_a_second_probe_of_klipper_is_refused_without_a_height_too(tmp_path: Path) -> None:
    sections = "[probe]\nz_offset: 1\n[bltouch]\nx_offset: 5\n"
    with pytest.raises(pk.FileError, match=r"\[bltouch\] x_offset is of a second probe"):
        imported(tmp_path, KLIPPER + sections, "klipper")
