"""A machine whose drives have laws: the one place where readings become ways, and ways readings.

The machine within takes the ways as its actuator coordinates, one for each drive. Whatever calls a
machine sees readings alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.chains import AnyMachine, ChainMachine
from pkmcal.core.core_machine import CoreMachine, Found, known_rows, whole_turn, written
from pkmcal.core.drive_turns import agreed_turns
from pkmcal.core.laws import Drive, Laws, Ways
from pkmcal.core.machine import Closure, Machine
from pkmcal.exceptions import ArgumentError


class DrivenMachine(CoreMachine):
    """A machine with drive laws, with the calls of the machine within.

    Parameters
    ----------
    inner : Machine or ChainMachine
        Whose actuators are the drives, each for itself.
    drives : sequence of Drive
        In the order of the inner machine's actuators.
    shape : (int, int)
        Of a geometry: that of the inner machine with the numbers of the laws behind each row.
    width : int
        How many numbers of a row are the inner machine's.

    Attributes
    ----------
    approach : ndarray or None
        The direction that actuators come from, (n,) or a row for each row of a call (N, n): +1
        upwards, -1 downwards, 0 unknown, which is half way.
    tension : ndarray or None
        Of what actuators drive, likewise, N; None: 0.
    """

    def __init__(
        self, inner: AnyMachine, drives: Sequence[Drive], shape: tuple[int, int], width: int
    ) -> None:
        self.inner, self.laws = inner, Laws(drives, shape[0] * shape[1])
        self.isa = inner.isa
        self.actuators = 1 + int(self.laws.actuator.max())
        self.m, self.rows = inner.m, inner.rows
        self.approach: FloatArray | None = None
        self.tension: FloatArray | None = None
        self._wide, self._width = shape[1], width
        self._offsets = [self._within(drive.offset) for drive in drives]
        self._gains = [self._within(drive.gain) for drive in drives]
        driven: dict[int, list[int]] = {}
        for d, drive in enumerate(drives):
            driven.setdefault(drive.actuator, []).append(d)
        self._driven = [driven[a] for a in range(self.actuators)]

    @property
    def struct(self) -> Any:
        """C struct of the machine within."""
        return self.inner.struct

    def with_tolerance(self, closure_tolerance: float) -> DrivenMachine:
        """Return a copy of the machine with another `closure_tolerance`, mm."""
        return self._with(inner=self.inner.with_tolerance(closure_tolerance))

    def approaching(self, approach: FloatArray) -> DrivenMachine:
        """Return the machine for actuators that come from a direction, (n,) or (N, n)."""
        return self._with(approach=approach)

    def tensioned(self, tension: FloatArray) -> DrivenMachine:
        """Return the machine under tensions of what the actuators drive, (n,) or (N, n)."""
        return self._with(tension=tension)

    def of_rows(self, rows: IntArray) -> DrivenMachine:
        """Return the machine with its state in some rows of a call."""
        state = {"approach": self.approach, "tension": self.tension}
        batches = {name: each for name, each in state.items() if each is not None and each.ndim > 1}
        return self._with(**{name: each[rows] for name, each in batches.items()})

    def _with(self, **changed: object) -> DrivenMachine:
        other = copy(self)
        other.__dict__.update(changed)
        return other

    # readings and ways ----------------------------------------------------------------------------

    def ways(self, slots: FloatArray, q: FloatArray) -> Ways:
        """Ways (N, drives) at readings (N, n), with their derivatives."""
        return self.laws.ways(slots, q, *self._state(len(q)))

    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Ways (N, drives) at readings (N, n)."""
        return self.ways(slots, q).way

    @property
    def turning(self) -> BoolArray:
        """Mask of drives that are angles, (drives,)."""
        return np.array([drive.angle for drive in self.laws.drives])

    def drives_at(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Ways (N, drives) that poses (N, 6) ask of each drive by itself; any turn."""
        return self.inner.drives_at(self._bare(slots), pose)

    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Differentiate the drives by their actuators at readings (N, n), (N, drives)."""
        return self.ways(slots, q).slope

    def bare(self, slots: FloatArray, q: FloatArray) -> tuple[AnyMachine, FloatArray, FloatArray]:
        """The machine within, its geometry, and its actuators where the readings are q."""
        return self.inner, self._bare(slots), self.drives(slots, q)

    def _state(self, count: int) -> tuple[FloatArray | None, FloatArray | None]:
        """Approach and tension of each drive, as `Laws` takes them."""
        return self._of_drives("approach", count), self._of_drives("tension", count)

    def _of_drives(self, name: str, count: int) -> FloatArray | None:
        given: FloatArray | None = getattr(self, name)
        if given is None:
            return None
        if given.ndim == 2 and len(given) != count:
            raise ArgumentError(f"{name} is of {len(given)} rows, but {count} were asked for")
        return given[..., self.laws.actuator]

    def _bare(self, slots: FloatArray) -> FloatArray:
        """The geometry of the machine within: its gains are 1, its offsets 0."""
        bare: FloatArray = slots[..., : self._width].copy()
        flat = bare.reshape(-1, bare.shape[-1] * bare.shape[-2])
        flat[:, self._offsets], flat[:, self._gains] = 0.0, 1.0
        return bare

    def _within(self, place: int) -> int:
        """Return the place of a number in the geometry of the machine without laws."""
        row, column = divmod(place, self._wide)
        return row * self._width + column

    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Readings (N, n) of drives; of those that share an actuator the mean."""
        state = self._state(len(way))
        q = self.laws.readings(slots, way, *state)
        out = np.ascontiguousarray(q[:, [drives[0] for drives in self._driven]])
        if len(self._driven) == len(self.laws.drives):
            return out
        there = self.laws.ways(slots, out, *state).way  # of all that share, as the first has it
        with np.errstate(invalid="ignore"):  # ways that are infinite
            turned = way + 2 * np.pi * np.rint((there - way) / (2 * np.pi))
        readings = self.laws.readings(slots, np.where(self.turning, turned, way), *state)
        return np.ascontiguousarray(self._mean(readings))

    def _mean(self, each: FloatArray) -> FloatArray:
        """Average drives (N, drives, ...) that share an actuator, (N, n, ...)."""
        return np.stack([each[:, drives].mean(axis=1) for drives in self._driven], axis=1)

    def _sum(self, each: FloatArray) -> FloatArray:
        """Sum drives (..., drives) that share an actuator, (..., n)."""
        return np.stack([each[..., drives].sum(axis=-1) for drives in self._driven], axis=-1)

    # angles ---------------------------------------------------------------------------------------

    def turns(self, slots: FloatArray) -> FloatArray:
        """Return the way of each actuator in a whole turn, (n,); infinite where none is known."""
        out = np.full(self.actuators, np.inf)
        for a, drives in enumerate(self._driven):
            if all(self.laws.drives[d].angle for d in drives):
                turn = whole_turn(slots.flat[[self.laws.drives[d].gain for d in drives]])
                if all(self.laws.returns(slots, d, turn) for d in drives):
                    out[a] = turn
        return out

    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to; 0 where it is none."""
        near = np.where(self.turning, self.inner.reference(self._bare(slots)), np.nan)
        anyhow = self._with(approach=None, tension=None)  # whatever those of the rows are
        q: FloatArray = anyhow.at_drives(slots, near[None])[0]
        angle = np.array([self.laws.drives[drives[0]].angle for drives in self._driven])
        return np.where(angle, q, 0.0)

    def nearest_turns(
        self, slots: FloatArray, q: FloatArray, near: FloatArray | None = None
    ) -> FloatArray:
        """Coordinates (N, n) with whole turns of the drives added, as `inverse` gives them."""
        q = super().nearest_turns(slots, q, near)
        way = self.drives(slots, q)  # a turn of the drive is one, whatever q makes of it
        turned = self._turned(slots, way, near)
        first = [drives[0] for drives in self._driven]
        moved = np.isinf(self.turns(slots)) & (turned != way)[:, first]
        return np.where(moved, self.at_drives(slots, turned), q) if moved.any() else q

    def _turned(self, slots: FloatArray, way: FloatArray, near: FloatArray | None) -> FloatArray:
        """Ways (N, drives) at the turns nearest to coordinates that have readings."""
        about = self.laws.ways(
            slots, np.atleast_2d(self.reference(slots) if near is None else near)
        )
        chosen = [
            drives if self.laws.drives[drives[0]].angle and (near is not None or drives[1:]) else []
            for drives in self._driven
        ]
        return agreed_turns(self.laws, slots, chosen, way, about.way, self._state(len(way))[0])

    # kinematics: as `pkmcal.core.machine.Machine` -------------------------------------------------

    def inverse(
        self,
        slots: FloatArray,
        pose: FloatArray,
        near: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Poses (N, 6) to readings (N, n)."""
        way = self.inner.inverse(self._bare(slots), pose)
        return written(known_rows(self.at_drives(slots, self._turned(slots, way, near))), out)

    def forward(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        threads: int | None,
        shape: tuple[int, ...] | None = None,
        out: Found | None = None,
    ) -> Found:
        """Readings (N, n) to pose, status, iterations and residual."""
        way = self.drives(slots, q)
        return self.inner.forward(self._bare(slots), way, guess, threads, shape, out)

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m)."""
        slope = self.ways(slots, self.inverse(slots, pose)).slope
        by_free = self.inner.jacobian(self._bare(slots), pose) / slope[:, :, None]
        return self._mean(by_free)

    def forward_jacobian(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool = False
    ) -> FloatArray:
        """∂pose/∂q at poses (N, 6): (N, 6, n), or of the twist (ω, v) of the platform by them."""
        ways = self.ways(slots, q)
        by_way = self.inner.forward_jacobian(self._bare(slots), pose, ways.way, twists)
        return self._sum(by_way * ways.slope[:, None])

    def error_jacobian(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        columns: Int32Array,
        twists: bool = False,
    ) -> FloatArray:
        """∂pose/∂(numbers at `columns` of the flattened geometry): (N, 6, columns)."""
        bare, way = self._bare(slots), self.drives(slots, q)
        out = np.empty((len(pose), 6, len(columns)))
        own, of_laws, drive = self._sorted(columns)
        inner = np.array([self._within(int(columns[i])) for i in own], dtype=np.int32)
        out[..., own] = self.inner.error_jacobian(bare, pose, way, inner, twists)
        if len(of_laws):
            by_way = self.inner.forward_jacobian(bare, pose, way, twists)
            by_number = self._by_number(slots, q, columns[of_laws])
            out[..., of_laws] = by_way[..., drive] * by_number[:, None]
        return out

    def _sorted(self, columns: Int32Array) -> tuple[list[int], list[int], list[int]]:
        """Sort the columns into those of the inner machine and those of laws, with their drives."""
        drives = [self.laws.drive_of(column) for column in columns.tolist()]
        of_laws = [i for i, d in enumerate(drives) if d >= 0]
        own = [i for i, d in enumerate(drives) if d < 0]
        return own, of_laws, [drives[i] for i in of_laws]

    def _by_number(self, slots: FloatArray, q: FloatArray, columns: Int32Array) -> FloatArray:
        return self.laws.by_number(slots, q, columns.tolist(), *self._state(len(q)))

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> Closure:
        """The closure rows and their derivatives at poses (N, 6) and readings (N, n)."""
        ways = self.ways(slots, q)
        found = self.inner.closure(self._bare(slots), pose, ways.way)
        with np.errstate(invalid="ignore"):  # ways that are infinite
            by_q = self._sum(found.by_q * ways.slope[:, None])
        return found._replace(by_q=by_q)

    def rates(
        self, slots: FloatArray, motion: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, as `pkmcal.core.machine.Machine.rates`."""
        at = self.ways(slots, q)
        way1, way2 = self.inner.rates(self._bare(slots), motion, at.way)
        q1 = way1 / at.slope
        q2 = (way2 - at.bend * q1**2) / at.slope
        return self._mean(q1), self._mean(q2)

    def motion(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The platform's motion, as `pkmcal.core.machine.Machine.motion`."""
        at = self.ways(slots, q)
        of = self.laws.actuator
        way1 = at.slope * q1[:, of]
        way2 = at.slope * q2[:, of] + at.bend * q1[:, of] ** 2
        return self.inner.motion(self._bare(slots), pose, at.way, way1, way2)

    def closure_cost(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Sum of the squared closures over poses (M, 6) and readings (M, n), for N geometries."""
        costs = [
            self.inner.closure_cost(self._bare(each[None]), pose, self.drives(each, q))
            for each in slots
        ]
        return np.concatenate(costs)

    def frames(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Passive joints and frames, as `pkmcal.core.chains.ChainMachine.frames`."""
        assert isinstance(self.inner, ChainMachine)
        return self.inner.frames(self._bare(slots), pose, self.drives(slots, q))

    # limbs in closed form -------------------------------------------------------------------------

    @property
    def _of_limbs(self) -> Machine:
        assert isinstance(self.inner, Machine)
        return self.inner

    def readings(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Closures in units of what was read, as `pkmcal.core.machine.Machine.readings`."""
        inner, bare = self.inner, self._bare(slots)
        at = self.ways(slots, q)
        own, of_laws, drive = self._sorted(np.empty(0, np.int32) if columns is None else columns)
        wanted = None
        if columns is not None:
            wanted = np.array([self._within(int(columns[i])) for i in own], dtype=np.int32)
        residual, by_step, by_own = inner.readings(bare, pose, at.way, wanted)
        spheres = inner.reading_rows
        of = self.laws.actuator
        needed = self.laws.readings(slots, at.way + residual[:, spheres], *self._state(len(q)))
        reached = np.isfinite(needed)
        needed = np.where(reached, needed, q[:, of])
        slope, by_number = np.empty_like(needed), np.empty((len(q), len(of_laws)))
        for d in range(len(of)):  # each limb at the reading that it needs
            there = np.repeat(needed[:, d, None], self.actuators, axis=1)
            slope[:, d] = self.ways(slots, there).slope[:, d]
            mine = [i for i, each in enumerate(drive) if each == d]
            if mine and columns is not None:
                by_number[:, mine] = self._by_number(
                    slots, there, columns[[of_laws[i] for i in mine]]
                )
        residual[:, spheres] = np.where(reached, needed - q[:, of], residual[:, spheres] / slope)
        by_step[:, spheres] /= slope[:, :, None]
        if columns is None or by_own is None:
            return residual, by_step, None
        by_own[:, spheres] /= slope[:, :, None]
        out = np.zeros((*residual.shape, len(columns)))
        out[..., own] = by_own
        for i, d in enumerate(drive):
            out[:, spheres[d], of_laws[i]] = -by_number[:, i] / slope[:, d]
        return residual, by_step, out

    def ways_at(
        self, slots: FloatArray, pose: FloatArray, columns: Int32Array
    ) -> tuple[FloatArray, FloatArray]:
        """Differentiate drives by poses (N, 6), as `pkmcal.core.machine.Machine.ways_at`."""
        own, _, _ = self._sorted(columns)
        within = np.array([self._within(int(columns[i])) for i in own], dtype=np.int32)
        by_step, by_own = self._of_limbs.ways_at(self._bare(slots), pose, within)
        by_number = np.zeros((*by_own.shape[:2], len(columns)))
        by_number[:, :, own] = by_own
        return by_step, by_number

    def by_tension(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Return how much less limbs read at poses (N, 6) per N of tension, (N, drives)."""
        way, state = self._of_limbs.inverse(self._bare(slots), pose), self._state(len(pose))
        slope = self.laws.ways(slots, self.laws.readings(slots, way, *state), *state).slope
        return -self.laws.by_tension(slots, way, state[1]) / slope

    def work_at_anchors(
        self, slots: FloatArray, q: FloatArray, force: FloatArray, columns: Int32Array
    ) -> FloatArray:
        """Work of forces on anchors, as `pkmcal.core.machine.Machine.work_at_anchors`."""
        own, of_laws, drive = self._sorted(columns)
        within = [self._within(int(columns[i])) for i in own]
        ways = [self._offsets[d] for d in drive]  # the way within is there the offset
        asked = np.array(within + ways, dtype=np.int32)
        work = self._of_limbs.work_at_anchors(
            self._bare(slots), self.drives(slots, q), force, asked
        )
        out = np.empty((len(q), len(columns)))
        out[:, own] = work[:, : len(own)]
        if of_laws:
            out[:, of_laws] = work[:, len(own) :] * self._by_number(slots, q, columns[of_laws])
        return out

    def moved(self, pose: FloatArray, step: FloatArray) -> FloatArray:
        """Poses moved, as `pkmcal.core.machine.Machine.moved`."""
        return self.inner.moved(pose, step)

    def step_twists(self, pose: FloatArray) -> FloatArray:
        """Twists by a step, as `pkmcal.core.machine.Machine.step_twists`."""
        return self.inner.step_twists(pose)

    def spheres(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Return limbs' spheres at readings (N, n), as `pkmcal.core.machine.Machine.spheres`."""
        return self._of_limbs.spheres(self._bare(slots), self.drives(slots, q))

    def limbs(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Look at each limb at poses (N, 6), as `pkmcal.core.machine.Machine.limbs`."""
        return self._of_limbs.limbs(self._bare(slots), pose)

    def pulls(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Force by limbs that push with 1, as `pkmcal.core.machine.Machine.pulls`."""
        return self._of_limbs.pulls(self._bare(slots), pose)


CompiledMachine = AnyMachine | DrivenMachine
