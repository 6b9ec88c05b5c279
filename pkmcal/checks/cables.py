"""Machines on cables: whether these can pull at home, and what the platform hangs on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.checks.finding import Finding
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.pulled import PRELOAD, load_of, pulled
from pkmcal.kinematics.robot import Robot


def not_pulled(robot: Robot) -> Iterator[Finding]:
    """A home at which some cable would have to push: under the stated load, or whatever acts."""
    if not np.isfinite(robot.inverse(robot.home)).all():
        return
    load = load_of(robot)
    if load is not None and _at_home(robot):
        return
    what = "neither by themselves nor against a force along any axis"
    if load is not None:
        what = "under the load of the file some would have to push"
        if np.isfinite(load.most):
            what += f", or to pull more than {load.most:g} N"
    yield Finding(
        "tension",
        (),
        f"at home not all cables can pull at once: {what}",
        "check the anchors' coordinates, on which side of them home lies, and which cable goes"
        " to which point of the platform" + (", and [load]" if load is not None else ""),
    )


def said_of_cables(robot: Robot) -> str:
    """Describe what holds the platform, and what its cables show."""
    free = ", ".join(robot.coordinates)
    count, m = len(robot.model.limbs), robot.machine.m
    said = f"{count} cables for {m} coordinates ({free}){_held(robot)}"
    surplus = pose_steps.surplus(robot)
    if surplus > 0:
        said += f"; {surplus} more than needed: it can calibrate itself by their readings"
    return said


def _held(robot: Robot) -> str:
    """Describe how cables hold the platform at home, as a part of a sentence; "" without cables."""
    load = load_of(robot)
    if load is None or not _at_home(robot):
        return ""
    if load == robot.model.load:
        return "; at home they hold the load of the file"
    if load == PRELOAD:
        return "; at home they pull against each other"
    (axis,) = (name for name, force in zip("xyz", load.force, strict=True) if force)
    return f"; at home they need a force along {'-' if sum(load.force) < 0 else '+'}{axis}"


def _at_home(robot: Robot) -> bool:
    return bool(pulled(robot, robot.home[None])[0])
