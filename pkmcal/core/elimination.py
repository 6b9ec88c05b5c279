"""Equations of many poses, each with unknowns of its own: their steps, and what they leave.

Own code in the core, for LAPACK through NumPy takes one pose after another and forms all of Q.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal._core import lib
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.library import ISA, call


class Fit(NamedTuple):
    """Steps of K poses with u unknowns each.

    Attributes
    ----------
    step : ndarray (K, u)
        0 of poses with numbers that are not finite.
    gain : ndarray (K,)
        What it should take off the squares; NaN of those poses.
    cost : ndarray (K,)
        The sum of the squares.
    left : ndarray (M,)
        What is left of the equations, as of a column in `PoseEquations.left`.
    """

    step: FloatArray
    gain: FloatArray
    cost: FloatArray
    left: FloatArray


class PoseEquations:
    """The equations of each of K poses, each pose with u unknowns.

    Parameters
    ----------
    order : ndarray of int (E,)
        Places of the equations in arrays of all of them, pose by pose.
    count : ndarray of int (K,)
        How many each pose has.
    unknowns : int
        Of each pose.
    isa : int, optional
        Of the core.

    Attributes
    ----------
    first : ndarray of int (K + 1,)
        Where those of each pose begin in `order`, and where the last ones end.
    left_of : ndarray of int (K,)
        How many equations are left of each pose.
    place : ndarray of int (K,)
        Where these begin in what is left of all.

    Examples
    --------
    Three lengths read at each of two poses, one unknown: two equations each are left, in which it
    has no part.

    >>> import numpy as np
    >>> poses = PoseEquations(np.arange(6), np.array([3, 3]), 1)
    >>> slopes = np.array([1.0, 2, 2, 0, 3, 4])[:, None]
    >>> left, _ = poses.left(slopes, np.column_stack([slopes, np.ones(6)]))
    >>> left.shape, bool(np.allclose(left[:, 0], 0.0))
    ((4, 2), True)
    """

    def __init__(self, order: IntArray, count: IntArray, unknowns: int, isa: int = ISA) -> None:
        self.order, self.unknowns, self._isa = order.astype(np.int64, copy=False), unknowns, isa
        self.first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        self._poses, self._most = len(count), int(count.max(initial=0))
        self.left_of: IntArray = np.maximum(count - unknowns, 0)
        self.place = (np.cumsum(self.left_of) - self.left_of).astype(np.int64)
        self._left = int(self.left_of.sum())

    @classmethod
    def of(cls, pose_of: IntArray, poses: int, unknowns: int) -> PoseEquations:
        """The equations of poses, of which each is of one (E,)."""
        count = np.bincount(pose_of, minlength=poses)
        return cls(np.argsort(pose_of, kind="stable"), count, unknowns)

    @property
    def pose_of(self) -> IntArray:
        """The pose of each equation (E,)."""
        found = np.empty(len(self.order), dtype=np.intp)
        found[self.order] = np.repeat(np.arange(self._poses), np.diff(self.first))
        return found

    def _work(self) -> FloatArray:
        u = self.unknowns
        return np.empty(lib.PKM_WIDEST * (self._most + u + 1) * (u + 1))

    def normals(
        self, residual: FloatArray, by_unknown: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """JᵀJ (K, u, u), Jᵀr (K, u) and rᵀr (K,) of equations (E,) and J (E, u)."""
        n, u = self._poses, self.unknowns
        found = np.empty((n, u, u)), np.empty((n, u)), np.empty(n)
        given = (
            n,
            u,
            self.first,
            self.order,
            np.ascontiguousarray(residual),
            np.ascontiguousarray(by_unknown),
        )
        call("pose_normals", *given, *found, self._work(), isa=self._isa)
        return found

    def triangle(self, rows: FloatArray) -> FloatArray:
        """R (K, u, u) of a QR factorisation of the rows (E, u) of each pose.

        Squares and products of its columns are those of all rows. Zeros follow where a pose has
        fewer than u.
        """
        n, u = self._poses, self.unknowns
        found = np.empty((n, u, u))
        given = n, u, self.first, self.order, np.ascontiguousarray(rows)
        call("pose_triangle", *given, found, self._work(), isa=self._isa)
        return found

    def fit(
        self,
        residual: FloatArray,
        by_unknown: FloatArray,
        damping: FloatArray,
        least: float = 0.0,
        rounding: float = 0.0,
    ) -> Fit:
        """Damped steps (K,) that take the squares of equations (E,) with slopes J (E, u) down.

        One that gains less than `least` of the squares, or no more than errors `rounding` of the
        unknowns make of it, is 0, and so is its gain.
        """
        n, u = self._poses, self.unknowns
        found = Fit(np.empty((n, u)), np.empty(n), np.empty(n), np.empty(self._left))
        given = np.ascontiguousarray(residual), np.ascontiguousarray(by_unknown), damping
        order = self.first, self.order, *given, least, rounding, self.place
        call("pose_fit", n, u, *order, *found, self._work(), isa=self._isa)
        return found

    def left(self, by_unknown: FloatArray, part: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project columns (E, c) onto what the poses' unknowns do not explain, (M, c).

        And how much the unknowns go against the columns for that (K, u, c); not finite where
        equations do not determine them.
        """
        n, u, columns = self._poses, self.unknowns, part.shape[1]
        left, following = np.empty((self._left, columns)), np.empty((n, u, columns))
        equations = np.ascontiguousarray(by_unknown), columns, np.ascontiguousarray(part)
        given = (n, u, self.first, self.order, *equations, self.place)
        call("pose_left", *given, left, following, self._work(), isa=self._isa)
        return left, following

    def spread(self, by_unknown: FloatArray, left: FloatArray) -> FloatArray:
        """Columns (E, c), pose by pose, of which so much is left (M, c), and no more."""
        n, u, columns = self._poses, self.unknowns, left.shape[1]
        part = np.empty((len(self.order), columns))
        given = (
            n,
            u,
            self.first,
            self.order,
            np.ascontiguousarray(by_unknown),
            columns,
            self.place,
        )
        call("pose_spread", *given, np.ascontiguousarray(left), part, self._work(), isa=self._isa)
        return part
