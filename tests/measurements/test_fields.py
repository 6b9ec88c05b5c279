"""What every field of the rows and every constant of an instrument obeys: it is read back."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn, write_csv
from pkmcal.measurements.field import Field, declared, read_back, row_fields
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.session import Session
from pkmcal.readings import Position

from ..readings.own import Spot

ROWS, N = 5, 6
RANDOM = np.random.default_rng(3)
STATED: dict[str, Any] = {
    "actuator_sigma": RANDOM.uniform(0.01, 0.1, (ROWS, N)),
    "sigma": RANDOM.uniform(0.01, 0.1, (ROWS, 3)),
    "target_index": [0, 1, 1, 0, 1],
    "group": [3, 1, 4, 1, 5],
    "pose_name": ["c.png", "a.png", "b b", "a.png", "d"],
    "session": ["a", "b", "b", "a", "c"],
    "temperature": RANDOM.uniform(15, 25, (ROWS, N + 2)),
    "time": RANDOM.uniform(0, 1e4, ROWS).cumsum(),
    "approach": RANDOM.choice([-1.0, 1.0], (ROWS, N)),
    "tension": RANDOM.uniform(10, 20, (ROWS, N)),
    "tension_sigma": RANDOM.uniform(0.1, 0.2, (ROWS, N)),
    "load": RANDOM.uniform(1, 2, (ROWS, 10)),
    "beside": {"current": RANDOM.normal(size=ROWS), "x": [1.5, 2.0 / 3.0, 0.0, 1e-300, -2.0]},
    "lines": np.arange(2, ROWS + 2),
}


@pytest.mark.parametrize("name", [field.name for field in row_fields(Measurements)])
def test_every_field_is_read_back_to_the_last_bit(name: str, tmp_path: Path) -> None:
    beside: dict[str, Any] = {"target_index": {"target": [[1.0, 2, 3], [4, 5, 6]]}}.get(name, {})
    beside |= {"tension_sigma": {"tension": STATED["tension"]}}.get(name, {})
    q, values = RANDOM.uniform(300, 500, (ROWS, N)), RANDOM.normal(size=(ROWS, 3))
    m = Measurements(q, values, **{name: STATED[name]}, **beside)
    m.write(tmp_path / "m.csv")
    again = pk.read_measurements(tmp_path / "m.csv")
    if name == "target_index":  # the names of targets are written
        np.testing.assert_array_equal(again.targets, m.targets)
    else:
        np.testing.assert_array_equal(getattr(again, name), getattr(m, name))


@pytest.mark.parametrize("unit", ["", "mm", "rad", "N", "mbar", None])
def test_a_field_that_declares_its_unit_alone_is_read_back(
    unit: str | None, tmp_path: Path
) -> None:
    one = Field()
    one.name, one.unit = "pressure", unit
    given = np.array(["1", "low"]) if unit is None else np.array([1013.25, np.pi])
    m = type("Rows", (), {"pressure": given})()
    columns = list(one.columns(m, ("mm",)))
    cells = zip(*(column.cells() for column in columns), strict=True)
    write_csv(tmp_path / "m.csv", [column.heading for column in columns], cells)
    found = one.read(Table(tmp_path / "m.csv"), Position(), ("mm",))
    np.testing.assert_array_equal(found, given)


def test_a_unit_of_ones_own_and_an_empty_cell_are_named(tmp_path: Path) -> None:
    one = Field()
    one.name, one.unit = "draught", "m/s"
    path = tmp_path / "m.csv"
    for text, message in (
        ("draught [knots]\n1\n", r"unit \[knots\]: expected one of m/s"),
        ("draught\n1\n", r"has no unit: expected 'draught \[m/s\]' \(or another of m/s\)"),
        ("x,draught [m/s]\n1,2\n1,\n", "line 3"),
    ):
        path.write_text(text)
        with pytest.raises(pk.FileError, match=message):
            one.read(Table(path), Position(), ("mm",))


def test_a_field_that_writes_columns_of_its_own_has_to_read_them() -> None:
    with pytest.raises(TypeError, match="Lost: has columns of its own, and no method read"):

        class Lost(Field):
            def columns(self, m: Any, units: Any) -> Any:
                yield WrittenColumn("lost", "", np.zeros(2))

    with pytest.raises(TypeError, match="Raw: has no method kept"):
        type("Raw", (Field,), {})


@pytest.mark.parametrize("name", ["air_temp", "pos", "motor_1", "temp", "Sigma"])
def test_a_field_whose_column_files_know_as_something_else_is_refused(name: str) -> None:
    """It was written, and lost on reading."""
    of = type("Own", (Field,), {"kept": lambda self, given, m: given})
    own = of()
    own.name = name
    with pytest.raises(TypeError, match=f"Own: files have its column '{name}' as another name for"):
        read_back((own,))
    own.name = "pressure"
    assert read_back((own,)) == (own,)


@pytest.mark.parametrize(
    ("returned", "found"),
    [
        (None, "NoneType"),
        ([1.0] * ROWS, "list"),
        (np.ones(ROWS - 1), r"shape \(4,\)"),
        (np.float64(1.0), "float64"),
    ],
)
def test_what_a_field_keeps_has_an_entry_for_each_row(returned: Any, found: str) -> None:
    """Else what was given would be lost, or be another row's."""
    own = type("Own", (Field,), {"kept": lambda self, given, m: returned})()
    own.name = "pressure"
    message = f"^pressure: kept of the class Own must return .* each of 5 rows; found {found}"
    with pytest.raises(pk.ArgumentTypeError, match=message):
        own.checked([1.0] * ROWS, range(ROWS))
    assert own.checked(None, range(ROWS)) is None


def own_field(**members: Any) -> Field:
    made = type("Own", (Field,), {"kept": lambda self, given, m: np.array(given), **members})()
    made.name = "pressure"
    return made


class Series:
    """A column of a table, as pandas has it."""

    def __init__(self, values: Any) -> None:
        self.values = values

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return self.values


@pytest.mark.parametrize("of", [np.asarray, Series])
def test_what_a_field_keeps_is_not_the_callers_array(of: Any) -> None:
    own, values = own_field(kept=lambda self, given, m: np.asarray(given)), np.ones(ROWS)
    kept = own.checked(of(values), range(ROWS))
    values[:] = 7.0
    assert (kept == 1.0).all()


def fails(*given: Any) -> Any:
    return {}["gone"]


@pytest.mark.parametrize("method", ["kept", "columns", "read", "said", "printed", "names"])
def test_what_fails_in_a_field_is_named_with_its_class(method: str) -> None:
    own = own_field(**{"columns": Field.columns, "read": fails, method: fails})
    needs = len(inspect.signature(getattr(Field, method)).parameters) - 1
    with pytest.raises(pk.ArgumentTypeError, match=f"^{method} of the class Own failed with KeyE"):
        getattr(own, method)(*[None] * needs)


@pytest.mark.parametrize("method", ["columns", "said", "printed", "names"])
def test_what_a_field_returns_is_of_the_class_that_is_declared(method: str) -> None:
    own = own_field(**{"read": fails, method: lambda *given: None})
    needs = len(inspect.signature(getattr(Field, method)).parameters) - 1
    with pytest.raises(pk.ArgumentTypeError, match=f"^{method} of the class Own must return "):
        getattr(own, method)(*[None] * needs)


def test_columns_that_a_field_would_not_be_read_back_from_are_not_written() -> None:
    def columns(self: Any, m: Any, units: Any) -> Iterator[WrittenColumn]:
        yield WrittenColumn("air", "", np.ones(ROWS))

    m = spots(Camera())
    with pytest.raises(
        pk.ArgumentTypeError, match="columns of the class Own writes 'air': the class needs"
    ):
        own_field(columns=columns, read=fails).written(m, ("mm",) * 6)
    own = own_field(columns=columns, read=fails, names=lambda self, a, c: {"air"})
    assert [column.name for column in own.written(m, ("mm",) * 6)] == ["air"]


def test_a_field_is_declared_by_its_module_and_class() -> None:
    assert isinstance(declared("session:Session"), Session)
    with pytest.raises(AttributeError):
        declared("session:Sitting")


@dataclass(frozen=True, eq=False)
class Camera(Spot):
    """A spot with all that an instrument may have for all its rows."""

    name = "camera"
    binning: int = 1
    lens: str = "wide"
    flipped: bool = False
    focal: float | None = None
    serial: str | None = None


def spots(instrument: Spot) -> Measurements:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 4, seed=1))
    return pk.VirtualMachine(robot, 0.01).measure(q, instrument, [0, 0, 50])


OTHER = Camera(0.1 / 3, 2, "long", True, 16.2, "X7")


@pytest.mark.parametrize("frame", [False, True], ids=["file", "data frame"])
def test_constants_of_an_instrument_are_those_of_the_file(frame: bool, tmp_path: Path) -> None:
    m = spots(OTHER)
    if frame:
        pytest.importorskip("pandas")
        again = Measurements.from_pandas(m.to_pandas(), kind=Camera())
    else:
        m.write(tmp_path / "m.csv")
        again = pk.read_measurements(tmp_path / "m.csv", kind=Camera())
    for each in fields(OTHER):
        assert getattr(again.instrument, each.name) == getattr(OTHER, each.name), each.name
    assert again.notes == ()


def test_a_file_of_another_instrument_than_stated_is_refused(tmp_path: Path) -> None:
    spots(OTHER).write(tmp_path / "m.csv")
    with pytest.raises(pk.FileError, match=r"m.csv.*0.033.*is not pitch=0.07"):
        pk.read_measurements(tmp_path / "m.csv", kind=Camera(0.07))
    text = (tmp_path / "m.csv").read_text().replace("long", "wide", 1)
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(pk.FileError, match=r"m.csv, line 3.*an instrument has one lens"):
        pk.read_measurements(tmp_path / "m.csv", kind=Camera())


def test_what_no_column_can_hold_is_not_written(tmp_path: Path) -> None:
    m = spots(replace(OTHER, lens=[1.0, 2.0]))  # type: ignore[arg-type]
    with pytest.raises(pk.ArgumentError, match="lens of 'camera' is of class list"):
        m.write(tmp_path / "m.csv")
    assert not (tmp_path / "m.csv").exists()


def test_numbers_beside_a_reading_keep_the_spelling_of_their_names(tmp_path: Path) -> None:
    m = Measurements(np.ones((2, N)), np.ones((2, 3)), beside={"Motor_A": [np.nan, 2.0]})
    m.write(tmp_path / "m.csv")
    again = pk.read_measurements(tmp_path / "m.csv")
    assert again.beside.dtype.names == ("Motor_A",) and again.notes == ()
    assert again.select([1]).beside["Motor_A"].tolist() == [2.0]
    for wrong, message in (
        ([1.0, 2.0], r"^beside must be numbers of the rows by their names"),
        ({"motor a": [1.0, 2.0]}, r"^beside: names are letters, digits and _"),
        ({"a": [1.0, 2.0, 3.0]}, r"^beside: a must have shape \(2,\); found \(3,\)"),
    ):
        with pytest.raises(pk.ArgumentError, match=message):
            Measurements(np.ones((2, N)), np.ones((2, 3)), beside=wrong)
