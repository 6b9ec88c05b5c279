"""Numbers with thousands apart are read where the cells themselves tell, and never guessed."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
        (("1.234", "1.5"), [1.234, 1.5]),
        (("1,234", "1,5"), [1.234, 1.5]),
        (("2,5", "1.5"), [2.5, 1.5]),  # neither can be thousands
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


@pytest.mark.parametrize(
    ("q", "z", "name", "cell"),
    [
        (("1,234", "5,678"), ("235.5", "236.5"), "q1", "1,234"),
        (("2,5", "3,25"), ("1.234", "999.001"), "z", "1.234"),
        (("1,234", "7"), ("235.5", "236,5"), "q1", "1,234"),
        (("1.234", "7,5"), ("1", "2"), "q1", "1.234"),
    ],
)
@pytest.mark.parametrize("separator", ["\t", ";"])
def test_what_may_be_a_thousand_is_refused_beside_other_decimals(
    q: tuple[str, str], z: tuple[str, str], name: str, cell: str, separator: str, tmp_path: Path
) -> None:
    rows = ["q1 [mm]", *q], ["z [mm]", *z]
    path = tmp_path / "m.csv"
    path.write_text("".join(f"{a}{separator}{b}\n" for a, b in zip(*rows, strict=True)))
    with pytest.raises(pk.FileError, match=f"column '{name}': '{cell}' may be 1.234 or 1234"):
        pk.read_measurements(path)


@given(
    st.lists(st.floats(-1e4, 1e4).map(lambda x: round(x, 3)), min_size=2, max_size=12),
    st.sampled_from([("", "."), ("", ","), (".", ","), (",", "."), (" ", ","), ("'", ".")]),
    st.integers(0, 3),
)
def test_a_number_is_read_as_it_was_written_or_not_at_all(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float], signs: tuple[str, str], n: int
) -> None:
    """Whatever the marks and the number of decimals, if one cell of the file shows the mark."""
    folder = tmp_path_factory.mktemp("numbers")
    cells = [f"{x:,.{n}f}".translate({ord(","): signs[0], ord("."): signs[1]}) for x in numbers]
    path = folder / "m.csv"
    shown = "0" + signs[1] + "5"
    path.write_text("q1 [mm];z [mm]\n" + "".join(f"{shown};{c}\n" for c in cells), "utf-8")
    try:
        found = pk.read_measurements(path)
    except pk.FileError as error:
        assert "may be" in str(error) or "expected a number" in str(error)
        return
    assert found.values.tolist() == [round(x, n) for x in numbers]


def test_where_nothing_tells_decimals_are_taken_and_said(tmp_path: Path) -> None:
    assert values(tmp_path, "1,234", "2,345") == [1.234, 2.345]
    notes = pk.read_measurements(tmp_path / "m.csv").notes
    assert "'1,234' in column 'z' taken as 1.234" in notes[0]


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
