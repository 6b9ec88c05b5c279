"""Numbers with thousands apart are read where the cells themselves tell, and never guessed."""

from __future__ import annotations

from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.files.number_text import plain, thousands


def values(folder: Path, *cells: str) -> list[float]:
    path = folder / "m.csv"
    path.write_text("q1 [mm];z [mm]\n" + "".join(f"1;{cell}\n" for cell in cells), "utf-8")
    return pk.read_measurements(path).values.tolist()


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("1.234,5", "-2.345,6", "812,0", "3.000"), [1234.5, -2345.6, 812.0, 3000.0]),
        (("1,234.5", "2", "12,345,678.25"), [1234.5, 2.0, 12345678.25]),
        (("1 234.5", "7.5"), [1234.5, 7.5]),
        (("1\u202f234,5", "-7,5"), [1234.5, -7.5]),
        (("1'234.5", "812"), [1234.5, 812.0]),
        (("1.234", "1,5"), [1.234, 1.5]),  # nothing says thousands
        (("\u22121,5", "-2"), [-1.5, -2.0]),
    ],
)
def test_cells_that_tell_thousands_from_decimals_are_read(
    cells: tuple[str, ...], expected: list[float], tmp_path: Path
) -> None:
    assert values(tmp_path, *cells) == expected


def test_a_cell_that_contradicts_the_others_is_refused(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match=r"line 3, column 'z': expected a number, found '12.34'"):
        values(tmp_path, "1.234,5", "12.34")


def test_what_was_taken_is_said(tmp_path: Path) -> None:
    values(tmp_path, "1.234,5")
    notes = pk.read_measurements(tmp_path / "m.csv").notes
    assert "'1.234,5' in column 'z' taken as a number with thousands apart" in notes[0]


def test_plain_numbers_are_what_float_reads() -> None:
    assert thousands(["1e3", "0.5", "-7", ""]) is None
    assert [plain(c, None, False) for c in ("1e3", "1,5")] == ["1e3", "1,5"]
    assert plain("1_000", None, False) != "1_000"


def test_text_below_the_table_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text("q1 [mm],z [mm],A.b [mm]\n1,2,3\n*** END ***\nchecked by nobody\n")
    m = pk.read_measurements(path, ignore="A.b")
    assert len(m) == 1 and "line 3 below the table left out: '*** END ***'" in m.notes[1]
    path.write_text("q1 [mm],z [mm],A.b [mm]\n1,2,3\n1,2\n")
    with pytest.raises(pk.FileError, match="line 3: 2 cells under 3 column names"):
        pk.read_measurements(path)


def test_a_cell_that_goes_on_is_quoted_by_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text(f"q1 [mm],z [mm]\n1,{'2.5' * 2000}\n", encoding="utf-8")
    with pytest.raises(pk.FileError, match=r"line 2, column 'z'.*found '2\.52\.5") as caught:
        pk.read_measurements(path)
    assert len(str(caught.value)) < 300 + len(str(path))
