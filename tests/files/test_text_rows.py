"""What programs write is read as their rows: wrapped headings, encodings, long tables."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table

ROW = "\n1,2,3,4\n"


@pytest.mark.parametrize("heading", ['"q1\n[mm]"', '"q1\r\n  [mm]"', '"q1\n\n[mm]"'])
def test_a_heading_that_is_wrapped_in_its_cell_is_one_heading(heading: str, tmp_path: Path) -> None:
    """Spreadsheets write a wrapped cell with line breaks in quotation marks."""
    path = tmp_path / "m.csv"
    path.write_bytes(f"{heading},x [mm],y [mm],z [mm]{ROW}".encode())
    table = Table(path)
    assert [column.name for column in table.columns.values()] == ["q1", "x", "y", "z"]
    assert table.numbers("q1", "mm")[0].tolist() == [1.0]
    assert table.lines == [len(heading.splitlines()) + 1]


@pytest.mark.parametrize("lines", [1, 40])
def test_a_quotation_mark_that_nothing_closes_is_named_with_its_line(
    lines: int, tmp_path: Path
) -> None:
    path = tmp_path / "m.csv"
    path.write_text("q1 [mm],z [mm]\n" + '"1,2\n' + "1,2\n" * lines)
    with pytest.raises(pk.FileError, match=r"m\.csv, line 2: unexpected end of data"):
        Table(path)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32", "utf-32-le"])
def test_texts_of_wide_characters_are_refused_with_what_helps(
    encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes(f"q1 [mm],x [mm],y [mm],z [mm]{ROW}".encode(encoding))
    with pytest.raises(pk.FileError, match=r"m\.csv: has zero bytes.*save it as UTF-8$"):
        Table(path)


def test_a_dash_is_no_name_of_standard_input(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"^-: no such file; standard input is /dev/stdin$"):
        Table("-")


SPELT = (str, "{:.3f}".format, "{:+.6e}".format, "{:.0f}.".format, "  {}".format)
ONE_BY_ONE = "n/a"  # beside it a column is read cell by cell


def test_plain_numbers_are_read_at_once_as_one_by_one(tmp_path: Path) -> None:
    rng = random.Random(1)
    for separator in ",;\t":
        numbers = [
            [rng.choice(SPELT)(rng.uniform(-2000, 2000)) for _ in range(3)] for _ in range(50)
        ]
        path = tmp_path / "m.csv"
        head = separator.join(["a [mm]", "b [mm]", "c [deg]"])
        path.write_text("\n".join([head, *(separator.join(row) for row in numbers)]))
        again = tmp_path / "again.csv"
        again.write_text(path.read_text() + "\n" + separator.join([ONE_BY_ONE] * 3))
        for name, unit in (("a", "mm"), ("b", "mm"), ("c", "rad")):
            read = Table(path).numbers(name, unit)[0]
            slowly = Table(again).numbers(name, unit, unseen=True)[0]
            assert np.isnan(slowly[-1])
            np.testing.assert_array_equal(read, slowly[:-1])


@pytest.mark.parametrize("cell", ["1e999", "inf", "nan", "1_000", "0x10", "1e", ".", "+"])
def test_what_is_no_finite_number_is_named_beside_plain_ones(cell: str, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text(f"a [mm],b [mm]\n1,2\n{cell},3\n", "utf-8")
    with pytest.raises(pk.FileError, match=r"line 3, column .a.: expected a (finite )?number"):
        Table(path).numbers("a", "mm")
