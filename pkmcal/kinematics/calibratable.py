"""The interface that calibration asks of a machine, and its adapter for serial arms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.arm_geometry import arm_geometry
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, as_rows
from pkmcal.core import screws
from pkmcal.geometry.carried import Load
from pkmcal.geometry.stated_uncertainty import NOTHING, StatedUncertainty
from pkmcal.kinematics.robot import Robot

_OK, _INVALID = 0, 4  # of a row, as in `Forward`


class Solved(Protocol):
    """Poses at actuator coordinates, row by row; `Forward` describes each."""

    @property
    def pose(self) -> FloatArray:
        """Poses (N, 6), NaN where there is none."""

    @property
    def ok(self) -> BoolArray:
        """Mask of rows that have a pose, (N,)."""


class SolvedRows(Solved, Protocol):
    """Solved rows with the reason where a row failed."""

    @property
    def status(self) -> Int32Array:
        """0 where a row has a pose, else why not, (N,)."""


class Solvable(Protocol):
    """A machine whose poses can be computed: what a virtual one needs."""

    def forward(self, q: FloatArray) -> Solved:
        """Poses at actuator coordinates (N, n)."""


class NamedNumbers(Protocol):
    """The numbers of a geometry; `Geometry` describes each."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the p numbers."""

    @property
    def units(self) -> Sequence[str]:
        """Units of the numbers: "mm", "rad" or "1"."""

    @property
    def values(self) -> FloatArray:
        """Values of the numbers (p,)."""

    def match(self, patterns: str | Iterable[str], argument: str = "") -> list[str]:
        """Names that names and wildcards choose."""


class FreeByDefault(Protocol):
    """The declarations of a robot file."""

    @property
    def free(self) -> tuple[str, ...]:
        """Numbers that a calibration frees unless it is given others."""

    @property
    def uncertainty(self) -> StatedUncertainty:
        """Stated uncertainty of numbers that a calibration does not look for."""


class Calibratable(Protocol):
    """A machine that can be calibrated: `Robot`, and a `SerialArm` through `ArmMachine`."""

    @property
    def name(self) -> str:
        """Name of the machine."""

    @property
    def length(self) -> float:
        """Characteristic length of the machine, mm: an angle counts as its arc there."""

    @property
    def n_actuators(self) -> int:
        """Number of actuators, n."""

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each, "mm" or "rad"."""

    @property
    def home(self) -> FloatArray:
        """The pose (6,) from which the forward kinematics start."""

    @property
    def geometry(self) -> NamedNumbers:
        """The p numbers that may be free."""

    @property
    def model(self) -> FreeByDefault:
        """The declarations of its file."""

    @property
    def yields(self) -> bool:
        """True if a number of the machine follows its load."""

    def replace(self, changes: FloatArray) -> Calibratable:
        """A machine with other numbers (p,), checked as those of a file are."""

    def with_values(self, values: FloatArray) -> Calibratable:
        """Return the machine for a step of a search: quickly, for numbers near the present ones."""

    def forward(self, q: FloatArray, guess: FloatArray | None = None) -> SolvedRows:
        """Poses at actuator coordinates (N, n)."""

    def error_twists(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Derivative (N, 6, p) of the platform's twist to each number."""

    def actuator_twists(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Derivative (N, 6, n) of the platform's twist to each actuator coordinate."""

    def commanded(self, places: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        """Poses (N, 6), actuator coordinates (N, n) and batch shape of what a user commands."""


@dataclass(frozen=True)
class ArmModel:
    """The declarations of an arm: joint errors are free, what its joints add is held."""

    free: tuple[str, ...]
    uncertainty: StatedUncertainty = NOTHING


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """Poses (N, 6) of the tool, x y z α β γ, and status (N,): 0 ok, 4 invalid input."""

    pose: FloatArray
    status: Int32Array

    @property
    def ok(self) -> BoolArray:
        """Mask of rows that have a pose."""
        return np.equal(self.status, _OK)


class ArmMachine:
    """A serial arm as `Calibratable`.

    Parameters
    ----------
    arm : SerialArm
        The arm; its joint errors are the numbers of the geometry.
    """

    def __init__(self, arm: SerialArm) -> None:
        self.arm = arm
        self.name, self.length = arm.name, arm.length
        self.n_actuators, self.actuator_units = arm.n_joints, arm.actuator_units
        self.joint_names = arm.joint_names
        self.geometry = arm_geometry(arm.joint_errors, arm.laws)
        self.model = ArmModel(self.geometry.names[: 6 * arm.n_joints], arm.uncertainty)
        self.home = screws.pose(arm.home.reshape(1, 16))[0]

    @property
    def yields(self) -> bool:
        """True if a joint yields to the load at the tool."""
        return self.arm.laws is not None and self.arm.laws.yielding

    def replace(self, changes: FloatArray) -> ArmMachine:
        """Return the arm with other joint errors (6 n,) and numbers of joint laws, mm and rad."""
        of_joints = 6 * self.n_actuators
        arm = self.arm.replace(changes[:of_joints].reshape(-1, 6))
        if arm.laws is not None:
            arm = arm.with_laws(arm.laws.with_values(changes[of_joints:]))
        return ArmMachine(arm)

    def approaching(self, approach: FloatArray) -> ArmMachine:
        """Return the arm for joints that come from these coordinates (N, n)."""
        return ArmMachine(self.arm.approaching(approach))

    def under(self, load: Load) -> ArmMachine:
        """Return the arm under a load at the tool, one for all rows or one each."""
        return ArmMachine(self.arm.under(load))

    def with_values(self, values: FloatArray) -> ArmMachine:
        """Return `replace` of these values, which is quick here."""
        return self.replace(values)

    def forward(self, q: ArrayLike, guess: ArrayLike | None = None) -> ArmPoses:
        """Poses at joint coordinates (N, n); an arm needs no guess."""
        motions = self.arm.forward(q).reshape(-1, 16)
        known = np.isfinite(motions[:, 0])
        status = np.where(known, _OK, _INVALID).astype(np.int32)
        return ArmPoses(screws.pose(motions), status)

    def error_twists(self, pose: ArrayLike, actuators: ArrayLike) -> FloatArray:
        """Turning of the tool, then velocity of its origin, by each number: (N, 6, p).

        In base axes, at joint coordinates `actuators` (N, n); an arm needs no pose.
        """
        by_errors = self.arm.error_jacobian(actuators, frame="tip")
        if self.arm.laws is None:
            return by_errors
        return np.concatenate([by_errors, self.arm.law_jacobian(actuators, "tip")], axis=-1)

    def actuator_twists(self, pose: ArrayLike, actuators: ArrayLike) -> FloatArray:
        """Return the tool's twists by each joint coordinate, (N, 6, n)."""
        return self.arm.jacobian(actuators, frame="tip")

    def commanded(self, places: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        """Pose, coordinates and batch shape of joint coordinates (..., n)."""
        q, shape = as_rows("poses", places, self.n_actuators)
        return self.forward(q).pose, q, shape


def as_machine(robot: Robot | SerialArm | ArmMachine) -> Calibratable:
    """The robot itself, or an arm through its adapter."""
    if isinstance(robot, SerialArm):
        return ArmMachine(robot)
    if isinstance(robot, ArmMachine):
        return robot
    return instance("robot", robot, Robot, " or SerialArm")


def as_given(machine: Calibratable) -> Robot | SerialArm:
    """The reverse of `as_machine`: what the user gave, an arm as an arm."""
    return machine.arm if isinstance(machine, ArmMachine) else instance("robot", machine, Robot)
