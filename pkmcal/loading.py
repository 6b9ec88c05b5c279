"""Machines by name or file: parallel ones and serial arms."""

from __future__ import annotations

from os import PathLike
from typing import Literal, overload

from pkmcal import armfile, robotfile
from pkmcal.robot import Robot
from pkmcal.serial import SerialArm
from pkmcal.toml_source import Source


@overload
def load(robot: Literal["3r"]) -> SerialArm: ...  # type: ignore[overload-overlap]


@overload
def load(robot: str | PathLike[str]) -> Robot: ...


def load(robot: str | PathLike[str]) -> Robot | SerialArm:
    """A built-in machine by name, or a robot file by path; a serial arm where it has joints.

    Parameters
    ----------
    robot : str or path
        A name of `machines`, or a path to a robot TOML.

    Raises
    ------
    ValueError
        No such machine, or a file with a mistake: the message says where.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import pkmcal as pk
    >>> pk.load("hexapod").n_actuators
    6
    """
    content, place, file = robotfile.located(robot)
    source = Source(content, place)
    if armfile.is_arm(source.data):
        return armfile.parse(source)
    return Robot(robotfile.parse(source, file))


def load_parallel(robot: str | PathLike[str]) -> Robot:
    """Load a machine as `load` does, and refuse serial arms with a ValueError."""
    machine: Robot | SerialArm = load(robot)
    if isinstance(machine, SerialArm):
        raise ValueError(f"{robot}: a serial arm, where a parallel machine is needed")
    return machine


def machines() -> tuple[str, ...]:
    """Names of the built-in machines, serial arms last."""
    return robotfile.builtin_names() + robotfile.builtin_names("arms")
