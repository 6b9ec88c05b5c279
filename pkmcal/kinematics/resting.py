"""Deflection of a machine's elastic numbers where it comes to rest under its load.

A compliance c belongs to a number e of the geometry. What pulls does Q = Tᵀw on it at held
actuators, T the twist of the platform by e and w the wrench on it, and e is c Q more: the loaded
machine is the rigid one with these numbers. At a pose they follow at once.
"""

from __future__ import annotations

from copy import copy
from typing import Any, TypeVar

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.core_machine import CoreMachine
from pkmcal.core.driven import CompiledMachine, DrivenMachine
from pkmcal.core.library import SLOTS
from pkmcal.core.machine import Machine
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.pulls import Pulls

R = TypeVar("R", bound="RestingMachine")

MOST_STEPS = 40  # a load that has not come to rest by then is not held
SETTLED = 1e-14  # of the size, or rad: numbers that stay
_MOST_LENGTH, _MOST_ANGLE = 1e-2, 0.1  # of the size, and rad, that a number may give
_STEP = 1e-4  # of differences by numbers of the load, which forces follow almost linearly


class RestingMachine(CoreMachine):
    """Numbers of a machine that give, at poses and actuators, and what pulls at them.

    Parameters
    ----------
    inner : Machine, ChainMachine or DrivenMachine
        Without what yields.
    pulls : Pulls
        What pulls at it.
    places : ndarray of int (c,)
        Where the numbers that move are in the flattened numbers of a geometry, rising.
    moves : ndarray (s, c)
        How far each of the numbers that yield moves these.
    shape : (int, int)
        Of a geometry: that of the inner machine with the numbers of `Elastic` behind each row,
        which the first row has.
    width : int
        How many numbers of a row are the inner machine's.

    Attributes
    ----------
    carried : ndarray or None
        What it carries in place of the stated payload, (10,) or a row for each row of a call
        (N, 10), as `pkmcal.geometry.carried.Load.rows` has it.
    """

    def __init__(
        self,
        inner: CompiledMachine,
        pulls: Pulls,
        places: IntArray,
        moves: FloatArray,
        shape: tuple[int, int],
        width: int,
    ) -> None:
        self.inner, self.pulls = inner, pulls
        self.isa, self.actuators = inner.isa, inner.actuators
        self.m, self.rows = inner.m, inner.rows
        self.carried: FloatArray | None = None
        self._shape, self._width = shape, width
        springs = pulls.elastic.springs
        self._columns = self._within(places)
        self._moves = None if np.array_equal(moves, np.eye(len(springs))) else moves
        angles = np.array([spring.unit == "rad" for spring in springs])
        size = float(inner.struct.size)
        self._scale = np.where(angles, 1.0, size)
        self._most = np.where(angles, _MOST_ANGLE, _MOST_LENGTH * size)
        self._compliance = [pulls.place(COMPLIANCE + spring.number) for spring in springs]
        self._growing = [
            (k, spring, pulls.place(COMPLIANCE + spring.number + PER_LENGTH))
            for k, spring in enumerate(springs)
            if spring.drive >= 0
        ]

    @property
    def struct(self) -> Any:
        """C struct of the machine within."""
        return self.inner.struct

    def with_tolerance(self: R, closure_tolerance: float) -> R:
        """Return a copy of the machine with another `closure_tolerance`, mm."""
        return self._with(inner=self.inner.with_tolerance(closure_tolerance))

    def approaching(self: R, approach: FloatArray) -> R:
        """Return the machine for actuators that come from a direction, (n,) or (N, n)."""
        return self._with(inner=self.inner.approaching(approach))

    def tensioned(self: R, tension: FloatArray) -> R:
        """Return the machine under tensions of what the actuators drive, (n,) or (N, n)."""
        return self._with(inner=self.inner.tensioned(tension))

    def carrying(self: R, carried: FloatArray) -> R:
        """Return the machine with another load, (10,) or (N, 10)."""
        return self._with(carried=carried)

    def _with(self: R, **changed: object) -> R:
        other = copy(self)
        other.__dict__.update(changed)
        return other

    # what yields ----------------------------------------------------------------------------------

    def rigid(self, slots: FloatArray) -> FloatArray:
        """The geometry of the machine within where nothing pulls."""
        if isinstance(self.inner, DrivenMachine):  # knows where its numbers are
            return slots
        return np.ascontiguousarray(slots[..., : self._width])

    def under_load(
        self, slots: FloatArray, pose: FloatArray, near: FloatArray | None = None
    ) -> FloatArray:
        """The geometry of the machine within for each of N poses under its load, (N, …, …).

        Of a pose that it does not reach, or where it gives way, that without load.
        """
        _, given = self._at_rest(slots, pose, near)
        return self._given(slots, np.where(np.isfinite(given), given, 0.0))

    def forces(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Return forces on each elastic number, N or N mm, (N, s), at poses (N, 6)."""
        inside = self.under_load(slots, pose, q)
        return self._forces(slots, pose, q, inside, self.numbers(slots), self.carried)

    def compliances(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Compliance of each number that yields, mm/N or rad/(N mm), (N, s), at q (N, n)."""
        numbers = self.numbers(slots)
        found = np.array(
            np.broadcast_to(numbers[..., self._compliance], (len(q), len(self._compliance)))
        )
        if self._growing:
            way = self.inner.drives(self.rigid(slots), q)
            for k, spring, place in self._growing:
                found[:, k] += numbers[..., place] * (way[:, spring.drive] - spring.at)
        return found

    def yielding_twists(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Twists of the platform by the numbers that yield, (N, 6, s), at poses under load."""
        inside = self.under_load(slots, pose, q)
        return self._of_springs(
            self.inner.error_jacobian(inside, pose, q, self._columns, twists=True)
        )

    def _of_springs(self, by_column: FloatArray) -> FloatArray:
        """Derivatives by the numbers that yield (…, s), from those by numbers that move (…, c)."""
        return by_column if self._moves is None else by_column @ self._moves.T

    def numbers(self, slots: FloatArray) -> FloatArray:
        """The numbers of `Elastic`, (k,) or (N, k)."""
        return slots[..., 0, self._width :]

    def _within(self, places: IntArray | Int32Array) -> Int32Array:
        """Return places of numbers in the geometry of the rigid machine."""
        if isinstance(self.inner, DrivenMachine):
            return np.asarray(places, dtype=np.int32)
        row, column = np.divmod(places, self._shape[1])
        return np.asarray(row * self._width + column, dtype=np.int32)

    def _given(self, slots: FloatArray, given: FloatArray) -> FloatArray:
        """Geometries of the machine within whose numbers gave (N, s), (N, …, …)."""
        rigid = self.rigid(slots)
        found = np.array(np.broadcast_to(rigid, (len(given), *rigid.shape[-2:])), order="C")
        flat = found.reshape(len(given), rigid.shape[-2] * rigid.shape[-1])
        flat[:, self._columns] += given if self._moves is None else given @ self._moves
        return found

    def _forces(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        inside: FloatArray,
        numbers: FloatArray,
        carried: FloatArray | None,
    ) -> FloatArray:
        twists = self.inner.error_jacobian(inside, pose, q, self._columns, twists=True)
        wrench = self.pulls.wrench(numbers, carried, pose, inside)
        found: FloatArray = (twists * wrench[:, :, None]).sum(axis=1)
        if self.pulls.elastic.rods or self.pulls.elastic.anchors:
            found += self._on_limbs(pose, q, inside, numbers)
        return self._of_springs(found)

    def _on_limbs(
        self, pose: FloatArray, q: FloatArray, inside: FloatArray, numbers: FloatArray
    ) -> FloatArray:
        """Return forces of weights on limbs on their own numbers, (N, c), the platform held."""
        assert isinstance(self.inner, Machine | DrivenMachine)
        limbs = inside.shape[-2]
        weights = np.broadcast_to(self.pulls.at_anchors(numbers, limbs), (len(pose), limbs, 3))
        found = self.inner.work_at_anchors(inside, q, weights, self._columns)
        joints = self.pulls.at_joints(numbers, pose, limbs)
        limb, slot = np.divmod(self._columns, inside.shape[-1])
        first = SLOTS.index("platform.x")
        for k in np.flatnonzero((slot >= first) & (slot < first + 3)).tolist():
            found[:, k] += joints[:, limb[k], slot[k] - first]
        return found

    def _at_rest(
        self, slots: FloatArray, pose: FloatArray, near: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Actuators (N, n) that hold poses (N, 6), and how far numbers give there (N, s)."""
        rigid, count = self.rigid(slots), len(pose)
        about = self.reference(slots) if near is None else near
        about = np.ascontiguousarray(np.broadcast_to(about, (count, self.actuators)))
        q = self.inner.inverse(rigid, pose, about)
        given = np.full((count, len(self._compliance)), np.nan)
        left = np.flatnonzero(np.isfinite(q).all(axis=1))
        given[left] = 0.0
        for _ in range(MOST_STEPS):
            if not len(left):
                break
            at, numbers, carried, rows = self._rows(slots, left)
            there = at._given(rows, given[left])
            force = at._forces(rows, pose[left], q[left], there, numbers, carried)
            fresh = at.compliances(rows, q[left]) * force
            settled = self._settled(fresh, given[left])
            given[left] = fresh
            left = left[~settled]
            if not len(left):
                break
            at, _, _, rows = self._rows(slots, left)
            q[left] = at.inner.inverse(at._given(rows, given[left]), pose[left], about[left])
            lost = ~np.isfinite(q[left]).all(axis=1) | self._too_far(given[left])
            q[left[lost]], given[left[lost]] = np.nan, np.nan
            left = left[~lost]
        q[left], given[left] = np.nan, np.nan
        return q, given

    def _rows(
        self: R, slots: FloatArray, rows: IntArray
    ) -> tuple[R, FloatArray, FloatArray | None, FloatArray]:
        """The machine, its numbers, what it carries and its geometry, for some rows of a call."""
        mine = slots[rows] if slots.ndim == 3 else slots
        at = self.of_rows(rows)
        return at, self.numbers(mine), at.carried, mine

    def of_rows(self: R, rows: IntArray) -> R:
        """Return the machine with its state in some rows of a call."""
        inner, carried = self.inner.of_rows(rows), self.carried
        if carried is not None and carried.ndim == 2:
            carried = carried[rows]
        return (
            self
            if inner is self.inner and carried is self.carried
            else self._with(inner=inner, carried=carried)
        )

    def _settled(self, fresh: FloatArray, before: FloatArray) -> BoolArray:
        """Mark rows where numbers stay, (N,)."""
        return np.asarray((np.abs(fresh - before) <= SETTLED * self._scale).all(axis=1))

    def _too_far(self, given: FloatArray) -> BoolArray:
        """Mark rows whose numbers give more than a deformation can, (N,)."""
        return np.asarray(~(np.abs(given) <= self._most).all(axis=1))

    def given_by_numbers(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        inside: FloatArray,
        places: IntArray,
    ) -> FloatArray:
        """Differentiate deflections (N, s, k) by numbers of `Elastic` at places (k,)."""
        numbers = self.numbers(slots)
        force = self._forces(slots, pose, q, inside, numbers, self.carried)
        compliance = self.compliances(slots, q)
        out = np.zeros((len(pose), len(self._compliance), len(places)))
        of_springs = {place: k for k, place in enumerate(self._compliance)}
        growing = {place: (k, spring) for k, spring, place in self._growing}
        for j, place in enumerate(places.tolist()):
            if place in of_springs:
                k = of_springs[place]
                out[:, k, j] = force[:, k]
            elif place in growing:
                k, spring = growing[place]
                way = self.inner.drives(self.rigid(slots), q)[:, spring.drive]
                out[:, k, j] = force[:, k] * (way - spring.at)
            else:
                out[..., j] = compliance * self._force_by(slots, pose, q, inside, place)
        return out

    def _force_by(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, inside: FloatArray, place: int
    ) -> FloatArray:
        """Derivative of the forces (N, s) by a number of what pulls, by central differences."""
        ends = []
        numbers = self.numbers(slots)
        step = _STEP * np.maximum(1.0, np.abs(numbers[..., place]).max())
        for sign in (1.0, -1.0):
            there = numbers.copy()
            there[..., place] += sign * step
            ends.append(self._forces(slots, pose, q, inside, there, self.carried))
        slope: FloatArray = (ends[0] - ends[1]) / (2.0 * step)
        return slope
