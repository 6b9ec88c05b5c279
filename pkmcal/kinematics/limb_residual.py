"""Misfit of geometries to measured poses: an objective for a swarm, compiled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, as_rows
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.perturbed import Geometries
from pkmcal.kinematics.robot import Robot, require_parallel


class LimbResidual:
    """Root mean square of the limbs' closures at measured poses, for many geometries at once.

    A limb's closure is the distance from its anchor to its platform joint less what it should be
    (of a length limb q̃, else the rod), in mm; constraint rows count with their weights. No
    kinematics is solved: the pose is taken as measured.

    Parameters
    ----------
    robot : Robot
        The machine; what is not free keeps its value.
    poses : array_like (..., 6)
        Measured, mm and rad.
    actuators : array_like (..., n)
        What was commanded, mm or rad.
    free : sequence of str, optional
        Names or wildcards of what a particle's coordinates are; the robot's default set.

    Attributes
    ----------
    free : tuple of str
        The names, in the order of a particle's coordinates.
    nominal : ndarray (k,)
        Their values in the robot, mm and rad.

    Raises
    ------
    ValueError, TypeError
        Shapes or names that do not fit.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> poses = robot.home + 10.0 * np.eye(6)[:3]
    >>> cost = LimbResidual(robot, poses, robot.inverse(poses), free=["offset*"])
    >>> cost(cost.nominal + [[0.0] * 6, [0.1] * 6]).round(6)
    array([0. , 0.1])
    """

    def __init__(
        self,
        robot: Robot,
        poses: ArrayLike,
        actuators: ArrayLike,
        *,
        free: Sequence[str] | None = None,
    ) -> None:
        require_parallel(robot)
        rows, shape = as_rows("poses", poses, 6)
        q, q_shape = as_rows("actuators", actuators, robot.n_actuators)
        if shape != q_shape or not len(rows):
            raise ArgumentError(
                f"poses must have shape (..., 6), not empty, and actuators (..., {q.shape[1]});"
                f" found {(*shape, 6)} and {(*q_shape, q.shape[1])}"
            )
        geometry = robot.geometry
        self.free = tuple(geometry.match(robot.model.free if free is None else free, "free"))
        for name in self.free:
            geometry.require_own(name)
        places = np.array([geometry.names.index(name) for name in self.free], dtype=np.intp)
        self.nominal: FloatArray = geometry.values[places]
        self._ascending = np.argsort(places)
        self._places = places[self._ascending]
        self._robot = robot
        self._poses = np.ascontiguousarray(robot.frames.inward(rows))
        self._actuators = q

    def __call__(self, values: ArrayLike) -> FloatArray:
        """Residual of each geometry, mm.

        Parameters
        ----------
        values : array_like (..., k)
            Of the free numbers, mm and rad.

        Returns
        -------
        ndarray (...)
            NaN where a closure is.
        """
        rows, shape = as_rows("values", values, len(self.free))
        return self.of_slots(self.geometries(rows)).reshape(shape)

    def geometries(self, values: FloatArray) -> FloatArray:
        """Values (N, k) of the free numbers as geometries of the core, (N, limbs, SLOTS)."""
        errors = (values - self.nominal)[:, self._ascending]
        changed = Geometries(self._robot.geometry, self._places, len(values))
        return changed.with_errors(errors)

    def of_slots(self, slots: FloatArray) -> FloatArray:
        """Residual (N,) of geometries as `geometries` returns them, mm."""
        machine = self._robot.machine
        cost = machine.closure_cost(slots, self._poses, self._actuators)
        residual: FloatArray = np.sqrt(cost / (len(self._poses) * machine.rows))
        return residual
