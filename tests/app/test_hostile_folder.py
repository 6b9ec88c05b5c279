"""A folder of somebody else: nothing in it is run, read from elsewhere, or lost."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from pkmcal.app.aside import Kept
from pkmcal.files.seal import sealed
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.project import Project

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser
from .test_flows import PRINTER, fits
from .test_guard import ask, state
from .test_same_as_commands import done, measured, take
from .test_staying import take_hexapod

HEXAPOD = Project(Calibration("hexapod", ("m.csv",)))


def test_no_file_of_the_folder_is_run_as_a_module(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    (folder / "pkmcal").mkdir(parents=True)
    ran = tmp_path / "ran"
    for name in ("json", "numpy", "difflib", "tomli_w", "pkmcal/__init__"):
        (folder / f"{name}.py").write_text(f"open({str(ran)!r}, 'w').close()\n")
    with browser.served(folder) as served:
        done(served, "take", {"builtin": "hexapod"})
    assert not ran.exists()


def test_a_websocket_is_not_spoken(tmp_path: Path) -> None:
    with browser.served(tmp_path) as served:
        lines = [
            "GET /api/events HTTP/1.1",
            f"Host: 127.0.0.1:{served.port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version: 13",
        ]
        with socket.create_connection(("127.0.0.1", served.port), timeout=10) as connection:
            connection.sendall("\r\n".join([*lines, "", ""]).encode())
            assert connection.recv(100).split()[1] == b"401"


def test_measurements_behind_a_link_are_read_nowhere(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    measured("hexapod", 20, seed=1).write(tmp_path / "elsewhere.csv")
    (folder / "m.csv").symlink_to(tmp_path / "elsewhere.csv")
    (folder / "project.toml").write_text(HEXAPOD.text())
    with browser.served(folder) as served:
        for operation in ("look", "fit"):
            answer = ask(served, "POST", f"/api/run/{operation}", b"{}")[2]
            assert b"is a link that leads out of this project" in answer, operation


def test_a_number_of_thousands_of_digits_is_no_row(tmp_path: Path) -> None:
    measured("hexapod", 20, seed=1).write(tmp_path / "m.csv")
    with browser.served(tmp_path) as served:
        for row in ("9" * 5000, "m.csv:" + "9" * 5000):
            take(served, Project(Calibration("hexapod", ("m.csv",), drop=(row,))))
            answer = ask(served, "POST", "/api/run/fit", b"{}")[2]
            assert b"expected the number of a row" in answer and len(answer) < 1000


def test_what_was_changed_in_a_written_file_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    written = sealed(b"z [mm]\n1\n", ".csv")
    Path("plan").mkdir()
    Path("plan/poses.csv").write_bytes(written)
    kept, paths = Kept(), [Path("plan/poses.csv"), Path("plan/none.csv")]
    with kept.aside(paths) as said:
        paths[0].write_bytes(sealed(b"z [mm]\n2\n", ".csv"))
    assert said == [] and not list(Path().glob("my_*"))
    for k, name in enumerate(("my_poses.csv", "my_poses.1.csv")):
        paths[0].write_bytes(written + b"%d\n" % k)
        with kept.aside(paths) as said:
            paths[0].write_bytes(written)
        assert len(said) == 1 and said[0].endswith(f"kept as {name}")
        assert Path(name).read_bytes() == written + b"%d\n" % k


def test_a_configuration_that_the_window_did_not_write_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    kept, path = Kept(), Path("new.cfg")
    path.write_text("mine")
    for content, names in (("one", 1), ("two", 1), ("two", 1)):
        with kept.aside([path]) as said:
            path.write_text(content)
        assert len(list(Path().glob("my_*"))) == names and bool(said) == (content == "one")
    assert Path("my_new.cfg").read_text() == "mine"
    with Kept().aside([path]) as said:  # another process, which writes the same
        path.write_text("two")
    assert not said and len(list(Path().glob("my_*"))) == 1
    with pytest.raises(OSError), kept.aside([path]):
        path.write_text("three")
        raise OSError
    path.write_text("mine again")
    with pytest.raises(OSError), kept.aside([path]) as said:
        raise OSError  # before it was written: it stands where it stood
    assert not said and len(list(Path().glob("my_*"))) == 1


def test_an_imported_machine_that_was_edited_is_kept_and_can_be_taken(tmp_path: Path) -> None:
    (tmp_path / "printer.cfg").write_bytes(PRINTER.read_bytes())
    importing = Importing("printer.cfg", "machine")
    with browser.served(tmp_path) as served:
        take(served, Project(Calibration("machine/robot.toml"), importing=importing))
        assert not any("written again" in note for note in done(served, "machine")["notes"])
        file = tmp_path / "machine" / "robot.toml"
        edited = file.read_text().replace("rod = 340.0", "rod = 341.0", 1)
        file.write_text(edited)
        found = done(served, "machine")
        assert any("kept as my_robot.toml" in note for note in found["notes"])
        assert "my_robot.toml" in found["machines"]
        assert (tmp_path / "my_robot.toml").read_text() == edited
        assert "rod = 341.0" not in file.read_text()


def test_readings_that_were_written_into_a_plan_outlive_the_next_plan(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        page.get_by_role("button", name="2 Plan").click()
        page.get_by_label("poses", exact=True).fill("8")
        page.locator("p.lead", has_text="measure 8 poses").wait_for()
        file = served.folder / "plan" / "commands.csv"
        filled = file.read_text().replace("\n", ",1.0\n")
        file.write_text(filled)
        page.get_by_label("poses", exact=True).fill("9")
        page.locator("p.warn", has_text="kept as my_commands.csv").wait_for()
        assert (served.folder / "my_commands.csv").read_text() == filled


@pytest.fixture
def full(tmp_path: Path) -> Path:
    """A small disk of its own."""
    folder = tmp_path / "small"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("a disk can be mounted by root alone, on Linux")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_full_disk_is_told_and_the_window_shows_what_holds(full: Path) -> None:
    with browser.served(full) as served, browser.page_of(served, "507") as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        before = (full / "project.toml").read_bytes()
        with pytest.raises(OSError), open(full / "fill", "wb", buffering=0) as file:
            while True:
                file.write(bytes(512))
        box = page.locator("tr[id] input").first
        box.click()
        page.locator("#trouble", has_text="project.toml: No space left on device").wait_for()
        assert box.is_checked()  # it is still used
        assert (full / "project.toml").read_bytes() == before
        (full / "fill").unlink()
        box.click()
        page.locator("tr.out").wait_for()
        assert b"drop" in (full / "project.toml").read_bytes()


def test_a_reload_and_the_way_back_lead_to_screens(tmp_path: Path) -> None:
    folder = tmp_path / "my printer"
    folder.mkdir()
    measured("hexapod", 20, seed=1).write(folder / "m.csv")
    with browser.served(folder) as served:
        take(served, HEXAPOD)
        with browser.page_of(served) as page:
            fits(page, 1)
            assert page.title() == "my printer – pkmcal"
            page.get_by_role("button", name="2 Plan").click()
            page.locator("main.plan h1").wait_for()
            page.reload()
            page.locator("main.plan h1").wait_for()
            page.get_by_role("button", name="3 Measure").click()
            page.locator("main.measure h1").wait_for()
            for step in ("plan", "result"):
                page.go_back()
                page.locator(f"main.{step} h1").wait_for()
            page.go_forward()
            page.locator("main.plan h1").wait_for()
            assert page.evaluate("document.activeElement.id") == "main"
            assert state(served)["version"] == 2  # to look around changes nothing


def test_a_folder_that_is_gone_is_told_and_goes_on_where_it_comes_back(tmp_path: Path) -> None:
    folder, away, copy = (tmp_path / name for name in ("project", "away", "copy"))
    folder.mkdir()
    measured("hexapod", 20, seed=1).write(folder / "m.csv")
    asked: tuple[tuple[str, str, bytes | None], ...] = (
        ("GET", "/api/state", None),
        ("POST", "/api/state", b'{"state":{"pkmcal-project":1},"version":2}'),
        ("POST", "/api/undo", b'{"version":2}'),
        ("PUT", "/api/file/a.csv", b"x"),
        ("POST", "/api/run/fit", b"{}"),
        ("POST", "/api/run/machine", b"{}"),
        ("POST", "/api/live", b'{"machine":"person","out":"a.csv","plan":{"kind":"height"}}'),
    )
    with browser.served(folder) as served:
        take(served, Project(Calibration("hexapod", ("m.csv",))))
        shutil.copytree(folder, copy)
        for there in (False, True):
            folder.rename(away)
            if there:  # as of a backup: what computes is still in the former
                copy.rename(folder)
            for method, path, body in asked:
                status, _, answer = ask(served, method, path, body)
                assert status != 500, path
                words = json.loads(answer.splitlines()[-1])
                assert set(words) & {"error", "trouble"}, path
                assert str(folder) in str(words), path
            if there:
                assert not (folder / "a.csv").exists()
                folder.rename(copy)
            away.rename(folder)
        assert "trouble" not in state(served)
        assert done(served, "fit")["verdict"]
        assert state(served)["state"]["measured"] == {"files": ["m.csv"]}
