"""A hexapod in LinuxCNC's simulation is measured: `make test-linuxcnc`; skipped where it is not."""

from __future__ import annotations

import shutil
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.live.course import Course
from pkmcal.live.device import DeviceError
from pkmcal.live.linuxcnc import LinuxCNC
from pkmcal.live.measuring_run import MeasuringRun, Rules, Stopped
from pkmcal.live.row_log import RowLog
from pkmcal.readings.registry import as_reading

from ..controllers.test_linuxcnc import MODULES, NOBODY, SYSTEM, needs_linuxcnc, needs_root

pytestmark = [needs_linuxcnc, needs_root]
ADDRESS = "127.0.0.1:5007"
NOISE = 0.02


@pytest.fixture(scope="module")
def robot() -> pk.Robot:
    return pk.load("hexapod")


@pytest.fixture
def simulation(robot: pk.Robot, tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """LinuxCNC with the exported component, off and not homed."""
    folder = tmp_path / "machine"
    pk.export.linuxcnc(robot, folder)
    home = Path(tempfile.mkdtemp(prefix="linuxcnc-"))  # a socket's path must be short
    home.chmod(0o777)
    command = ["halcompile", "--install", "pkm_machine.c"]
    subprocess.run(command, cwd=folder, env=SYSTEM, check=True, capture_output=True)
    own = {"HOME": str(home), "RTAPI_UID": str(NOBODY), "RTAPI_FIFO_PATH": f"{home}/fifo"}
    with open(home / "log", "w") as log:
        running = subprocess.Popen(
            ["linuxcnc", "-r", "machine.ini"], cwd=folder, env=SYSTEM | own,
            stdin=subprocess.DEVNULL, stdout=log, stderr=log,
        )  # fmt: skip
        try:
            tell()  # when it has started
            yield running
        finally:
            if running.poll() is None:
                tell("set enable EMCTOO", "shutdown")
            try:
                running.wait(60)
            except subprocess.TimeoutExpired:
                running.terminate()
                running.wait(60)
            (MODULES / "pkm_machine.so").unlink(missing_ok=True)
            shutil.rmtree(home, ignore_errors=True)


def tell(*lines: str) -> None:
    """What a person does at its window."""
    end = time.monotonic() + 60
    while True:
        try:
            with socket.create_connection(("127.0.0.1", 5007), timeout=10) as connection:
                for line in ("hello EMC test 1.0", "set set_wait done", *lines):
                    connection.sendall(f"{line}\r\n".encode())
                    time.sleep(0.3)
            return
        except ConnectionRefusedError:
            assert time.monotonic() < end, "LinuxCNC did not start"
            time.sleep(0.2)


def switched_on() -> None:
    """On and homed: once it has started, which may take a while after it listens."""
    for _ in range(20):
        tell("set enable EMCTOO", "set estop off", "set machine on", "set home -1")
        time.sleep(1.0)
        if "JOINT_HOMED YES YES YES YES YES YES" in said("get joint_homed"):
            return
    raise AssertionError("LinuxCNC was not homed")


def said(line: str) -> str:
    with socket.create_connection(("127.0.0.1", 5007), timeout=10) as connection:
        connection.sendall(f"hello EMC test 1.0\r\n{line}\r\n".encode())
        time.sleep(0.5)
        return connection.recv(10000).decode()


class Tracker:
    """Reads where the true machine is at the joints of the simulation."""

    ADDRESS = ""

    def __init__(self, machine: LinuxCNC, true: pk.Robot) -> None:
        self._machine, self._true, self._noise = machine, true, np.random.default_rng(3)

    def read(self, wanted: str) -> FloatArray:
        pose = self._true.forward(self._machine.where().actuators).pose
        found: FloatArray = pose[:3] + self._noise.normal(0.0, NOISE, 3)
        return found

    def close(self) -> None: ...


def near_home(robot: pk.Robot, count: int) -> FloatArray:
    moved = np.random.default_rng(5).uniform(-1, 1, (count, 6)) * [40, 40, 30, 0.1, 0.1, 0.1]
    return robot.home + moved


def test_a_hexapod_is_measured_and_stops_at_once(
    simulation: subprocess.Popen[bytes], robot: pk.Robot, tmp_path: Path
) -> None:
    machine = LinuxCNC(ADDRESS, robot)
    with pytest.raises(DeviceError, match="off, or in emergency stop"):
        machine.require_ready()
    switched_on()
    machine.require_ready()
    true = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.4, "offset3": 0.6})
    poses = near_home(robot, 60)
    log = RowLog(tmp_path / "log.csv", robot, as_reading("position"), np.full(3, NOISE), None, "")
    prior = {"prior": 0.5}
    choice = pk.next_pose(robot, poses, kind="position", noise=NOISE, **prior)

    run = MeasuringRun(
        robot, machine, Tracker(machine, true), log, Rules(6000.0, 0.0), lambda line: None
    )
    *_, last = run.start(Course(choice, True, None, 20, prior))
    assert last.poses == 20
    log.close()
    rows = pk.read_measurements(tmp_path / "log.csv", robot)
    # each row is at a pose that was asked for, by the joints that the machine says
    away = np.abs(robot.forward(rows.actuators).pose[:, None] - poses).max(axis=2).min(axis=1)
    assert away.max() < 1e-4
    found = pk.identify(robot, rows, **prior)
    q = robot.inverse(near_home(robot, 200))
    off = [
        np.linalg.norm(each.forward(q).pose[:, :3] - true.forward(q).pose[:, :3], axis=1).mean()
        for each in (robot, found.robot)
    ]
    assert off[1] < 0.2 * off[0], off

    with pytest.raises(DeviceError, match=r"stopped .* from the pose"):  # beyond its joints
        machine.go(robot.home + np.array([0.0, 0.0, 4000.0, 0.0, 0.0, 0.0]), 6000.0)
    machine.require_ready()
    far = robot.home + np.array([40.0, 40.0, 30.0, 0.0, 0.0, 0.0])
    machine.go(robot.home, 6000.0)
    more = RowLog(tmp_path / "more.csv", robot, as_reading("position"), None, None, "")
    stopped = MeasuringRun(robot, machine, None, more, Rules(60.0, 0.0), lambda line: None)
    go = machine.go

    def stopped_in(pose: FloatArray, feed: float) -> None:
        threading.Timer(1.0, stopped.stop).start()  # of a move of a minute
        go(pose, feed)

    machine.go = stopped_in  # type: ignore[method-assign]
    choice = pk.next_pose(
        robot, np.vstack([far, poses[:59]]), noise=NOISE, done=range(1, 60), **prior
    )
    began = time.monotonic()
    with pytest.raises(Stopped):
        next(stopped.start(Course(choice, True, None, 1, prior)))
    assert time.monotonic() - began < 10.0 and more.rows is None
    there = machine.where().pose
    time.sleep(0.5)
    np.testing.assert_allclose(machine.where().pose, there, atol=1e-5)
    assert np.abs(there - far)[:3].max() > 10.0
    with pytest.raises(DeviceError, match="off, or in emergency stop"):
        machine.require_ready()
    more.close()
    machine.close()


def test_a_machine_that_dies_loses_no_row(
    simulation: subprocess.Popen[bytes], robot: pk.Robot, tmp_path: Path
) -> None:
    switched_on()
    machine = LinuxCNC(ADDRESS, robot)
    log = RowLog(tmp_path / "log.csv", robot, as_reading("position"), np.full(3, NOISE), None, "")
    choice = pk.next_pose(robot, near_home(robot, 40), noise=NOISE, prior=0.5)

    run = MeasuringRun(
        robot, machine, Tracker(machine, robot), log, Rules(6000.0, 0.0), lambda line: None
    )
    courses = run.start(Course(choice, True, None, 30, {"prior": 0.5}))
    for _ in range(5):
        next(courses)
    tell("set enable EMCTOO", "shutdown")
    simulation.wait(60)
    with pytest.raises(DeviceError, match=r"linuxcncrsh at 127\.0\.0\.1:5007"):
        next(courses)
    log.close()
    machine.close()
    assert len(pk.read_measurements(tmp_path / "log.csv", robot)) == 5
