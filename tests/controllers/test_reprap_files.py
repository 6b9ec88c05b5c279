"""Files that a config.g runs: what is in force is read, and never hidden by what is written."""

from __future__ import annotations

from pathlib import Path

import pytest

import pkmcal as pk

CONFIG = "M665 R105.6 L215.0 B85 H240\nM666 X0 Y0 Z0\nG31 P500 X0 Y9 Z1.2\n"
OVERRIDE = """\
; config-override.g file generated in response to M500
M665 L215.000:215.000:215.000 R107.100 H240.700 B85.0 X0.000 Y0.000 Z0.000
M666 X0.3 Y-0.3 Z0.0 A0.00 B0.00
G31 K0 P500 X0.0 Y9.0 Z1.45
"""


def placed(folder: Path, config: str = CONFIG + "M501\n", **others: str) -> Path:
    """The folder sys of a card."""
    (folder / "sys").mkdir()
    for name, text in {"config": config, **others}.items():
        (folder / "sys" / f"{name}.g").write_text(text)
    return folder / "sys" / "config.g"


def radius(file: Path) -> float:
    return pk.import_printer(file, "reprap").robot.geometry["radius"]


def override(folder: Path, text: str = OVERRIDE) -> None:
    (folder / "sys" / "config-override.g").write_text(text)


def test_what_m501_loads_is_in_force(tmp_path: Path) -> None:
    file = placed(tmp_path)
    override(tmp_path)
    printer = pk.import_printer(file, "reprap")
    g = printer.robot.geometry
    assert g["radius"] == 107.1 and g["offset1"] - g["offset2"] == pytest.approx(0.6)
    assert printer.robot.model.probe == pytest.approx([0.0, 9.0, 1.45])
    assert printer.notes == ()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("M501", 107.1),
        ("m501 ; load what M500 saved", 107.1),
        ("; M501", 105.6),
        ("M5011", 105.6),
        ('M98 P"delta.g"', 109.0),
        ('M98 P"0:/sys/delta.g"', 109.0),
        ("M98 P/sys/delta.g R1", 109.0),
        ('M98 P"/macros/delta.g"', 111.0),
        ('M98 P"nested.g"', 109.0),
        ('M501\nM98 P"delta.g"', 109.0),
        ('M98 P"delta.g"\nM501', 107.1),
        ("M501\nM665 R113", 113.0),
    ],
)
def test_files_are_read_where_they_are_run(line: str, expected: float, tmp_path: Path) -> None:
    file = placed(tmp_path, config=CONFIG + line + "\n", delta="M665 R109\n")
    override(tmp_path)
    (tmp_path / "sys" / "nested.g").write_text('M98 P"delta.g"')
    (tmp_path / "macros").mkdir()
    (tmp_path / "macros" / "delta.g").write_text("M665 R111\n")
    assert radius(file) == expected


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("M501", "config-override.g, which M501 runs, is not there and was not read"),
        ('M98 P"delta.g"', "delta.g, which M98 P.* runs, is not there and was not read"),
        ("M98 P{var.name}", "M98 P{var.name} names its file by an expression"),
        ("if true\n  M501", "M501 stands under a condition and was not followed"),
    ],
)
def test_what_cannot_be_read_is_said_and_nothing_is_written_above_it(
    line: str, note: str, tmp_path: Path
) -> None:
    file = placed(tmp_path, config=CONFIG + line + "\n")
    printer = pk.import_printer(file, "reprap")
    assert len(printer.notes) == 1 and printer.robot.geometry["radius"] == 105.6
    with pytest.raises(pk.FileError, match=f"config.g: other numbers may be in force .*{note}"):
        pk.export.reprap(printer.robot, tmp_path / "new.g", config=file)
    assert not (tmp_path / "new.g").exists()


def test_numbers_go_into_the_file_that_sets_them(tmp_path: Path) -> None:
    file = placed(tmp_path)
    override(tmp_path)
    robot = pk.import_printer(file, "reprap").robot
    better = robot.replace({"radius": 108.0})
    with pytest.raises(pk.FileError, match=r"config-override\.g sets M665 and M666; give the file"):
        pk.export.reprap(better, tmp_path / "new.g", config=file)
    own = tmp_path / "sys" / "config-override.g"
    pk.export.reprap(better, own, config=own)
    assert "R108.000000" in own.read_text()
    assert radius(file) == pytest.approx(108.0)
    override(tmp_path, "; nothing of the geometry\nM307 H0 R2\n")
    pk.export.reprap(robot.replace({"radius": 110.0}), file, config=file)
    assert radius(file) == pytest.approx(110.0)


def test_a_file_that_runs_itself_and_a_mistake_in_another_file_are_named(tmp_path: Path) -> None:
    file = placed(tmp_path, config=CONFIG + 'M98 P"a.g"\n', a='\nM98 P"config.g"\n')
    with pytest.raises(pk.FileError, match=r'a\.g: M98 P"config\.g" runs a file that is being run'):
        pk.import_printer(file, "reprap")
    (tmp_path / "sys" / "a.g").write_text("\n\nM665 R1 R2\n")
    with pytest.raises(pk.FileError, match=r"a\.g, line 3: 'M665 R1 R2': M665 must have R once"):
        pk.import_printer(file, "reprap")


def test_an_offset_of_the_probe_that_is_no_number_is_said(tmp_path: Path) -> None:
    file = placed(tmp_path, config=CONFIG + "G31 Z{global.trigger}\n")
    printer = pk.import_printer(file, "reprap")
    assert printer.robot.model.probe is None
    assert "Z of G31 must be a number" in printer.notes[0]
