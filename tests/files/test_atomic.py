"""A file is complete or untouched, whoever else writes or reads it."""

from __future__ import annotations

import ast
import os
import signal
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from pkmcal.files import atomic
from pkmcal.files.atomic import write_whole


def test_threads_that_write_one_path_neither_fail_nor_tear_it(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    contents = [bytes([65 + k]) * 200_000 for k in range(4)]
    write_whole(path, contents[0])
    done = threading.Event()
    torn = []

    def read() -> None:
        while not done.is_set():
            if path.read_bytes() not in contents:
                torn.append(1)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(lambda k: write_whole(path, contents[k % 4]), range(80)))
    finally:
        done.set()
        reader.join()
    assert not torn
    assert list(tmp_path.iterdir()) == [path]


def test_the_mode_of_a_file_is_kept_and_a_new_one_has_the_usual(tmp_path: Path) -> None:
    secret, new = tmp_path / "secret.toml", tmp_path / "new.toml"
    secret.write_text("old")
    secret.chmod(0o600)
    (tmp_path / "usual").write_text("")
    for path in (secret, new):
        write_whole(path, "content")
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    assert new.stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real.toml").write_text("old")
    (tmp_path / "link.toml").symlink_to("real.toml")
    write_whole(tmp_path / "link.toml", "new")
    assert (tmp_path / "link.toml").is_symlink()
    assert (tmp_path / "real.toml").read_text() == "new"


def test_a_name_may_be_as_long_as_the_file_system_allows(tmp_path: Path) -> None:
    write_whole(tmp_path / ("n" * 250 + ".toml"), "content")
    with pytest.raises(OSError, match=r"File name too long: '.*n{252}\.toml'"):
        write_whole(tmp_path / ("n" * 252 + ".toml"), "content")
    assert len(list(tmp_path.iterdir())) == 1


def test_a_folder_in_the_place_of_the_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").mkdir()
    with pytest.raises(IsADirectoryError, match=r"robot\.toml: this is a folder"):
        write_whole(tmp_path / "robot.toml", "content")


def test_a_disk_that_is_full_is_told_of_the_file_that_was_to_be_written(tmp_path: Path) -> None:
    program = (
        "import resource, signal; from pkmcal.files.atomic import write_whole\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "write_whole('m.csv', 'x' * 5000)"
    )
    (tmp_path / "m.csv").write_text("old")
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stderr.splitlines()[-1] == "OSError: [Errno 27] File too large: 'm.csv'"
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_what_a_killed_writer_left_is_swept_by_the_next_and_a_living_ones_is_not(
    tmp_path: Path,
) -> None:
    program = (
        "import os; from pkmcal.files import atomic\n"
        "def stop(handle): print('here', flush=True); import time; time.sleep(100)\n"
        "os.fsync = stop\n"
        "atomic.write_whole('m.csv', 'new')"
    )
    writer = subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    try:
        assert writer.stdout is not None and writer.stdout.readline() == "here\n"
    finally:
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
    (left,) = tmp_path.iterdir()  # nobody takes it for a table
    assert left.name.startswith(".") and left.suffix == ".part"
    write_whole(tmp_path / "other.csv", "content")
    assert left.exists()
    os.utime(left, (0, left.stat().st_mtime - 2 * atomic._GONE))
    write_whole(tmp_path / "other.csv", "content")
    assert [path.name for path in tmp_path.iterdir()] == ["other.csv"]


def test_content_is_on_the_disk_before_it_takes_the_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(atomic.os, name, lambda *a, n=name, f=real: (calls.append(n), f(*a))[1])
    write_whole(tmp_path / "m.csv", "content")
    assert calls == ["fsync", "replace", "fsync"]


def test_a_file_that_somebody_has_open_for_a_moment_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows refuses while it is open; here a stand-in does."""
    path, real, left = tmp_path / "robot.toml", os.replace, [3]

    def refused(part: Path, place: Path) -> None:
        if left[0]:
            left[0] -= 1
            raise PermissionError(13, "Permission denied", str(part))
        real(part, place)

    path.write_text("old")
    monkeypatch.setattr(os, "replace", refused)
    monkeypatch.setattr(atomic, "_WAITS", (0.0, 0.0, 0.0))
    write_whole(path, "new")
    assert path.read_text() == "new"
    left[0] = 4
    with pytest.raises(PermissionError, match=r"robot\.toml"):
        write_whole(path, "newer")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_no_file_is_written_as_text() -> None:
    """On Windows that would write other line ends than those of the content."""
    package = Path(atomic.__file__).parents[1]
    found = []
    for file in package.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            modes = [each.value for each in node.args if isinstance(each, ast.Constant)]
            if name == "write_text" or (name == "open" and "w" in modes):
                found.append(f"{file.relative_to(package).as_posix()}: {ast.unparse(node)}")
    assert found == ["cli/main.py: open(os.devnull, 'w', encoding='utf-8')"]
