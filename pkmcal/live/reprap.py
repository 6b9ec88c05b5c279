"""Machines with RepRapFirmware, by the HTTP requests of a Duet in standalone mode.

Its page: github.com/Duet3D/RepRapFirmware/wiki/HTTP-requests: rr_connect, rr_gcode, rr_model;
and docs.duet3d.com, object model: state.status, move.axes, move.compensation.
"""

from __future__ import annotations

from time import monotonic, sleep
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.live.device import RESTS, DeviceError, Where, require_translations, understood
from pkmcal.live.http import RefusedError, Server

_MOVE, _PAUSE = 600.0, 0.1  # s that a move may take, and between questions
_THERE = 0.01  # mm that a place may differ from the command by
_PASSWORD = "reprap"  # that of the firmware where none is set; no other is asked for or kept


class RepRap:
    """A Duet board by itself, without a password of its own."""

    ADDRESS = "http://HOST"

    def __init__(self, address: str, robot: Robot) -> None:
        require_translations(robot, "reprap")
        self._server = Server(address, "RepRapFirmware")
        self._connect()

    def _connect(self) -> None:
        """Begin a session, which the board ends when it was asked nothing for some seconds."""
        found = self._server.ask("/rr_connect", password=_PASSWORD)
        if found.get("err") != 0:
            why = {"1": "it has a password (M551)", "2": "too many are connected"}
            raise DeviceError(f"RepRapFirmware refuses: {why.get(str(found.get('err')), found)}")
        if "sessionKey" in found:
            self._server.headers["X-Session-Key"] = str(found["sessionKey"])

    def require_ready(self) -> None:
        """Raise a `DeviceError` unless it is idle, homed, and no mesh bends its moves."""
        status = self._status()
        if status != "idle":
            raise DeviceError(f"the machine is {status}, where it should be idle")
        move = self._model("move")
        with understood("RepRapFirmware, move"):
            axes = [str(axis["letter"]) for axis in move["axes"][:3] if axis["homed"] is not True]
            kind = move["compensation"]["type"]
        if axes:
            raise DeviceError(f"{', '.join(axes)} not homed: home it (G28)")
        if kind != "none":
            raise DeviceError(f"a {kind} compensation bends its moves: switch it off (G29 S2)")

    def go(self, pose: FloatArray, feed: float) -> None:
        """Drive straight to a place, in machine coordinates, and wait until it is there."""
        x, y, z = pose[:3]
        self._gcode(f"G21 G90 G53 G1 X{x:.5f} Y{y:.5f} Z{z:.5f} F{feed:.1f}")
        end, idle = monotonic() + _MOVE, 0
        while True:
            status = self._status()
            if status not in ("idle", "busy", "processing"):
                raise DeviceError(f"the machine is {status} in a move")
            idle = idle + 1 if status == "idle" else 0
            if idle and (off := np.abs(self._place() - pose[:3]).max()) < _THERE:
                return
            if idle > RESTS:
                said = " ".join(self._server.text("/rr_reply").split())
                raise DeviceError(
                    f"the machine is at rest {off:.3f} mm from where it was to go; it says:"
                    f" {said[:200] or 'nothing'}"
                )
            if monotonic() > end:
                raise DeviceError(f"the machine is not there after {_MOVE:g} s")
            sleep(_PAUSE)

    def where(self) -> Where:
        """Place of the axes; the board reports no motors that the robot file could count."""
        return Where(np.array([*self._place(), 0.0, 0.0, 0.0]))

    def stop(self) -> None:
        """M112: the board has to be started again (M999) and the machine homed."""
        self._ask("/rr_gcode", wait=3.0, gcode="M112")

    def close(self) -> None:
        """End the session."""
        self._server.text("/rr_disconnect", wait=3.0)

    def _ask(self, path: str, **asked: Any) -> dict[str, Any]:
        """Ask in a session; in a new one where the board has ended it, as while a person reads."""
        try:
            return self._server.ask(path, **asked)
        except RefusedError as error:
            if error.code != 401:
                raise
        self._connect()
        return self._server.ask(path, **asked)

    def _gcode(self, line: str) -> None:
        self._ask("/rr_gcode", gcode=line)

    def _status(self) -> str:
        return str(self._model("state").get("status"))

    def _place(self) -> FloatArray:
        move = self._model("move")
        with understood("RepRapFirmware, move.axes"):
            place = np.array([float(axis["machinePosition"]) for axis in move["axes"][:3]])
        if len(place) != 3 or not np.isfinite(place).all():
            raise DeviceError(f"RepRapFirmware says it is at {place}")
        return place

    def _model(self, key: str) -> dict[str, Any]:
        found = self._ask("/rr_model", key=key, flags="vn").get("result")
        if not isinstance(found, dict):
            raise DeviceError(f"RepRapFirmware: its object model has no {key}")
        return found
