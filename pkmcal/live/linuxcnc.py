"""Machines with LinuxCNC, by linuxcncrsh, its interface of lines (``DISPLAY = linuxcncrsh``).

Its manual page, linuxcncrsh(1), has the commands: hello, get and set.
"""

from __future__ import annotations

from time import monotonic, sleep

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.kinematics.robot import Robot
from pkmcal.live.address import host_and_port
from pkmcal.live.device import RESTS, DeviceError, Where, understood
from pkmcal.live.lines import Lines

_PORT = 5007
_MOVE, _PAUSE = 600.0, 0.05  # s that a move may take, and between questions
_THERE = 1e-3  # mm, deg that a place may differ from the command by
_PASSWORDS = ("EMC", "EMCTOO")  # of the program where none are stated


class LinuxCNC:
    """A machine with LinuxCNC; its component is the one exported from this robot file."""

    ADDRESS = "HOST:5007"

    def __init__(self, address: str, robot: Robot) -> None:
        self._robot = robot
        self._axes = [POSE.index(name) for name in robot.model.match or robot.coordinates]
        self._where = host_and_port(address, _PORT, "linuxcnc")
        self._lines = Lines(*self._where, "linuxcncrsh")
        try:
            _greet(self._lines)
        except BaseException:
            self._lines.close()
            raise

    def require_ready(self) -> None:
        """Raise a `DeviceError` unless it is on, homed and idle."""
        if self._get("estop") != "OFF" or self._get("machine") != "ON":
            raise DeviceError("LinuxCNC is off, or in emergency stop: switch it on")
        homed = self._get("joint_homed").split()[: self._robot.n_actuators]
        if not homed or set(homed) != {"YES"}:
            raise DeviceError("LinuxCNC is not homed: home all joints")
        if self._get("program_status") != "IDLE":
            raise DeviceError("LinuxCNC runs a program: wait until it has ended")
        self._set(f"enable {_PASSWORDS[1]}")  # of several connections one has it
        self._set("mode mdi")

    def go(self, pose: FloatArray, feed: float) -> None:
        """Drive straight to a pose, in machine coordinates, and wait until it is there."""
        wanted = np.r_[pose[:3], np.degrees(pose[3:])]
        words = " ".join(f"{'XYZABC'[i]}{wanted[i]:.6f}" for i in self._axes)
        self._set(f"mdi G21 G90 G53 G1 {words} F{feed:.2f}")
        end, idle = monotonic() + _MOVE, 0
        while True:
            if self._get("machine") != "ON":
                raise DeviceError("LinuxCNC went off in a move")
            place = self._numbers("abs_act_pos", max(self._axes) + 1)
            off = np.abs(place[self._axes] - wanted[self._axes]).max()
            idle = idle + 1 if self._get("program_status") == "IDLE" else 0
            if idle and off < _THERE:
                return
            if idle > RESTS:
                raise DeviceError(
                    f"LinuxCNC stopped {off:.3f} from the pose; it says: {self._get('error')}"
                )
            if monotonic() > end:
                raise DeviceError(f"LinuxCNC is {off:.3f} from the pose after {_MOVE:g} s")
            sleep(_PAUSE)

    def where(self) -> Where:
        """Return the machine's coordinates and the positions of its joints."""
        place = self._numbers("abs_act_pos", max(self._axes) + 1)
        pose = np.full(6, np.nan)
        pose[self._axes] = place[self._axes]
        pose[3:] = np.radians(pose[3:])
        count = self._robot.n_actuators
        joints = self._numbers("joint_pos", count)[:count]
        turned = np.array([unit == "rad" for unit in self._robot.actuator_units])
        return Where(pose, np.where(turned, np.radians(joints), joints))

    def stop(self) -> None:
        """Emergency stop, by a connection of its own: `go` may be waiting at the other."""
        lines = Lines(*self._where, "linuxcncrsh", wait=3.0)
        try:
            _greet(lines)
            _set(lines, "estop on")
        finally:
            lines.close()

    def close(self) -> None:
        """Close the connection."""
        self._lines.close()

    def _set(self, words: str) -> None:
        _set(self._lines, words)

    def _get(self, name: str) -> str:
        def taken(said: str) -> str | None:
            if said.upper().startswith(name.upper()):
                return said[len(name) :].strip()
            if "NAK" in said:
                raise DeviceError(f"LinuxCNC does not say {name}: {said}")
            return None

        self._lines.send(f"get {name}")
        return self._lines.answer(taken)

    def _numbers(self, name: str, least: int) -> FloatArray:
        with understood(f"LinuxCNC, {name}"):
            numbers = np.array([float(each) for each in self._get(name).split()])
        if len(numbers) < least or not np.isfinite(numbers[:least]).all():
            raise DeviceError(f"LinuxCNC says {numbers} of {name}, where {least} are expected")
        return numbers


def _greet(lines: Lines) -> None:
    connect, enable = _PASSWORDS
    lines.send(f"hello {connect} pkmcal 1.0")
    said = lines.answer(
        lambda line: line if "HELLO" in line.upper().split(maxsplit=1)[:1] else None
    )
    if "ACK" not in said:
        raise DeviceError(f"linuxcncrsh refuses: {said}")
    lines.send("set echo off")
    for words in ("verbose on", f"enable {enable}"):
        _set(lines, words)


def _set(lines: Lines, words: str) -> None:
    lines.send(f"set {words}")
    name = f"SET {words.split()[0].upper()}"
    said = lines.answer(
        lambda line: line if line.startswith((f"{name} ACK", f"{name} NAK")) else None
    )
    if said.endswith("NAK"):
        raise DeviceError(f"LinuxCNC refuses {words!r}")
