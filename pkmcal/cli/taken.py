"""The poses that a machine takes of those that are asked for, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.cli.rows import POSE_UNITS, table
from pkmcal.core.library import POSE
from pkmcal.display import first_rows
from pkmcal.kinematics.complete import ON_THE_MANIFOLD
from pkmcal.kinematics.robot import Robot


class Taken(NamedTuple):
    """Poses asked for, those that the machine takes for them, and its actuators there.

    Attributes
    ----------
    given, pose : ndarray (N, 6)
        mm and rad; where nothing is completed the same, NaN where no pose is found.
    actuators : ndarray (N, n)
        mm or rad.
    missed : ndarray (N,)
        What closures miss the poses by, mm; NaN where a limb does not reach one.
    most : float
        What closures may miss of a pose that the machine takes, mm.
    kept : str
        The coordinates that are kept.
    """

    given: FloatArray
    pose: FloatArray
    actuators: FloatArray
    missed: FloatArray
    most: float
    kept: str

    @classmethod
    def of(cls, machine: Robot, given: FloatArray, match: bool) -> Taken:
        """Poses (N, 6) completed where the closures do not allow them, or all as they are."""
        pose, q = given.copy(), machine.inverse(given)
        off = ~(machine.violation(given) <= ON_THE_MANIFOLD)
        if match and off.any():
            pose[off] = machine.complete(given[off])
            q[off] = machine.inverse(given[off], match=True)
        missed = np.where(np.isnan(pose[:, 0]), np.nan, machine.violation(pose))
        over = machine.machine.rows > machine.machine.m  # more closures than a pose can meet
        most = max(ON_THE_MANIFOLD, machine.closure_tolerance if over else 0.0)
        return cls(given, pose, q, missed, most, ", ".join(machine.moved))

    @property
    def asked(self) -> FloatArray:
        """Poses whose limits count: as given where none is taken."""
        return np.where(np.isnan(self.pose), self.given, self.pose)

    @property
    def ok(self) -> BoolArray:
        """Mask of poses that the machine takes, (N,)."""
        return np.asarray(self.missed <= self.most)

    def said(self) -> Iterator[str]:
        """Name the completed coordinates, and the poses that the machine does not take."""
        none = np.isnan(self.pose).any(axis=1)
        with np.errstate(invalid="ignore"):
            changed = (np.abs(self.pose - self.given) > ON_THE_MANIFOLD).any(axis=1)
        if changed.any():
            yield (
                f"rows {first_rows(np.flatnonzero(changed))}: the machine cannot take the pose as"
                f" given; {self.kept} are kept, the others follow:"
            )
            yield table(POSE, POSE_UNITS, self.pose)
        if none.any():
            yield (f"rows {first_rows(np.flatnonzero(none))}: no pose found that keeps {self.kept}")
        for row in np.flatnonzero(self.missed > self.most):
            yield f"row {row}: the closures miss this pose by {self.missed[row]:.3g} mm"
