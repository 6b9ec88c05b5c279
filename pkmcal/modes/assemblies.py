"""`Assemblies`: every assembly mode at given actuator coordinates, and what is proven of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal.arguments import whole
from pkmcal.arrays import TIED_CLOSELY, BoolArray, FloatArray, Int32Array, as_rows, first_largest
from pkmcal.display import POSE_HEADER, Table, pose_cells
from pkmcal.exceptions import ArgumentError
from pkmcal.result import Result

Signs = NDArray[np.int8]


@dataclass(frozen=True, eq=False, repr=False)
class Assemblies(Result):
    """The poses a machine can have at one set of actuator coordinates, nearest to home first.

    Attributes
    ----------
    poses : ndarray (k, 6)
        x y z in mm, α β γ in rad.
    certified : ndarray of bool (k,)
        Proven to be near a solution, one each, and to be the only one near.
    error : ndarray (k,)
        How far the solution is at most, mm; entries of R count times ``robot.length``, and p is in
        the machine's own frames: the origin of a tool frame is further off by its lever. NaN where
        nothing is proven.
    unique : ndarray (k,)
        No other solution is within this distance of the pose, in the same measure; of machines of
        chains none with its passive joints as near.
    complete : bool
        True only where it is known that no mode is missing and every mode is certified.
    reason : str
        Why it is complete, or why it is not.
    sign : ndarray of int (k,)
        Sign of the closures' determinant: modes of different signs have a type-2 singularity
        between them. 0 with more closures than free coordinates.
    mirror : ndarray of int (k,)
        Which mode is this one's mirror image in the plane of the base; -1 where none is.
    paths, far, lost : int
        Complex solutions that were followed, how many of them went to infinity (entries of R
        beyond 100 000), and how many failed; 0 where the machine has no start system.
    """

    poses: FloatArray
    certified: BoolArray
    error: FloatArray
    unique: FloatArray
    complete: bool
    reason: str
    sign: Signs
    mirror: Int32Array
    paths: int
    far: int
    lost: int
    _distance: Callable[[FloatArray], FloatArray]
    _feasible: Callable[[], BoolArray]
    _continued: Callable[[FloatArray, ArrayLike | None, int], FloatArray]

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def feasible(self) -> BoolArray:
        """Mask of modes that keep the strokes and cones of the robot file (k,), when asked for."""
        return self._feasible()

    def nearest(self, pose: ArrayLike) -> int:
        """Index of the mode nearest to a pose (6,), rotations counted as their arc.

        Raises
        ------
        ValueError
            No modes, or no pose.
        """
        rows, shape = as_rows("pose", pose, 6)
        if shape != ():
            raise ArgumentError(f"pose must have shape (6,), found {(*shape, 6)}")
        if not len(self):
            raise ArgumentError("there are no modes to choose from")
        apart = self._distance(rows)
        return first_largest(-apart, TIED_CLOSELY * float(apart.max()))

    def reached_from(
        self, pose: ArrayLike, actuators: ArrayLike | None = None, steps: int = 200
    ) -> int | None:
        """The mode in which the machine arrives from a pose without crossing a type-2 singularity.

        The actuators move in a straight line from where they are at the pose, and the sign of the
        determinant is watched on the way.

        Parameters
        ----------
        pose : array_like (6,)
            Where the machine is now.
        actuators : array_like (n,), optional
            Its coordinates there; by default the inverse of the pose, which is on the robot
            file's branches.
        steps : int
            How many stops the line has.

        Returns
        -------
        int or None
            Index of the mode; None where the way is cut by a singularity, or not all of it can be
            assembled.
        """
        rows, shape = as_rows("pose", pose, 6)
        if shape != ():
            raise ArgumentError(f"pose must have shape (6,), found {(*shape, 6)}")
        end = self._continued(rows[0], actuators, whole("steps", steps, 1))
        if not np.isfinite(end).all() or not len(self):
            return None
        apart = self._distance(end[None])
        best = first_largest(-apart, TIED_CLOSELY * float(apart.max()))
        return best if apart[best] <= 1e-6 + 10.0 * np.nan_to_num(self.error[best]) else None

    def _parts(self) -> Iterator[str | Table]:
        known = "complete" if self.complete else "not known to be complete"
        certified = int(self.certified.sum())
        yield f"{len(self)} assembly modes, {certified} certified; {known}: {self.reason}"
        yield Table(
            [*POSE_HEADER, "det", "mirror", "error [mm]"],
            [
                [
                    *pose_cells(pose),
                    "0+-"[int(self.sign[k])],
                    str(self.mirror[k]) if self.mirror[k] >= 0 else "-",
                    f"{self.error[k]:.0e}" if self.certified[k] else "none",
                ]
                for k, pose in enumerate(self.poses)
            ],
        )
