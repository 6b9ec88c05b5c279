"""A file is read once and up to its limit, also a pipe."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.files import reading
from pkmcal.files.reading import Input, content
from pkmcal.measurements.pose_csv import read_poses

POSES = "q1 [mm],q2 [mm],q3 [mm],q4 [mm],x [mm],y [mm],z [mm]\n450,452,400,405,6,-6,400\n"


def test_what_changes_after_the_first_reading_does_not_count(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes(b"first")
    read = Input(path)
    assert content(read, 10) == b"first"
    path.write_bytes(b"second")
    assert content(read, 10) == b"first"
    assert (os.fspath(read), str(read)) == (str(path), str(path))


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("robot.toml", pk.load),
        ("m.csv", pk.read_measurements),
        ("m.xlsx", pk.read_measurements),
        ("poses.csv", lambda path: read_poses(path, pk.load("hexapod"))),
        ("arm.urdf", pk.SerialArm.from_urdf),
        ("printer.cfg", pk.import_printer),
    ],
)
def test_a_missing_file_is_named_in_the_same_words_by_all_who_read(
    name: str, read: Callable[[Path], object], tmp_path: Path
) -> None:
    path = tmp_path / name
    for kind in (pk.Error, FileNotFoundError, ValueError):
        with pytest.raises(kind) as raised:
            read(path)
        assert str(raised.value) == f"{path}: no such file"
    near = path.with_stem(path.stem + "2")
    near.touch()
    with pytest.raises(pk.FileError) as raised:
        read(path)
    assert str(raised.value) == f"{path}: no such file; did you mean {near.name!r}?"


def test_a_pipe_is_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "m.csv"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(POSES,))
    writer.start()
    assert len(pk.read_measurements(pipe, pk.load("2tpr2tps"))) == 1
    writer.join()


def test_a_robot_may_come_through_a_pipe(tmp_path: Path) -> None:
    text = (Path(pk.__file__).parent / "builtin/machines/hexapod.toml").read_text("utf-8")
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert pk.load(pipe).n_actuators == 6
    writer.join()


def test_a_file_without_end_is_read_to_the_limit_only() -> None:
    with pytest.raises(ValueError, match=r"/dev/zero: larger than 3 MB, the most that is read"):
        content("/dev/zero", 3 * reading.MB)


def test_a_file_above_the_limit_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    with open(path, "wb") as file:
        file.truncate(10**12)  # takes no room
    with pytest.raises(ValueError, match=r"large.toml: larger than 1 MB"):
        pk.load(path)


def test_a_file_of_just_the_limit_is_read(tmp_path: Path) -> None:
    path = tmp_path / "m"
    path.write_bytes(b"x" * 1000)
    assert len(content(path, 1000)) == 1000
    with pytest.raises(ValueError, match="larger than 0 MB"):
        content(path, 999)


def test_standard_input_is_read() -> None:
    program = "import pkmcal as pk; print(len(pk.read_measurements('/dev/stdin')))"
    done = subprocess.run(
        [sys.executable, "-c", program], input=POSES, capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ("1\n", "")


@pytest.mark.skipif(not os.path.exists("/proc/self/mem"), reason="a file that fails when read")
def test_what_fails_while_it_is_read_is_named() -> None:
    with pytest.raises(OSError, match="Input/output error: '/proc/self/mem'"):
        content("/proc/self/mem", 10)
