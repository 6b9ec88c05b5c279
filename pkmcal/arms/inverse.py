"""Inverse kinematics of serial arms by damped least squares."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import word
from pkmcal.arms.inputs import Frame, checked_errors
from pkmcal.arrays import FloatArray, Int32Array, IntArray, Unit, as_rows, mm_per_unit, wrapped
from pkmcal.core.library import STATUS
from pkmcal.display import Table, displayed, fixed, long_table
from pkmcal.exceptions import ArgumentError
from pkmcal.result import RowResult

Part = Literal["pose", "position"]
PARTS: dict[str, slice] = {"pose": slice(0, 6), "position": slice(3, 6)}
_STEPS = 100
_REACHED = 1e-9  # mm; what counts as there
_LARGEST = 1e12  # damping at which a row is given up
_OK, _NOT_CONVERGED, _INVALID = 0, 1, 4


class Solvable(Protocol):
    """The interface that the search asks of an arm; `SerialChain` describes each member."""

    @property
    def n_joints(self) -> int:
        """Number of joints, n."""

    @property
    def n_actuators(self) -> int:
        """Number of joints that have an actuator, m."""

    @property
    def length(self) -> float:
        """Characteristic length, mm."""

    @property
    def actuator_units(self) -> tuple[Unit, ...]:
        """Unit of each joint coordinate."""

    def of_rows(self, rows: IntArray) -> Solvable:
        """The arm in the state that it has in some rows of a call."""

    def require_loads_of(self, rows: int) -> None:
        """Refuse rows that are not as many as the loads at the tool."""

    def forward(self, theta: ArrayLike, joint_errors: ArrayLike | None = None) -> FloatArray:
        """Return the tool's frame, (..., 4, 4)."""

    def jacobian(
        self,
        theta: ArrayLike,
        joint_errors: ArrayLike | None = None,
        frame: Frame = "space",
    ) -> FloatArray:
        """The tool's twist by each joint coordinate, (..., 6, n)."""


@dataclass(frozen=True, eq=False, repr=False)
class ArmInverse(RowResult):
    """Inverse kinematics of a batch; every array has the batch's leading shape.

    Attributes
    ----------
    theta : ndarray (..., n)
        Joint coordinates, rad and mm; NaN where `status` is not 0. Revolute ones are within half
        a turn of the guess.
    status : ndarray of int (...)
        0 ok, 1 not converged (out of reach, or another guess is needed), 4 invalid input; `ok`
        and `failed` are masks of it, `failures` says it in words.
    iterations : ndarray of int (...)
        Steps tried.
    residual : ndarray (...)
        How far the tool stayed from the target, mm; a rotation counts as its arc at the arm's
        characteristic length. Kept where the row was not reached.
    units : tuple of str
        Unit of each joint coordinate, "rad" or "mm".
    """

    STATUS = STATUS

    theta: FloatArray
    status: Int32Array
    iterations: Int32Array
    residual: FloatArray
    units: tuple[Unit, ...]

    def _parts(self) -> Iterator[str | Table]:
        yield self._counts()
        header = [f"θ{i} [{displayed(0.0, unit)[1]}]" for i, unit in enumerate(self.units, 1)]
        rows = zip(
            self.theta.reshape(-1, len(self.units)),
            self.residual.reshape(-1),
            self.status.reshape(-1).tolist(),
            strict=True,
        )
        cells = (
            [
                *(fixed(displayed(v, u)[0], 4) for v, u in zip(theta, self.units, strict=True)),
                f"{residual:.1e}",
                self.STATUS[code],
            ]
            for theta, residual, code in rows
        )
        yield from long_table([*header, "residual [mm]", "status"], cells, self.status.size)


def damped_least_squares(
    arm: Solvable,
    target: ArrayLike,
    guess: ArrayLike | None,
    joint_errors: ArrayLike | None,
    parts: Part,
) -> ArmInverse:
    """Solve `SerialArm.inverse` row by row.

    Steps δ = Jᵀ (J Jᵀ + λ)⁻¹ e with the twist e to the target, each row with a damping λ of its
    own: a tenth after a step that helped, fivefold after one that did not.
    """
    word("parts", parts, PARTS)
    rows, shape = screw.as_motions("target", target)
    goal = rows.reshape(-1, 4, 4)
    arm.require_loads_of(len(goal))
    n = arm.n_actuators
    theta = np.zeros((len(goal), n))
    if guess is not None:
        start, guess_shape = as_rows("guess", guess, n)
        if guess_shape not in ((), shape):
            raise ArgumentError(
                f"guess must have shape ({n},) or {(*shape, n)}, found {np.shape(guess)}"
            )
        theta += start
    errors = None
    if joint_errors is not None:
        errors = checked_errors(joint_errors, arm.n_joints, shape)
    search = _Search(arm, goal, errors, PARTS[parts])
    begun = theta.copy()
    status, iterations, residual = search.run(theta)
    turning = [unit == "rad" for unit in arm.actuator_units]
    theta[:, turning] = (begun + wrapped(theta - begun))[:, turning]
    theta[status != _OK] = np.nan
    return ArmInverse(
        theta.reshape(*shape, n),
        status.reshape(shape),
        iterations.reshape(shape),
        residual.reshape(shape),
        arm.actuator_units,
    )


class _Search:
    def __init__(
        self, arm: Solvable, goal: FloatArray, errors: FloatArray | None, parts: slice
    ) -> None:
        self.arm, self.goal, self.errors, self.parts = arm, goal, errors, parts
        self.length = arm.length
        self.travel = mm_per_unit(arm.actuator_units, self.length)  # so that λ fits all

    def errors_of(self, rows: np.ndarray) -> FloatArray | None:
        """Joint errors shared by all rows, or those of these."""
        if self.errors is None or self.errors.ndim == 2:
            return self.errors
        own: FloatArray = self.errors[rows]
        return own

    def remaining(self, theta: FloatArray, rows: np.ndarray) -> FloatArray:
        """Twist to the target, in base axes: rotation as its arc, position, mm (N, k)."""
        tool = self.arm.of_rows(rows).forward(theta, self.errors_of(rows))
        turn = np.zeros_like(tool)
        turn[:, :3, :3] = self.goal[rows, :3, :3] @ tool[:, :3, :3].transpose(0, 2, 1)
        turn[:, 3, 3] = 1.0
        turn[~np.isfinite(tool).all(axis=(1, 2))] = np.nan
        off = screw.log(turn)
        off[:, :3] *= self.length
        off[:, 3:] = self.goal[rows, :3, 3] - tool[:, :3, 3]
        return off[:, self.parts]

    # a target too far for squares is not reached, and needs no warning
    @np.errstate(over="ignore", invalid="ignore")
    def run(self, theta: FloatArray) -> tuple[Int32Array, Int32Array, FloatArray]:
        """Improve `theta` in place."""
        count = len(theta)
        everyone = np.arange(count)
        off = self.remaining(theta, everyone)
        residual = np.hypot.reduce(off, axis=1)  # no squares: they overflow
        status = np.full(count, _NOT_CONVERGED, dtype=np.int32)
        status[np.isnan(residual)] = _INVALID
        iterations = np.zeros(count, dtype=np.int32)
        damping = np.full(count, 1e-3)
        goal_size = np.abs(self.goal[:, :3, 3]).max(axis=1, initial=0.0) + self.length
        enough = np.maximum(_REACHED, 1e-13 * goal_size)
        status[residual <= enough] = _OK
        for _ in range(_STEPS):
            rows = everyone[(status == _NOT_CONVERGED) & (damping < _LARGEST)]
            if not rows.size:
                break
            jacobian = self.arm.of_rows(rows).jacobian(
                theta[rows], self.errors_of(rows), frame="tip"
            )
            jacobian[:, :3] *= self.length
            J = jacobian[:, self.parts] / self.travel
            k = J.shape[1]
            square = J @ J.transpose(0, 2, 1) + damping[rows, None, None] * np.eye(k)
            step = J.transpose(0, 2, 1) @ np.linalg.solve(square, off[rows, :, None])
            trial = theta[rows] + step[:, :, 0] / self.travel
            trial_off = self.remaining(trial, rows)
            trial_residual = np.hypot.reduce(trial_off, axis=1)
            better = trial_residual < residual[rows]
            taken = rows[better]
            theta[taken], off[taken] = trial[better], trial_off[better]
            residual[taken] = trial_residual[better]
            damping[rows] *= np.where(better, 0.1, 5.0)
            damping[taken] = np.maximum(damping[taken], 1e-14)
            iterations[rows] += 1
            status[rows[residual[rows] <= enough[rows]]] = _OK
        return status, iterations, residual
