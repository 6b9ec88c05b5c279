"""Tensions of cables as unknowns of each row: load cells read them, the load is balanced by them.

The unknowns of a row are the pose and the tensions, m + c numbers, that `FreePoses` would have with
m numbers; where the load is balanced its m equations of equilibrium are held as what passive joints
hold is: exactly. The c readings of the load cells are equations beside those of the c cables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.display import first_rows
from pkmcal.estimation.closures import FreePoses, machine_of, one_mm
from pkmcal.estimation.row_states import RowStates
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.load import CELL, CableLoad
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.equilibrium import Equilibrium, balance, equilibrium
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tension import filled_tension

_SHARE = 0.1  # of the largest force: a step of a tension that counts as one of 1 mm does


class Cells(NamedTuple):
    """The readings of load cells of cables.

    Attributes
    ----------
    read : ndarray (K, c)
        N; NaN where nothing was read.
    sigma : ndarray (K, c) or None
        Its standard deviations; None: not known.
    """

    read: FloatArray
    sigma: FloatArray | None

    def of(self, rows: IntArray) -> Cells:
        """Return the cells of some rows."""
        return Cells(self.read[rows], None if self.sigma is None else self.sigma[rows])


class TensionedPoses(FreePoses):
    """Poses of a machine on cables whose tensions are unknown, too.

    Parameters
    ----------
    robot : Robot
        The machine.
    read, sigma : ndarray (K, c)
        As for `FreePoses`.
    cells : Cells
        What the load cells read.
    """

    def __init__(self, robot: Robot, read: FloatArray, sigma: FloatArray, cells: Cells) -> None:
        if not sigma.all():
            raise ArgumentError(
                "measurements: actuator_sigma must be positive where tensions are unknown"
            )
        super().__init__(robot, read, sigma)
        count = read.shape[1]
        load = robot.model.balanced_load
        self.missing = np.zeros((len(read), self.equations + count), dtype=bool)
        self.missing[:, self.equations :] = np.isnan(cells.read)
        self._cells = np.nan_to_num(cells.read)
        self._cache: dict[str, tuple[object, RowStates, FloatArray, FloatArray]] = {}
        self._first = filled_tension(cells.read)
        force = 0.0 if load is None else float(np.linalg.norm(load.force))
        largest = max(force, float(np.abs(self._first).max(initial=0.0)), 1.0)
        balanced = 0 if load is None else robot.machine.m
        closures = self._read.shape[1]
        self._read = _beside(self._read, np.eye(balanced + count)[balanced:])
        self._held = np.vstack([
            np.pad(self._held, ((0, 0), (0, balanced + count))),
            np.eye(balanced, closures + balanced + count, closures),
        ])  # fmt: skip
        self._mixed, self.cells = True, count
        self._drives = np.eye(count)[[limb.actuator for limb in robot.model.limbs]]
        self._arcs = np.concatenate([self._arcs, np.full(count, _SHARE * largest)])
        self.unknowns = len(self._arcs) - len(self._held)
        self.equations += count
        self._turning = [*self._turning, *[False] * count]
        self.actuators = (*self.actuators, *[-1] * count)
        of_cells = np.ones(cells.read.shape) if cells.sigma is None else cells.sigma
        self.sigma = np.hstack([np.asarray(self.sigma), of_cells])
        self._white, self._white_steps = self._whitening(self.sigma)

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_cache": {}}

    def settled(self, robot: Calibratable, states: RowStates) -> RowStates:
        """Tensions begin where cells read them, those that were not read at the row's mean."""
        if states.tension is None:
            states = replace(states, tension=self._first)
        return super().settled(robot, states)

    def _rows(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """Rows as of `FreePoses`; kept for the last states, of which a step asks several times."""
        known = self._cache.get("rows")
        if known is not None and known[0] is robot and known[1] is states:
            _, _, off, by_step = known
        else:
            off, by_step = self._rows_at(robot, states)
            self._cache["rows"] = robot, states, off, by_step
        return off.copy(), by_step.copy()

    def _rows_at(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        machine, load, tension = self._at(robot, states)
        off, by_pose = pose_steps.readings(machine, states.pose, self.read)
        by_tension = pose_steps.readings_by_tension(machine, states.pose)
        gains = self._gains(load)
        c, m = tension.shape[1], by_pose.shape[2]
        parts = [np.concatenate([by_pose, by_tension[:, :, None] * self._drives], axis=2)]
        missed = [off]
        if load is not None:
            left = self._left(machine, states, load, np.empty(0, dtype=np.intp))
            missed.append(left.off)
            by_cables = left.by_tension @ self._drives
            parts.append(np.concatenate([left.by_step, by_cables], axis=2))
        missed.append(gains * tension - self._cells)
        parts.append(np.tile(np.eye(c, m + c, m) * gains[:, None], (len(off), 1, 1)))
        return np.hstack(missed), np.concatenate(parts, axis=1)

    def _rows_by_numbers(
        self, robot: Calibratable, states: RowStates, places: IntArray
    ) -> FloatArray:
        machine, load, tension = self._at(robot, states)
        parts = [pose_steps.readings_by_numbers(machine, states.pose, self.read, places)]
        if load is not None:
            parts.append(self._left(machine, states, load, places).by_number)
        of_cells = np.zeros((*tension.shape, len(places)))
        names = [machine.geometry.names[place] for place in places]
        for j in range(tension.shape[1]):
            if (name := f"{CELL}{j + 1}") in names:
                of_cells[:, j, names.index(name)] = tension[:, j]
        return np.concatenate([*parts, of_cells], axis=1)

    def _stepped(self, robot: Calibratable, states: RowStates, step: FloatArray) -> RowStates:
        m = machine_of(robot).machine.m
        moved = super()._stepped(robot, states, step[:, :m])
        return replace(moved, tension=np.asarray(states.tension) + step[:, m:])

    def _step_twists(self, robot: Calibratable, states: RowStates) -> FloatArray:
        return np.pad(super()._step_twists(robot, states), ((0, 0), (0, 0), (0, self.cells)))

    def _at(
        self, robot: Calibratable, states: RowStates
    ) -> tuple[Robot, CableLoad | None, FloatArray]:
        """The machine under the tensions of the states."""
        machine, tension = machine_of(robot), np.asarray(states.tension)
        known = np.isfinite(tension).all(axis=1)
        pulled = tension if known.all() else np.where(known[:, None], tension, 0.0)
        return machine.tensioned(pulled), machine.model.balanced_load, pulled

    def _kept(self, robot: Calibratable, states: RowStates) -> RowStates:
        """Tensions go back to balance by themselves: they are as many as coordinates, or more."""
        load, tension = machine_of(robot).model.balanced_load, np.asarray(states.tension)
        if load is not None:
            slopes, pull = balance(machine_of(robot), states.pose, load)
            slopes = slopes @ self._drives
            known = np.asarray(np.isfinite(slopes).all(axis=(1, 2)))
            slopes[~known] = 0.0
            missed = pull - (slopes @ tension[:, :, None])[:, :, 0]
            undone = (np.linalg.pinv(slopes) @ missed[:, :, None])[:, :, 0]
            tension = tension + np.where(known[:, None], undone, np.nan)
        return self._said(replace(states, tension=tension), states.pose)

    def _gains(self, load: CableLoad | None) -> FloatArray:
        return np.ones(self.cells) if load is None else np.array(load.cells)

    def _left(
        self, machine: Robot, states: RowStates, load: CableLoad, places: IntArray
    ) -> Equilibrium:
        pulled = np.asarray(states.tension) @ self._drives.T
        return equilibrium(machine, states.pose, pulled, load, places)


def tensioned_poses(
    robot: Calibratable, read: FloatArray, sigma: FloatArray | None, cells: Cells
) -> TensionedPoses:
    """Poses with unknown tensions, for actuators that read so (K, n); as `closures_of`."""
    machine = machine_of(robot)
    return TensionedPoses(machine, read, one_mm(machine, read) if sigma is None else sigma, cells)


def _beside(one: FloatArray, other: FloatArray) -> FloatArray:
    """Two matrices on a diagonal."""
    right, below = (0, other.shape[1]), (0, other.shape[0])
    both = np.pad(one, (below, right))
    both[one.shape[0] :, one.shape[1] :] = other
    return both


def cells_of(robot: Calibratable, sets: Sequence[Measurements]) -> Cells | None:
    """Return all load-cell readings of sets (N, n); None where tensions are no unknowns."""
    if not unknown_tensions(robot, sets):
        return None
    read = [np.full(m.actuators.shape, np.nan) if m.tension is None else m.tension for m in sets]
    sigmas = [m.tension_sigma for m in sets if m.tension_sigma is not None]
    return Cells(np.concatenate(read), np.concatenate(sigmas) if sigmas else None)


def unknown_tensions(robot: Calibratable, sets: Sequence[Measurements]) -> bool:
    """Return whether tensions are unknowns: they balance the load, or were read with noise.

    Where they balance it, but nothing depends on them nor was any read, they are not.

    Raises
    ------
    ValueError
        Of this machine they cannot be; or tensions that were read in part.
    """
    stated = [measured.tension_sigma is not None for measured in sets]
    balanced = robot.model.balanced_load is not None
    if not balanced and not any(stated):
        if any(m.tension is not None and np.isnan(m.tension).any() for m in sets):
            raise ArgumentError(
                "measurements: tension was not read everywhere: state tension_sigma, or in the"
                " robot file that they balance the load, [load] balance = true"
            )
        return False
    if any(stated) and not all(stated):
        raise ArgumentError("measurements: state tension_sigma of all sets, or of none")
    stretching = any(law is not None and law.stretch for law in robot.model.laws)
    if not stretching and all(measured.tension is None for measured in sets):
        return False
    why = _hindrance(robot)
    if why:
        raise ArgumentError(f"measurements: tensions of {robot.name} cannot be unknown: {why}")
    return True


def _hindrance(robot: Calibratable) -> str:
    """Why tensions of a machine cannot be unknowns; "" where they can."""
    if robot.kind == "arm":
        return "it is a serial arm"
    for i, limb in enumerate(robot.model.limbs):
        if not limb.cable:
            return f"limb {i + 1} is a {limb.kind}, no cable"
    if robot.n_actuators < len(robot.model.limbs):
        return "limbs share an actuator"
    return ""


def check_cells(robot: Calibratable, cells: Cells, rows: IntArray) -> None:
    """Refuse rows whose tensions would not be determined.

    `rows` (K,) are the numbers of the first row at each pose.
    """
    c, machine = cells.read.shape[1], machine_of(robot)
    balanced = machine.model.balanced_load is not None
    needed = max(c - machine.machine.m, 0) if balanced else c
    few = np.flatnonzero(np.isfinite(cells.read).sum(axis=1) < needed)
    if len(few):
        held = f", {machine.machine.m} follow from the balance" if balanced else ""
        raise ArgumentError(
            f"measurements: of {c} tensions {needed} or more must be read in each row{held}: too"
            f" few in row {first_rows(np.sort(rows[few]).tolist())}"
        )
