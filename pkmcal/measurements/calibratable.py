"""A serial arm as calibration sees a machine: numbers with names, and poses of its tool."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal.arguments import did_you_mean, instance, words
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.inputs import ERRORS
from pkmcal.arrays import FloatArray, Int32Array, as_rows
from pkmcal.core import screws
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot

_OK, _INVALID = 0, 4  # of a row, as in `Forward`


@dataclass(frozen=True, eq=False)
class ArmGeometry:
    """The joint errors of an arm by name: ``joint1.dx`` … ``joint6.dpsi``.

    Attributes
    ----------
    names, units : tuple of str, 6 n
    values : ndarray (6 n,)
        mm and rad.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray

    def match(self, patterns: str | Iterable[str], argument: str = "") -> list[str]:
        """Find names and wildcards, each name once, in the order of the patterns.

        Raises
        ------
        ValueError
            A pattern that matches nothing.
        """
        found: dict[str, None] = {}
        for pattern in words(argument or "patterns", patterns):
            hits = [name for name in self.names if fnmatchcase(name, pattern)]
            if not hits:
                known = did_you_mean(pattern, self.names)
                lead = f"{argument}: " if argument else ""
                raise ArgumentError(f"{lead}no joint error matches {pattern!r}{known}")
            found.update(dict.fromkeys(hits))
        return list(found)


@dataclass(frozen=True)
class ArmModel:
    """What an arm declares: all its joint errors are free, and no limb has a stroke."""

    free: tuple[str, ...]
    limbs: tuple[()] = ()


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """Poses (N, 6) of the tool, x y z α β γ, and status (N,): 0 ok, 4 invalid input."""

    pose: FloatArray
    status: Int32Array

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which rows have a pose."""
        return np.equal(self.status, _OK)


class ArmMachine:
    """An arm behind the face of a parallel machine.

    Parameters
    ----------
    arm : SerialArm
        The arm; its joint errors are the numbers of the geometry.
    """

    def __init__(self, arm: SerialArm) -> None:
        self.arm = arm
        self.name, self.length = arm.name, arm.length
        self.n_actuators, self.actuator_units = arm.n_joints, arm.actuator_units
        joints = range(1, arm.n_joints + 1)
        names = tuple(f"joint{i}.{error}" for i in joints for error in ERRORS)
        units = ("mm", "mm", "mm", "rad", "rad", "rad") * arm.n_joints
        self.geometry = ArmGeometry(names, units, arm.joint_errors.reshape(-1))
        self.model = ArmModel(names)
        self.home = screws.pose(arm.home.reshape(1, 16))[0]

    def replace(self, values: ArrayLike) -> ArmMachine:
        """With other joint errors (6 n,), mm and rad."""
        return ArmMachine(self.arm.replace(np.reshape(values, (-1, 6))))

    _with_values = replace

    def forward(self, q: ArrayLike, guess: ArrayLike | None = None) -> ArmPoses:
        """Poses at joint coordinates (N, n); an arm needs no guess."""
        motions = self.arm.forward(q).reshape(-1, 16)
        known = np.isfinite(motions[:, 0])
        status = np.where(known, _OK, _INVALID).astype(np.int32)
        return ArmPoses(screws.pose(motions), status)

    def error_twists(self, pose: ArrayLike, q: ArrayLike) -> FloatArray:
        """Turning of the tool, then velocity of its origin, by each error: (N, 6, 6 n).

        In base axes, at joint coordinates `q` (N, n); an arm needs no pose.
        """
        return self.arm.error_jacobian(q, frame="tip")

    def commanded(self, places: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        """Pose, coordinates and batch shape of joint coordinates (..., n)."""
        q, shape = as_rows("poses", places, self.n_actuators)
        return self.forward(q).pose, q, shape


def as_machine(robot: Robot | SerialArm) -> Robot:
    """The robot itself, or an arm behind the face of one."""
    if isinstance(robot, SerialArm):
        return cast(Robot, ArmMachine(robot))
    if isinstance(cast(Any, robot), ArmMachine):
        return robot
    return instance("robot", robot, Robot, " or SerialArm")


def as_given(robot: Robot) -> Robot:
    """The reverse of `as_machine`: what the user gave, an arm as an arm."""
    machine: Any = robot
    return cast(Robot, machine.arm) if isinstance(machine, ArmMachine) else robot
