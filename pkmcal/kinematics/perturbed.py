"""One robot with a geometry of its own in every row, and the poses where its ideal one is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, IntArray, as_rows, wrapped
from pkmcal.core.machine import with_errors
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.ties import Term, Tie
from pkmcal.kinematics.robot import Robot


class Ideal(NamedTuple):
    """Poses that a robot without errors takes, and the actuator coordinates that lead there.

    Attributes
    ----------
    poses : ndarray (N, 6)
        x y z in mm, α β γ in rad; NaN where there is none.
    actuators : ndarray (N, n)
        mm or rad.
    shape : tuple of int
        The batch's leading shape.
    """

    poses: FloatArray
    actuators: FloatArray
    shape: tuple[int, ...]


def ideal(robot: Robot, poses: ArrayLike) -> Ideal:
    """Command poses: what the machine's closures do not allow is completed first.

    Parameters
    ----------
    robot : Robot
        The machine without errors.
    poses : array_like (..., 6)
        x y z in mm, α β γ in rad. Of a pose that the machine cannot take, the coordinates that
        its file declares are kept (`Robot.complete`).

    Raises
    ------
    ValueError, TypeError
        A wrong shape, no pose at all, or no numbers.
    """
    given, shape = as_rows("poses", poses, 6)
    if not len(given):
        raise ArgumentError("poses must be at least one, found none")
    rows, actuators, _ = robot.commanded(given)
    return Ideal(rows, actuators, shape)


class Geometries:
    """Geometries with errors, as the core takes them, a batch after the other.

    Parameters
    ----------
    geometry : Geometry
        Without errors.
    places : ndarray of int (k,)
        Which of ``geometry.names`` have errors: limb numbers first, none of them tied.
    rows : int
        How many geometries a batch has at most.
    """

    def __init__(self, geometry: Geometry, places: IntArray, rows: int) -> None:
        self._geometry = geometry
        self._slots = np.repeat(geometry.slots.reshape(1, -1), rows, axis=0)
        own = int(np.searchsorted(places, len(geometry.numbers)))  # parameters come after
        self._own = np.ascontiguousarray(geometry.slot_index[places[:own]], dtype=np.int32)
        self._parameters = {geometry.names[place]: own + i for i, place in enumerate(places[own:])}
        self._tied = [
            (place, number.tie)
            for place, number in zip(geometry.slot_index, geometry.numbers, strict=True)
            if number.tie and not self._parameters.keys().isdisjoint(number.tie.drivers)
        ]

    def with_errors(self, errors: FloatArray) -> FloatArray:
        """Slots (N, limbs, SLOTS) for errors (N, k), mm and rad; valid until the next call.

        Tied numbers follow their parameters exactly.
        """
        geometry, slots = self._geometry, self._slots[: len(errors)]
        own = np.ascontiguousarray(errors[:, : len(self._own)])
        with_errors(own, self._own, geometry.slots, slots)
        changed = {
            name: geometry[name] + errors[:, column] for name, column in self._parameters.items()
        }
        for place, tie in self._tied:
            slots[:, place] = _tied(tie, geometry, changed)
        return slots.reshape(len(errors), *geometry.slots.shape)


def _tied(tie: Tie, geometry: Geometry, changed: Mapping[str, FloatArray]) -> FloatArray:
    def value(term: Term) -> FloatArray | float:
        if term.name is None:
            return term.factor
        return term.factor * changed.get(term.name, geometry[term.name])

    first, *angle = map(value, tie.terms)
    if tie.rule != "equal":
        first = first * (np.cos(angle[0]) if tie.rule == "cos" else np.sin(angle[0]))
    return np.asarray(first)


def forward_of(
    robot: Robot, slots: FloatArray, actuators: FloatArray, guess: FloatArray
) -> FloatArray:
    """Poses of machines that differ in geometry, at the same actuator coordinates.

    Parameters
    ----------
    robot : Robot
        What the machines have in common.
    slots : ndarray (N, limbs, SLOTS)
        Their geometries.
    actuators : ndarray (P, n)
        mm or rad.
    guess : ndarray (P, 6)
        Where to start, in the robot's frames.

    Returns
    -------
    ndarray (P, N, 6)
        NaN where a machine has no pose near the guess.
    """
    own = robot.machine.forward_machines(slots, actuators, robot.frames.inward(guess))
    return robot.frames.outward(own.reshape(-1, 6)).reshape(own.shape)


def off(poses: FloatArray, from_poses: FloatArray) -> FloatArray:
    """Pose errors (..., 6), eq. 16: angles the short way round."""
    error = poses - from_poses
    error[..., 3:] = wrapped(error[..., 3:])
    return error
