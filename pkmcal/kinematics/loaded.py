"""A machine that yields, with the calls of a rigid machine.

At a pose the numbers that gave way follow at once (`resting`), so that the inverse needs no search;
forward kinematics goes through them until they stay.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.chains import AnyMachine
from pkmcal.core.core_machine import Found, unwritten, written
from pkmcal.core.driven import CompiledMachine, DrivenMachine
from pkmcal.core.library import DRIVERS, GIVES_WAY, NOT_CONVERGED
from pkmcal.core.machine import Closure, Machine, Yielding
from pkmcal.core.path_differences import actuator_rates, platform_motion
from pkmcal.core.poses import rates_of_twists
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.resting import MOST_STEPS, SETTLED, RestingMachine

# Drivers of the core by which no anchor moves.
_UNMOVED = {kind.driver.core for kind in KINDS.values() if not kind.driver.carries}


class LoadedMachine(RestingMachine):
    """A machine that yields, with the calls of the rigid machine within.

    Derivatives are those of the rigid machine with the numbers that it has under its load. Numbers
    and poses give way a little as well when these change, which they leave out: of their size it is
    the part that the sag is of the machine's.
    """

    @cached_property
    def _compiled(self) -> bool:
        """True if the core computes it: loads at the platform alone, weights and forces."""
        elastic = self.pulls.elastic
        if type(self.inner) is not Machine or elastic.balancers or elastic.anchors:
            return False
        if self._moves is not None:
            return False
        angles = any(spring.unit == "rad" for spring in elastic.springs)
        drivers = [DRIVERS[driver] for driver in self.struct.driver[0 : self.struct.limbs]]
        offsets = all(spring.of_drive for spring in elastic.springs)
        legs = offsets and not angles and _UNMOVED.issuperset(drivers)
        return legs or not elastic.rods  # halves of legs at base points do not move with offsets

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
            SETTLED * self._scale,
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
        given = np.zeros((len(left), len(self._compliance)))
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
        twists = self._of_springs(
            self.inner.error_jacobian(inside, pose, q, self._columns, twists=True)
        )
        by_force = self.given_by_numbers(slots, pose, q, inside, places)
        return np.asarray(np.einsum("nis,nsk->nik", twists, by_force))

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
            by_column = by_number[..., np.searchsorted(asked, self._columns)]
            out[..., others] = self._of_springs(by_column) @ given
        return residual, by_step, out

    @property
    def reading_rows(self) -> IntArray:
        """Row of `readings` for each coordinate."""
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
        """The ways q̃ (N, drives) that poses (N, 6) ask of the drives under the load; any turn.

        Of what is commanded, as `drives` and `at_drives` are: what gives way is no way of a drive.
        """
        return self.drives(slots, self.inverse(slots, pose))

    # what the load does not change ----------------------------------------------------------------

    def bare(self, slots: FloatArray, q: FloatArray) -> tuple[AnyMachine, FloatArray, FloatArray]:
        """The machine without drive laws and load, its geometry, its coordinates at q (N, n)."""
        return self.inner.bare(self.rigid(slots), q)

    def turns(self, slots: FloatArray) -> FloatArray:
        """Return the way of each actuator in a whole turn, (n,); infinite where it is no angle."""
        return self.inner.turns(self.rigid(slots))

    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to; 0 where it is none."""
        return self.inner.reference(self.rigid(slots))

    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """The ways q̃ of the drives at actuator coordinates (N, n), (N, drives)."""
        return self.inner.drives(self.rigid(slots), q)

    @property
    def turning(self) -> BoolArray:
        """Mask of drives that are angles, (drives,)."""
        return self.inner.turning

    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Differentiate the drives by their actuators at coordinates (N, n), (N, drives)."""
        return self.inner.slopes(self.rigid(slots), q)

    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Actuator coordinates (N, n) where the drives are at their ways (N, drives)."""
        return self.inner.at_drives(self.rigid(slots), way)

    def spheres(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Return limbs' spheres at coordinates (N, n), as `pkmcal.core.machine.Machine.spheres`."""
        assert isinstance(self.inner, Machine | DrivenMachine)
        return self.inner.spheres(self.rigid(slots), q)


AnyCompiled = CompiledMachine | LoadedMachine
