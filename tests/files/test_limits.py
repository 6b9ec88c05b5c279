"""What is damaged or beyond the stated limits is refused by name, and before it takes long.

How long is judged by the work: each of these took minutes, or all memory, without its limit.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import MAX_LIMBS
from pkmcal.files import reading
from pkmcal.files.csv_table import Table
from pkmcal.files.reading import LONGEST_NAME, MOST_COLUMNS
from pkmcal.files.text_rows import TextRows
from pkmcal.files.toml_lines import MOST_NESTED, Source
from pkmcal.files.xlsx_rows import xlsx_rows

HEXAPOD = (Path(pk.__file__).parent / "builtin/machines/hexapod.toml").read_text("utf-8")


def refused(read: Callable[[Path], object], path: Path, content: str | bytes) -> str:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(pk.FileError) as raised:
        read(path)
    message = str(raised.value)
    assert message.startswith(str(path)) and len(message) < len(str(path)) + 400
    return message


# --- robot files ---------------------------------------------------------------------------------


def under_pose(text: str) -> str:
    return HEXAPOD.replace("[pose]", f"[pose]\n{text}", 1)


@pytest.mark.parametrize(
    "content, message",
    [
        (under_pose("q" + ".a" * 5000 + " = 1"), "line 15: more than 1000 dots on a line"),
        (under_pose("q" + ".a" * 300_000 + " = 1"), "line 15: more than 1000 dots on a line"),
        (under_pose("q" + ".a" * 900 + " = 1"), "nested deeper than 50"),
        (HEXAPOD + "\n[stated]\nq" + ".a" * 900 + " = 1\n", "nested deeper than 50"),
        (under_pose("q = " + "{a=" * 325 + "1" + "}" * 325), "nested deeper than 50"),
        (under_pose("q = " + "[" * 60 + "]" * 60), "nested deeper than 50"),
        (under_pose("q = " + "[" * 100_000 + "]" * 100_000), "nested deeper than 50"),
        (under_pose("k" * 300_000 + " = 1"), "the key 'k{20}'… has 300000 characters"),
        (under_pose("foo = [\n" + "1.0,\n" * 20_000 + "]"), "line 15: .pose.: unknown key 'foo'"),
        (under_pose('foo = """\n' + "text\n" * 20_000 + '"""'), "line 15: .* unknown key 'foo'"),
        (re.sub("(?m)^name = .*", f'name = "{"n" * 500_000}"', HEXAPOD), "name: has 500000 char"),
        (HEXAPOD.replace("[pose]", "#" + "x" * 1_000_000 + "\n[pose]"), "larger than 1 MB"),
        (re.sub(r"base = \[[^,]*,", "base = [1e154,", HEXAPOD, count=1), "base: .* at most 1e.15"),
        (re.sub(r"base = \[[^,]*,", "base = [-1e300,", HEXAPOD, count=1), "base: .* at most 1e.15"),
    ],
    ids=lambda value: value[:40] if len(value) < 100 else str(len(value)),
)
def test_a_robot_file_beyond_the_limits_is_refused(
    content: str, message: str, tmp_path: Path
) -> None:
    assert re.search(message, refused(pk.load, tmp_path / "robot.toml", content))


def test_limbs_are_as_many_as_the_core_takes(tmp_path: Path) -> None:
    head, first, *_ = HEXAPOD.split("[[limb]]")
    path = tmp_path / "many.toml"
    path.write_text(head + f"[[limb]]{first}" * MAX_LIMBS, "utf-8")
    assert pk.load(path).n_actuators == MAX_LIMBS
    message = refused(pk.load, path, head + f"[[limb]]{first}" * (MAX_LIMBS + 1))
    assert message.endswith(f"[[limb]] {MAX_LIMBS + 1}: a robot has at most {MAX_LIMBS} limbs")


def test_limits_are_far_from_what_files_need(tmp_path: Path) -> None:
    """Of the built-in machines, and of what is just below a limit."""
    for name in pk.machines():
        pk.load(name).save(tmp_path / "saved.toml")
        assert 50 * len((tmp_path / "saved.toml").read_bytes()) < reading.MOST_ROBOT
    name = "n" * LONGEST_NAME
    (tmp_path / "long.toml").write_text(re.sub("(?m)^name = .*", f'name = "{name}"', HEXAPOD))
    assert pk.load(tmp_path / "long.toml").name == name
    deep = "{a=" * (MOST_NESTED - 1) + "1" + "}" * (MOST_NESTED - 1)
    assert Source(f"q = {deep}".encode(), "deep.toml").where("q") == "deep.toml, line 1"


@pytest.mark.parametrize(
    "value",
    [
        '"""\n[no.heading]\na = 1\n"""',
        "'''\n[[no]]\n'''",
        '"""a"" b"""',
        '""""quoted""""',
        r'"""\""" # no comment"""',
        '"[" # ]',
        "'{' # '''",
        "[ # [\n1, # ]\n'],'\n]",
        "{ a = [\n1,\n[2]\n], b = ']' }",
        "1 # [",
    ],
)
def test_the_line_of_a_key_is_known_after_values_that_look_like_others(value: str) -> None:
    text = f"first = 0\nodd = {value}\n[table]\nlast = 1"
    source = Source(text.encode(), "f")
    lines = text.split("\n")
    for path, written in ((("odd",), "odd ="), (("table", "last"), "last = 1")):
        line = next(i for i, each in enumerate(lines, 1) if each.startswith(written))
        assert source.where(*path) == f"f, line {line}"


# --- tables --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content, message",
    [
        ("x" + " " * 600 + "[" + " " * 600 + "y,z [mm]\n1,2\n", "column 1 is headed 'x . y'"),
        ("x [" + " " * 2400 + "y,z [mm]\n1,2\n", "column 1 is headed 'x . y'"),
        ("x" + "a" * 100_000 + ",z [mm]\n1,2\n", "heading of column 1 has 100001 characters"),
        (",".join(f"x{i}" for i in range(100_000)) + "\n" + "," * 99_999, "100000 columns"),
    ],
    ids=["unit far in", "unit far out", "long heading", "many columns"],
)
def test_a_table_beyond_the_limits_is_refused(content: str, message: str, tmp_path: Path) -> None:
    assert re.search(message, refused(Table, tmp_path / "m.csv", content))


def test_blanks_in_a_heading_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("x" + " " * 8000 + "[" + " " * 8000 + "mm ]\n1\n")
    assert list(Table(tmp_path / "m.csv").columns) == ["x"]
    (tmp_path / "m.csv").write_text(",".join(f"x{i}" for i in range(MOST_COLUMNS)) + "\n" + "1" + (
        ",1" * (MOST_COLUMNS - 1)))  # fmt: skip
    assert len(Table(tmp_path / "m.csv").columns) == MOST_COLUMNS


def test_a_number_that_its_unit_makes_infinite_is_named_by_line_and_column(tmp_path: Path) -> None:
    content = "q1 [mm],z [m]\n1,2\n1,1e308\n"
    message = refused(pk.read_measurements, tmp_path / "m.csv", content)
    assert message.endswith("m.csv, line 3, column 'z': expected a smaller number, found '1e308'")


def test_many_targets_are_read_in_the_order_of_the_file(tmp_path: Path) -> None:
    names = [f"t{(7 * i) % 30_011}" for i in range(30_011)]
    rows = "".join(f"1,2,3,{i},{name}\n" for i, name in enumerate(names))
    (tmp_path / "m.csv").write_text("q1 [mm],x [mm],y [mm],z [mm],target\n" + rows * 2)
    read = pk.read_measurements(tmp_path / "m.csv")
    assert read.target_names == tuple(names)
    assert read.target_index is not None
    np.testing.assert_array_equal(read.target_index, np.tile(np.arange(30_011), 2))


def test_a_target_at_two_places_is_named_with_both_lines(tmp_path: Path) -> None:
    head = "q1 [mm],x [mm],y [mm],z [mm],target,target.x [mm],target.y [mm],target.z [mm]\n"
    rows = "1,2,3,4,B,0,0,1\n1,2,3,4,A,0,0,2\n1,2,3,4,B,0,0,3\n"
    message = refused(pk.read_measurements, tmp_path / "m.csv", head + rows)
    assert message.endswith("line 4, column 'target': 'B' has another place here than in line 2")


# --- workbooks -----------------------------------------------------------------------------------

SHEET = "xl/worksheets/sheet1.xml"
END = b"</sheetData>"


@pytest.fixture(scope="module")
def workbook() -> bytes:
    openpyxl = pytest.importorskip("openpyxl")
    book, content = openpyxl.Workbook(), io.BytesIO()
    for row in (["q1 [mm]", "z [mm]"], [1.5, 2.25], [3, 4]):
        book.active.append(row)
    book.save(content)
    return content.getvalue()


ROWS = [(1, ["q1 [mm]", "z [mm]"]), (2, ["1.5", "2.25"]), (3, ["3", "4"])]


def edited(book: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """The book with another first sheet."""
    content = io.BytesIO()
    new = zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED)
    with zipfile.ZipFile(io.BytesIO(book)) as old, new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, change(data) if name == SHEET else data)
    return content.getvalue()


def marked(book: bytes, offset: int, bits: int) -> bytes:
    """The book with these bits set in every header of its archive."""
    data = bytearray(book)
    for signature, shift in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        for found in re.finditer(re.escape(signature), book):
            data[found.start() + offset + shift] |= bits
    return bytes(data)


def edited_name_length(book: bytes) -> bytes:
    """A part of which the file says that its name goes on for a thousand letters."""
    at = book.index(b"xl/workbook.xml") - 4
    return book[:at] + (1000).to_bytes(2, "little") + book[at + 2 :]


DAMAGED: dict[str, Callable[[bytes], bytes]] = {
    "half": lambda book: book[: len(book) // 2],
    "cut sheet": lambda book: edited(book, lambda xml: xml[: len(xml) // 2]),
    "long file name": edited_name_length,
    "encrypted": lambda book: marked(book, 6, 1),
    "unknown compression": lambda book: marked(book, 8, 99),
    "doctype": lambda book: edited(
        book,
        lambda xml: xml.replace(
            b"<worksheet", b'<!DOCTYPE l [<!ENTITY a "bb"><!ENTITY c "&a;&a;">]><worksheet', 1
        ).replace(b"2.25", b"&c;"),
    ),
    "far cell": lambda book: edited(
        book, lambda xml: xml.replace(END, b'<row r="99999999"><c r="A99999999"/></row>' + END)
    ),
    "wide rows": lambda book: edited(
        book,
        lambda xml: xml.replace(
            END, b"".join(b'<row><c r="XFD%d"/></row>' % row for row in range(4, 80)) + END
        ),
    ),
    "many cells": lambda book: edited(
        book, lambda xml: xml.replace(END, b"<row>" + b"<c/>" * 1_000_001 + b"</row>" + END)
    ),
    "large": lambda book: edited(book, lambda xml: xml + b" " * (reading.MOST_WORKBOOK + 1)),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_a_damaged_workbook_is_refused_in_one_line(
    how: str, workbook: bytes, tmp_path: Path
) -> None:
    message = refused(xlsx_rows, tmp_path / "m.xlsx", DAMAGED[how](workbook))
    words = "not an Excel workbook|MB unpacked|more than 1000000 cells"
    assert re.search(words, message) and "\n" not in message


def test_bytes_changed_anywhere_in_a_workbook_give_rows_or_one_error(
    workbook: bytes, tmp_path: Path
) -> None:
    random = np.random.default_rng(0)
    path = tmp_path / "m.xlsx"
    refusals = 0
    for _ in range(300):
        data = bytearray(workbook)
        for at in random.integers(len(data), size=random.integers(1, 4)):
            data[at] = random.integers(256)
        path.write_bytes(data)
        try:
            assert isinstance(xlsx_rows(path), TextRows)
        except pk.FileError:
            refusals += 1
    assert 30 < refusals < 300


def test_a_stray_cell_far_below_costs_no_more_than_its_row(workbook: bytes, tmp_path: Path) -> None:
    stray = b'<row r="1048576"><c r="XFD1048576"><v>9</v></c></row>'
    path = tmp_path / "m.xlsx"
    path.write_bytes(edited(workbook, lambda xml: xml.replace(END, stray + END)))
    *rows, (number, cells) = xlsx_rows(path).rows
    assert rows == ROWS and number == 1_048_576
    assert len(cells) == 16_384 and cells[-1] == "9" and not any(cells[:-1])


def test_an_empty_row_and_a_short_one_keep_their_places(workbook: bytes, tmp_path: Path) -> None:
    more = b'<row r="6"><c r="B6"><v>7</v></c></row><row r="8"><c r="A8"><v>8</v></c></row>'
    path = tmp_path / "m.xlsx"
    path.write_bytes(edited(workbook, lambda xml: xml.replace(END, more + END)))
    assert xlsx_rows(path).rows == [*ROWS, (6, ["", "7"]), (8, ["8", ""])]
