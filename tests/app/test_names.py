"""Names of files that others chose: what is kept of them names a file of the folder alone."""

from __future__ import annotations

import shlex
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal.app.folder import Folder
from pkmcal.app.names import safe_name
from pkmcal.app.work import own_export
from pkmcal.geometry.controller import Controller

HOSTILE = [
    "../x.csv",
    "..\\x.csv",
    "/etc/passwd",
    "C:\\x.csv",
    "-rf",
    "--out",
    ".hidden",
    "a\nb.csv",
    "a\x00b.csv",
    "x;rm -rf ~.csv",
    "$(x).csv",
    "`x`.csv",
    "con.txt",
    "LPT1",
    "a" * 300 + ".csv",
    "…",
    "\u202egnp.csv",
    "\x1b[31m.csv",
    "<img src=x onerror=alert(1)>.csv",
    "é.csv",
    "e\u0301.csv",
    " ",
    "",
    "%2e%2e%2f",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_becomes_a_plain_one(name: str) -> None:
    check(safe_name(name))


@given(st.text(max_size=400))
def test_any_name_becomes_a_plain_one_and_stays_it(name: str) -> None:
    found = safe_name(name)
    check(found)
    assert safe_name(found) == found


def check(name: str) -> None:
    assert name and Path(name).name == name and not name.startswith((".", "-", "~"))
    assert len(name.encode()) <= 105 and name.isprintable()
    assert not set(name) & set("<>:\"|?*'`$&;!%#\\/()[]{}^~")
    assert unicodedata.normalize("NFC", name) == name


def test_names_of_ordinary_files_stay() -> None:
    for name in ("printer.cfg", "probe log 3.csv", "Messung-Straße_2.xlsx", "robot.v2.toml"):
        assert safe_name(name) == name


def test_a_file_of_the_users_never_takes_the_place_of_the_projects(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "project")
    for name in (
        "project.toml",
        "PROJECT.TOML",
        "robot.toml",
        "new.cfg",
        "machine.h",
        "plan",
        "x.part",
    ):
        part = folder.path / ".sent"
        part.write_text("mine")
        assert folder.store(name, part) == (f"my_{name}", None)


@pytest.mark.parametrize(
    "path",
    ["../secret", "/etc/passwd", "link", "a/../../secret", "\0", ".hidden", "sub/.x", "", "."],
)
def test_what_is_not_in_the_folder_is_not_given(tmp_path: Path, path: str) -> None:
    (tmp_path / "secret").write_text("secret")
    folder = Folder(tmp_path / "project")
    (folder.path / "link").symlink_to(tmp_path / "secret")
    (folder.path / ".hidden").write_text("x")
    (folder.path / "sub").mkdir()
    (folder.path / "sub" / ".x").write_text("x")
    (folder.path / "mine.csv").write_text("x")
    assert folder.written(path) is None
    assert folder.written("mine.csv") == folder.path / "mine.csv"


@pytest.mark.parametrize(
    "text",
    [
        '[import]\nfile = "/etc/printer.cfg"\nout = "machine"',
        '[import]\nfile = "printer.cfg"\nout = "../elsewhere"',
        '[import]\nfile = "printer.cfg"',
        '[machine]\nfile = "../robot.toml"',
    ],
)
def test_a_project_written_by_hand_does_not_lead_out_of_the_folder(
    tmp_path: Path, text: str
) -> None:
    (tmp_path / "project.toml").write_text(f"pkmcal-project = 1\n{text}\n")
    with pytest.raises(ValueError, match="within this project"):
        Folder(tmp_path)


@pytest.mark.parametrize("file", ["/etc/passwd", "../printer.cfg", "a/../../b.cfg"])
def test_the_controller_of_a_robot_file_leads_to_no_file_elsewhere(file: str) -> None:
    with pytest.raises(ValueError, match="is not a file of this project"):
        own_export(Controller("klipper", file), "report/robot.toml")


def test_a_command_that_is_to_be_copied_is_one_command() -> None:
    words = shlex.split(Controller("klipper", "a.$(touch x) y").command("robot.toml"))
    assert words[-1] == "new.$(touch x) y" and len(words) == 9


def test_a_change_of_an_old_version_is_not_taken_and_undo_goes_back(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "project")
    before = folder.project.text()
    table = {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}}
    assert folder.change(table, 1) and folder.version == 2
    assert not folder.change(table, 1)
    assert Folder(folder.path).project == folder.project  # the file is all there is
    assert folder.undo(2) and folder.project.text() == before
    assert not folder.undoable


@pytest.mark.parametrize(
    "table",
    [
        {"pkmcal-project": 1, "machine": {"file": "/etc/passwd"}},
        {"pkmcal-project": 1, "machine": {"file": "../x.toml"}},
        {"pkmcal-project": 1, "measured": {"files": ["missing.csv"]}},
        {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}, "fit": {"holdout": "/etc/passwd"}},
        {"pkmcal-project": 1, "import": {"file": "/etc/passwd", "out": "machine"}},
        {"pkmcal-project": 1, "import": {"file": "mine.cfg", "out": "../elsewhere"}},
        {"pkmcal-project": 1, "import": {"file": "mine.cfg", "out": "."}},
        {
            "pkmcal-project": 1,
            "import": {"file": "mine.cfg", "out": "machine", "log": "/etc/passwd"},
        },
        {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}, "plan": {"out": "/tmp/elsewhere"}},
        {"pkmcal-project": 1, "measured": {"board": "../points.csv"}},
        {"pkmcal-project": 1, "measured": {"files": [], "controller": "../../x"}},
        {"pkmcal-project": 2},
        {"pkmcal-project": 1, "shell": "rm"},
        {},
    ],
)
def test_a_state_of_files_elsewhere_or_of_unknown_keys_is_refused(
    tmp_path: Path, table: dict
) -> None:
    folder = Folder(tmp_path / "project")
    (folder.path / "mine.cfg").write_text("")
    with pytest.raises(ValueError):
        folder.change(table, folder.version)
    assert folder.version == 1
