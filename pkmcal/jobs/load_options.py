"""Options of what a machine that yields carries, and of what yields."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.geometry.carried import Load
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.kinematics.robot import Robot

_MASSES = {"": 1.0, "kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}  # kg
_MASS = re.compile(r"(.*?)\s*([a-z]*)")
_TOOL = re.compile(r"[Tt]?(\d+)\s*=([^,]*)(?:,(.*))?", re.ASCII)


def carrying(
    robot: Robot, payload: str | None, payload_at: str | None, tool_force: str | None
) -> Robot:
    """The robot with the payload of the options; itself without any."""
    if payload is None and payload_at is None and tool_force is None:
        return robot
    if payload_at is not None and payload is None:
        raise ArgumentError("--payload-at is the centre of a payload: --payload is missing")
    load = Load(
        0.0 if payload is None else mass("--payload", payload),
        three("--payload-at", payload_at),
        three("--tool-force", tool_force),
    )
    return robot.carrying(load)


def loads_by_tool(texts: list[str] | None) -> dict[int, Load]:
    """Return the load that the machine carries with each tool."""
    found: dict[int, Load] = {}
    for text in texts or ():
        match = _TOOL.fullmatch(text.strip())
        if match is None:
            raise ArgumentError(f"--load must be T1=MASS or T1=MASS,X,Y,Z, found {text!r}")
        tool = int(match[1])
        if tool in found:
            raise ArgumentError(f"--load states T{tool} twice")
        found[tool] = Load(mass("--load", match[2]), three("--load", match[3]))
    return found


def yielding(robot: Robot, compliances: Sequence[str] | None) -> Robot:
    """The robot with what the options say that yields."""
    found: dict[str, float] = {}
    for text in compliances or ():
        for part in text.split(","):
            name, equals, value = part.partition("=")
            try:
                found[name.strip()] = typed(value)
            except ValueError:
                equals = ""
            if not equals:
                raise ArgumentError(f"--compliance must be NAME=C, found {part!r}")
    return robot.yielding(found) if found else robot


def mass(option: str, text: str) -> float:
    """A mass in kg, of a number with or without a unit."""
    match = _MASS.fullmatch(text.strip().lower())
    try:
        assert match is not None
        return typed(match[1]) * _MASSES[match[2]]
    except (ValueError, KeyError):
        units = ", ".join(unit for unit in _MASSES if unit)
        raise ArgumentError(f"{option} must be a mass in {units}, found {text!r}") from None


def three(option: str, text: str | None) -> tuple[float, float, float]:
    """Three numbers of an option; zeros without it."""
    if text is None:
        return (0.0, 0.0, 0.0)
    row = numbers_on_line(option, text, ("mm", "mm", "mm"), rad=True)
    if row is None:
        raise ArgumentError(f"{option} must be three numbers, found {text!r}")
    x, y, z = row[0].tolist()
    return (x, y, z)
