"""Printers with Klipper or Kalico, by the HTTP interface of Moonraker.

Its pages: moonraker.readthedocs.io, External API: printer/gcode/script, printer/objects/query,
server/gcode_store, printer/emergency_stop.
"""

from __future__ import annotations

import re
from time import sleep
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.live.device import DeviceError, Where, require_translations, understood
from pkmcal.live.http import Server

_STRAIGHT = 0.01  # mm by which a commanded place may differ from that of the toolhead at rest
_MOVE = 600.0  # s that a move may take
_SAID = 100  # answers that are looked through for that of GET_POSITION
_ASKED, _TRIED, _PAUSE = 5, 20, 0.05  # how often it is asked and looked for, and s between
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_STEPPERS = re.compile(r"^(?:// )?stepper: (.*)$", re.MULTILINE)
_TOOLHEAD = re.compile(rf"^(?:// )?toolhead: X:{_NUMBER} Y:{_NUMBER} Z:{_NUMBER}", re.MULTILINE)


class Moonraker:
    """A printer behind Moonraker; `robot` is the one imported from the configuration it runs.

    Klipper says how high each carriage is (or how a crank is turned); by gain and offset of the
    robot file that is what its actuators read.
    """

    ADDRESS = "http://HOST:7125"

    def __init__(self, address: str, robot: Robot) -> None:
        require_translations(robot, "moonraker")
        self._server, self._robot = Server(address, "Moonraker"), robot

    def require_ready(self) -> None:
        """Raise a `DeviceError` unless Klipper is ready, homed, straight, and prints nothing."""
        info = self._result("/printer/info")
        if info.get("state") != "ready":
            said = " ".join(str(info.get("state_message", "")).split())
            raise DeviceError(f"the printer is {info.get('state')}: {said}")
        status = self._status(toolhead="homed_axes", print_stats="state")
        with understood("Moonraker, toolhead and print_stats"):
            homed = str(status["toolhead"]["homed_axes"])
            prints = status.get("print_stats", {}).get("state") in ("printing", "paused")
        if not set(homed) >= set("xyz"):
            raise DeviceError(
                "the printer is not homed: home it (G28), and see that nothing is in its way"
            )
        if prints:
            raise DeviceError("the printer prints: wait until it has ended")
        self._require_straight()

    def _require_straight(self) -> None:
        """Refuse whatever would make a move end elsewhere, or be faster, than it is told.

        Raises
        ------
        DeviceError
            An offset (SET_GCODE_OFFSET, G92), a mesh, or a speed factor (M220).
        """
        status = self._status(toolhead="position", gcode_move="", bed_mesh="profile_name")
        with understood("Moonraker, toolhead and gcode_move"):
            told = status["gcode_move"]
            there = np.array(status["toolhead"]["position"][:3], dtype=np.float64)
            commanded = np.array(told["gcode_position"][:3], dtype=np.float64)
            off = np.abs(commanded - there).reshape(3).max()
            speed = float(told["speed_factor"])
            mesh = str((status.get("bed_mesh") or {}).get("profile_name") or "")
        if not off < _STRAIGHT:
            raise DeviceError(
                f"an offset or a mesh bends its moves by {off:.3f} mm: clear it"
                " (SET_GCODE_OFFSET X=0 Y=0 Z=0, BED_MESH_CLEAR; after G92, G28)"
            )
        if mesh:
            raise DeviceError(f"the mesh {mesh!r} bends its moves: clear it (BED_MESH_CLEAR)")
        if not abs(speed - 1.0) < 1e-6:
            raise DeviceError(f"the printer moves {speed:g} times as fast as told: M220 S100")

    def go(self, pose: FloatArray, feed: float) -> None:
        """Drive straight to a place, in absolute coordinates, and wait until it is there."""
        self._require_straight()  # somebody else may have set one meanwhile
        x, y, z = pose[:3]
        self._run(
            "SAVE_GCODE_STATE NAME=pkmcal\nG90\n"
            f"G1 X{x:.5f} Y{y:.5f} Z{z:.5f} F{feed:.1f}\n"
            "RESTORE_GCODE_STATE NAME=pkmcal\nM400"
        )

    def where(self) -> Where:
        """Places of toolhead and steppers: offsets and meshes have been added to the command."""
        said = self._position()
        toolhead, steppers = _TOOLHEAD.search(said), _STEPPERS.search(said)
        heights = dict(re.findall(rf"(\w+):{_NUMBER}", steppers[1])) if steppers else {}
        names = [f"stepper_{tower}" for tower in "abc"]
        if toolhead is None or not heights.keys() >= {*names}:
            raise DeviceError(f"GET_POSITION says no toolhead, or no {', '.join(names)}: {said!r}")
        numbers = self._robot.geometry
        offset = np.array([numbers[f"offset{i}"] for i in (1, 2, 3)])
        gain = np.array([numbers[f"gain{i}"] for i in (1, 2, 3)])
        drives = np.array([float(heights[name]) for name in names])
        if self._robot.model.limbs[0].kind == "RUS":  # Klipper counts angles of cranks upwards
            drives = -drives
        pose = np.array([*map(float, toolhead.groups()), 0.0, 0.0, 0.0])
        return Where(pose, (drives - offset) / gain)

    def stop(self) -> None:
        """Klipper's emergency stop: it has to be restarted (FIRMWARE_RESTART) and homed."""
        self._server.ask("/printer/emergency_stop", "POST", wait=3.0)

    def close(self) -> None:
        """Do nothing: no connection is held."""

    def _run(self, script: str) -> None:
        self._server.ask("/printer/gcode/script", "POST", wait=_MOVE, script=script)

    def _position(self) -> str:
        """Newest answer of GET_POSITION that was not there before."""
        last = max((time for time, _ in self._answers()), default=-1.0)
        for turn in range(_ASKED * _TRIED):
            if turn % _TRIED == 0:  # just restarted, Moonraker may not have heard the first
                self._run("GET_POSITION")
            new = [said for time, said in self._answers() if time > last and "stepper:" in said]
            if new:
                return new[-1]
            sleep(_PAUSE)
        raise DeviceError("the printer did not answer GET_POSITION")

    def _answers(self) -> list[tuple[float, str]]:
        stored = self._result("/server/gcode_store", count=_SAID)
        with understood("Moonraker, gcode_store"):
            return [(float(each["time"]), str(each["message"])) for each in stored["gcode_store"]]

    def _status(self, **query: str) -> dict[str, Any]:
        found = self._result("/printer/objects/query", **query).get("status")
        if not isinstance(found, dict):
            raise DeviceError("Moonraker: /printer/objects/query has no status")
        return found

    def _result(self, path: str, **query: Any) -> dict[str, Any]:
        found = self._server.ask(path, **query).get("result")
        if not isinstance(found, dict):
            raise DeviceError(f"Moonraker: {path} has no result")
        return found
