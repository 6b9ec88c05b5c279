"""The machine of each session at its own poses, and the closures there.

Where all numbers of the geometry are common to all sessions there is one machine, at all poses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, lots
from pkmcal.estimation.closures import Closures, closures_of, following
from pkmcal.estimation.pose_table import PoseTable
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import by_parameters
from pkmcal.estimation.tensioned_poses import tensioned_poses
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.drive_state import DriveState

AnyArray = TypeVar("AnyArray", FloatArray, Int32Array, BoolArray)

_TOGETHER = 8192  # poses whose derivatives are held at once


@dataclass(frozen=True, eq=False)
class Machines:
    """The machines of a calibration, and what their closures say of the poses.

    Attributes
    ----------
    robots : tuple of Calibratable
        One, or one for each session.
    rows : tuple of ndarray of int
        The poses that are its own, of each.
    closures : tuple of Closures
        Of each; none where poses follow from what the actuators read.
    read : ndarray (K, n)
        What these read.
    state : DriveState
        From where the actuators came, the tension of what they drive, and what was carried.
    shift : ndarray (K, equations) or None
        By how much whitened equations of the closures are larger: of other readings.
    """

    robots: tuple[Calibratable, ...]
    rows: tuple[IntArray, ...]
    closures: tuple[Closures, ...]
    read: FloatArray
    state: DriveState
    shift: FloatArray | None = None

    @property
    def unknowns(self) -> int:
        """Unknowns of each pose."""
        return self.closures[0].unknowns if self.closures else 0

    @property
    def equations(self) -> int:
        """Equations of the closures of each pose."""
        return self.closures[0].equations if self.closures else 0

    @property
    def cells(self) -> int:
        """Number of readings of load cells, which come last."""
        return self.closures[0].cells if self.closures else 0

    @property
    def actuators(self) -> tuple[int, ...]:
        """The actuator that each equation has the reading of; -1: none."""
        return self.closures[0].actuators if self.closures else ()

    @property
    def missing(self) -> BoolArray | None:
        """Equations (K, equations) of load cells that were not read."""
        found = [each.missing for each in self.closures if each.missing is not None]
        return _joined(found, self.rows) if found else None

    @property
    def sigma(self) -> FloatArray | None:
        """Standard deviations (K, equations) of the equations."""
        found = [each.sigma for each in self.closures if each.sigma is not None]
        return _joined(found, self.rows) if found else None

    # the machines ---------------------------------------------------------------------------------

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
        """Evaluate a function of machine and poses in batches of poses, and join the results."""
        parts = []
        for robot, rows in zip(self.robots, self.rows, strict=True):
            found = [function(_driven(robot, self.state.at(own)), own) for own in _lots(rows)]
            parts.append(found[0] if len(found) == 1 else np.concatenate(found))
        return _joined(parts, self.rows)

    def actuator_twists(self, states: RowStates, poses: IntArray) -> FloatArray:
        """Derivative (b, 6, n) of the platform's twist to each actuator coordinate, of poses."""
        found = np.empty((len(poses), 6, states.actuators.shape[1]))
        for robot, rows in zip(self.robots, self.rows, strict=True):
            mine = np.flatnonzero(rows.take(np.searchsorted(rows, poses), mode="clip") == poses)
            own = poses[mine]
            driven = _driven(robot, self.state.at(own))
            found[mine] = driven.actuator_twists(states.pose[own], states.actuators[own])
        return found

    # their closures -------------------------------------------------------------------------------

    def settled(self, states: RowStates) -> RowStates:
        """The states near those of machines with other numbers."""
        if self.closures:
            found = [each.settled(robot, own) for each, robot, own in self._each(states)]
        else:
            read, guesses = _apart(self.read, self.rows), _apart(states.pose, self.rows)
            found = [*map(following, self.driven, read, guesses)]
        return self._states(found)

    def moved(self, states: RowStates, step: FloatArray) -> RowStates:
        """States after steps (K, unknowns) of the unknowns."""
        steps = _apart(step, self.rows)
        return self._states([
            each.moved(robot, own, mine)
            for (each, robot, own), mine in zip(self._each(states), steps, strict=True)
        ])  # fmt: skip

    def residual(self, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """The equations (K, equations), whitened, and their derivative by the unknowns."""
        found = [each.residual(robot, own) for each, robot, own in self._each(states)]
        off, by_unknown = zip(*found, strict=True)
        whole = _joined(off, self.rows)
        whole = whole if self.shift is None else whole + self.shift
        return whole, _joined(by_unknown, self.rows)

    def shifted(self, by: FloatArray) -> Machines:
        """Return the machines with other actuator readings, by whitened shifts (K, equations)."""
        return replace(self, shift=by if self.shift is None else self.shift + by)

    def lengths(self) -> FloatArray:
        """Factors (equations,) to mm of the equations times their sigma."""
        return self.closures[0].lengths(self.robots[0])

    def twists(self, states: RowStates) -> FloatArray:
        """Compute twists of the platform by the unknowns, (K, 6, unknowns)."""
        found = [each.twists(robot, own) for each, robot, own in self._each(states)]
        return _joined(found, self.rows)

    def by_numbers(
        self, states: RowStates, places: IntArray, columns: IntArray, size: int
    ) -> FloatArray:
        """Derivative of the equations by the parameters, (K, equations, size).

        `columns` (S, g) are the parameters that numbers of the geometry are, of each machine.
        """
        found = [each.by_numbers(robot, own, places) for each, robot, own in self._each(states)]
        wide = [
            by_parameters(part, own[None], np.zeros(len(part), dtype=np.intp), size)
            for part, own in zip(found, columns, strict=True)
        ]
        return _joined(wide, self.rows)

    def twists_by_numbers(
        self, states: RowStates, places: IntArray, poses: IntArray
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Compute twists by numbers of each pose's machine, unknowns held.

        Of distinct poses, all where they have unknowns: those of each machine, and their twists
        (b, 6, g). Nothing where it does not move.
        """
        alone = len(self.rows) == 1
        for i, (robot, rows) in enumerate(zip(self.robots, self.rows, strict=True)):
            own = poses
            if not alone:
                own = poses[rows.take(np.searchsorted(rows, poses), mode="clip") == poses]
            driven = _driven(robot, self.state.at(own))
            if not self.closures:
                at = states.pose[own], states.actuators[own]
                yield own, driven.error_twists(*at).take(places, axis=2)  # no more is held
                continue
            found = self.closures[i].twists_by_numbers(driven, _some(states, own), places)
            if found is not None:
                yield own, found

    def _each(self, states: RowStates) -> list[tuple[Closures, Calibratable, RowStates]]:
        own = [states] if len(self.rows) == 1 else [_some(states, rows) for rows in self.rows]
        return list(zip(self.closures, self.driven, own, strict=True))

    def _states(self, parts: Sequence[RowStates]) -> RowStates:
        if len(parts) == 1:
            return parts[0]
        tensions = [part.tension for part in parts if part.tension is not None]
        return RowStates(
            _joined([part.pose for part in parts], self.rows),
            _joined([part.actuators for part in parts], self.rows),
            _joined([part.status for part in parts], self.rows),
            None if not tensions else _joined(tensions, self.rows),
        )

    def with_exact_actuators(self, read: FloatArray) -> Machines:
        """Return the machines with poses that follow exactly from the actuators (K, n)."""
        return replace(self, closures=(), read=read, shift=None)


def _lots(rows: IntArray) -> list[IntArray]:
    return [rows[lot] for lot in lots(len(rows) or 1, _TOGETHER)]


def _driven(robot: Calibratable, state: DriveState) -> Calibratable:
    return state.of(robot)


def machines_of(robot: Calibratable, table: PoseTable) -> Machines:
    """The machine of each session at the present numbers, with its closures; see `closures_of`."""
    rows = table.poses_of_machine
    sigma, cells = table.actuator_sigma, table.cells
    sigmas = [None] * len(rows) if sigma is None else _apart(sigma, rows)
    pairs = zip(_apart(table.actuators, rows), sigmas, strict=True)
    found: list[Closures | None]
    if cells is None:
        found = [closures_of(robot, *pair, table.estimated) for pair in pairs]
    else:
        found = [
            tensioned_poses(robot, *pair, cells.of(own))
            for pair, own in zip(pairs, rows, strict=True)
        ]
    closures = tuple(each for each in found if each is not None)
    several = {(each.unknowns, each.equations) for each in closures}
    if len(several) > 1 or len(closures) not in (0, len(rows)):
        raise ArgumentError(
            "measurements: state actuator_sigma of the same actuators in all sessions"
        )
    return Machines((robot,) * len(rows), rows, closures, table.actuators, table.state)


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
