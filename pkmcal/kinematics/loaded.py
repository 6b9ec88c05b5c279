"""A machine that yields: the rigid one with other numbers, by what pulls at it.

A compliance c belongs to a number e of the geometry. What pulls does Q = Tᵀw on it at held
actuators, T the twist of the platform by e and w the wrench on it, and e is c Q more: the loaded
machine is the rigid one with these numbers. At a pose they follow at once, so that the inverse
needs no search; forward kinematics goes through them until they stay.
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.chains import AnyMachine
from pkmcal.core.core_machine import CoreMachine, Found, unwritten, written
from pkmcal.core.driven import CompiledMachine, DrivenMachine
from pkmcal.core.library import DRIVERS, GIVES_WAY, NOT_CONVERGED, SLOTS
from pkmcal.core.machine import Closure, Machine, Yielding
from pkmcal.core.path_differences import actuator_rates, platform_motion
from pkmcal.core.poses import rates_of_twists
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.pulls import Pulls

MOST_STEPS = 40  # a load that has not come to rest by then is not held
_SETTLED = 1e-14  # of the size, or rad: numbers that stay
_MOST_LENGTH, _MOST_ANGLE = 1e-2, 0.1  # of the size, and rad, that a number may give
_STEP = 1e-4  # of differences by numbers of the load, which forces follow almost linearly


class LoadedMachine(CoreMachine):
    """A machine that yields, with the calls of the rigid machine within.

    Derivatives are those of the rigid machine with the numbers that it has under its load. Numbers
    and poses give way a little as well when these change, which they leave out: of their size it is
    the part that the sag is of the machine's.

    Parameters
    ----------
    inner : Machine, ChainMachine or DrivenMachine
        Without what yields.
    pulls : Pulls
        What pulls at it.
    places : ndarray of int (s,)
        Where the numbers that yield are in the flattened numbers of a geometry, rising.
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
        angles = np.array([spring.unit == "rad" for spring in springs])
        size = float(inner.struct.size)
        self._scale = np.where(angles, 1.0, size)
        self._most = np.where(angles, _MOST_ANGLE, _MOST_LENGTH * size)
        self._compliance = [pulls.place(COMPLIANCE + spring.number) for spring in springs]
        self._compiled = self._is_compiled(angles)
        self._growing = [
            (k, spring, pulls.place(COMPLIANCE + spring.number + PER_LENGTH))
            for k, spring in enumerate(springs)
            if spring.drive >= 0
        ]

    def _is_compiled(self, angles: BoolArray) -> bool:
        """Whether the core has it: nothing pulls but at the platform, by weights and forces."""
        elastic = self.pulls.elastic
        if type(self.inner) is not Machine or elastic.balancers or elastic.anchors:
            return False
        drivers = [DRIVERS[driver] for driver in self.struct.driver[0 : self.struct.limbs]]
        offsets = all(spring.number.startswith("offset") for spring in elastic.springs)
        legs = offsets and not angles.any() and set(drivers) == {"length"}
        return legs or not elastic.rods  # halves of legs at base points do not move with offsets

    @property
    def struct(self) -> Any:
        """Of C, of the machine within."""
        return self.inner.struct

    def with_tolerance(self, closure_tolerance: float) -> LoadedMachine:
        """The same with another `closure_tolerance`, mm."""
        return self._with(inner=self.inner.with_tolerance(closure_tolerance))

    def approaching(self, approach: FloatArray) -> LoadedMachine:
        """The same with actuators that come from a direction, (n,) or (N, n)."""
        return self._with(inner=self.inner.approaching(approach))

    def tensioned(self, tension: FloatArray) -> LoadedMachine:
        """The same with tensions of what actuators drive, (n,) or (N, n)."""
        return self._with(inner=self.inner.tensioned(tension))

    def carrying(self, carried: FloatArray) -> LoadedMachine:
        """The same with what it carries, (10,) or (N, 10)."""
        return self._with(carried=carried)

    def _with(self, **changed: object) -> LoadedMachine:
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
        """What pulls at each number that yields, N or N mm, (N, s), at poses (N, 6)."""
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
        return self.inner.error_jacobian(inside, pose, q, self._columns, twists=True)

    def numbers(self, slots: FloatArray) -> FloatArray:
        """The numbers of `Elastic`, (k,) or (N, k)."""
        return slots[..., 0, self._width :]

    def _within(self, places: IntArray | Int32Array) -> Int32Array:
        """Places of numbers of the machine within in its own geometry."""
        if isinstance(self.inner, DrivenMachine):
            return np.asarray(places, dtype=np.int32)
        row, column = np.divmod(places, self._shape[1])
        return np.asarray(row * self._width + column, dtype=np.int32)

    def _given(self, slots: FloatArray, given: FloatArray) -> FloatArray:
        """Geometries of the machine within whose numbers gave (N, s), (N, …, …)."""
        rigid = self.rigid(slots)
        found = np.array(np.broadcast_to(rigid, (len(given), *rigid.shape[-2:])), order="C")
        flat = found.reshape(len(given), rigid.shape[-2] * rigid.shape[-1])
        flat[:, self._columns] += given
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
        return found

    def _on_limbs(
        self, pose: FloatArray, q: FloatArray, inside: FloatArray, numbers: FloatArray
    ) -> FloatArray:
        """What weights on limbs do on their own numbers, (N, s), the platform held."""
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
        given = np.full((count, len(self._columns)), np.nan)
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
        self, slots: FloatArray, rows: IntArray
    ) -> tuple[LoadedMachine, FloatArray, FloatArray | None, FloatArray]:
        """The machine, its numbers, what it carries and its geometry, for some rows of a call."""
        mine = slots[rows] if slots.ndim == 3 else slots
        at = self.of_rows(rows)
        return at, self.numbers(mine), at.carried, mine

    def of_rows(self, rows: IntArray) -> LoadedMachine:
        """The same with the state that it has in some rows of a call."""
        inner, carried = self.inner.of_rows(rows), self.carried
        if carried is not None and carried.ndim == 2:
            carried = carried[rows]
        return (
            self
            if inner is self.inner and carried is self.carried
            else self._with(inner=inner, carried=carried)
        )

    def _settled(self, fresh: FloatArray, before: FloatArray) -> BoolArray:
        """Where numbers stay, (N,)."""
        return np.asarray((np.abs(fresh - before) <= _SETTLED * self._scale).all(axis=1))

    def _too_far(self, given: FloatArray) -> BoolArray:
        """Where numbers give more than what is a deformation, (N,)."""
        return np.asarray(~(np.abs(given) <= self._most).all(axis=1))

    # kinematics: as `pkmcal.core.machine.Machine` -------------------------------------------------

    def inverse(
        self,
        slots: FloatArray,
        pose: FloatArray,
        near: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Poses (N, 6) to actuator coordinates (N, n); NaN also where the machine gives way."""
        self._check(len(pose))
        return written(self._at_rest(slots, pose, near)[0], out)

    def forward(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        threads: int | None,
        shape: tuple[int, ...] | None = None,
        out: Found | None = None,
    ) -> Found:
        """Actuator coordinates (N, n) to pose, status, iterations and residual."""
        self._check(len(q))
        found = unwritten(len(q)) if out is None else out
        if self._compiled and slots.ndim == 2:
            self._forward_compiled(slots, q, guess, threads, found)
        else:
            self.inner.forward(self.rigid(slots), q, guess, threads, None, found)
            self._settle(slots, q, np.flatnonzero(found[1] == 0), threads, found)
        if shape is None or len(shape) == 1:
            return found
        pose, status, iterations, residual = found
        shaped = pose.reshape(*shape, 6), status.reshape(shape), iterations.reshape(shape)
        return *shaped, residual.reshape(shape)

    def _forward_compiled(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        threads: int | None,
        found: Found,
    ) -> None:
        """`forward` by the core, and row by row of what it does not settle."""
        assert isinstance(self.inner, Machine)
        rigid, numbers = self.rigid(slots), self.numbers(slots)
        compliance = numbers[self._compliance]
        if self._growing:
            compliance = self.compliances(slots, q)
        yielding = Yielding(
            self._columns,
            np.ascontiguousarray(compliance),
            np.ascontiguousarray(self.pulls.summed(numbers, self.carried, rigid)),
            _SETTLED * self._scale,
            self._most,
            MOST_STEPS,
        )
        self.inner.forward_loaded(rigid, q, guess, yielding, threads, found)
        left = np.flatnonzero(found[1] == NOT_CONVERGED)
        if not len(left):
            return
        begin = guess if guess.ndim == 1 else np.ascontiguousarray(guess[left])
        again = self.inner.forward(rigid, np.ascontiguousarray(q[left]), begin, threads)
        pose, status, iterations, residual = found
        pose[left], status[left], iterations[left], residual[left] = again
        self._settle(slots, q, left[again[1] == 0], threads, found)

    def _settle(
        self, slots: FloatArray, q: FloatArray, left: IntArray, threads: int | None, found: Found
    ) -> None:
        """Go from rigid poses of some rows to where the numbers that yield stay; in place."""
        pose, status, iterations, residual = found
        given = np.zeros((len(left), len(self._columns)))
        for _ in range(MOST_STEPS):
            if not len(left):
                break
            at, numbers, carried, rows = self._rows(slots, left)
            there, mine = at._given(rows, given), np.ascontiguousarray(q[left])
            force = at._forces(rows, pose[left], mine, there, numbers, carried)
            fresh = at.compliances(rows, mine) * force
            going = ~self._settled(fresh, given)
            lost = going & self._too_far(fresh)
            status[left[lost]] = GIVES_WAY
            going &= ~lost
            left, given = left[going], fresh[going]
            if not len(left):
                break
            at, _, _, rows = self._rows(slots, left)
            again = at.inner.forward(
                at._given(rows, given), np.ascontiguousarray(q[left]), pose[left], threads
            )
            pose[left], _, steps, residual[left] = again
            iterations[left] += steps
            held = again[1] == 0
            status[left[~held]] = GIVES_WAY
            left, given = left[held], given[held]
        status[left] = GIVES_WAY
        failed = status == GIVES_WAY
        pose[failed], residual[failed] = np.nan, np.nan

    def _check(self, rows: int) -> None:
        if self.carried is not None and self.carried.ndim == 2 and len(self.carried) != rows:
            raise ArgumentError(f"load is of {len(self.carried)} rows, but {rows} were asked for")

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m)."""
        return self.inner.jacobian(self.under_load(slots, pose), pose)

    def forward_jacobian(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool = False
    ) -> FloatArray:
        """∂pose/∂q at poses (N, 6): (N, 6, n), or of the twist (ω, v) of the platform by them."""
        return self.inner.forward_jacobian(self.under_load(slots, pose, q), pose, q, twists)

    def error_jacobian(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        columns: Int32Array,
        twists: bool = False,
    ) -> FloatArray:
        """∂pose/∂(numbers at `columns` of the flattened geometry): (N, 6, columns)."""
        inside = self.under_load(slots, pose, q)
        column = columns % self._shape[1]
        own = np.flatnonzero(column < self._width)
        out = np.empty((len(pose), 6, len(columns)))
        out[..., own] = self.inner.error_jacobian(
            inside, pose, q, self._within(columns[own]), twists
        )
        others = np.flatnonzero(column >= self._width)
        if len(others):
            numbers = (column[others] - self._width).astype(np.intp)
            moved = self._by_numbers(slots, pose, q, inside, numbers)
            out[..., others] = moved if twists else rates_of_twists(pose, moved)
        return out

    def _by_numbers(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        inside: FloatArray,
        places: IntArray,
    ) -> FloatArray:
        """Twists (N, 6, k) by numbers of `Elastic` at places (k,)."""
        twists = self.inner.error_jacobian(inside, pose, q, self._columns, twists=True)
        by_force = self.given_by_numbers(slots, pose, q, inside, places)
        return np.asarray(np.einsum("nis,nsk->nik", twists, by_force))

    def given_by_numbers(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        inside: FloatArray,
        places: IntArray,
    ) -> FloatArray:
        """How far numbers give more, (N, s, k), by numbers of `Elastic` at places (k,)."""
        numbers = self.numbers(slots)
        force = self._forces(slots, pose, q, inside, numbers, self.carried)
        compliance = self.compliances(slots, q)
        out = np.zeros((len(pose), len(self._columns), len(places)))
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

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> Closure:
        """The closure rows and their derivatives at poses (N, 6) and coordinates (N, n)."""
        return self.inner.closure(self.under_load(slots, pose, q), pose, q)

    def readings(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Closures in units of what was read, as `pkmcal.core.machine.Machine.readings`."""
        inside = self.under_load(slots, pose, q)
        if columns is None:
            return self.inner.readings(inside, pose, q)
        column = columns % self._shape[1]
        own, others = np.flatnonzero(column < self._width), np.flatnonzero(column >= self._width)
        asked = np.union1d(self._within(columns[own]), self._columns).astype(np.int32)
        residual, by_step, by_number = self.inner.readings(inside, pose, q, asked)
        assert by_number is not None
        out = np.empty((*residual.shape, len(columns)))
        out[..., own] = by_number[..., np.searchsorted(asked, self._within(columns[own]))]
        if len(others):
            places = (column[others] - self._width).astype(np.intp)
            given = self.given_by_numbers(slots, pose, q, inside, places)
            by_spring = by_number[..., np.searchsorted(asked, self._columns)]
            out[..., others] = by_spring @ given
        return residual, by_step, out

    @property
    def reading_rows(self) -> IntArray:
        """Which row of `readings` is that of each coordinate."""
        within = self.inner.inner if isinstance(self.inner, DrivenMachine) else self.inner
        return within.reading_rows

    def rates(
        self, slots: FloatArray, motion: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, as `pkmcal.core.machine.Machine.rates`."""

        def inverse(pose: FloatArray) -> FloatArray:
            return self.inverse(slots, pose, q)

        return actuator_rates(inverse, self.turns(slots), float(self.struct.size), motion)

    def motion(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The platform's motion, as `pkmcal.core.machine.Machine.motion`."""

        def forward(at: FloatArray) -> FloatArray:
            return self.forward(slots, at, pose, threads=None)[0]

        scale = np.where(np.isfinite(self.turns(slots)), 1.0, 1.0 / float(self.struct.size))
        return platform_motion(forward, pose, q, q1, q2, scale)

    def closure_cost(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Sum of the squared closures over poses (M, 6) and q (M, n), for N geometries."""
        costs = [(self.closure(each, pose, q).residual ** 2).sum() for each in slots]
        return np.array(costs)

    def limbs(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Look at each limb at poses (N, 6), as `pkmcal.core.machine.Machine.limbs`."""
        assert isinstance(self.inner, Machine | DrivenMachine)
        return self.inner.limbs(self.under_load(slots, pose), pose)

    def drives_at(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """The ways q̃ (N, drives) that poses (N, 6) ask of each drive by itself; any turn."""
        return self.inner.drives_at(self.under_load(slots, pose), pose)

    # what the load does not change ----------------------------------------------------------------

    def bare(self, slots: FloatArray, q: FloatArray) -> tuple[AnyMachine, FloatArray, FloatArray]:
        """The machine without drive laws and load, its geometry, its coordinates at q (N, n)."""
        return self.inner.bare(self.rigid(slots), q)

    def turns(self, slots: FloatArray) -> FloatArray:
        """How far each actuator goes in a whole turn, (n,); infinite where it is no angle."""
        return self.inner.turns(self.rigid(slots))

    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to; 0 where it is none."""
        return self.inner.reference(self.rigid(slots))

    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """The ways q̃ of the drives at actuator coordinates (N, n), (N, drives)."""
        return self.inner.drives(self.rigid(slots), q)

    @property
    def turning(self) -> BoolArray:
        """Which drives are angles, (drives,)."""
        return self.inner.turning

    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """How far the drives go by their actuators at coordinates (N, n), (N, drives)."""
        return self.inner.slopes(self.rigid(slots), q)

    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Actuator coordinates (N, n) where the drives are at their ways (N, drives)."""
        return self.inner.at_drives(self.rigid(slots), way)

    def spheres(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """What the limbs are at coordinates (N, n), as `pkmcal.core.machine.Machine.spheres`."""
        assert isinstance(self.inner, Machine | DrivenMachine)
        return self.inner.spheres(self.rigid(slots), q)


AnyCompiled = CompiledMachine | LoadedMachine
