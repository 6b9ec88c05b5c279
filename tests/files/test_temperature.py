"""Temperatures and times of files are those that were written there, in °C and seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.column_names import known_as
from pkmcal.files.header import parted


def read(folder: Path, text: str) -> pk.Measurements:
    path = folder / "m.csv"
    path.write_text(text, "utf-8")
    return pk.read_measurements(path)


@pytest.mark.parametrize(
    ("heading", "cell", "celsius"),
    [
        ("Temp C", "20.5", 20.5),
        ("Temperature [°C]", "20.5", 20.5),
        ("Temperatur (°C)", "20.5", 20.5),
        ("Temperature_C", "20.5", 20.5),
        ("temperature/°C", "20.5", 20.5),
        ("Machine Temp [degC]", "20.5", 20.5),
        ("Temperature [K]", "293.65", 20.5),
        ("Temp. [°F]", "68.9", 20.5),
    ],
)
def test_every_spelling_is_the_temperature_of_the_machine(
    heading: str, cell: str, celsius: float, tmp_path: Path
) -> None:
    m = read(tmp_path, f"q1 [mm],z [mm],{heading}\n1,2,{cell}\n")
    np.testing.assert_allclose(m.temperature, [[celsius] * 3], rtol=1e-12)


@pytest.mark.parametrize(
    ("heading", "name"),
    [
        ("Strut 3 Temp", "temperature.q3"),
        ("temp_leg_2", "temperature.q2"),
        ("Axis1 Temperature [°C]", "temperature.q1"),
        ("Temp Strut 4 (°C)", "temperature.q4"),
        ("Base temperature", "temperature.base"),
        ("Platform Temp", "temperature.platform"),
    ],
)
def test_parts_have_temperatures_of_their_own(heading: str, name: str) -> None:
    assert known_as(parted(heading)[0]) == name


def test_a_part_without_a_column_has_that_of_the_machine(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],q2 [mm],z [mm],Temp C,Strut 2 Temp [°C]\n1,2,3,20,25\n1,3,3,,26\n")
    nan = np.nan
    np.testing.assert_equal(m.temperature, [[20, 20, 20, 25], [nan, nan, nan, 26]])
    assert "'Temp C' has no unit, taken as °C" in m.notes[0]


def test_letters_behind_a_name_are_no_unit_of_temperature() -> None:
    assert parted("Euler C")[1] is None and parted("Force_K")[1] is None


def test_the_air_is_not_the_machine(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],z [mm],Air Temperature\n1,2,20\n")
    assert m.temperature is None and "left out: 'Air Temperature'" in m.notes[0]


def test_an_actuator_that_is_not_there_has_no_temperature(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match=r"'Strut 3 Temp' is the temperature of an actuator"):
        read(tmp_path, "q1 [mm],z [mm],Strut 3 Temp\n1,2,20\n")


def test_times_and_temperatures_are_read_back(tmp_path: Path) -> None:
    text = "Time,q1 [mm],A.x [mm],A.y [mm],A.z [mm],B.x [mm],B.y [mm],B.z [mm],Temp C\n"
    m = read(tmp_path, text + "10:00:00,1,2,3,4,5,6,7,20.1\n10:00:30.5,1,2,3,4,5,6,7,20.2\n")
    assert m.time is not None and np.diff(m.time).tolist() == [0, 30.5, 0]
    m.write(tmp_path / "again.csv")
    again = pk.read_measurements(tmp_path / "again.csv")
    np.testing.assert_array_equal(again.time, m.time)
    np.testing.assert_array_equal(again.temperature, m.temperature)


def test_the_log_of_a_controller_has_the_temperature_too(tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("Point,X [mm],Y [mm],Z [mm]\nP1,1,2,3\nP2,1,2,4\n")
    log = tmp_path / "log.csv"
    log.write_text("Point,Strut 1 [mm],Temperature\nP1,5,20.4\nP2,6,20.6\n")
    m = pk.read_measurements(points, controller=log)
    np.testing.assert_array_equal(m.temperature, [[20.4] * 3, [20.6] * 3])


def test_the_machine_is_as_warm_as_its_log_says(tmp_path: Path) -> None:
    """What a tracker states is the air's."""
    points = tmp_path / "points.csv"
    points.write_text("Point,X [mm],Y [mm],Z [mm],Temperature\nP1,1,2,3,19\nP2,1,2,4,19\n")
    log = tmp_path / "log.csv"
    log.write_text("Point,Strut 1 [mm],Temperature\nP1,5,20.4\nP2,6,20.6\n")
    m = pk.read_measurements(points, controller=log)
    np.testing.assert_array_equal(m.temperature, [[20.4] * 3, [20.6] * 3])
    assert any("taken for the machine's" in note for note in m.notes)


def test_a_temperature_that_is_no_number_does_not_stand_in_the_way(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],z [mm],Temperature\n1,2,warm\n")
    assert m.temperature is None and "line 2, column 'Temperature': expected a number" in m.notes[0]
