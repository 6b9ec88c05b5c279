"""A machine in the compiled core: its kinematics of rows of poses and actuator coordinates."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pkmcal._core import ffi, lib
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core import balance
from pkmcal.core.core_machine import CoreMachine, Found, whole_turn
from pkmcal.core.library import (
    AXES,
    DRIVERS,
    ISA,
    MAPS,
    ROWS,
    SLOTS,
    call,
    ensure,
    in_threads,
    part,
    pointer,
    rows,
)
from pkmcal.core.path_differences import platform_motion
from pkmcal.core.poses import rates_of_twists

CLOSURE_TOLERANCE = 2e-3  # of a machine's size
FAR_HOME = 10.0  # times the limbs' numbers: a home beyond is that of another geometry
_MET = 1e-12  # of the size: closures that are met to rounding
_OFFSET, _GAIN = SLOTS.index("offset"), SLOTS.index("gain")


class Closure(NamedTuple):
    """Closure rows of N poses, limb by limb and the sphere row first.

    Attributes
    ----------
    residual : ndarray (N, rows)
        mm.
    by_step : ndarray (N, rows, m)
        By the map's step, with an angle as its arc at the characteristic length.
    by_free : ndarray (N, rows, m)
        By the free coordinates, mm and rad.
    by_q : ndarray (N, rows, n)
        By the actuator coordinates.
    pose : ndarray (N, 6)
        As the pose map has it: what it does not move follows from the free coordinates.
    pose_by_free : ndarray (N, 6, m)
        Its derivatives by the free coordinates.
    """

    residual: FloatArray
    by_step: FloatArray
    by_free: FloatArray
    by_q: FloatArray
    pose: FloatArray
    pose_by_free: FloatArray


class Yielding(NamedTuple):
    """Compliances of a machine and the loads at its platform, for `Machine.forward_loaded`.

    Attributes
    ----------
    columns : ndarray of int (s,)
        Places of the numbers that yield in the flattened geometry, rising.
    compliance : ndarray (s,) or (N, s)
        mm/N, rad/(N mm).
    pull : ndarray (16,) or (N, 16)
        Σ m r [kg mm], Σ m [kg], gravity [N/kg], a point [mm], the force there [N], a moment
        [N mm]: points in the platform's axes, the rest in the base's.
    settled, most : ndarray (s,)
        By how much a number that rests changes at most, and how far one may give.
    steps : int
        At most.
    """

    columns: Int32Array
    compliance: FloatArray
    pull: FloatArray
    settled: FloatArray
    most: FloatArray
    steps: int


class Machine(CoreMachine):
    """A machine of limbs in the core: what of a robot does not change with its geometry.

    Parameters
    ----------
    map : str
        A key of `MAPS`.
    limbs : list of dict
        Of each limb: driver, rows (names), actuator, branch, frames (3, 3) by axis, lever,
        weights of the sphere row and the other rows; `angle`, whether its q̃ is one, and `near`,
        the q̃ in the middle of its stroke, or NaN.
    length : float
        Characteristic length, mm.
    slots, home : ndarray
        Geometry (limbs, SLOTS) and pose (6,) at which the order of elimination is chosen.
    closure_tolerance : float
        What more rows than free coordinates may miss, mm; by default `CLOSURE_TOLERANCE` of the
        size.
    isa : int
        Index into `ISAS`.

    A geometry is (limbs, SLOTS), or (N, limbs, SLOTS) with one for each row of a call.
    """

    _FORWARD, _ERRORS = "forward", "error_jacobian"
    fixed_spheres = True  # the actuators say where anchors are and how long, whatever the pose

    def __init__(
        self,
        map: str,
        limbs: list[dict[str, Any]],
        length: float,
        slots: FloatArray,
        home: FloatArray,
        closure_tolerance: float | None = None,
        isa: int = ISA,
    ) -> None:
        struct = ffi.new("pkm_machine *")
        struct.map = list(MAPS).index(map)
        struct.limbs = len(limbs)
        struct.actuators = 1 + max(limb["actuator"] for limb in limbs)
        struct.length = length
        joints = float(np.abs(slots).sum(axis=1).max())
        struct.size = joints + min(float(np.abs(home[:3]).sum()), FAR_HOME * joints)
        if closure_tolerance is None:
            closure_tolerance = CLOSURE_TOLERANCE * struct.size
        struct.closure_tolerance = closure_tolerance
        weights: list[float] = []
        for i, limb in enumerate(limbs):
            struct.driver[i] = DRIVERS.index(limb["driver"])
            struct.rows[i] = sum(1 << list(ROWS).index(row) for row in limb["rows"])
            struct.actuator[i] = limb["actuator"]
            struct.branch[i] = limb["branch"]
            struct.lever[i] = limb["lever"]
            struct.angle[i] = limb["angle"]
            struct.near[i] = limb["near"]
            for axis, frame in limb["frames"].items():
                place = 9 * (len(AXES) * i + list(AXES).index(axis))
                struct.frame[place : place + 9] = frame.ravel().tolist()
            weights += limb["weights"]
        for r, weight in enumerate(weights):
            struct.weight[r] = weight
        ensure(lib.pkm_prepare(struct, pointer(slots), pointer(home)))
        self.struct = struct
        self.isa = isa
        self.actuators: int = struct.actuators
        self.m = len(MAPS[map])
        self.rows = len(weights)
        driven: dict[int, list[int]] = {}
        for i, limb in enumerate(limbs):
            driven.setdefault(limb["actuator"], []).append(i)
        self._angles = {a: each for a, each in driven.items() if limbs[each[0]]["angle"]}

    def inverse(
        self,
        slots: FloatArray,
        pose: FloatArray,
        near: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Poses (N, 6) to actuator coordinates (N, n), in the array `out` if there is one.

        Of angles, the turn nearest to `near` (n,) or (N, n), or to the machine's own reference:
        the middle of the stroke, or the home pose.
        """
        q = np.empty((len(pose), self.actuators)) if out is None else out
        stride = self.actuators if near is not None and near.ndim == 2 else 0
        given = (len(pose), slots, _by_row(slots), pose, near, stride, q)
        call("inverse", self.struct, *given, isa=self.isa)
        return q

    def turns(self, slots: FloatArray) -> FloatArray:
        """Return the way of each actuator until all its limbs are where they were, (n,).

        Infinite where it is no angle, or no such way is known.
        """
        out = np.full(self.actuators, np.inf)
        for a, limbs in self._angles.items():
            if all(self.struct.angle[i] for i in limbs):
                out[a] = whole_turn(slots[limbs, _GAIN])
        return out

    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to; 0 where it is none."""
        out = np.zeros(self.actuators)
        for a, (i, *_) in self._angles.items():
            out[a] = (self.struct.near[i] - slots[i, _OFFSET]) / slots[i, _GAIN]
        return out

    def bare(self, slots: FloatArray, q: FloatArray) -> tuple[Machine, FloatArray, FloatArray]:
        """The machine without drive laws, its geometry, and its coordinates at q (N, n)."""
        return self, slots, q

    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """q̃ of each limb (N, limbs) at actuator coordinates (N, n)."""
        of_limbs = list(self.struct.actuator[0 : self.struct.limbs])
        with np.errstate(over="ignore"):  # beyond all numbers: infinite
            found: FloatArray = slots[:, _GAIN] * q[:, of_limbs] + slots[:, _OFFSET]
        return found

    @property
    def turning(self) -> BoolArray:
        """Mask of drives that are angles, (limbs,)."""
        return np.array(list(self.struct.angle[0 : self.struct.limbs]), dtype=bool)

    def drives_at(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """q̃ (N, limbs) that poses (N, 6) ask of each limb by itself; any turn."""
        return self.limbs(slots, pose)[0]

    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """The gain of each limb, (N, limbs)."""
        return np.tile(slots[:, _GAIN], (len(q), 1))

    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Actuator coordinates (N, n) of q̃ (N, limbs); of limbs that share one the mean."""
        q = (way - slots[:, _OFFSET]) / slots[:, _GAIN]
        of_limbs = np.array(list(self.struct.actuator[0 : self.struct.limbs]))
        each = [q[:, of_limbs == a].mean(axis=1) for a in range(self.actuators)]
        return np.stack(each, axis=1)

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m)."""
        out = np.empty((len(pose), self.actuators, self.m))
        call("jacobian", self.struct, len(pose), slots, _by_row(slots), pose, out, isa=self.isa)
        return self.as_written(pose, out, 2)

    def forward_machines(self, slots: FloatArray, q: FloatArray, guess: FloatArray) -> FloatArray:
        """Poses (P, N, 6) of N machines at coordinates (P, n), from guesses (P, 6)."""
        shape = len(q), len(slots)
        pose, residual = np.empty((*shape, 6)), np.empty(shape)
        status, iterations = np.empty((2, *shape), dtype=np.int32)
        given = (shape[1], slots, shape[0], q, guess, pose, status, iterations, residual)
        call("forward_machines", self.struct, *given, isa=self.isa)
        return pose

    def forward_loaded(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        yielding: Yielding,
        threads: int | None,
        out: Found,
    ) -> None:
        """`forward` of a machine with as many rows as free coordinates in which numbers yield.

        Rows whose numbers do not come to rest by steps of this kind are "not converged", and
        their poses mean nothing.
        """
        n, found = len(q), out
        guess_stride = 6 if guess.ndim == 2 else 0
        places = yielding.columns, len(yielding.columns)
        of_rows = [
            (each, each.shape[1] if each.ndim == 2 else 0)
            for each in (yielding.compliance, yielding.pull)
        ]
        ends = yielding.settled, yielding.most, yielding.steps

        def run(start: int, stop: int) -> None:
            begin = part(guess, start, stop) if guess_stride else guess
            each = [
                (part(array, start, stop) if stride else array, stride) for array, stride in of_rows
            ]
            given = (stop - start, slots, part(q, start, stop), begin, guess_stride)
            written = [part(array, start, stop) for array in found]
            arguments = (*given, *places, *each[0], *each[1], *ends, *written)
            call("forward_loaded", self.struct, *arguments, isa=self.isa)

        in_threads(run, n, threads)

    def forward_jacobian(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool = False
    ) -> FloatArray:
        """∂pose/∂q at poses (N, 6): (N, 6, n), or of the twist (ω, v) of the platform by them."""
        if self.rows == self.m:
            return self._by_actuators(slots, pose, q, twists)
        found = balance.by_actuators(self, slots, pose, q)
        return found if twists else rates_of_twists(pose, found)

    def error_jacobian(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        columns: Int32Array,
        twists: bool = False,
    ) -> FloatArray:
        """∂pose/∂(numbers at `columns` of the flattened geometry): (N, 6, columns).

        Or of the twist (ω, v) of the platform by them. With more rows than free coordinates, where
        the platform is at q.
        """
        if self.rows == self.m:
            return self._by_numbers(slots, pose, q, columns, twists)
        found = balance.by_numbers(self, slots, pose, q, columns)
        return found if twists else rates_of_twists(pose, found)

    def _by_actuators(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool
    ) -> FloatArray:
        """`forward_jacobian` with as many rows as free coordinates."""
        out = np.empty((len(pose), 6, self.actuators))
        given = (len(pose), slots, _by_row(slots), pose, q, twists, out)
        call("forward_jacobian", self.struct, *given, isa=self.isa)
        return out if twists else self.as_written(pose, out, 1)

    def _by_numbers(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array, twists: bool
    ) -> FloatArray:
        """`error_jacobian` with as many rows as free coordinates."""
        return super().error_jacobian(slots, pose, q, columns, twists)

    def rates(
        self, slots: FloatArray, motion: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, (N, n) each.

        `motion` (N, 3, 4, 4) is the platform's homogeneous matrix and its first and second
        derivative by time. At coordinates q (N, n), whose turn matters to drive laws alone.
        """
        velocity, acceleration = np.empty((2, len(motion), self.actuators))
        given = (len(motion), slots, _by_row(slots), motion, velocity, acceleration)
        call("rates", self.struct, *given, isa=self.isa)
        return velocity, acceleration

    def motion(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The platform's motion at poses (N, 6) as the actuators move with q1 and q2 (N, n).

        The homogeneous matrix with its first and second derivative by time (N, 3, 4, 4), and
        velocity and acceleration of the pose (N, 6) each. NaN where singular. With more rows than
        free coordinates it is that of the poses which miss them least, solved again.
        """
        found = self._met(slots, pose, q, q1, q2)
        return found if self.rows == self.m else self._missing(slots, pose, q, q1, q2, found)

    def _met(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`motion` where all closures are met."""
        n = len(pose)
        motion, rates = np.empty((n, 3, 4, 4)), np.empty((n, 2, 6))
        given = (n, slots, _by_row(slots), pose, q, q1, q2, motion, rates)
        call("motion", self.struct, *given, isa=self.isa)
        return motion, rates[:, 0], rates[:, 1]

    def _missing(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        q1: FloatArray,
        q2: FloatArray,
        exact: tuple[FloatArray, FloatArray, FloatArray],
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`motion` where not all closures can be met: the rows that they are exact for stay."""
        closing, missed = self.with_tolerance(np.inf), np.zeros(len(pose))

        def forward(at: FloatArray) -> FloatArray:
            found, _, _, residual = closing.forward(slots, at, pose, threads=None)
            np.fmax(missed, residual, out=missed)
            return found

        scale = np.full(self.actuators, 1.0 / self.struct.size)
        scale[list(self._angles)] = 1.0
        found = platform_motion(forward, pose, q, q1, q2, scale)
        rows = missed > _MET * self.struct.size
        for each, solved in zip(exact, found, strict=True):
            each[rows] = solved[rows]
        return exact

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> Closure:
        """The closure rows and their derivatives at poses (N, 6) and coordinates (N, n)."""
        n, m = len(pose), self.m
        out = Closure(
            np.empty((n, self.rows)),
            np.empty((n, self.rows, m)),
            np.empty((n, self.rows, m)),
            np.empty((n, self.rows, self.actuators)),
            np.empty((n, 6)),
            np.empty((n, 6, m)),
        )
        call("closure", self.struct, n, slots, _by_row(slots), pose, q, *out, isa=self.isa)
        self.as_written(pose, out.by_free, 2)
        return out

    def readings(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Closures in units of what was read, at poses (N, 6) and coordinates (N, n).

        Of each limb the coordinate that it needs at the pose less the one read, then its other
        rows, weighted, in mm: (N, rows). Their derivatives by the map's step, mm and rad,
        (N, rows, m), and by the numbers at `columns` of the flattened slots (N, rows, columns).
        Of a limb that does not reach, the closure at q over its slope by q.
        """
        n = len(pose)
        residual, by_step = np.empty((n, self.rows)), np.empty((n, self.rows, self.m))
        count = 0 if columns is None else len(columns)
        by_number = None if columns is None else np.empty((n, self.rows, count))
        given = (n, slots, _by_row(slots), pose, q, columns, count, residual, by_step, by_number)
        call("readings", self.struct, *given, isa=self.isa)
        return residual, by_step, by_number

    def ways_at(
        self, slots: FloatArray, pose: FloatArray, columns: Int32Array
    ) -> tuple[FloatArray, FloatArray]:
        """Differentiate limbs' drives at poses (N, 6) by steps of the map, (N, limbs, m), mm, rad.

        And by the numbers at `columns` of the flattened slots (N, limbs, columns).
        """
        bare, width = slots.copy(), slots.shape[-1]
        bare[:, _GAIN], bare[:, _OFFSET] = 1.0, 0.0
        nowhere = np.full((len(pose), self.actuators), self.struct.size)
        _, by_step, by_number = self.readings(bare, pose, nowhere, columns)
        assert by_number is not None
        by_number[:, :, np.isin(columns % width, (_GAIN, _OFFSET))] = 0.0
        return by_step[:, self.reading_rows], by_number[:, self.reading_rows]

    @property
    def reading_rows(self) -> IntArray:
        """The row of `readings` of each limb's coordinate."""
        rows_of = [1 + int(row).bit_count() for row in self.struct.rows[0 : self.struct.limbs]]
        return np.concatenate([[0], np.cumsum(rows_of)[:-1]])

    def spheres(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Return the spheres of the limbs at coordinates (N, n): (N, limbs, 7 + 3 AXES).

        Platform joint (3), anchor (3), length in mm, and the axes (3 each), 0 where it has none;
        lengths are NaN in rows where a limb has no positive one.
        """
        out = np.empty((len(q), self.struct.limbs, lib.PKM_SPHERE))
        call("spheres", self.struct, len(q), slots, q, out, isa=self.isa)
        return out

    def limbs(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Look at each limb at poses (N, 6).

        Its q̃ (N, limbs), and the unit vectors from its anchor to the
        platform joint in base and in platform axes (N, limbs, 3).
        """
        n, limbs = len(pose), slots.shape[-2]
        drive, base, platform = np.empty((n, limbs)), *np.empty((2, n, limbs, 3))
        given = (n, slots, _by_row(slots), pose, drive, base, platform)
        call("limbs", self.struct, *given, isa=self.isa)
        return drive, base, platform

    def pulls(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Force on the platform joints by limbs that push with 1 (N, limbs, 3), in base axes.

        Cables pull the other way. Of a limb between two points the unit vector along it.
        """
        return self.limbs(slots, pose)[1]

    def work_at_anchors(
        self, slots: FloatArray, q: FloatArray, force: FloatArray, columns: Int32Array
    ) -> FloatArray:
        """Work of forces (N, limbs, 3) on the anchors by numbers at `columns`, (N, columns)."""
        out = np.zeros((len(q), len(columns)))
        limb, slot = np.divmod(columns, len(SLOTS))
        for i in np.unique(limb).tolist():
            mine, pull = limb == i, np.ascontiguousarray(force[:, i])
            driver = DRIVERS[self.struct.driver[i]]
            if driver == "length":  # its anchor is its base point
                by_number = np.zeros((len(q), len(SLOTS)))
                by_number[:, :3] = pull
            else:
                place = 9 * len(AXES) * i
                frame = np.array(list(self.struct.frame[place : place + 9]))
                at = np.ascontiguousarray(q[:, self.struct.actuator[i], None])
                given = (at, np.ascontiguousarray(slots[..., i, :]), pull, frame)
                _, by_number = rows(f"{driver}_work", *given, isa=self.isa)
            out[:, mine] = by_number[:, slot[mine]]
        return out

    def closure_cost(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Sum of the squared closures over poses (M, 6) and coordinates (M, n), mm².

        For each of N geometries (N, limbs, SLOTS); (N,).
        """
        cost = np.empty(len(slots))
        given = (self.struct, len(slots), slots, len(pose), pose, q)
        call("closure_cost", *given, cost, isa=self.isa)
        return cost


def _by_row(slots: FloatArray) -> int:
    """Stride of geometries: one for all rows (limbs, SLOTS), or one for each (N, limbs, SLOTS)."""
    return slots.shape[1] * slots.shape[2] if slots.ndim == 3 else 0


def with_errors(
    errors: FloatArray, places: Int32Array, ideal: FloatArray, slots: FloatArray
) -> None:
    """Write the ideal slots with errors (N, k) at places (k,) to `slots` (N, size)."""
    size, given = slots.shape[1], (pointer(errors), pointer(places))
    ensure(lib.pkm_with_errors(*errors.shape, *given, size, pointer(ideal), pointer(slots)))
