"""Machines by name or file: parallel ones and serial arms."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from typing import Literal, overload

from pkmcal.arms import arm_file
from pkmcal.arms.arm import SerialArm
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.reading import Input
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.kinematics.independent import independent_numbers
from pkmcal.kinematics.robot import Robot

_URDF = (".urdf", ".xml")


@overload
def load(robot: Literal["3r"]) -> SerialArm: ...  # type: ignore[overload-overlap]


@overload
def load(robot: str | PathLike[str]) -> Robot: ...


def load(robot: str | PathLike[str]) -> Robot | SerialArm:
    """A built-in machine by name, or a file by path; a serial arm where it has joints.

    Parameters
    ----------
    robot : str or path
        A name of `machines`, or a path to a robot TOML. Or to a URDF file, which is a serial arm;
        where it has several ends, ``arm.urdf#tool0`` names the tip and ``arm.urdf#base:tool0``
        base and tip.

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
    if chain := urdf_chain(robot):
        path, tip, base = chain
        return SerialArm.from_urdf(path, tip, base)
    content, place, file = robot_file.located(robot)
    source = Source(content, place)
    if arm_file.is_arm(source.data):
        arguments = arm_file.parse(source)
        try:
            return SerialArm(**arguments)
        except ArgumentError as error:  # numbers that are each right, and too large together
            raise FileError(f"{source.place}: {error}") from None
    machine = Robot(robot_file.parse(source, file))
    if machine.model.closed_form or machine.model.free:
        return machine
    return Robot(replace(machine.model, free=independent_numbers(machine)))


def urdf_chain(
    robot: str | PathLike[str],
) -> tuple[str | PathLike[str], str | None, str | None] | None:
    """The URDF file that is meant, with tip and base; None where it is no such file.

    Examples
    --------
    >>> urdf_chain("ur10e.urdf#base_link:tool0")
    ('ur10e.urdf', 'tool0', 'base_link')
    >>> urdf_chain("hexapod")
    """
    if not isinstance(robot, str | PathLike):
        return None
    text = robot.called if isinstance(robot, Input) else str(robot)
    path, _, links = text.partition("#")
    if not path.lower().endswith(_URDF):
        return None
    base, colon, tip = links.partition(":")
    if not colon:
        base, tip = "", links
    return robot if isinstance(robot, Input) else path, tip or None, base or None


def load_parallel(robot: str | PathLike[str]) -> Robot:
    """Load a machine as `load` does, and refuse serial arms with a ValueError."""
    machine: Robot | SerialArm = load(robot)
    if isinstance(machine, SerialArm):
        raise ArgumentError(f"{robot}: a serial arm, where a parallel machine is needed")
    return machine


def machines() -> tuple[str, ...]:
    """Names of the built-in machines, serial arms last."""
    return robot_file.builtin_names() + robot_file.builtin_names("arms")
