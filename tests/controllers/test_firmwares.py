"""Whose file it is, told by what stands in it, and what an imported machine says at the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk
from pkmcal.controllers.firmwares import firmware_of

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "examples" / "linear-delta" / "printer.cfg"
SIZE = "M665 L250 R125 H300\nM666 X-0.1\n"
MASLOW = "kinematics:\n  MaslowKinematics:\n    tlX: -6.2\n    tlY: 2188.0\n    trX: 2991.2\n"
MASLOW += "    trY: 2197.4\n    blX: 0.0\n    blY: 0.0\n    brX: 2989.8\n    brY: 0.0\n"
BELTS = "[MSG]\nCLBM:[{bl:1851.5, br:1843.25,   tr:1.8e3,   tl:1820},]\n"


@pytest.mark.parametrize(
    ("text", "firmware"),
    [
        (CONFIG.read_text(), "klipper"),
        ("# all of it is included\n[include hardware.cfg]\n[printer]\n", "klipper"),
        (SIZE + "M574 X2 S1\n", "reprap"),
        (SIZE + 'M98 P"a.g"\n', "reprap"),
        ("; config-override.g file generated in RepRapFirmware\n" + SIZE, "reprap"),
        ("M669 K10 U170 L400 H300 R100 A-90:60\n", "reprap"),
        ("M669 K6 N4 A1:2:3\n", "hangprinter"),
        ("echo:  M665 L250 R125 H300\necho:  M666 X-0.1\n", "marlin"),
        (SIZE + "M851 X0 Y0 Z-1\n", "marlin"),
        (SIZE + "; M574 echo:\nM851 X0 Y0 Z-1\n", "marlin"),
        (SIZE + "G31 Z1\nM851 Z-1\n", "reprap"),
        (MASLOW, "maslow"),
        ("$/Maslow_tlX=-6.2\n", "maslow"),
        ("Maslow_vertical: false\nMaslow_tlX: -6.2\nMaslow_tlY: 2188.0\n", "maslow"),
        (BELTS, "maslow"),
    ],
)
def test_a_file_shows_whose_it_is(text: str, firmware: str) -> None:
    assert firmware_of(text, "file") == firmware


@pytest.mark.parametrize("text", [SIZE, SIZE + "M851 Z-1\n", "hello\n", ""])
def test_a_file_that_may_be_of_two_is_asked_about(text: str, tmp_path: Path) -> None:
    """The adjustments of M666 have opposite signs."""
    (tmp_path / "f.g").write_text(text)
    with pytest.raises(pk.FileError, match=r"f\.g: it does not show whose file it is: .*--from"):
        pk.import_printer(tmp_path / "f.g")


def test_a_maslow_has_its_anchors_in_one_file_and_its_belts_in_another(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    yaml, log = tmp_path / "maslow.yaml", tmp_path / "serial.log"
    yaml.write_text(MASLOW)
    log.write_text(BELTS)
    done = run("import", yaml, "--log", log, "--out", tmp_path / "sled")
    assert done.exit_code == 0, done.output
    robot = pk.load(tmp_path / "sled" / "robot.toml")
    belts = pk.read_measurements(tmp_path / "sled" / "belts.csv", robot)
    assert belts.actuators.tolist() == [[1820.0, 1800.0, 1851.5, 1843.25]]
    assert robot.geometry["base2.x"] == 2991.2
    assert "they are in its maslow.yaml" in refused("import", log, "--out", tmp_path / "x")
    assert "no belts" in refused("import", yaml, "--log", yaml, "--out", tmp_path / "x")
    said = refused("import", CONFIG, "--log", log, "--out", tmp_path / "x")
    assert "only a Maslow's is read" in said


def test_the_report_of_an_imported_machine_ends_with_its_own_export(
    run: Any, tmp_path: Path
) -> None:
    """And carries it out: the command is run as it stands."""
    (tmp_path / "printer.cfg").write_bytes(CONFIG.read_bytes())
    assert run("import", tmp_path / "printer.cfg", "--out", tmp_path / "mine").exit_code == 0
    mine = tmp_path / "mine"
    done = run(
        "calibrate", mine / "robot.toml", mine / "probe.csv", "--report", tmp_path / "report"
    )
    *_, last = done.stdout.splitlines()
    robot = tmp_path / "report" / "robot.toml"
    command = f"pkmcal export {robot} --as klipper --config printer.cfg --out new.cfg"
    assert last == f"for its firmware: {command}"
    page = (tmp_path / "report" / "report.html").read_text()
    assert f"<pre>{command.replace(str(robot), 'robot.toml')}</pre>" in page
    assert "enter the values under" not in page
    assert '"reading": "counts"' in page.replace('":"', '": "')  # of the sliders
    words = command.replace("printer.cfg", str(tmp_path / "printer.cfg")).split()[1:]
    assert run(*words[:-1], tmp_path / "new.cfg").exit_code == 0
    assert "delta_radius: 171.4" in (tmp_path / "new.cfg").read_text()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('firmware = "smoothie"', "firmware"),
        ('file = "x"', "firmware"),
        ('firmware = "klipper"\nport = 1', "port"),
    ],
)
def test_a_controller_that_is_not_known_is_named(table: str, message: str, tmp_path: Path) -> None:
    text = pk.import_printer(CONFIG).text
    start, end = text.index("[controller]"), text.index("[parameters]")
    (tmp_path / "r.toml").write_text(f"{text[:start]}[controller]\n{table}\n{text[end:]}")
    with pytest.raises(pk.FileError, match=rf"r\.toml, line \d+: .*{message}"):
        pk.load(tmp_path / "r.toml")
