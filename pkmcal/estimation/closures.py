"""Closures of poses that have unknowns: these follow from the actuators nearly, or not alone.

An estimator that gives every row a pose of its own needs three things of a machine: unknowns of the
pose, equations between them and what the actuators read, and how the pose moves with the unknowns
and with the numbers of the geometry. There are two cases beside that of as many closures as free
coordinates and actuators without error, where the pose is that of the forward kinematics:

* `NoisyActuators`: the same closures, actuators with a stated deviation. The unknowns are where the
  actuators really are; closures hold exactly, for the pose is that of the forward kinematics there.
* `FreePoses`: more actuators than ways to move, whose closures no pose can meet at once. The
  unknowns are the coordinates that joints leave free; each closure that is read is an equation in
  units of its actuator.

Closures beyond the free coordinates do not make the second case by themselves. An over-constrained
machine has them between passive joints, which read nothing: with errors of the geometry they give
way, and the pose that misses them least is that of the forward kinematics. To take what they miss
for noise would make small whatever geometry lets them agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, mm_per_unit
from pkmcal.estimation.row_states import RowStates
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.calibratable import Calibratable, as_parallel
from pkmcal.kinematics.robot import Robot

_HELD = 1e-9  # of the size: a step back onto held rows after which its square is rounding
_STEPS = 30  # back onto them


class Closures(Protocol):
    """The closures of a machine at its poses."""

    unknowns: int
    equations: int
    actuators: tuple[int, ...]
    sigma: FloatArray | None
    missing: BoolArray | None  # equations (K, equations) of load cells that were not read
    cells: int  # how many of the equations are of load cells: the last ones

    def settled(self, robot: Calibratable, states: RowStates) -> RowStates:
        """The states of a robot with other numbers, near those given."""

    def moved(self, robot: Calibratable, states: RowStates, step: FloatArray) -> RowStates:
        """States after steps (K, unknowns) of the unknowns."""

    def residual(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """The equations (K, equations), whitened, and their derivative by the unknowns."""

    def lengths(self, robot: Calibratable) -> FloatArray:
        """Factors (equations,) to mm of the equations times their sigma."""

    def twists(self, robot: Calibratable, states: RowStates) -> FloatArray:
        """Compute twists of the platform by the unknowns, (K, 6, unknowns)."""

    def by_numbers(self, robot: Calibratable, states: RowStates, places: IntArray) -> FloatArray:
        """Derivative of the equations by numbers of the geometry, (K, equations, p)."""

    def twists_by_numbers(
        self, robot: Calibratable, states: RowStates, places: IntArray
    ) -> FloatArray | None:
        """Compute twists by numbers while the unknowns are held, (K, 6, p); None without any."""


class NoisyActuators:
    """Poses that follow from where the actuators are, which is near what they read.

    Parameters
    ----------
    read : ndarray (K, n)
        What they read.
    sigma : ndarray (K, n)
        Its standard deviation, mm or rad; an actuator whose deviations are 0 has no unknown.
    """

    cells = 0
    missing: BoolArray | None = None

    def __init__(self, read: FloatArray, sigma: FloatArray) -> None:
        self.read = read
        self._free = np.flatnonzero(sigma.any(axis=0))
        self.sigma: FloatArray | None = sigma[:, self._free]
        self._white = 1.0 / self.sigma
        self.unknowns = self.equations = len(self._free)
        self.actuators: tuple[int, ...] = tuple(self._free.tolist())

    def settled(self, robot: Calibratable, states: RowStates) -> RowStates:
        """Solve the forward kinematics where the actuators are."""
        return following(robot, states.actuators, states.pose)

    def moved(self, robot: Calibratable, states: RowStates, step: FloatArray) -> RowStates:
        """Move the actuators."""
        actuators = states.actuators.copy()
        actuators[:, self._free] += step
        return self.settled(robot, RowStates(states.pose, actuators, states.status))

    def residual(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """Return the readings of the actuators at the poses, less what was read."""
        off = (states.actuators - self.read)[:, self._free]
        return off * self._white, self._white[:, :, None] * np.eye(self.unknowns)

    def lengths(self, robot: Calibratable) -> FloatArray:
        """Return the scale of each equation in the actuators' units."""
        return mm_per_unit(robot.actuator_units, robot.length)[self._free]

    def twists(self, robot: Calibratable, states: RowStates) -> FloatArray:
        """Twists by the actuators."""
        return robot.actuator_twists(states.pose, states.actuators)[:, :, self._free]

    def by_numbers(self, robot: Calibratable, states: RowStates, places: IntArray) -> FloatArray:
        """Nothing: what actuators read is not of the geometry."""
        return np.zeros((len(self.read), self.equations, len(places)))

    def twists_by_numbers(
        self, robot: Calibratable, states: RowStates, places: IntArray
    ) -> FloatArray | None:
        """Twists, actuators held."""
        return robot.error_twists(states.pose, states.actuators)[:, :, places]


class FreePoses:
    """Poses of a machine with more actuators than ways to move, which no pose can meet at once.

    The unknowns are steps of the pose that keep what passive joints hold and actuators that are
    never wrong, if there are any: those across the gradients of the held rows, with Newton's steps
    of least norm back onto them where a pose or the geometry has moved.

    Parameters
    ----------
    robot : Robot
        The machine.
    read : ndarray (K, n)
        What the actuators read.
    sigma : ndarray (K, n)
        Its standard deviation, mm or rad; an actuator whose deviations are 0 is never wrong.
    """

    cells = 0
    missing: BoolArray | None = None

    def __init__(self, robot: Robot, read: FloatArray, sigma: FloatArray) -> None:
        self.read = read
        roles = pose_steps.row_roles(robot)
        exact = np.flatnonzero(~sigma.any(axis=0))
        rows = np.setdiff1d(np.arange(len(roles.read)), exact)  # the first are of the actuators
        self._read = roles.read[rows]
        self.actuators: tuple[int, ...] = tuple(roles.actuator[row] for row in rows)
        self._held = np.concatenate([roles.held, roles.read[exact]])
        self._mixed = not np.array_equal(self._read, np.eye(robot.machine.rows))
        self._arcs = 1.0 / mm_per_unit(pose_steps.step_units(robot), robot.length)
        units = [robot.actuator_units[a] if a >= 0 else "mm" for a in self.actuators]
        self._turning = [unit == "rad" for unit in units]
        self.unknowns = robot.machine.m - len(self._held)
        self.equations = len(rows)
        if self.unknowns < 1 or not sigma[:, np.setdiff1d(self.actuators, -1)].all():
            raise ArgumentError(
                f"measurements: {robot.name} has more actuators than ways to move, which cannot"
                " be met without noise: actuator_sigma must be positive, or None; 0 at all rows for"
                f" at most {robot.machine.m - len(roles.held) - 1} actuators that are never wrong"
            )
        if self.actuators != tuple(range(sigma.shape[1])):
            # passive rows that give way are as sure as the file weighs them against the actuators
            common = np.mean(sigma * mm_per_unit(robot.actuator_units, robot.length), axis=1)
            each = [sigma[:, a] if a >= 0 else common for a in self.actuators]
            sigma = np.stack(each, axis=1)
        self.sigma: FloatArray | None = sigma
        self._white, self._white_steps = self._whitening(sigma)

    def _whitening(self, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute whitening from deviations (K, equations), and its derivatives."""
        white = 1.0 / sigma
        some = white[:1] if (sigma == sigma[:1]).all() else white
        return white, np.repeat(some[:, :, None], self.unknowns, axis=2)

    def settled(self, robot: Calibratable, states: RowStates) -> RowStates:
        """Poses stay where they are, or where joints hold them, until they are fitted."""
        return self._kept(robot, states)

    def moved(self, robot: Calibratable, states: RowStates, step: FloatArray) -> RowStates:
        """Move the poses."""
        if len(self._held):
            step = (self._allowed(robot, states)[0] @ step[:, :, None])[:, :, 0]
        return self._kept(robot, self._stepped(robot, states, step))

    def residual(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """Return the limbs' readings at the poses, less what was read."""
        off, by_step = self._rows(robot, states)
        if self._mixed:
            off, by_step = off @ self._read.T, self._read @ by_step
        if len(self._held):
            by_step = by_step @ self._allowed(robot, states)[0]
        off *= self._white
        by_step *= self._white_steps
        return off, by_step

    def lengths(self, robot: Calibratable) -> FloatArray:
        """Return the scale of each equation: actuators' units; the other rows are in mm."""
        arc = robot.length if any(self._turning) else 1.0
        return np.array([arc if turning else 1.0 for turning in self._turning])

    def twists(self, robot: Calibratable, states: RowStates) -> FloatArray:
        """Twists by steps of the pose."""
        twists = self._step_twists(robot, states)
        return twists @ self._allowed(robot, states)[0] if len(self._held) else twists

    def by_numbers(self, robot: Calibratable, states: RowStates, places: IntArray) -> FloatArray:
        """Differentiate the limbs' readings by numbers, unknowns held."""
        by_free = self._rows_by_numbers(robot, states, places)
        found = self._read @ by_free if self._mixed else by_free
        if len(self._held):
            by_step = self._rows(robot, states)[1]
            found += self._read @ by_step @ self._following(robot, states, by_free)
        found *= self._white[:, :, None]
        return found

    def twists_by_numbers(
        self, robot: Calibratable, states: RowStates, places: IntArray
    ) -> FloatArray | None:
        """Poses are held, or go with the joints that hold them."""
        if not len(self._held):
            return None
        steps = self._following(robot, states, self._rows_by_numbers(robot, states, places))
        return self._step_twists(robot, states) @ steps

    # rows of read and held equations by steps of the unknowns, before any is held -----------------

    def _rows(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """Compute what the rows miss (K, rows), and the derivative by steps (K, rows, s)."""
        return pose_steps.readings(machine_of(robot), states.pose, self.read)

    def _rows_by_numbers(
        self, robot: Calibratable, states: RowStates, places: IntArray
    ) -> FloatArray:
        """Differentiate the rows by numbers of the geometry, (K, rows, p)."""
        return pose_steps.readings_by_numbers(machine_of(robot), states.pose, self.read, places)

    def _stepped(self, robot: Calibratable, states: RowStates, step: FloatArray) -> RowStates:
        """The states after steps (K, s)."""
        pose = pose_steps.moved(machine_of(robot), states.pose, step)
        return RowStates(pose, self.read, states.status)

    def _step_twists(self, robot: Calibratable, states: RowStates) -> FloatArray:
        """Twists by the steps, (K, 6, s)."""
        return pose_steps.step_twists(machine_of(robot), states.pose)

    # what is held ---------------------------------------------------------------------------------

    def _following(self, robot: Calibratable, states: RowStates, by_free: FloatArray) -> FloatArray:
        """Steps of the pose by numbers that keep what is held, (K, m, p)."""
        return -self._allowed(robot, states)[1] @ (self._held @ by_free)

    def _allowed(self, robot: Calibratable, states: RowStates) -> tuple[FloatArray, FloatArray]:
        """Steps that keep the held rows (K, m, unknowns), and those that undo them (K, m, h)."""
        return self._split(self._rows(robot, states)[1])

    def _split(self, by_step: FloatArray) -> tuple[FloatArray, FloatArray]:
        across = (self._held @ by_step * self._arcs).transpose(0, 2, 1)
        known = np.isfinite(across).all(axis=(1, 2))
        across[~known] = np.eye(*across.shape[1:])
        q, r = np.linalg.qr(across, mode="complete")
        square = r[:, : len(self._held)].transpose(0, 2, 1)
        undo = q[:, :, : len(self._held)] @ np.linalg.inv(square)
        undo[~known] = np.nan
        arcs = self._arcs[:, None]
        return arcs * q[:, :, len(self._held) :], arcs * undo

    def _kept(self, robot: Calibratable, states: RowStates) -> RowStates:
        """States moved back to where joints hold them; poses of NaN where they do not get there."""
        pose = states.pose
        if len(self._held):
            limit = _HELD * machine_of(robot).machine.struct.size
            for _ in range(_STEPS):
                off, by_step = self._rows(robot, states)
                missed = off @ self._held.T
                step = -(self._split(by_step)[1] @ missed[:, :, None])[:, :, 0]
                states = self._stepped(robot, states, step)
                short = np.abs(step / self._arcs).max(axis=1) <= limit
                if (short | np.isnan(step).any(axis=1)).all():
                    break
            pose = np.where(short[:, None], states.pose, np.nan)
        return self._said(states, pose)

    def _said(self, states: RowStates, pose: FloatArray) -> RowStates:
        """The states at poses (K, 6), with a status where there is none."""
        found = np.zeros(len(pose), dtype=np.int32)
        if not np.isfinite(pose).all():
            lost = ~np.isfinite(pose).all(axis=1)
            found[lost] = np.where(states.status == 0, 1, states.status)[lost]
        return RowStates(pose, self.read, found, states.tension)


def following(robot: Calibratable, actuators: FloatArray, guess: FloatArray) -> RowStates:
    """States whose poses follow from where the actuators are (K, n)."""
    solved = robot.forward(actuators, guess)
    return RowStates(solved.pose, actuators, solved.status)


def machine_of(robot: Calibratable) -> Robot:
    """The parallel machine that rows with poses of their own are of."""
    found = as_parallel(robot)
    assert found is not None  # arms have no surplus closures
    return found


def one_mm(robot: Calibratable, read: FloatArray) -> FloatArray:
    """Deviations (K, n) of what actuators read, where none is known: to be estimated."""
    return np.tile(1.0 / mm_per_unit(robot.actuator_units, robot.length), (len(read), 1))


def has_equations(
    robot: Calibratable, sigmas: Sequence[FloatArray | None], estimated: bool
) -> bool:
    """Return whether closures are equations for these deviations; see `closures_of`."""
    noisy = estimated or any(sigma is not None and bool(sigma.any()) for sigma in sigmas)
    return noisy or (pose_steps.surplus(robot) > 0)


def closures_of(
    robot: Calibratable, read: FloatArray, sigma: FloatArray | None, estimated: bool
) -> NoisyActuators | FreePoses | None:
    """Make the closures of a machine for the actuator readings (K, n); None of exact ones.

    Parameters
    ----------
    robot : Calibratable
        The machine.
    read : ndarray (K, n)
        Distinct rows.
    sigma : ndarray (K, n) or None
        Standard deviations of what was read. None: nothing is stated, which is 0 where the
        actuators are as many as the ways to move, and 1 mm, to be estimated, where they are more.
    estimated : bool
        Whether they are to be estimated on any machine, for what was read tells them.
    """
    if sigma is None and estimated:
        sigma = one_mm(robot, read)
    if pose_steps.surplus(robot) > 0:
        return FreePoses(machine_of(robot), read, one_mm(robot, read) if sigma is None else sigma)
    if sigma is None or not has_equations(robot, [sigma], estimated):
        return None
    return NoisyActuators(read, sigma)
