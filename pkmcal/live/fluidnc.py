"""Machines with FluidNC, a Maslow among them, by its lines at telnet.

Its pages: wiki.fluidnc.com, Commands and Settings, Telnet; the protocol is that of Grbl 1.1:
`ok` and `error:N`, and at `?` a status such as ``<Idle|MPos:0.000,0.000,0.000|FS:0,0>``.
"""

from __future__ import annotations

import re
from time import monotonic, sleep

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.live.address import host_and_port
from pkmcal.live.device import DeviceError, Where, require_translations, understood
from pkmcal.live.lines import Lines

_TELNET = 23
_MOVE, _PAUSE = 600.0, 0.1  # s that a move may take, and between questions
_RESTS = 10  # looks at rest after which a move that has not arrived has ended elsewhere
_THERE = 0.02  # mm that a place may differ from the command by; three decimals are printed
_STATUS = re.compile(r"<(?P<state>\w+)[^|>]*(?P<rest>[^>]*)>")
_PLACE = re.compile(r"\|MPos:([-\d.,]+)")
_STOP = b"!\x18"  # feed hold, then reset: both take effect in the middle of a line


class FluidNC:
    """A machine with FluidNC. Its coordinates have to be those of the robot file.

    A Maslow counts x and y from where the diagonals of its frame meet, a robot file from where its
    anchors do: of one that was imported they are not the same, and it is refused.
    """

    ADDRESS = "HOST:23"

    def __init__(self, address: str, robot: Robot) -> None:
        require_translations(robot, "fluidnc")
        if robot.model.controller is not None and robot.model.controller.firmware == "maslow":
            raise DeviceError(
                "fluidnc: a Maslow counts x and y from where the diagonals of its frame meet, the"
                " robot file from its anchor: measure its belts with its own calibration, and read"
                " the log"
            )
        self._axes = len(robot.coordinates)
        self._lines = Lines(*host_and_port(address, _TELNET, "fluidnc"), "FluidNC")

    def require_ready(self) -> None:
        """Raise a `DeviceError` unless it is idle and says machine coordinates."""
        state, place = self._status()
        if state != "Idle":
            raise DeviceError(
                f"the machine is {state}, where it should be Idle (alarm: home it, $H)"
            )
        if place is None:
            raise DeviceError("its status says no MPos: set $10=1")

    def go(self, pose: FloatArray, feed: float) -> None:
        """Drive straight to a place, in machine coordinates, and wait until it is there."""
        words = " ".join(
            f"{axis}{value:.4f}" for axis, value in zip("XYZ"[: self._axes], pose, strict=False)
        )
        self._command(f"G21 G90 G53 G1 {words} F{feed:.1f}")
        end, idle = monotonic() + _MOVE, 0
        while True:
            state, place = self._status()
            if state not in ("Idle", "Run"):
                raise DeviceError(f"the machine is {state} in a move")
            if place is None:
                raise DeviceError("its status says no MPos in a move: set $10=1")
            off = np.abs(place[: self._axes] - pose[: self._axes]).max()
            idle = idle + 1 if state == "Idle" else 0  # a move may not have begun yet
            if idle and off < _THERE:
                return
            if idle > _RESTS:
                raise DeviceError(f"the machine stopped {off:.3f} mm from where it was to go")
            if monotonic() > end:
                raise DeviceError(f"the machine is not there after {_MOVE:g} s")
            sleep(_PAUSE)

    def where(self) -> Where:
        """Return the machine's coordinates; FluidNC says nothing of its drives."""
        _, place = self._status()
        if place is None:
            return Where()
        pose = np.zeros(6)
        pose[: self._axes] = place[: self._axes]
        return Where(pose)

    def stop(self) -> None:
        """Feed hold and reset: the machine has to be unlocked and homed ($H)."""
        self._lines.send(_STOP)

    def close(self) -> None:
        """Close the connection."""
        self._lines.close()

    def _command(self, line: str) -> None:
        def taken(said: str) -> bool | None:
            if said.startswith(("error", "ALARM")):
                raise DeviceError(f"FluidNC refuses {line!r}: {said}")
            return said == "ok" or None

        self._lines.send(line)
        self._lines.answer(taken)

    def _status(self) -> tuple[str, FloatArray | None]:
        def taken(said: str) -> re.Match[str] | None:
            if said.startswith("ALARM"):
                raise DeviceError(f"FluidNC: {said}")
            return _STATUS.fullmatch(said)

        self._lines.send(b"?")
        found = self._lines.answer(taken)
        place = _PLACE.search(found["rest"])
        if place is None:
            return found["state"], None
        with understood(f"FluidNC, {found[0]}"):
            numbers = np.array([float(x) for x in place[1].split(",")])
        if len(numbers) < self._axes:
            raise DeviceError(f"FluidNC says {len(numbers)} axes: {found[0]}")
        return found["state"], numbers
