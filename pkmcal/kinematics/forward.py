"""`Forward`: what forward kinematics found, row by row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array
from pkmcal.core.library import POSE, STATUS
from pkmcal.display import POSE_HEADER, Table, long_table, pose_cells
from pkmcal.modes.certificate import Certificate
from pkmcal.modes.find import AssemblyProblem, certify_rows
from pkmcal.result import RowResult


class Solved(Protocol):
    """The interface that a result asks of its machine; `Kinematics` describes each member."""

    def closure_by_twist(self, own: FloatArray, q: FloatArray | None = None) -> FloatArray:
        """Closure rows by a scaled twist, (N, rows, m); q by default the inverse of the poses."""

    def in_working_mode(self, own: FloatArray, q: FloatArray) -> BoolArray:
        """Return whether limbs are on the branches of the file at own poses (N, 6) and q (N, n)."""

    def assembly_problem(self, q: FloatArray) -> AssemblyProblem:
        """The closures at coordinates (N, n)."""

    def passive_joints(self, own: FloatArray, q: FloatArray) -> FloatArray:
        """Return passive joints' ways from home at own poses (N, 6), (N, passive)."""


@dataclass(eq=False, repr=False)  # a frozen one takes a microsecond more to make
class Forward(RowResult):
    """Forward kinematics of a batch; every array has the batch's leading shape.

    Attributes
    ----------
    pose : ndarray (..., 6)
        x y z in mm, α β γ in rad; NaN where `status` is not 0.
    status : ndarray of int (...)
        0 ok, 1 not converged, 2 singular, 3 infeasible, 4 invalid input, 5 does not close: of more
        closures than free coordinates one misses by more than ``robot.closure_tolerance``, 6 gives
        way: under its load the machine does not hold. `ok` and `failed` are masks of it,
        `failures` says it in words.
    iterations : ndarray of int (...)
        Newton steps taken.
    residual : ndarray (...)
        Largest closure error, mm; NaN where `status` is not 0 or 5. Of a limb of length ρ whose
        joints are d apart it is (d² - ρ²)/(2ρ): d - ρ but for (d - ρ)²/(2ρ), so that a miss of
        8 mm on 1000 mm reads 8.03.
    """

    STATUS = STATUS

    pose: FloatArray
    status: Int32Array
    iterations: Int32Array
    residual: FloatArray
    # where it comes from, for what is computed when asked for; rows in the machine's own frame
    _machine: Solved
    _own: FloatArray
    _q: FloatArray
    _guess: FloatArray

    def __post_init__(self) -> None:
        """Arrays can be written to: `Robot.forward` does so where it is given this as `out`."""

    @cached_property
    def conditioning(self) -> FloatArray:
        """σ_min/σ_max of the closures by a twist (...), computed when asked for.

        Rotations count as their arc at ``robot.length``; 0 is a type-2 singularity, 1 is isotropic.
        NaN where the row was not solved.
        """
        steps = self._closure_by_twist(self._own)
        out = np.full(steps.shape[:-2], np.nan)
        ok = np.isfinite(steps).all(axis=(-2, -1))
        sigma = np.linalg.svd(steps[ok], compute_uv=False)
        out[ok] = sigma[..., -1] / sigma[..., 0]
        return out

    @cached_property
    def same_side(self) -> BoolArray:
        """True where no singularity must lie between the guess and the pose (...).

        Computed when asked for: the determinant has the sign it has at the guess, with the
        actuators that lead there, and each limb in closed form is on the branch that its file
        states, as at the guess. False means that the pose is another assembly mode than the
        guess's, with a singularity between. True where it is unknown: with more closures than free
        coordinates, and where a limb does not reach the guess. Modes with one sign and the same
        branches are not told apart.
        """
        steps = self._closure_by_twist(self._own)
        if steps.shape[-2] != steps.shape[-1]:
            return np.asarray(self.ok)
        same = np.asarray(self.ok)
        at_guess = self._machine.closure_by_twist(np.atleast_2d(self._guess))
        with np.errstate(invalid="ignore"):  # rows that failed, guesses out of reach
            there, sign = (np.sign(np.linalg.det(each)) for each in (steps, at_guess))
        sign = sign[0] if self._guess.ndim == 1 else sign.reshape(same.shape)
        kept = self._machine.in_working_mode(self._own.reshape(-1, 6), self._q).reshape(same.shape)
        return np.asarray(same & (((there == sign) & kept) | np.isnan(sign)))

    @cached_property
    def certificate(self) -> Certificate:
        """Proof that each pose is near a solution (...), computed when asked for.

        ``.ok``, ``.error`` and ``.unique`` in mm: the solution is within `error` of the pose and is
        the only one within `unique`. Not ok with more closures than free coordinates, near a
        singularity, and where the row was not solved. It costs some 12 µs a row. Of machines of
        chains it is the only one with its passive joints that near.
        """
        problem = self._machine.assembly_problem(self._q)
        return certify_rows(problem, self._own.reshape(-1, 6)).reshape(self.status.shape)

    @cached_property
    def passive(self) -> FloatArray:
        """Return passive joints' ways from home (..., passive), computed when asked for.

        rad or mm, in the order of ``robot.passive_names``. NaN where the row was not solved.

        Raises
        ------
        ValueError
            The machine's limbs are no chains of joints.
        """
        found = self._machine.passive_joints(self._own.reshape(-1, 6), self._q)
        return found.reshape(*self.status.shape, found.shape[-1])

    def failures(self) -> str:
        """Describe in one line what failed and where; empty where nothing did."""
        said = super().failures()
        if not said or self._guess.ndim > 1 or not np.isfinite(self._guess).all():
            return said
        if not np.isfinite(self._machine.closure_by_twist(self._guess[None])).all():
            said += "; a limb does not reach the guess, by default the home pose"
        return said

    def _closure_by_twist(self, own: FloatArray) -> FloatArray:
        """Closure rows by a scaled twist (..., rows, m), at a pose for each row or one for all."""
        rows = np.ascontiguousarray(np.broadcast_to(own.reshape(-1, 6), (len(self._q), 6)))
        steps = self._machine.closure_by_twist(rows, self._q)
        return steps.reshape(*self.status.shape, *steps.shape[1:])

    def _columns(self) -> dict[str, Any]:
        """The six numbers of each pose, its status, iterations and residual."""
        columns = dict(zip(POSE, self.pose.reshape(-1, 6).T, strict=True))
        others = {name: getattr(self, name) for name in ("status", "iterations", "residual")}
        return columns | {name: np.ravel(values) for name, values in others.items()}

    def _parts(self) -> Iterator[str | Table]:
        yield self._counts()
        rows = zip(self.pose.reshape(-1, 6), self.status.reshape(-1).tolist(), strict=True)
        cells = ([*pose_cells(pose), self.STATUS[code]] for pose, code in rows)
        yield from long_table([*POSE_HEADER, "status"], cells, np.size(self.status))
