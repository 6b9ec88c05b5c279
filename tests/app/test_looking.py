"""What a file's columns were read as is told column by column, and a log's rows by each way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk
from pkmcal.app.work import Work, look
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.project import Project
from pkmcal.jobs.reading import Reading


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    robot = pk.load("hexapod")
    measured = pk.VirtualMachine(robot, noise=0.02, seed=1).measure(
        robot.inverse(pk.sample_poses(robot, 8, seed=2))
    )
    rows = [f"P{i};{x:.4f};{y:.4f};{z:.4f};1" for i, (x, y, z) in enumerate(measured.values)]
    Path("t.csv").write_text("\n".join(["Point;X;Y;Z;Quality", *rows]))
    legs = [
        f"P{i}," + ",".join(f"{q:.4f}" for q in row) for i, row in enumerate(measured.actuators)
    ]
    heads = ",".join(f"q{i} [mm]" for i in range(1, 7))
    Path("log.csv").write_text("\n".join([f"Name,{heads}", *legs]))
    return tmp_path


def looked(**reading: Any) -> dict[str, Any]:
    job = Calibration("hexapod", ("t.csv",), Reading(controller="log.csv", **reading))
    return look(Work(), Project(job).table(), {}, lambda *said: None)


def test_each_column_is_told_as_it_was_read(folder: Path) -> None:
    found = looked(units="mm", ignore=("Quality",))
    said = {(one["file"], one["heading"]): one["said"] for one in found["columns"]}
    assert said["t.csv", "X"] == "read as x in mm, the unit of the units stated here"
    assert said["log.csv", "q3"] == "read as q3 in mm"
    assert said["t.csv", "Quality"] == "left out"
    assert len(said) == 5 + 7 and "error" not in found


def test_columns_are_there_to_be_named_where_they_cannot_be_read(folder: Path) -> None:
    found = looked()
    assert "Quality" in found["error"]["message"]
    assert {one["heading"] for one in found["columns"] if one["file"] == "t.csv"} == {
        "Point", "X", "Y", "Z", "Quality"
    }  # fmt: skip


def test_each_way_of_joining_is_shown_before_it_is_chosen(folder: Path) -> None:
    ways = {one["way"]: one for one in looked(units="mm", ignore=("Quality",))["joins"]}
    assert "by name" in ways["auto"]["said"] and "by row" in ways["row"]["said"]
    first = {way: ways[way]["text"].splitlines()[2].split()[1] for way in ("name", "row", "row+1")}
    logged = [line.split(",")[1] for line in Path("log.csv").read_text().splitlines()[1:3]]
    assert first == {"name": logged[0], "row": logged[0], "row+1": logged[1]}
    assert not ways["time"]["text"] and "time" in ways["time"]["said"]


def test_a_mistake_far_down_is_shown_with_its_line(folder: Path) -> None:
    lines = Path("t.csv").read_text().splitlines()
    lines += lines[1:] * 5
    lines[30] = lines[30].replace(";1", ";one").replace("P", "P;", 1)
    Path("t.csv").write_text("\n".join(lines))
    found = looked(units="mm")
    assert found["error"]["line"] == 31
    assert dict(found["files"]["t.csv"])[31] == lines[30]
