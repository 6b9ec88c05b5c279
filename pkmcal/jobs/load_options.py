"""Options of what a machine that yields carries, and of what yields."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TypeVar

from pkmcal.arms.arm import SerialArm
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.geometry.carried import Load
from pkmcal.geometry.elastic import require_compliance
from pkmcal.geometry.yielding import elastic_numbers
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.kinematics.robot import Robot

Machine = TypeVar("Machine", Robot, SerialArm)
_MASSES = {"": 1.0, "kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}  # kg
_MASS = re.compile(r"(.*?)\s*([a-z]*)")
_TOOL = re.compile(r"[Tt]?(\d+)\s*=([^,]*)(?:,(.*))?", re.ASCII)


def carrying(
    robot: Machine, payload: str | None, payload_at: str | None, tool_force: str | None
) -> Machine:
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
    if isinstance(robot, Robot):
        return robot.carrying(load)
    if robot.laws is None or not robot.laws.yielding:
        raise ArgumentError(
            f"robot: {robot.name} is an arm of which nothing yields to a payload: its file states"
            " no stiffness of a joint"
        )
    return robot.under(load)


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
    by: dict[str, str] = {}  # the pattern that a number was named with
    for text in compliances or ():
        for part in text.split(","):
            pattern, equals, value = (each.strip() for each in part.partition("="))
            try:
                given = typed(value)
            except ValueError:
                equals = ""
            if not equals:
                raise ArgumentError(f"--compliance must be NAME=C, found {part!r}")
            for name in elastic_numbers(robot.model, pattern):
                if name in by:
                    twice = pattern if pattern == by[name] else f"{by[name]} and {pattern}"
                    raise ArgumentError(f"--compliance states {name} twice, by {twice}")
                by[name] = pattern
            _require_compliance(pattern, given)
            found[pattern] = given
    return robot.yielding(found) if found else robot


def _require_compliance(pattern: str, value: float) -> None:
    """Refuse what is no compliance of a machine: none at all, or a stiffness."""
    if value == 0.0:
        raise ArgumentError(
            f"--compliance {pattern} is 0: what does not yield is left out; found {value:g}"
        )
    require_compliance(f"--compliance {pattern}", value, "N/mm or N mm/rad")


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
