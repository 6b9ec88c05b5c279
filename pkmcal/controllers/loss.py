"""The distance of a controller's model from a robot, and its nearest numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, rms
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import sample_poses

COMPARED = 200  # poses at which a machine and what a controller holds of it are compared
EXACT = 1e-6  # mm: firmware numbers have six decimals


@dataclass(frozen=True)
class Loss:
    """The error of a firmware's model at equal actuators, over a workspace.

    Attributes
    ----------
    rms, worst : float
        Mm, at the poses that the model has; infinite where it has none of them.
    over : str
        Over which workspace.
    lacking : float
        Share of the poses that the model, or the machine under its load, does not have.
    """

    rms: float
    worst: float
    over: str
    lacking: float = 0.0

    @classmethod
    def of(cls, off: FloatArray, over: str) -> Loss:
        """The loss by how far poses are off (N, 3), mm; NaN where there is none."""
        size = np.linalg.norm(off, axis=1)
        known = np.isfinite(size)
        if not known.any():
            return cls(np.inf, np.inf, over, 1.0)
        return cls(rms(size[known]), float(size[known].max()), over, float(1.0 - known.mean()))

    @property
    def exact(self) -> bool:
        """True if the firmware holds the robot."""
        return self.worst <= EXACT and not self.lacking

    def __str__(self) -> str:
        if self.lacking == 1.0:
            return f"without any pose {self.over}"
        size = f"off by {self.rms:.2g} mm rms, {self.worst:.2g} mm at most, {self.over}"
        if not self.lacking:
            return size
        share = max(100.0 * self.lacking, 1.0)
        return f"{size}, and without a pose at {share:.0f} % of the places there"


def cylinder(across: float, high: float, count: int) -> FloatArray:
    """Poses (count, 6) within a radius of the vertical through the origin and a height above it."""
    rng = np.random.default_rng(0)
    r, angle = across * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    poses = np.zeros((count, 6))
    poses[:, 0], poses[:, 1] = r * np.cos(angle), r * np.sin(angle)
    poses[:, 2] = high * rng.random(count)
    return poses


def off_by(model: Robot, q: FloatArray, poses: FloatArray) -> FloatArray:
    """Return how far (N, 3) a model of a machine that only translates is from poses (N, 6)."""
    found: FloatArray = model.forward(q, guess=poses).pose[:, :3] - poses[:, :3]
    return found


def loss(model: Robot, q: FloatArray, poses: FloatArray, over: str) -> Loss:
    """Return how far a model is from poses."""
    return Loss.of(off_by(model, q, poses), over)


def sag(robot: Robot) -> Loss:
    """Return how far a machine that yields is from the rigid one, where it does not give way."""
    rigid = robot.rigid
    poses, q, _ = rigid.commanded(sample_poses(rigid, COMPARED, share=0.5))
    off = robot.forward(q, guess=poses).pose[:, :3] - poses[:, :3]
    return Loss.of(off, "by what yields under the stated load, over half of its workspace")


def laws(arm: SerialArm) -> Loss:
    """Return how far an arm is from the one whose joints stand where they are commanded."""
    limits = arm.limits()
    turning = np.array([unit == "rad" for unit in arm.actuator_units])
    most = np.where(turning, np.pi, arm.length)
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], -most)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], most)
    theta = low + (high - low) * np.random.default_rng(0).random((COMPARED, arm.n_actuators))
    off = (arm.forward(theta) - arm.rigid.forward(theta))[:, :3, 3]
    return Loss.of(off, "by what its joints add to their commands")


def require_plain(arm: SerialArm, format: str) -> None:
    """Refuse an arm whose joints have laws.

    Raises
    ------
    ValueError
        It says by how much the arm would be off.
    """
    if arm.laws is not None and arm is not arm.rigid:
        raise ArgumentError(
            f"robot: {arm.name}: {format} does not hold what joints add to their commands;"
            f" arm.rigid, without it, is {laws(arm)}"
        )


def fitted(
    model: Callable[[FloatArray], Robot],
    built: FloatArray,
    q: FloatArray,
    poses: FloatArray,
    over: str,
) -> tuple[FloatArray, Loss]:
    """Numbers of a controller's model: as built where these are exact, else the nearest.

    Parameters
    ----------
    model : callable
        The robot with such numbers.
    built : ndarray (n,)
        Numbers of the robot as if the controller could hold it.
    q, poses : ndarray (N, n), (N, 6)
        Of the robot, over its workspace.
    over : str
        What to call the workspace.
    """
    lost = loss(model(built), q, poses, over)
    if lost.exact:
        return built, lost
    found: FloatArray = least_squares(
        lambda x: off_by(model(x), q, poses).ravel(), built, x_scale="jac", xtol=1e-12
    ).x
    return found, loss(model(found), q, poses, over)


def require_held(robot: Robot, lost: Loss, project: bool, lacks: str) -> None:
    """Refuse a robot that the controller cannot hold, unless its numbers are to be projected.

    Raises
    ------
    ValueError
        `lacks` says what the controller cannot hold.
    """
    if not (lost.exact or project):
        raise ArgumentError(
            f"robot: {robot.name}: {lacks}; its numbers can be projected onto that, {lost}"
        )
