"""The common part of machines of limbs and of chains in the core: rows, angles, threads."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, ClassVar, TypeVar

import numpy as np

from pkmcal._core import ffi
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.library import MAPS, call, in_threads, part

M = TypeVar("M", bound="CoreMachine")
_MOST_TURNS = 16  # of the first limb of an actuator, until the others have turned as well
_AT_ONCE = 500  # rows, where more would be copies of a long batch
_WHOLE = 5e-3  # of a turn: by so much gains that were identified differ from one another


def whole_turn(gains: FloatArray) -> float:
    """Return the way of an actuator until limbs with these gains are where they were, rad.

    Infinite where no such way is known.
    """
    turns = np.abs(gains / gains[0])[:, None] * np.arange(1, _MOST_TURNS + 1)  # limbs, of the first
    whole = (np.abs(turns - np.rint(turns)) <= _WHOLE).all(axis=0)
    if not whole.any():
        return np.inf
    return float((1 + int(np.argmax(whole))) * 2 * np.pi / abs(gains[0]))


Found = tuple[FloatArray, Int32Array, Int32Array, FloatArray]


def unwritten(n: int) -> Found:
    """Arrays for what `CoreMachine.forward` finds in n rows."""
    status, iterations = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    return np.empty((n, 6)), status, iterations, np.empty(n)


def known_rows(q: FloatArray) -> FloatArray:
    """Rows (N, n) of which nothing is known where one number is not; in place."""
    q[~np.isfinite(q).all(axis=1)] = np.nan
    return q


def written(values: FloatArray, out: FloatArray | None) -> FloatArray:
    """Values in the array `out`, if there is one."""
    if out is None:
        return values
    out[...] = values
    return out


class CoreMachine(ABC):
    """A machine in the core: its struct, and calls that differ in the name of the C call alone.

    Attributes
    ----------
    struct : cdata
        Of C.
    isa : int
        Index into `ISAS`.
    actuators : int
        Number of actuator coordinates, n.
    m : int
        Number of free coordinates.
    """

    _FORWARD: ClassVar[str]
    _ERRORS: ClassVar[str]
    struct: Any
    isa: int
    actuators: int
    m: int

    @property
    def _free(self) -> tuple[str, ...]:
        return MAPS[list(MAPS)[int(self.struct.map)]]

    @property
    def turns_freely(self) -> bool:
        """True if the pose map has every rotation, so that two triples of angles name each."""
        return {"alpha", "beta", "gamma"} <= set(self._free)

    def as_written(self, pose: FloatArray, rates: FloatArray, axis: int) -> FloatArray:
        """Derivatives of or by angles of poses (N, 6) as these write their rotations; in place.

        In the core cos β is not negative. A pose with β beyond ±90° is the same rotation as
        α + π, π - β, γ + π, and its β goes the other way. `axis` counts all six coordinates, or
        the free ones.
        """
        if self.turns_freely:
            place = 4 if rates.shape[axis] == 6 else self._free.index("beta")
            beta = np.moveaxis(rates, axis, -1)[..., place]
            with np.errstate(invalid="ignore"):  # infinite angles
                for start in range(0, len(pose), _AT_ONCE):
                    rows = slice(start, start + _AT_ONCE)
                    beta[rows][np.cos(pose[rows, 4]) < 0.0] *= -1.0
        return rates

    def with_tolerance(self: M, closure_tolerance: float) -> M:
        """Return a copy of the machine with another `closure_tolerance`, mm."""
        other = copy(self)
        other.struct = ffi.new(ffi.typeof(self.struct), self.struct[0])
        other.struct.closure_tolerance = closure_tolerance
        return other

    def approaching(self: M, approach: FloatArray) -> M:
        """Return the machine for actuators that come from a direction, (n,) or (N, n): itself."""
        return self

    def tensioned(self: M, tension: FloatArray) -> M:
        """Return the machine under tensions of actuators, (n,) or (N, n): itself, without laws."""
        return self

    def of_rows(self: M, rows: IntArray) -> M:
        """Return the machine with its state in some rows of a call: itself, without laws."""
        return self

    @abstractmethod
    def turns(self, slots: FloatArray) -> FloatArray:
        """Return the way of each actuator in a whole turn, (n,); infinite where it is no angle."""

    @abstractmethod
    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to; 0 where it is none."""

    @abstractmethod
    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """The ways q̃ of the drives at actuator coordinates (N, n), (N, drives)."""

    @property
    @abstractmethod
    def turning(self) -> BoolArray:
        """Mask of drives that are angles, (drives,)."""

    @abstractmethod
    def drives_at(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """The ways q̃ that poses (N, 6) ask of each drive by itself, (N, drives); any turn."""

    @abstractmethod
    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Differentiate the drives by their actuators at coordinates (N, n), (N, drives)."""

    @abstractmethod
    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Actuator coordinates (N, n) where the drives are at their ways (N, drives)."""

    def nearest_turns(
        self, slots: FloatArray, q: FloatArray, near: FloatArray | None = None
    ) -> FloatArray:
        """Coordinates (N, n) with whole turns added, as `inverse` gives them."""
        turns = self.turns(slots)
        angles = np.isfinite(turns)
        if not angles.any():
            return q
        about = self.reference(slots) if near is None else near
        out: FloatArray = q.copy()
        with np.errstate(invalid="ignore"):  # infinite coordinates are nowhere
            off, turn = q[:, angles] - about[..., angles], turns[angles]
            out[:, angles] -= turn * np.rint(off / turn)
        return out

    def forward(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        threads: int | None,
        shape: tuple[int, ...] | None = None,
        out: Found | None = None,
    ) -> Found:
        """Actuator coordinates (N, n) to pose, status, iterations and residual.

        `slots` is one geometry, (limbs, SLOTS) or (1, numbers) of chains, or one per row (N, …);
        `guess` (6,) or (N, 6). What is found has the leading `shape` of N rows, by default (N,),
        and is in the arrays of `out` (N, …), if there are any.
        """
        n, shape = len(q), (len(q),) if shape is None else shape
        pose, status, iterations, residual = unwritten(n) if out is None else out
        stride = slots.shape[1] * slots.shape[2] if slots.ndim == 3 else 0
        guess_stride = 6 if guess.ndim == 2 else 0

        def run(start: int, stop: int) -> None:
            if stop - start == n:  # one row as often as not: no slices
                whole = (n, slots, stride, q, guess, guess_stride, pose, status, iterations)
                return call(self._FORWARD, self.struct, *whole, residual, isa=self.isa)
            geometry = part(slots, start, stop) if stride else slots
            begin = part(guess, start, stop) if guess_stride else guess
            found = [part(each, start, stop) for each in (pose, status, iterations, residual)]
            given = (geometry, stride, part(q, start, stop), begin, guess_stride)
            call(self._FORWARD, self.struct, stop - start, *given, *found, isa=self.isa)

        in_threads(run, n, threads)
        if len(shape) == 1:
            return pose, status, iterations, residual
        return (
            pose.reshape(*shape, 6),
            status.reshape(shape),
            iterations.reshape(shape),
            residual.reshape(shape),
        )

    def forward_machines(self, slots: FloatArray, q: FloatArray, guess: FloatArray) -> FloatArray:
        """Poses (P, N, 6) of N machines at coordinates (P, n), from guesses (P, 6)."""
        found = np.empty((len(q), len(slots), 6))
        for poses, at, start in zip(found, q, guess, strict=True):
            each = np.repeat(at[None], len(slots), axis=0)
            poses[:] = self.forward(slots, each, start, threads=1)[0]
        return found

    def error_jacobian(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        columns: Int32Array,
        twists: bool = False,
    ) -> FloatArray:
        """∂pose/∂(numbers at `columns` of the flattened geometry): (N, 6, columns).

        Or of the twist (ω, v) of the platform by them.
        """
        out = np.empty((len(pose), 6, len(columns)))
        stride = slots.shape[1] * slots.shape[2] if slots.ndim == 3 else 0
        given = (len(pose), slots, stride, pose, q, columns, len(columns), twists)
        call(self._ERRORS, self.struct, *given, out, isa=self.isa)
        return out if twists else self.as_written(pose, out, 1)

    def moved(self, pose: FloatArray, step: FloatArray) -> FloatArray:
        """Poses (N, 6) moved by steps of the map (N, m), mm and rad."""
        moved = np.empty((len(pose), 6))
        call("moved", self.struct.map, len(pose), pose, step, moved, None, isa=self.isa)
        return moved

    def step_twists(self, pose: FloatArray) -> FloatArray:
        """The platform's twist (ω, v) by a step of the map at poses (N, 6), (N, 6, m)."""
        n, m = len(pose), self.m
        twist = np.empty((n, 6, m))
        given = (pose, np.zeros((n, m)), np.empty((n, 6)))
        call("moved", self.struct.map, n, *given, twist, isa=self.isa)
        return twist
