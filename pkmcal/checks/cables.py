"""Machines on cables: whether these can pull at home, and what the platform hangs on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.checks.finding import Finding
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.tensions import Tensions, tensions

_PRELOAD, _SOME = 1.0, 1e-3  # N: without a load, and with one of 1 N


def on_cables(robot: Robot) -> bool:
    """Whether every limb is a cable."""
    limbs = robot.model.limbs
    return robot.model.chains is None and all(KINDS[limb.kind].cable for limb in limbs)


def not_pulled(robot: Robot) -> Iterator[Finding]:
    """A home at which some cable would have to push, whatever acts on the platform."""
    if np.isfinite(robot.inverse(robot.home)).all() and _held_by(robot) is None:
        yield Finding(
            "tension",
            (),
            "at home not all cables can pull at once, neither by themselves nor against a force"
            " along any axis",
            "check the anchors' coordinates, on which side of them home lies, and which cable goes"
            " to which point of the platform",
        )


def said_of_cables(robot: Robot) -> str:
    """What holds the platform, and what its cables say of themselves."""
    held = _held_by(robot)
    free = ", ".join(robot.coordinates)
    by_themselves = "pull against each other" if held == "" else f"need a force along {held}"
    count, m = len(robot.model.limbs), robot.machine.m
    said = f"{count} cables for {m} coordinates ({free}); at home they {by_themselves}"
    surplus = pose_steps.surplus(robot)
    if surplus > 0:
        said += f"; {surplus} more than needed: it can calibrate itself by their readings"
    return said


def unpulled(robot: Robot, poses: FloatArray) -> BoolArray:
    """At which poses (N, 6) some cable of a machine on cables alone would have to push.

    Against what holds it at home: each other, or a force along an axis. None where nothing does.
    """
    none = np.zeros(len(poses), dtype=bool)
    held = _held_by(robot) if on_cables(robot) else None
    if held is None:
        return none
    found = tensions(robot, poses, least=_PRELOAD) if held == "" else _loaded(robot, poses, held)
    return ~found.ok


def _loaded(robot: Robot, poses: FloatArray, axis: str) -> Tensions:
    """Tensions with 1 N along an axis."""
    force: FloatArray = np.zeros(3)
    force["xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return tensions(robot, poses, force, least=_SOME)


def _held_by(robot: Robot) -> str | None:
    """The axis of a force with which all cables pull at home; "" without one, None with none."""
    if tensions(robot, robot.home, least=_PRELOAD).ok:
        return ""
    for axis in ("-z", "-y", "-x", "+z", "+y", "+x"):
        if axis[1] in robot.coordinates and _loaded(robot, robot.home, axis).ok:
            return axis
    return None
