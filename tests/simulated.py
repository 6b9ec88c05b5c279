"""Machines with errors and poses to measure them at, for the tests of calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.check import Said
from pkmcal.diagnostics.checks import CHECKS
from pkmcal.diagnostics.diagnosis import statements
from pkmcal.kinematics.robot import Robot


def with_errors(robot: Robot, sigma: float, rng: np.random.Generator) -> Robot:
    """The robot with Gaussian errors on its default free numbers, in mm; of angles the arc."""
    geometry = robot.geometry
    units = dict(zip(geometry.names, geometry.units, strict=True))
    per_mm = {"mm": 1.0, "rad": 1.0 / robot.length}
    names = geometry.match(robot.model.free)
    errors = rng.normal(0.0, sigma, len(names))
    return robot.replace(
        {
            name: geometry[name] + error * per_mm[units[name]]
            for name, error in zip(names, errors, strict=True)
        }
    )


def tilted_poses(robot: Robot, count: int, rng: np.random.Generator) -> FloatArray:
    """Poses of the 2TPR&2TPS with x = z tan(beta), every leg within its stroke."""
    found: list[list[float]] = []
    strokes = np.array([limb.stroke for limb in robot.model.limbs])
    while len(found) < count:
        z, y = rng.uniform(320, 480), rng.uniform(-80, 80)
        alpha, beta = rng.uniform(-0.4, 0.4, 2)
        pose = [z * np.tan(beta), y, z, alpha, beta, 0.0]
        q = robot.inverse(pose)
        if ((strokes[:, 0] < q) & (q < strokes[:, 1])).all():
            found.append(pose)
    return np.array(found)


def hexapod_poses(robot: Robot, count: int, rng: np.random.Generator) -> FloatArray:
    """Poses all around home, in every coordinate."""
    spread = np.array([150, 150, 100, 0.3, 0.3, 0.3])
    return robot.home + [0, 0, 50, 0, 0, 0] + rng.uniform(-1, 1, (count, 6)) * spread


def missed(robot: Robot, true: Robot, actuators: FloatArray) -> FloatArray:
    """How far (mm) the robot's idea of where it goes is from where the true one goes."""
    off = robot.forward(actuators).pose - true.forward(actuators).pose
    return np.linalg.norm(off[:, :3], axis=1)


def altered(found: Identification, **changes: Any) -> Identification:
    """The result with other numbers under the flat names that users read."""
    return replace(found, **changes)


def said_by(found: Identification, *names: str) -> dict[str, Said]:
    """What these checks say, beside each other alone: no others are made."""
    checks = [check for check in CHECKS if check.name in names]
    assert len(checks) == len(names)
    return {each.check: each for each in statements(found, checks, {})}
