"""The machine of each session at its own poses, and the closures there.

Where all numbers of the geometry are common to all sessions there is one machine, at all poses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, lots
from pkmcal.estimation.closures import Closures, ExactActuators, closures_of
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import by_parameters
from pkmcal.estimation.tensioned_poses import Cells, tensioned_poses
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.drive_state import DriveState

AnyArray = TypeVar("AnyArray", FloatArray, Int32Array, BoolArray)

_TOGETHER = 8192  # poses whose derivatives are held at once


@dataclass(frozen=True, eq=False)
class Machines:
    """The machines of a calibration.

    Attributes
    ----------
    robots : tuple of Calibratable
        One, or one for each session.
    rows : tuple of ndarray of int
        The poses that are its own, of each.
    state : DriveState
        From where the actuators came, and the tension of what they drive (K, n).
    """

    robots: tuple[Calibratable, ...]
    rows: tuple[IntArray, ...]
    state: DriveState

    @cached_property
    def driven(self) -> tuple[Calibratable, ...]:
        """The machines, each with its drives in the state of its poses."""
        if all(each is None for each in self.state):
            return self.robots
        return tuple(
            _driven(r, self.state.at(own)) for r, own in zip(self.robots, self.rows, strict=True)
        )

    def at(self, k: int) -> Calibratable:
        """The machine of pose `k`."""
        robot = next(r for r, own in zip(self.robots, self.rows, strict=True) if k in own)
        return _driven(robot, self.state.at(np.intp(k)))

    def joined(self, function: Callable[[Calibratable, IntArray], FloatArray]) -> FloatArray:
        """What a function of a machine and its poses gives, pose by pose; in lots of poses."""
        parts = []
        for robot, rows in zip(self.robots, self.rows, strict=True):
            found = [function(_driven(robot, self.state.at(own)), own) for own in _lots(rows)]
            parts.append(found[0] if len(found) == 1 else np.concatenate(found))
        return _joined(parts, self.rows)

    def actuator_twists(self, states: RowStates) -> FloatArray:
        """Derivative (K, 6, n) of the platform's twist to each actuator coordinate."""
        return self.joined(
            lambda robot, own: robot.actuator_twists(states.pose[own], states.actuators[own])
        )


class SessionClosures:
    """What the closures of each session's machine say of its poses; see `Closures`.

    Parameters
    ----------
    parts : sequence of Closures
        Of each machine.
    rows : sequence of ndarray of int
        The poses that are its own.
    shift : ndarray (K, equations), optional
        By how much whitened equations are larger: of other readings.

    Attributes
    ----------
    unknowns, equations : int
        Of each pose, the same in all sessions.
    actuators : tuple of int, equations
        Whose reading each equation is of; -1 of none.
    sigma : ndarray (K, equations) or None
        Standard deviations of the equations.
    missing : ndarray of bool (K, equations) or None
        Those of load cells that were not read.
    cells : int
        How many of the equations are of load cells: the last ones.
    """

    def __init__(
        self,
        parts: Sequence[Closures],
        rows: Sequence[IntArray],
        shift: FloatArray | None = None,
    ) -> None:
        self._parts, self._rows, self._shift = tuple(parts), tuple(rows), shift
        self.unknowns, self.equations = parts[0].unknowns, parts[0].equations
        if any((p.unknowns, p.equations) != (self.unknowns, self.equations) for p in parts):
            raise ArgumentError(
                "measurements: state actuator_sigma of the same actuators in all sessions"
            )
        self.actuators, self.cells = parts[0].actuators, parts[0].cells
        missing = [part.missing for part in parts if part.missing is not None]
        self.missing = _joined(missing, self._rows) if missing else None
        stated = [part.sigma for part in parts if part.sigma is not None]
        self.sigma = _joined(stated, self._rows) if stated else None

    def settled(self, machines: Machines, states: RowStates) -> RowStates:
        """The states of machines with other numbers, near those given."""
        return self._states([
            part.settled(robot, own) for part, robot, own in self._each(machines, states)
        ])  # fmt: skip

    def moved(self, machines: Machines, states: RowStates, step: FloatArray) -> RowStates:
        """States after steps (K, unknowns) of the unknowns."""
        steps = _apart(step, self._rows)
        return self._states([
            part.moved(robot, own, mine)
            for (part, robot, own), mine in zip(self._each(machines, states), steps, strict=True)
        ])  # fmt: skip

    def residual(self, machines: Machines, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """The equations (K, equations), whitened, and their derivative by the unknowns."""
        found = [part.residual(robot, own) for part, robot, own in self._each(machines, states)]
        off, by_unknown = zip(*found, strict=True)
        whole = _joined(off, self._rows)
        whole = whole if self._shift is None else whole + self._shift
        return whole, _joined(by_unknown, self._rows)

    def shifted(self, by: FloatArray) -> SessionClosures:
        """The closures of other readings: whitened equations (K, equations) are larger."""
        shift = by if self._shift is None else self._shift + by
        return SessionClosures(self._parts, self._rows, shift)

    def lengths(self, machines: Machines) -> FloatArray:
        """Factors (equations,) to mm of the equations times their sigma."""
        return self._parts[0].lengths(machines.robots[0])

    def twists(self, machines: Machines, states: RowStates) -> FloatArray:
        """How the platform moves with the unknowns: twists (K, 6, unknowns)."""
        found = [part.twists(robot, own) for part, robot, own in self._each(machines, states)]
        return _joined(found, self._rows)

    def by_numbers(
        self, machines: Machines, states: RowStates, places: IntArray, columns: IntArray, size: int
    ) -> FloatArray:
        """Derivative of the equations by the parameters, (K, equations, size).

        `columns` (S, g) are the parameters that numbers of the geometry are, of each machine.
        """
        found = [
            part.by_numbers(robot, own, places) for part, robot, own in self._each(machines, states)
        ]
        nowhere = [np.zeros(len(rows), dtype=np.intp) for rows in self._rows]
        wide = [
            by_parameters(part, columns[s : s + 1], rows, size)
            for s, (part, rows) in enumerate(zip(found, nowhere, strict=True))
        ]
        return _joined(wide, self._rows)

    def twists_by_numbers(
        self, machines: Machines, states: RowStates, places: IntArray, poses: IntArray
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """How the platform moves with numbers of its machine, unknowns held.

        Of distinct poses, all where they have unknowns: those of each machine, and their twists
        (b, 6, g). Nothing where it does not move.
        """
        for part, robot, rows in zip(self._parts, machines.robots, self._rows, strict=True):
            own = poses[rows.take(np.searchsorted(rows, poses), mode="clip") == poses]
            driven = _driven(robot, machines.state.at(own))
            found = part.twists_by_numbers(driven, _some(states, own), places)
            if found is not None:
                yield own, found

    def _each(
        self, machines: Machines, states: RowStates
    ) -> list[tuple[Closures, Calibratable, RowStates]]:
        own = [states] if len(self._rows) == 1 else [_some(states, rows) for rows in self._rows]
        return list(zip(self._parts, machines.driven, own, strict=True))

    def _states(self, parts: Sequence[RowStates]) -> RowStates:
        if len(parts) == 1:
            return parts[0]
        tensions = [part.tension for part in parts if part.tension is not None]
        return RowStates(
            _joined([part.pose for part in parts], self._rows),
            _joined([part.actuators for part in parts], self._rows),
            _joined([part.status for part in parts], self._rows),
            None if not tensions else _joined(tensions, self._rows),
        )


def _lots(rows: IntArray) -> list[IntArray]:
    return [rows[lot] for lot in lots(len(rows) or 1, _TOGETHER)]


def _driven(robot: Calibratable, state: DriveState) -> Calibratable:
    return state.of(robot)


def exact_closures(rows: Sequence[IntArray], read: FloatArray) -> SessionClosures:
    """Poses that follow from what the actuators read."""
    return SessionClosures([ExactActuators(each) for each in _apart(read, rows)], rows)


def closures_of_sessions(
    robot: Calibratable,
    rows: Sequence[IntArray],
    read: FloatArray,
    sigma: FloatArray | None,
    cells: Cells | None = None,
) -> SessionClosures:
    """What the closures say of poses at what the actuators read (K, n); see `closures_of`.

    `cells` are what load cells read there, where tensions are unknown.
    """
    sigmas = [None] * len(rows) if sigma is None else _apart(sigma, rows)
    pairs = zip(_apart(read, rows), sigmas, strict=True)
    if cells is None:
        return SessionClosures([closures_of(robot, *pair) for pair in pairs], rows)
    parts = [
        tensioned_poses(robot, *pair, cells.of(own)) for pair, own in zip(pairs, rows, strict=True)
    ]
    return SessionClosures(parts, rows)


def _apart(whole: FloatArray, rows: Sequence[IntArray]) -> list[FloatArray]:
    """The rows of each machine; a single one has them all."""
    return [whole] if len(rows) == 1 else [whole[own] for own in rows]


def _some(states: RowStates, rows: IntArray) -> RowStates:
    tension = None if states.tension is None else states.tension[rows]
    return RowStates(states.pose[rows], states.actuators[rows], states.status[rows], tension)


def _joined(parts: Sequence[AnyArray], rows: Sequence[IntArray]) -> AnyArray:
    """Rows of all parts, each where it is said to be."""
    if len(parts) == 1:
        return parts[0]
    whole = np.empty((sum(map(len, rows)), *parts[0].shape[1:]), dtype=parts[0].dtype)
    for part, own in zip(parts, rows, strict=True):
        whole[own] = part
    return whole
