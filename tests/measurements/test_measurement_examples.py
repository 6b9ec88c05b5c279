"""Example files of `tests/data`: one log in many spellings, and mistakes with what they say."""

from __future__ import annotations

import builtins
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table
from pkmcal.files.xlsx_rows import xlsx_rows
from pkmcal.measurements.command_csv import read_commands
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.pose_csv import read_poses

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
SAME = sorted((DATA / "same").iterdir())
WRONG = sorted((DATA / "wrong").iterdir())
LOG = np.array([
    [450, 452.5, 400, 405.25, 6.125, -6.25, 400.5],
    [460, 449.75, 402.5, 401, -1.5, 3.75, 398.875],
    [470.5, 440, 410, 398.25, 12.25, 0.5, 405.0625],
])  # fmt: skip


@pytest.mark.parametrize("path", SAME, ids=lambda path: path.name)
def test_every_spelling_is_the_same_log(path: Path) -> None:
    if path.suffix == ".xlsx":
        pytest.importorskip("openpyxl")
    read = read_measurements(path, pk.load("2tpr2tps"))
    assert read.kind == "position" and read.sigma is None
    np.testing.assert_array_equal(np.hstack([read.actuators, read.values]), LOG)


@pytest.mark.parametrize("path", WRONG, ids=lambda path: path.name)
def test_what_is_wrong_is_said_in_the_words_of_the_file(path: Path) -> None:
    expected = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# says: ")
    with pytest.raises(ValueError) as caught:
        read_measurements(path)
    assert str(path) in str(caught.value) and expected in str(caught.value)


def machine_with(actuators: int, folder: Path) -> Path:
    """A delta whose carriages share so many drives."""
    text = (ROOT / "examples" / "linear-delta" / "robot.toml").read_text(encoding="utf-8")
    parts = text.split('kind = "PUS"\n')
    drives = (min(k + 1, actuators) for k in range(3))
    limbs = (
        f'kind = "PUS"\nactuator = {drive}\n{part}'
        for drive, part in zip(drives, parts[1:], strict=True)
    )
    robot = folder / "robot.toml"
    robot.write_text(parts[0] + "".join(limbs), encoding="utf-8")
    return robot


@pytest.mark.parametrize("path", WRONG, ids=lambda path: path.name)
def test_check_says_in_one_line_what_is_wrong_with_a_file(
    run: Any, path: Path, tmp_path: Path
) -> None:
    said, names, *_ = path.read_text(encoding="utf-8").splitlines()
    robot = machine_with(len(re.findall(r"\bq[0-9]", names)), tmp_path)
    result = run("check", str(robot), str(path))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"pkmcal: {path}")
    assert said.removeprefix("# says: ") in result.stderr and result.stderr.count("\n") == 1


def test_check_reads_a_log_in_any_spelling(run: Any) -> None:
    for path in SAME:
        if path.suffix != ".xlsx":
            result = run("check", "2tpr2tps", str(path))
            assert f"{path}: 3 rows of kind position, readable\n" in result.stdout


def test_angles_of_a_pose_by_their_usual_names(tmp_path: Path) -> None:
    path = tmp_path / "pose.csv"
    path.write_text("J1 (deg);X/m;Y/m;Z/m;Roll (degrees);Pitch_deg;Yaw °\n90;1;2;3;10;20;30\n")
    read = read_measurements(path)
    assert (read.kind, read.actuator_units) == ("pose", ("rad",))
    np.testing.assert_allclose(read.values, [[1000, 2000, 3000, *np.radians([10, 20, 30])]])


def test_targets_keep_their_names_and_axes_may_be_capitals(tmp_path: Path) -> None:
    path = tmp_path / "targets.csv"
    path.write_text("q1 [mm],SMR 1.X (mm),SMR 1.Y (mm),SMR 1.Z (mm)\n1,2,3,4\n")
    assert read_measurements(path).target_names == ("SMR 1",)


def test_poses_and_commands_are_headed_likewise(tmp_path: Path) -> None:
    robot = pk.load("2tpr2tps")
    (tmp_path / "p.csv").write_text("Time;X (mm);Y (mm);Z (m);Roll (deg)\n1;0;5,5;0,4;90\n")
    pose = read_poses(tmp_path / "p.csv", robot)
    np.testing.assert_allclose(pose, [[0, 5.5, 400, np.pi / 2, 0, 0]])
    (tmp_path / "q.csv").write_text("Leg 1 (mm),Leg 2 (mm)\n1,2\n")
    np.testing.assert_array_equal(read_commands(tmp_path / "q.csv", ("mm", "mm")), [[1, 2]])


# --- Excel ---------------------------------------------------------------------------------------


def workbook(path: Path, *rows: list[Any]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


def test_numbers_of_a_workbook_are_exact(tmp_path: Path) -> None:
    q = np.random.default_rng(0).normal(0, 500, (30, 2)).round(9)  # openpyxl writes 16 digits
    path = workbook(tmp_path / "m.xlsx", ["q1 [mm]", "z [mm]"], *q.tolist())
    read = read_measurements(path)
    np.testing.assert_array_equal(np.column_stack([read.actuators, read.values]), q)


def test_a_number_of_a_workbook_is_a_number_whatever_others_look_like(tmp_path: Path) -> None:
    """1.234 may be a thousand in a text file; a cell that holds a number is no text."""
    path = workbook(tmp_path / "m.xlsx", ["q1 [mm]", "z [mm]"], [1.234, "2,5"], [-235.125, "3,25"])
    read = read_measurements(path)
    assert (read.actuators[:, 0].tolist(), read.values.tolist()) == ([1.234, -235.125], [2.5, 3.25])


def test_a_text_of_a_workbook_may_be_a_thousand(tmp_path: Path) -> None:
    path = workbook(tmp_path / "m.xlsx", ["q1 [mm]", "z [mm]"], ["1,450", 2.5])
    with pytest.raises(ValueError, match=r"'1,450' may be 1\.450 or 1450"):
        read_measurements(path)


def test_hidden_rows_columns_and_sheets_of_a_workbook_are_said(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title, book.active.sheet_state = "raw", "hidden"
    book.active.append(["q1 [mm]", "z [mm]"])
    book.active.append([7, 8])
    shown, empty, more = (book.create_sheet(name) for name in ("poses", "empty", "more"))
    for row in (["q1 [mm]", "z [mm]"], [1, 2], [3, 4], [5, 6]):
        shown.append(row)
    more.append(["x"])
    shown.row_dimensions[3].hidden = True
    shown.auto_filter.ref = "A1:B4"
    shown.row_dimensions[9].hidden = True  # nothing is there
    shown.column_dimensions["B"].hidden = True
    shown.column_dimensions.group("D", "XFD", hidden=True)  # nor there
    book.active = 1
    book.save(tmp_path / "m.xlsx")
    read = read_measurements(tmp_path / "m.xlsx")
    assert read.values.tolist() == [2, 4, 6]
    assert [note.partition(": ")[2] for note in read.notes] == [
        "of the workbook the sheet 'poses' was read, not 'raw' (hidden), 'more'",
        "1 row hidden in the workbook, and read: 3",
        "1 column hidden in the workbook, and read: B",
    ]
    assert empty.title not in "".join(read.notes)


def test_lines_of_a_workbook_count_as_in_excel(tmp_path: Path) -> None:
    path = workbook(tmp_path / "m.xlsx", ["# log"], ["q1 [mm]", "z (mm)"], [1, 2], [3, "off"])
    with pytest.raises(ValueError, match=r"m.xlsx, line 4, column 'z': .* found 'off'"):
        read_measurements(path)


def test_an_error_of_a_formula_is_no_comment(tmp_path: Path) -> None:
    path = workbook(tmp_path / "m.xlsx", ["q1 [mm]", "z [mm]"], ["#DIV/0!", 2])
    with pytest.raises(ValueError, match=r"expected a number, found '#DIV/0!'"):
        read_measurements(path)


def test_a_column_without_name_is_refused(tmp_path: Path) -> None:
    path = workbook(tmp_path / "m.xlsx", ["q1 [mm]", "z [mm]"], [1, 2, 3])
    with pytest.raises(ValueError, match="3 cells under 2 column names"):
        read_measurements(path)


@pytest.mark.parametrize("name", ["m.xlsx", "m.xls"])
def test_what_is_no_workbook_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"q1 [mm],z [mm]\n1,2\n")
    with pytest.raises(ValueError, match=r"m\.xlsx?: (not an Excel workbook|the old format)"):
        Table(tmp_path / name)


def test_without_openpyxl_the_way_out_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "m.xlsx").write_bytes(b"")
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("openpyxl"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ValueError, match="pip install openpyxl"):
        xlsx_rows(tmp_path / "m.xlsx")
