"""Files that are given to the window become what they are, wherever they are dropped."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.app.taking import kind_of, taken, with_machine
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.project import Project

EXAMPLES = Path(__file__).parents[2] / "examples"
PRINTER = EXAMPLES / "linear-delta" / "printer.cfg"
M503 = "echo:  M665 L330 R120 H300\necho:  M666 X-0.1 Y0 Z0\n"
LENS = "camera_matrix:\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    shutil.copy(PRINTER, tmp_path)
    pk.load("hexapod").save(tmp_path / "mine.toml")
    files = {
        "t.csv": "x [mm],y [mm]\n1,2\n", "export.txt": "Point X Y\nP1 1 2\n", "m503.txt": M503,
        "config.g": "M665 L330 R120 H300\nM666 X0 Y0 Z0\nM558 P1\n", "bed.g": "G30\n",
        "lens.yaml": LENS, "columns.toml": 'ignore = ["Quality"]\n',
        "notes.pdf": "%PDF-1.4", "other.toml": "pkmcal-project = 1\n",
        "arm.urdf": "<robot name='a'/>", "broken.toml": "[pose\n",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("printer.cfg", "configuration"), ("config.g", "configuration"),
        ("m503.txt", "configuration"), ("mine.toml", "machine"), ("arm.urdf", "machine"),
        ("broken.toml", "machine"), ("t.csv", "measurements"), ("export.txt", "measurements"),
        ("lens.yaml", "camera"), ("columns.toml", "columns"), ("other.toml", "project"),
    ],
)  # fmt: skip
def test_a_file_is_known_by_what_stands_in_it(folder: Path, name: str, kind: str) -> None:
    assert kind_of(Path(name)) == kind


def test_measurements_never_take_the_place_of_the_machine(folder: Path) -> None:
    before = Project(Calibration("hexapod", ("a.csv",)))
    found = taken(before, ["t.csv", "export.txt"])
    assert found.project.calibration == replace(
        before.calibration, files=("a.csv", "t.csv", "export.txt")
    )
    assert any("t.csv, export.txt: measurements" in line for line in found.said)


@pytest.mark.parametrize("order", [("bed.g", "config.g", "t.csv"), ("t.csv", "config.g", "bed.g")])
def test_each_of_several_files_is_taken_or_named(folder: Path, order: tuple[str, ...]) -> None:
    found = taken(Project(), order)
    assert found.project.importing == Importing("config.g", "machine")
    assert found.project.calibration.files == ("t.csv",)
    assert all(any(name in line for line in found.said) for name in order)


def test_another_machine_keeps_what_was_measured_and_says_what_is_gone(folder: Path) -> None:
    job = Calibration("machine/robot.toml", ("machine/probe.csv", "t.csv"), free=("offset1",))
    before = Project(job, Planning(count=7), Importing("printer.cfg", "machine"), ("c",))
    found = taken(before, ["mine.toml"])
    assert found.project == Project(Calibration("mine.toml", ("t.csv",)))
    said = " ".join(found.said)
    assert "printer.cfg is gone" in said and "t.csv" in said
    assert with_machine(Project(), "hexapod").said == ("machine: hexapod",)


def test_the_machine_itself_read_again_keeps_what_is_asked_of_it(folder: Path) -> None:
    job = Calibration("machine/robot.toml", ("machine/probe.csv",), free=("offset1",))
    before = Project(job, importing=Importing("printer.cfg", "machine", "klipper"))
    assert taken(before, ["printer.cfg"]).project == before
    own = Project(Calibration("mine.toml", ("t.csv",), fix=("offset1",)))
    assert taken(own, ["mine.toml"]).project == own


@pytest.mark.parametrize("name", ["notes.pdf", "other.toml"])
def test_what_is_neither_is_refused_by_name(folder: Path, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        taken(Project(), ["t.csv", name])


def test_a_lens_and_columns_go_to_the_reading(folder: Path) -> None:
    reading = taken(Project(), ["lens.yaml", "columns.toml"]).project.calibration.reading
    assert (reading.camera, reading.columns) == (("lens.yaml",), "columns.toml")
