"""A measurement that goes on: with a machine of this file, plugs pulled at every step."""

from __future__ import annotations

import errno
import os
import resource
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
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.live.course import Course
from pkmcal.live.device import DeviceError, Where
from pkmcal.live.measuring_run import MeasuringRun, Rules, Stopped, measured_already
from pkmcal.live.row_log import RowLog
from pkmcal.readings.registry import as_reading

NOISE = 0.03
PRINTER = pk.load(Path(__file__).resolve().parents[2] / "examples" / "linear-delta" / "robot.toml")
TRUE = PRINTER.replace({"radius": 171.0, "offset1": PRINTER.geometry["offset1"] - 0.4})


def bed(count: int = 30, z: float = 5.0) -> FloatArray:
    random = np.random.default_rng(2)
    radius, turn = 100.0 * np.sqrt(random.uniform(0, 1, count)), random.uniform(0, 2 * np.pi, count)
    poses = np.zeros((count, 6))
    poses[:, 0], poses[:, 1], poses[:, 2] = radius * np.cos(turn), radius * np.sin(turn), z
    return poses


class Simulated:
    """A machine that notes its moves; `fails` after so many."""

    ADDRESS = ""

    def __init__(self, fails: int | None = None, says: bool = True) -> None:
        self.moves: list[FloatArray] = []
        self.at, self.fails, self.says, self.stops = np.array([0, 0, 60.0, 0, 0, 0]), fails, says, 0
        self.during: Any = None

    def require_ready(self) -> None: ...

    def go(self, pose: FloatArray, feed: float) -> None:
        if len(self.moves) == self.fails:
            raise DeviceError("the machine does not answer")
        if self.during is not None:
            self.during()
        self.moves.append(pose)
        self.at = pose

    def where(self) -> Where:
        return Where(self.at, PRINTER.inverse(self.at)) if self.says else Where()

    def stop(self) -> None:
        self.stops += 1

    def close(self) -> None: ...


class Gauge:
    ADDRESS = ""

    def __init__(self, machine: Simulated) -> None:
        self.machine, self.noise, self.blind = machine, np.random.default_rng(1), set[int]()
        self.bad: dict[int, float] = {}
        self.readings = 0

    def read(self, wanted: str) -> FloatArray:
        self.readings += 1
        if self.readings in self.blind:
            return np.array([np.nan])
        z = TRUE.forward(PRINTER.inverse(self.machine.moves[-1])).pose[2]
        off = self.bad.get(self.readings, 0.0)
        return np.array([z + off + self.noise.normal(0.0, NOISE)])

    def close(self) -> None: ...


class Measurement:
    def __init__(self, path: Path, robot: pk.Robot = PRINTER, **given: Any) -> None:
        rules = given.pop("rules", Rules(dwell=0.0))
        accuracy, count = given.pop("accuracy", 0.03), given.pop("count", None)
        self.machine = Simulated(**given)
        self.gauge, self.said = Gauge(self.machine), list[str]()
        self.log = RowLog(path, robot, as_reading("height"), np.array([NOISE]), None, "# head\n")
        done = measured_already(robot, bed(), self.log)
        choice = pk.next_pose(
            robot, bed(), kind="height", noise=NOISE, direction=(0, 0, 1), done=done,
            measured=self.log.rows,
        )  # fmt: skip
        course = Course(choice, True, accuracy, count, {}, self.log.rows, len(done)).fitted()
        self.run = MeasuringRun(robot, self.machine, self.gauge, self.log, rules, self.said.append)
        self.courses = self.run.start(course)


def lines(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if line[0] not in "#q"]


def test_it_stops_where_the_accuracy_is_there_and_the_rows_are_a_calibration(
    tmp_path: Path,
) -> None:
    measured = Measurement(tmp_path / "log.csv")
    for course in measured.courses:
        assert len(lines(tmp_path / "log.csv")) == course.poses
    assert course.reached and course.predicted <= 0.03 and course.poses < 30
    measured.log.close()
    rows = pk.read_measurements(tmp_path / "log.csv", PRINTER)
    found = pk.identify(PRINTER, rows)
    np.testing.assert_allclose(found.values, course.found.values, rtol=1e-12)
    q = PRINTER.inverse(bed())
    off = found.robot.forward(q).pose[:, 2] - TRUE.forward(q).pose[:, 2]
    assert np.sqrt((off**2).mean()) < 0.03


def test_between_poses_it_rises_and_stays_within_limits(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv", rules=Rules(dwell=0.0, safe_height=20.0), count=3)
    list(measured.courses)
    moves = np.array(measured.machine.moves)
    sideways = np.abs(np.diff(moves[:, :2], axis=0)).max(axis=1) > 0
    assert (moves[1:, 2][sideways] >= 20.0).all() and (moves[:-1, 2][sideways] >= 20.0).all()
    assert np.isclose(moves[:, 2], 5.0).sum() == 3
    measured.log.close()


@pytest.mark.parametrize("box", [{"z": (0.0, 15.0)}, {"z": (6.0, 300.0)}])
def test_a_way_that_leaves_the_box_of_the_user_is_not_driven(
    tmp_path: Path, box: dict[str, Any]
) -> None:
    measured = Measurement(tmp_path / "log.csv")
    run = MeasuringRun(
        PRINTER.within(box), measured.machine, measured.gauge, measured.log,
        Rules(dwell=0.0, safe_height=20.0), print,
    )  # fmt: skip
    course = Course(pk.next_pose(PRINTER, bed(), kind="height"), True, 0.03)
    with pytest.raises(ArgumentError, match="leaves the limits"):
        next(run.start(course))
    assert measured.machine.moves == []
    measured.log.close()


def test_a_row_that_contradicts_is_told_at_once_and_holds_the_stop_back(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv", accuracy=None)
    measured.gauge.bad = {20: 0.4}
    odd = [course.poses for course in measured.courses if course.odd is not None]
    assert odd[0] == 20
    measured.log.close()


def test_repeats_are_rows_and_what_is_not_seen_is_none(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv", rules=Rules(dwell=0.0, repeats=2), count=6)
    measured.gauge.blind = {3, 5, 6}
    *_, last = measured.courses
    assert last.poses == 6 and len(last.rows) == 11  # one seen once, one not at all
    assert len(measured.said) == 1 and "nothing was seen" in measured.said[0]
    assert last.rows.pose_index.max() == 5
    measured.log.close()


@pytest.mark.parametrize("moves", [0, 1, 4])
def test_a_machine_that_dies_loses_no_row_and_it_goes_on(tmp_path: Path, moves: int) -> None:
    measured = Measurement(tmp_path / "log.csv", fails=moves)
    with pytest.raises(DeviceError, match="does not answer"):
        list(measured.courses)
    assert len(lines(tmp_path / "log.csv")) == measured.gauge.readings == moves
    measured.log.close()
    again = Measurement(tmp_path / "log.csv")
    *_, last = again.courses
    assert last.reached and len(np.unique(last.rows.actuators, axis=0)) == last.poses
    again.log.close()


def test_stop_in_a_move_stops_the_machine_and_writes_nothing(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv")
    next(measured.courses)
    measured.machine.during = measured.run.stop  # from the thread of a window, say
    with pytest.raises(Stopped):
        next(measured.courses)
    assert measured.machine.stops == 1 and len(lines(tmp_path / "log.csv")) == 1
    measured.log.close()


def test_stop_at_rest_sends_nothing_and_moves_nothing(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv", rules=Rules(dwell=60.0))
    threading.Timer(0.5, measured.run.stop).start()
    began = time.monotonic()
    with pytest.raises(Stopped):
        next(measured.courses)
    assert time.monotonic() - began < 30.0
    assert measured.machine.stops == 0 and len(measured.machine.moves) == 1
    measured.log.close()


def test_ctrl_c_in_a_move_stops_the_machine(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv")

    def interrupted() -> None:
        raise KeyboardInterrupt

    measured.machine.during = interrupted
    with pytest.raises(KeyboardInterrupt):
        next(measured.courses)
    assert measured.machine.stops == 1
    measured.log.close()


def test_a_machine_that_says_nothing_is_where_it_was_sent(tmp_path: Path) -> None:
    measured = Measurement(tmp_path / "log.csv", says=False, count=2)
    *_, last = measured.courses
    sent = PRINTER.inverse(np.array(measured.machine.moves))
    np.testing.assert_array_equal(last.rows.actuators, sent)
    measured.log.close()


def log_of(path: Path, sigma: float | None = NOISE) -> RowLog:
    deviation = None if sigma is None else np.array([sigma])
    return RowLog(path, PRINTER, as_reading("height"), deviation, None, "# head\n")


def test_a_row_that_was_half_written_is_cut_off_and_said(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log.csv")
    log.append(np.array([1.0, 2.0, 3.0]), np.array([[4.0]]), 5.0)
    log.close()
    whole = (tmp_path / "log.csv").read_bytes()
    for half in (b"1.5", b"1.5,2.5,3.5,4", whole.splitlines()[-1]):
        (tmp_path / "log.csv").write_bytes(whole + half)
        log = log_of(tmp_path / "log.csv")
        assert "half written" in log.notes[0] and len(log.rows) == 1
        log.append(np.array([1.0, 2.0, 3.5]), np.array([[4.5]]), 6.0)
        np.testing.assert_array_equal(log.rows.values, [4.0, 4.5])
        log.close()


def test_a_full_disk_loses_no_row_and_leaves_no_half(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log.csv")
    log.append(np.array([1.0, 2.0, 3.0]), np.array([[4.0]]), 5.0)
    before = (tmp_path / "log.csv").read_bytes()
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.getsignal(signal.SIGXFSZ)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 9, limits[1]))
    try:
        with pytest.raises(OSError, match=r"log\.csv") as caught:
            log.append(np.array([1.0, 2.0, 3.5]), np.array([[4.5]]), 6.0)
        assert caught.value.errno == errno.EFBIG
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert (tmp_path / "log.csv").read_bytes() == before and len(log.rows) == 1
    log.append(np.array([1.0, 2.0, 3.5]), np.array([[4.5]]), 6.0)
    log.close()
    assert len(pk.read_measurements(tmp_path / "log.csv", PRINTER)) == 2


def test_a_log_of_something_else_is_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for text in ("x,y\n1,2\n", "# other\n", "\n", "# head"):
        path.write_text(text)
        with pytest.raises(FileError, match="choose another file"):
            log_of(path)
        assert path.read_text() == text
    path.unlink()
    log_of(path).close()
    with pytest.raises(FileError, match="sigma"):  # other columns
        log_of(path, None)


def test_two_do_not_write_to_one_log(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    log = log_of(tmp_path / "log.csv")
    with pytest.raises(OSError, match="another measurement"):
        log_of(tmp_path / "log.csv")
    log.close()
    log_of(tmp_path / "log.csv").close()


def test_a_row_is_on_the_disk_before_the_program_goes_on(tmp_path: Path) -> None:
    """A process that is killed behind `append` has written the row."""
    program = (
        "import os, sys, numpy as np, pkmcal as pk; from pathlib import Path\n"
        "from pkmcal.live.row_log import RowLog; from pkmcal.readings.registry import as_reading\n"
        "kind, robot = as_reading('position'), pk.load('hexapod')\n"
        "log = RowLog(Path('log.csv'), robot, kind, None, None, '')\n"
        "log.append(np.zeros(6), np.ones((1, 3)), 1.0); os.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path)
    assert done.returncode == -signal.SIGKILL
    assert len(pk.read_measurements(tmp_path / "log.csv")) == 1
    assert os.path.getsize(tmp_path / "log.csv") > 0
