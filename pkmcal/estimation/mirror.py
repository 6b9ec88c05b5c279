"""Check whether the mirror image of a machine fits as well as the machine: no derivative sees it.

With the points of the base reflected in a plane by S and those of the platform by T, both 4 x 4,
and every pose M in the place of S M T, each joint of the platform is reflected as the base is, and
all distances are what they were. Both are minima, apart from each other.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import TIED, BoolArray, FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.misfits import rounding
from pkmcal.kinematics.calibratable import as_parallel
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose, to_pose

MIRROR = "its mirror image fits as well: which of the two it is, the robot file says alone"
_FAR = 1e4  # times the cost, at mirrored poses: no image, which would have the same there
_FLAT = 1e-9  # of the machine's size: points in one plane
_DIMENSIONS = {"translation": 3, "xy": 2, "spatial": 3, "planar": 2}
_NO_TURN = ("translation", "xy")  # maps of platforms that do not turn: T turns as S does


def mirror_fits(equations: Equations, evaluation: Evaluation, noise: FloatArray) -> bool:
    """Return whether a mirror image that keeps all numbers that are not free fits as well.

    The poses are fitted there. Axes, such as those of swivels, are left as they are.
    """
    robot, parameters = as_parallel(evaluation.robot), equations.parameters
    if robot is None or not equations.machines.unknowns:
        return False
    if not robot.model.closed_form or robot.model.map not in _DIMENSIONS:
        return False
    names = parameters.names
    if any(name.startswith(("base", "over", "platform")) and "@" in name for name in names):
        return False  # points of each session: not looked at
    base, platform = _points(robot, "base", "over"), _points(robot, "platform")
    cost = _cost(equations, evaluation, noise)
    motions = from_pose(robot.frames.inward(evaluation.pose))
    for on_base, on_platform in _mirrors(robot, base, platform, names):
        theta = evaluation.theta.copy()
        for points, mirror in ((base, on_base), (platform, on_platform)):
            for name, value in _reflected(points, mirror).items():
                if name in names:
                    theta[names.index(name)] = value
        if np.abs(theta - evaluation.theta).max() <= _FLAT * robot.machine.struct.size:
            continue  # another pose of the same machine
        pose = robot.frames.outward(to_pose(on_base @ motions @ on_platform))
        image = equations
        states = evaluation.onward.at_poses(np.arange(len(pose)), pose)
        if image.squares_ahead(theta, noise, states) > _FAR * (
            cost + rounding(equations, noise) ** 2
        ):
            continue
        there = image.at(theta, noise, states)
        if there.ok and _cost(image, there, noise) <= (1.0 + TIED) * cost:
            return True
    return False


Points = dict[str, FloatArray]  # places (3,) by name, such as "base1"


def _points(robot: Robot, *kinds: str) -> Points:
    """The points of all limbs, of the base or of the platform."""
    found: Points = {}
    for name in robot.geometry.names:
        point, _, axis = name.rpartition(".")
        if axis in ("x", "y", "z") and point.rstrip("0123456789.") in kinds:
            place = found.setdefault(point, np.zeros(3))
            place["xyz".index(axis)] = robot.geometry[name]
    return found


def _reflected(points: Points, mirror: FloatArray) -> dict[str, float]:
    """The coordinates of mirrored points, by name."""
    return {
        f"{name}.{axis}": float(value)
        for name, place in points.items()
        for axis, value in zip("xyz", mirror[:3, :3] @ place + mirror[:3, 3], strict=True)
    }


def _mirrors(
    robot: Robot, base: Points, platform: Points, free: tuple[str, ...]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Mirrors (4, 4) of base and platform that keep what is not free."""
    dimensions = _DIMENSIONS[robot.model.map]
    size = _FLAT * float(robot.machine.struct.size)
    for normal in _normals(base, free, dimensions):
        on_base = _mirror(base, free, normal, size)
        if on_base is None:
            continue
        turning = robot.model.map not in _NO_TURN
        for other in _normals(platform, free, dimensions) if turning else [normal]:
            on_platform = _mirror(platform, free, other, size)
            if on_platform is not None:
                yield on_base, on_platform


def _held(points: Points, free: tuple[str, ...]) -> BoolArray:
    """Mark coordinates (k, 3) that are not free."""
    return np.array([[f"{name}.{axis}" not in free for axis in "xyz"] for name in points])


def _normals(points: Points, free: tuple[str, ...], dimensions: int) -> list[FloatArray]:
    """Return normals of planes across the axes, and of one through all held points."""
    normals = list(np.eye(3)[:dimensions])
    places, held = np.array(list(points.values())), _held(points, free)
    kept = places[held[:, :dimensions].any(axis=1), :dimensions]
    if len(kept):
        across = np.zeros(3)
        across[:dimensions] = np.linalg.svd(kept - kept.mean(axis=0))[2][-1]
        if np.abs(across).max() < 1.0 - _FLAT:  # none across an axis, which is there
            normals.append(across)
    return normals


def _mirror(
    points: Points, free: tuple[str, ...], normal: FloatArray, size: float
) -> FloatArray | None:
    """The mirror (4, 4) across a normal that keeps what is not free; None where there is none."""
    places, held = np.array(list(points.values())), _held(points, free)
    away = places @ normal
    kept = away[(held & (normal != 0.0)).any(axis=1)]
    if np.ptp(kept) > size if len(kept) else False:
        return None
    mirror = np.eye(4)
    mirror[:3, :3] -= 2.0 * np.outer(normal, normal)
    mirror[:3, 3] = 2.0 * normal * (kept if len(kept) else away).mean()
    return mirror


def _cost(equations: Equations, evaluation: Evaluation, noise: FloatArray) -> float:
    prior = equations.parameters.prior_left(evaluation.theta)
    return float((equations.residual(evaluation, noise) ** 2).sum() + prior @ prior)
