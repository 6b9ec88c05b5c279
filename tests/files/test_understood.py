"""What was made of each heading of a file: its meaning, its unit and where that is stated."""

from __future__ import annotations

from pathlib import Path

import pkmcal as pk
from pkmcal.files.understood import Understood


def test_each_heading_has_a_meaning_a_unit_and_where_that_is_from(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(
        "Lg1 [in],q2,X [um],Y,Z [m],Humidity,Std\n1,2,3,4,5,60,0.1\n2,3,4,5,6,61,0.1\n"
    )
    m = pk.read_measurements(
        tmp_path / "m.csv", rename={"Lg1": "q1 [in]"}, units="mm", ignore="Humidity"
    )
    said = {each.heading: each for each in m.understood}
    file = str(tmp_path / "m.csv")
    assert said["Y"] == Understood("Y", "y", "mm", "options", file, 1)
    assert said["Z"] == Understood("Z", "z", "m", "heading", file, 1)
    assert said["Lg1"] == Understood("Lg1", "q1", "in", "heading", file, 1)
    assert said["Std"] == Understood("Std", "sigma", "um", "X", file, 1)
    assert said["Humidity"].meaning is None and said["Humidity"].unit is None
    assert len(m.understood) == 7


def test_columns_of_a_log_are_those_of_its_own_file(tmp_path: Path) -> None:
    (points := tmp_path / "p.csv").write_text("name,x [mm],y [mm],z [mm]\nA,1,2,3\nB,2,3,4\n")
    (log := tmp_path / "log.csv").write_text("name,q1 [mm],q2 [mm],speed\nA,10,11,5\nB,20,21,5\n")
    m = pk.read_measurements(points, controller=log)
    by_file = {
        path.name: [each.heading for each in m.understood if each.file == str(path)]
        for path in (points, log)
    }
    assert {"x", "y", "z"} <= set(by_file["p.csv"])
    assert {"q1", "q2", "speed"} <= set(by_file["log.csv"])
    (speed,) = (each for each in m.understood if each.heading == "speed")
    assert speed.meaning is None


def test_a_unit_above_the_table_is_told_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text("Units: mm\n\nq1,q2,x,y,z\n1,2,3,4,5\n2,3,4,5,6\n")
    m = pk.read_measurements(tmp_path / "m.txt")
    assert {each.unit_from for each in m.understood} == {"line 1"}


def test_measurements_that_were_not_read_say_nothing_of_headings() -> None:
    assert pk.Measurements([[1.0, 2.0]], [[1.0, 2.0, 3.0]]).understood == ()
