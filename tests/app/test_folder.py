"""A project's folder: what others do in it is seen, and nothing of theirs is lost or led away."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.app.claim import ClaimedError, claimed
from pkmcal.app.folder import Folder

HEXAPOD = {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}}
DELTA = {"pkmcal-project": 1, "machine": {"builtin": "linear-delta"}}


def sent(folder: Folder, content: str) -> Path:
    part = folder.path / ".upload-x.part"
    part.write_text(content)
    return part


def test_another_file_of_the_same_name_keeps_the_one_before(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    assert folder.store("t.csv", sent(folder, "monday")) == ("t.csv", None)
    assert folder.store("t.csv", sent(folder, "monday")) == ("t.csv", None)
    assert folder.store("t.csv", sent(folder, "tuesday")) == ("t.csv", "t.1.csv")
    assert folder.store("t.csv", sent(folder, "wednesday")) == ("t.csv", "t.2.csv")
    kept = {name: (tmp_path / name).read_text() for name in folder.files}
    assert kept == {"t.csv": "wednesday", "t.1.csv": "monday", "t.2.csv": "tuesday"}


def test_a_file_takes_the_place_of_a_link_and_nothing_is_read_through_it(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    folder = Folder(tmp_path / "project")
    (folder.path / "t.csv").symlink_to(tmp_path / "secret")
    assert folder.store("t.csv", sent(folder, "mine")) == ("t.csv", None)
    assert not (folder.path / "t.csv").is_symlink()
    assert (tmp_path / "secret").read_text() == "secret"


def test_what_somebody_writes_into_the_file_is_not_written_over(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    assert folder.change(HEXAPOD, 1)
    file = tmp_path / "project.toml"
    file.write_text(file.read_text() + '\n[fit]\nfree = ["offset1"]\n')
    assert not folder.change(DELTA, 2)  # made of a state that is not there any more
    assert folder.project.calibration.free == ("offset1",) and folder.version == 3
    assert folder.undo(3) and folder.project.calibration.free == ()


def test_a_mistake_that_somebody_makes_in_the_file_is_named_and_stays(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.change(HEXAPOD, 1)
    file = tmp_path / "project.toml"
    file.write_text(wrong := file.read_text() + "\n[fit]\nfre = 3\n")
    with pytest.raises(ValueError, match=r"line 7.*fre"):
        folder.change(DELTA, 2)
    assert file.read_text() == wrong and folder.project.calibration.robot == "hexapod"


def test_a_project_file_that_is_none_is_refused_at_once(tmp_path: Path) -> None:
    file = tmp_path / "project.toml"
    for made, message in (
        (lambda: os.mkfifo(file), "a pipe or a device"),
        (lambda: file.symlink_to("/dev/zero"), "a pipe or a device"),
        (lambda: file.write_text("# " + "x" * 2_000_000), "too many for a project file"),
        (lambda: file.write_text("x = " + "[" * 100_000), "too deeply"),
    ):
        made()
        with pytest.raises(pk.Error, match=message):
            Folder(tmp_path)
        file.unlink()


def test_a_name_that_no_file_can_have_is_that_of_none(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    for name in ("x" * 5000, "a" * 200 + "/" + "b" * 5000, "a\0b"):
        assert folder.written(name) is None


@pytest.mark.parametrize("name", ["machine", "report", "plan", "new.cfg", "for_klipper.txt"])
@pytest.mark.parametrize("absolute", [False, True])
def test_a_link_by_which_pkmcal_would_write_elsewhere_is_refused(
    tmp_path: Path, name: str, absolute: bool
) -> None:
    (tmp_path / "elsewhere").mkdir()
    folder = Folder(tmp_path / "project")
    target = tmp_path / "elsewhere" if absolute else Path("..", "elsewhere")
    (folder.path / name).symlink_to(target)
    with pytest.raises(ValueError, match=f'"{name}" is a link that leads out'):
        folder.change(HEXAPOD, 1)


def test_a_link_within_a_written_folder_and_one_in_a_circle_are_refused(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "project")
    (folder.path / "report").mkdir()
    link = folder.path / "report" / "robot.toml"
    link.symlink_to(tmp_path / "mine.toml")
    with pytest.raises(ValueError, match="is a link that leads out"):
        folder.change(HEXAPOD, 1)
    link.unlink()
    link.symlink_to(link)
    with pytest.raises(ValueError, match="is a link that leads out"):
        folder.change(HEXAPOD, 1)


def test_links_within_the_project_stay(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "project")
    (folder.path / "made").mkdir()
    (folder.path / "machine").symlink_to("made")
    assert folder.change(HEXAPOD, 1)


def test_a_folder_is_claimed_once_at_a_time(tmp_path: Path) -> None:
    with claimed(tmp_path), pytest.raises(ClaimedError), claimed(tmp_path):
        pass
    with claimed(tmp_path):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="there it cannot be renamed")
def test_another_folder_by_its_name_is_not_taken_for_it(tmp_path: Path) -> None:
    """The processes of a window are in the folder that was there, and go on to read that."""
    folder = Folder(tmp_path / "project")
    assert folder.change(HEXAPOD, 1)
    shutil.copytree(folder.path, tmp_path / "copy")
    folder.path.rename(tmp_path / "former")
    (tmp_path / "copy").rename(folder.path)
    for what in (folder.follow, lambda: folder.change(DELTA, 2), lambda: folder.undo(2)):
        with pytest.raises(pk.Error, match="another folder has this name now"):
            what()
    assert "hexapod" in (folder.path / "project.toml").read_text()
    folder.path.rename(tmp_path / "copy")
    (tmp_path / "former").rename(folder.path)
    assert folder.change(DELTA, 2)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no Linux")
def test_a_folder_that_is_not_needed_any_more_is_not_held_open(tmp_path: Path) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(20):
        Folder(tmp_path)
    assert len(os.listdir("/proc/self/fd")) <= before + 1
