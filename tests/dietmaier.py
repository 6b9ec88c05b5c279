"""The hexapod of the examples all of whose 40 complex assembly modes are real."""

from __future__ import annotations

from pathlib import Path

import pkmcal as pk

FILE = Path(__file__).parents[1] / "examples" / "assembly-modes" / "dietmaier.toml"
LENGTHS = (100.0, 64.5275, 108.6284, 150.3439, 128.1933, 77.1071)  # mm


def hexapod() -> pk.Robot:
    robot = pk.load(FILE)
    assert isinstance(robot, pk.Robot)
    return robot
