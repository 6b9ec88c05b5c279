"""A serial arm behind the interface that calibration asks of a machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arms.arm import SerialArm
from pkmcal.arms.arm_geometry import arm_geometry
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, Unit, as_rows
from pkmcal.core import screws
from pkmcal.geometry.carried import Load
from pkmcal.geometry.stated_uncertainty import NOTHING, StatedUncertainty

_OK, _INVALID = 0, 4  # of a row, as in `Forward`


@dataclass(frozen=True)
class ArmModel:
    """The declarations of an arm: joint errors are free, what its joints add is held.

    An arm has no limbs, and nothing that a file says of them.
    """

    free: tuple[str, ...]
    uncertainty: StatedUncertainty = NOTHING
    limbs: tuple[()] = ()
    laws: tuple[()] = ()
    driven: Literal[False] = False
    closed_form: Literal[False] = False
    elastic: None = None
    load: None = None
    balanced_load: None = None
    controller: None = None


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
    """A serial arm as `pkmcal.kinematics.calibratable.Calibratable`.

    Parameters
    ----------
    arm : SerialArm
        The arm; its joint errors are the numbers of the geometry.
    """

    kind: Literal["arm"] = "arm"
    passive_names: tuple[str, ...] = ()

    def __init__(self, arm: SerialArm) -> None:
        self.arm = arm
        self.name, self.length = arm.name, arm.length
        self.n_actuators, self.actuator_units = arm.n_actuators, arm.actuator_units
        self.actuator_names = arm.actuator_names
        self.geometry = arm_geometry(arm.joint_errors, arm.laws)
        self.model = ArmModel(self.geometry.names[: 6 * arm.n_joints], arm.uncertainty)
        self.home = screws.pose(arm.home.reshape(1, 16))[0]

    @property
    def commands(self) -> dict[str, Unit]:
        """Name and unit of each joint coordinate."""
        return {f"q{i}": unit for i, unit in enumerate(self.actuator_units, 1)}

    def as_commands(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Return the joint coordinates: several postures have one pose."""
        return actuators

    @property
    def yields(self) -> bool:
        """True if a joint yields to the load at the tool."""
        return self.arm.laws is not None and self.arm.laws.yielding

    def replace(self, changes: FloatArray) -> ArmMachine:
        """Return the arm with other joint errors (6 n,) and numbers of joint laws, mm and rad."""
        of_joints = 6 * self.arm.n_joints
        arm = self.arm.replace(changes[:of_joints].reshape(-1, 6))
        if arm.laws is not None:
            arm = arm.with_laws(arm.laws.with_values(changes[of_joints:]))
        return ArmMachine(arm)

    def approaching(self, approach: FloatArray) -> ArmMachine:
        """Return the arm for joints that come from these coordinates (N, n)."""
        return ArmMachine(self.arm.approaching(approach))

    def tensioned(self, tension: FloatArray) -> ArmMachine:
        """Return the arm itself: no cable drives it."""
        return self

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
