"""What an outsider pulled and typed while a machine was measured; each of these went wrong once."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import FileError
from pkmcal.jobs import measuring
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.plan import Planning
from pkmcal.live.device import DeviceError
from pkmcal.live.measuring_run import Rules
from pkmcal.live.row_log import RowLog
from pkmcal.readings.registry import as_reading

from .servers import duet, grbl
from .test_command import measured
from .test_measuring_run import NOISE, PRINTER, Measurement, lines, log_of

ROW = np.array([1.0, 2.0, 3.0]), np.array([[4.0]]), 5.0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A printer and 30 places on its bed."""
    root = Path(__file__).resolve().parents[2]
    (tmp_path / "robot.toml").write_text(
        (root / "examples" / "linear-delta" / "robot.toml").read_text()
    )
    places = np.random.default_rng(1).uniform(-70, 70, (30, 2)).round(2)
    rows = "".join(f"{x},{y},5\n" for x, y in places)
    (tmp_path / "poses.csv").write_text("x [mm],y [mm],z [mm]\n" + rows)
    return tmp_path


def written(path: Path, rows: int = 3) -> str:
    """A log with some rows."""
    log = log_of(path)
    for i in range(rows):
        log.append(np.array([1.0, 2.0, 3.0 + i]), np.array([[4.0 + i]]), 5.0)
    log.close()
    return path.read_text()


def test_rows_keep_the_noise_and_the_point_that_they_were_measured_with(tmp_path: Path) -> None:
    """A better gauge from row 2 on does not make row 1 better."""
    path = tmp_path / "log.csv"
    for sigma, point in ((0.03, 0.0), (0.003, -30.0)):
        log = RowLog(path, PRINTER, as_reading("height"), np.array([sigma]),
                     np.array([0.0, 0.0, point]), "# head\n")  # fmt: skip
        log.append(*ROW)
        rows = log.rows
        log.close()
    assert rows is not None and len(log.notes) == 3
    of_file = pk.read_measurements(path, PRINTER)
    for each in (rows, of_file):
        np.testing.assert_array_equal(np.ravel(each.sigma), [0.03, 0.003])
        np.testing.assert_array_equal(each.target, [[0, 0, 0], [0, 0, -30]])


@pytest.mark.parametrize(
    "edited", [lambda text: text.replace("\n", "\r\n"), lambda text: "\ufeff" + text,
               lambda text: text + "\n\n", lambda text: text.replace(",4.0,", ",4.25,")],
    ids=["line ends of Windows", "byte order mark", "empty lines", "a value"],
)  # fmt: skip
def test_a_log_that_an_editor_has_saved_goes_on(tmp_path: Path, edited: Any) -> None:
    path = tmp_path / "log.csv"
    text = written(path)
    path.write_bytes(edited(text).encode())
    log = log_of(path)
    log.append(*ROW)
    rows = log.rows
    log.close()
    assert rows is not None and len(rows) == 4
    np.testing.assert_array_equal(pk.read_measurements(path, PRINTER).values, rows.values)


@pytest.mark.parametrize("value", ["", "nan", "inf", "abc", '"4,0"', "-"])
def test_a_row_that_was_spoilt_by_hand_is_named_by_its_line_and_kept(
    tmp_path: Path, value: str
) -> None:
    path = tmp_path / "log.csv"
    text = written(path).replace(",5.0,", f",{value},", 1)
    path.write_text(text)
    line = next(i for i, each in enumerate(text.splitlines(), 1) if f",{value}," in each)
    with pytest.raises(FileError, match=f"line {line}"):
        log_of(path)
    assert path.read_text() == text


def test_a_row_that_was_deleted_by_hand_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    first = Measurement(path, count=8)
    list(first.courses)
    first.log.close()
    kept = path.read_text().splitlines(True)
    path.write_text("".join(kept[:4] + kept[5:]))
    again = Measurement(path, count=8)
    *_, last = again.courses
    assert len(last.rows) == 8 == len(np.unique(last.rows.actuators, axis=0))
    again.log.close()


def test_what_is_cut_off_is_shown(tmp_path: Path) -> None:
    """An editor may have left a whole row without the end of its line."""
    path = tmp_path / "log.csv"
    text = written(path)
    path.write_text(text[:-1])
    log = log_of(path)
    assert text.splitlines()[-1] in log.notes[0]
    log.close()


def replaced(path: Path) -> None:
    beside = path.with_suffix(".new")
    beside.write_text(path.read_text())
    beside.replace(path)


@pytest.mark.parametrize(
    "touch",
    [
        replaced,
        Path.unlink,
        lambda path: path.write_text("# head\n"),
        lambda path: path.write_text(path.read_text() + "x\n"),
    ],
    ids=["saved by an editor", "deleted", "emptied", "added to"],
)
def test_a_log_that_others_touch_while_it_grows_is_told_before_a_row_is_lost(
    tmp_path: Path, touch: Any
) -> None:
    path = tmp_path / "log.csv"
    written(path)
    log = log_of(path)
    touch(path)
    left = path.read_text() if path.exists() else None
    with pytest.raises(OSError, match=r"log\.csv") as caught:
        log.append(*ROW)
    assert caught.value.errno in (errno.EBUSY, errno.ENOENT)
    assert (path.read_text() if path.exists() else None) == left
    log.close()


def test_a_reading_that_no_machine_reaches_is_a_mistake(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv")
    measured.gauge.bad = {3: 1e200}
    with pytest.raises(DeviceError, match="reads 1e\\+200"):
        list(measured.courses)
    assert len(lines(tmp_path / "log.csv")) == 2
    measured.log.close()


def test_rows_that_have_no_calibration_say_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    measured = Measurement(tmp_path / "log.csv", count=9)
    monkeypatch.setattr("pkmcal.live.course.identify", fails)
    *_, last = measured.courses
    assert last.poses == 9 and last.trouble == "SVD did not converge" and not last.reached
    measured.log.close()


def test_ctrl_c_twice_does_not_keep_the_stop_from_the_machine(tmp_path: Path) -> None:
    """The second comes while the machine is being told; it hears of it all the same."""
    measured = Measurement(tmp_path / "log.csv")
    told = threading.Event()

    def interrupted() -> None:
        raise KeyboardInterrupt

    def slow() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.3)
        told.set()

    measured.machine.during, measured.machine.stop = interrupted, slow  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        next(measured.courses)
    assert told.wait(10.0)
    measured.log.close()


def test_a_machine_that_does_not_take_the_stop_is_told(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv")

    def interrupted() -> None:
        raise KeyboardInterrupt

    def deaf() -> None:
        raise DeviceError("it does not answer")

    measured.machine.during, measured.machine.stop = interrupted, deaf  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        next(measured.courses)
    assert measured.said == [
        "the machine did not obey the stop: stop it by hand (it does not answer)"
    ]
    measured.log.close()


@pytest.mark.parametrize("height", [float("nan"), float("inf"), 1e9])
def test_a_safe_height_that_is_none_moves_nothing(folder: Path, height: float) -> None:
    job = Planning(str(folder / "robot.toml"), count=3, kind="height", direction="z",
                   noise=str(NOISE), poses=str(folder / "poses.csv"))  # fmt: skip
    with duet() as (address, machine), pytest.raises(pk.ArgumentError, match="--safe-height"):
        driven = measuring.driven(
            job, f"reprap:{address}", "person", Rules(safe_height=height, dwell=0.0),
            str(folder / "log.csv"), Inputs(), print,
        )  # fmt: skip
        try:
            next(driven.start())
        finally:
            driven.close()
    assert machine.lines == []


@pytest.mark.parametrize("server", [duet, grbl])
def test_a_server_that_dies_while_a_person_reads_is_told_once(folder: Path, server: Any) -> None:
    word = "reprap" if server is duet else "fluidnc"
    with server() as (address, machine):
        running = subprocess.Popen(
            [Path(sys.executable).with_name("pkmcal"), "measure", "robot.toml", "--kind", "height",
             "--noise", "0.03", "--direction", "z", "--poses", "poses.csv", "--dwell", "0",
             "--machine", f"{word}:{address}", "--instrument", "person", "--count", "9",
             "--out", "log.csv"],
            cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        assert running.stdin is not None
        running.stdin.write("start\n5.0\n5.01\n")
        running.stdin.flush()
        end = time.monotonic() + 60.0
        while machine.looks or len(machine.lines) < 3:
            assert running.poll() is None and time.monotonic() < end
            time.sleep(0.05)
        machine.dead = True
    _, err = running.communicate("5.0\n5.0\n5.0\n5.0\n", timeout=60)
    said = err.splitlines()
    assert running.returncode == 1, err
    rows = len(lines(folder / "log.csv"))  # the third's move may have been asked after once more
    assert rows in (2, 3)
    assert f"stopped with {rows} rows in log.csv: the same command goes on" in said[-2]
    assert address.removeprefix("http://") in said[-1] and len(said) == 2
    done = measured(folder, "person", "start\n" + "\n5.0\n" * 3, "--count", "5")
    assert done.returncode == 0 and f"goes on behind {rows} rows" in done.stderr
