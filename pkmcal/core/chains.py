"""A machine of chains in the compiled core: limbs as joints in a row, passive ones eliminated."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from pkmcal._core import ffi, lib
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core import screws
from pkmcal.core.chain_actuators import coordinates
from pkmcal.core.chain_readings import readings
from pkmcal.core.core_machine import CoreMachine, known_rows, written
from pkmcal.core.library import COORDINATE_UNITS, ISA, MAPS, call, pointer
from pkmcal.core.machine import CLOSURE_TOLERANCE, Closure, Machine
from pkmcal.core.path_differences import actuator_rates, platform_motion

MAX_CHAIN: int = lib.PKM_MAX_CHAIN
MAX_JOINTS: int = lib.PKM_MAX_JOINTS
MAX_SHARED: int = lib.PKM_MAX_SHARED
MAX_CHAIN_ROWS: int = lib.PKM_MAX_CHAIN_ROWS
MAX_NUMBERS: int = lib.PKM_MAX_NUMBERS
_STEP = 1e-5  # rad, and of the characteristic length
GROUPS = {"spatial": 6, "planar": 3, "spherical": 3}  # pose maps of chains, and the rows of a chain


@dataclass(frozen=True, eq=False)
class ChainLayout:
    """The layout of a machine of chains: what does not change with its numbers.

    Joints count once where chains share them. Places are those of numbers in the geometry.

    Attributes
    ----------
    map : str
        A key of `GROUPS`.
    home : ndarray (4, 4)
        The platform's frame at home.
    size, length : float
        Of the machine, and at which radius a rotation counts as its arc, mm.
    numbers : int
        How many the geometry has.
    first : ndarray of int (chains + 1)
        Where each chain begins in `member`.
    member : ndarray of int
        Joints from base to platform, chain after chain.
    ball : ndarray of int (chains)
        Whether the chain ends in a ball, behind its joints.
    end_place, ball_place : ndarray of int (chains)
        Of the six errors on the platform's side, and of the ball's three.
    end : ndarray (chains, 3)
        The point on the platform, at home.
    prismatic, actuator, coordinate, place : ndarray of int (joints)
        Whether it slides, its actuator or -1, which of the passive ones it is or -1 (those that
        chains share first), and where its six errors are.
    axes : ndarray (joints, 3, 3)
        At home; the third column is the joint's own.
    point : ndarray (joints, 3)
        At home.
    soft : ndarray (joints)
        Compliance beside that of the others.
    drive_place : ndarray of int (actuators)
        Of the offset; the gain follows.
    zero : ndarray (actuators)
        What the actuators read at home.
    near : ndarray (actuators)
        What they read, gain and offset included, where an angle is given nearest to.
    tail : int
        The first actuator of the joints behind the platform, which all chains have in common and
        which come last; the number of actuators where there are none.
    """

    map: str
    home: FloatArray
    size: float
    length: float
    numbers: int
    first: Int32Array
    member: Int32Array
    ball: Int32Array
    end_place: Int32Array
    ball_place: Int32Array
    end: FloatArray
    prismatic: Int32Array
    actuator: Int32Array
    coordinate: Int32Array
    place: Int32Array
    axes: FloatArray
    point: FloatArray
    soft: FloatArray
    drive_place: Int32Array
    zero: FloatArray
    near: FloatArray
    tail: int

    @property
    def shared(self) -> int:
        """Number of passive joints that are in several chains."""
        return int((self._in_several & (self.coordinate >= 0)).sum())

    @property
    def _chain(self) -> IntArray:
        """The chain of each member."""
        return np.repeat(np.arange(len(self.ball)), np.diff(self.first))

    @property
    def _in_several(self) -> BoolArray:
        """Mask of joints that are in several chains."""
        of = self._chain
        users = [len(set(of[self.member == joint].tolist())) for joint in range(len(self.place))]
        return np.array(users) > 1

    @property
    def steps(self) -> FloatArray:
        """Return steps of each number for differences, mm and rad."""
        found = np.full(self.numbers, _STEP)
        for place in (self.place, self.end_place, self.ball_place[self.ball != 0]):
            found[np.unique(place)[:, None] + np.arange(3)] *= self.length
        slides = np.unique(self.actuator[(self.actuator >= 0) & (self.prismatic != 0)])
        found[self.drive_place[slides]] *= self.length
        return found

    @property
    def passive(self) -> int:
        """Number of joints that no actuator moves."""
        return int((self.coordinate >= 0).sum())

    @property
    def loose(self) -> bool:
        """True if a chain that shares a joint has more joints than rows: others must hold it."""
        more = np.diff(self.first) > self._closing
        return bool((self._in_several[self.member] & more[self._chain]).any())

    @property
    def _closing(self) -> IntArray:
        """In how many ways each chain is closed."""
        return np.where(self.ball != 0, 3, GROUPS[self.map])

    @property
    def rows(self) -> int:
        """Number of rows left when each chain has eliminated the passive joints of its own."""
        own = self.coordinate[self.member] >= self.shared
        return int(self._closing.sum() - own.sum())


class ChainMachine(CoreMachine):
    """A machine of chains in the core, with the calls of `pkmcal.core.machine.Machine`.

    Parameters
    ----------
    layout : ChainLayout
        The machine.
    closure_tolerance : float, optional
        What more rows than unknowns may miss, mm; by default `CLOSURE_TOLERANCE` of the size.
    isa : int
        Index into `ISAS`.
    """

    _FORWARD, _ERRORS = "chain_forward", "chain_response"

    def __init__(
        self, layout: ChainLayout, closure_tolerance: float | None = None, isa: int = ISA
    ) -> None:
        struct = ffi.new("pkm_chains *")
        self.layout, self._together = layout, layout.loose or layout.tail < len(layout.zero)
        self._kept = {  # C has pointers to these
            each.name: np.ascontiguousarray(value)
            for each in fields(layout)
            if isinstance(value := getattr(layout, each.name), np.ndarray)
        }
        for name, array in self._kept.items():
            if name == "home":
                struct.home[0:12] = array[:3].ravel().tolist()
            elif name != "near":
                setattr(struct, name, pointer(array))
        struct.map = list(MAPS).index(layout.map)
        struct.chains = len(layout.ball)
        struct.joints, struct.actuators = len(layout.place), len(layout.zero)
        struct.passive, struct.shared = layout.passive, layout.shared
        struct.numbers, struct.tail = layout.numbers, layout.tail
        struct.size, struct.length = layout.size, layout.length
        if closure_tolerance is None:
            closure_tolerance = CLOSURE_TOLERANCE * layout.size
        struct.closure_tolerance = closure_tolerance
        self.m = len(MAPS[layout.map])
        self.rows = layout.rows - layout.shared
        struct.over = int(self.rows > self.m)
        self.struct, self.isa = struct, isa
        self.actuators: int = struct.actuators
        turning = {
            a for a, slides in zip(layout.actuator, layout.prismatic, strict=True) if not slides
        }
        self._angles = sorted(int(a) for a in turning if a >= 0)

    def inverse(
        self,
        slots: FloatArray,
        pose: FloatArray,
        near: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Poses (N, 6) to actuator coordinates (N, n), from home; chains one by one if that does.

        Angles as `pkmcal.core.machine.Machine.inverse` gives them.
        """
        if self._together:
            found = self._all_at_once(slots, pose)
        else:
            found = np.empty((len(pose), self.actuators))
            given = (len(pose), slots, _by_row(slots), pose, found)
            call("chain_inverse", self.struct, *given, isa=self.isa)
        return written(known_rows(self.nearest_turns(slots, found, near)), out)

    def _all_at_once(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """`inverse` of a machine whose chains cannot be taken one by one."""
        arms = np.append(np.ones(self.actuators), self.layout.length)
        arms[self._angles] = self.layout.length
        arms[:-1] *= np.abs(self.slopes(slots, pose[:1])[0]) if len(pose) else 1.0
        guess = screws.pose(np.ascontiguousarray(self.layout.home.reshape(1, 16)))[0]
        q = self.at_drives(slots, self.layout.zero[None])[0]
        home, status, _, _ = self.forward(slots, q[None], guess, 1)
        if status[0] != 0:
            return np.full((len(pose), self.actuators), np.nan)
        return coordinates(
            lambda there, near: self.forward(slots, there, guess if near is None else near, 1)[:2],
            lambda at, there: self.forward_jacobian(slots, at, there, twists=True),
            pose, (home[0], q), self.layout.size, arms,
        )  # fmt: skip

    def turns(self, slots: FloatArray) -> FloatArray:
        """Return the way of each actuator in a whole turn, (n,); infinite where it is no angle."""
        out = np.full(self.actuators, np.inf)
        gain = slots.ravel()[self.layout.drive_place + 1]
        out[self._angles] = 2 * np.pi / np.abs(gain[self._angles])
        return out

    def reference(self, slots: FloatArray) -> FloatArray:
        """The coordinate (n,) that an angle is given nearest to."""
        drive, place = slots.ravel(), self.layout.drive_place
        found: FloatArray = (self.layout.near - drive[place]) / drive[place + 1]
        return found

    def bare(self, slots: FloatArray, q: FloatArray) -> tuple[ChainMachine, FloatArray, FloatArray]:
        """The machine without drive laws, its geometry, and its coordinates at q (N, n)."""
        return self, slots, q

    def drives(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """Return the drives' coordinates with gain and offset, (N, n)."""
        place, numbers = self.layout.drive_place, slots.reshape(-1, slots.shape[-1])
        found: FloatArray = numbers[:, place + 1] * q + numbers[:, place]
        return found

    @property
    def turning(self) -> BoolArray:
        """Mask of actuators that are angles, (n,)."""
        found = np.zeros(self.actuators, dtype=bool)
        found[self._angles] = True
        return found

    def drives_at(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Return the actuators' readings at poses (N, 6), with gain and offset, (N, n)."""
        return self.drives(slots, self.inverse(slots, pose))

    def slopes(self, slots: FloatArray, q: FloatArray) -> FloatArray:
        """The gain of each actuator, (N, n)."""
        return np.tile(slots.ravel()[self.layout.drive_place + 1], (len(q), 1))

    def at_drives(self, slots: FloatArray, way: FloatArray) -> FloatArray:
        """Return the actuators' readings (N, n) at q̃ (N, n)."""
        place, numbers = self.layout.drive_place, slots.reshape(-1, slots.shape[-1])
        q: FloatArray = (way - numbers[:, place]) / numbers[:, place + 1]
        return q

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m); the least squares of the closures."""
        closure = self.closure(slots, pose, self.inverse(slots, pose))
        out = np.full((len(pose), self.actuators, self.m), np.nan)
        good = np.isfinite(closure.by_q).all(axis=(1, 2)) & np.isfinite(closure.by_free).all((1, 2))
        out[good] = -np.linalg.pinv(closure.by_q[good]) @ closure.by_free[good]
        return out

    def forward_jacobian(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool = False
    ) -> FloatArray:
        """∂pose/∂q at poses (N, 6): (N, 6, n), or of the twist (ω, v) of the platform by them."""
        out = np.empty((len(pose), 6, self.actuators))
        given = (len(pose), slots, _by_row(slots), pose, q, None, self.actuators, twists)
        call("chain_response", self.struct, *given, out, isa=self.isa)
        return out if twists else self.as_written(pose, out, 1)

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> Closure:
        """The rows that the passive joints leave, and their derivatives.

        As `pkmcal.core.machine.Machine.closure`. A chain whose passive joints hold 6 - k directions
        of the platform has k rows, in mm.
        """
        n, rows, shared = len(pose), self.layout.rows, self.struct.shared
        out = Closure(
            np.empty((n, rows)),
            np.empty((n, rows, self.m + shared)),
            np.empty((n, rows, self.m)),
            np.empty((n, rows, self.actuators)),
            np.empty((n, 6)),
            np.empty((n, 6, self.m)),
        )
        call("chain_closure", self.struct, n, slots, _by_row(slots), pose, q, *out, isa=self.isa)
        self.as_written(pose, out.by_free, 2)
        return _without_shared(out, self.m) if shared else out

    def frames(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Passive joints (N, passive) at poses (N, 6) and coordinates (N, n), and all frames.

        Of each chain those of its joints before they move and that of its end, (N, joints + 1 of
        each chain, 12): R row by row and p.
        """
        layout = self.layout
        passive = np.empty((len(pose), self.struct.passive))
        frames = np.empty((len(pose), len(layout.member) + len(layout.ball), 12))
        given = (len(pose), slots, _by_row(slots), pose, q)
        call("chain_frames", self.struct, *given, passive, frames, isa=self.isa)
        return passive, frames

    def readings(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Closures in units of what was read, as `pkmcal.core.machine.Machine.readings`."""
        layout = self.layout
        turns = np.array([COORDINATE_UNITS[name] == "rad" for name in MAPS[layout.map]])
        return readings(
            lambda numbers, needed: self.closure(numbers, pose, needed),
            slots, q, np.where(turns, layout.length, 1.0), columns, layout.steps,
        )  # fmt: skip

    @property
    def reading_rows(self) -> IntArray:
        """The row of `readings` of each actuator's coordinate."""
        return np.arange(self.actuators)

    def rates(
        self, slots: FloatArray, motion: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, as `pkmcal.core.machine.Machine.rates`."""

        def inverse(pose: FloatArray) -> FloatArray:
            return self.inverse(slots, pose)

        return actuator_rates(inverse, self.turns(slots), self.layout.size, motion)

    def motion(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The platform's motion, as `pkmcal.core.machine.Machine.motion`."""

        def forward(at: FloatArray) -> FloatArray:
            return self.forward(slots, at, pose, threads=None)[0]

        scale = np.full(self.actuators, 1.0 / self.layout.size)
        scale[self._angles] = 1.0
        return platform_motion(forward, pose, q, q1, q2, scale)

    def closure_cost(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Sum of the squared closures over poses (M, 6) and coordinates (M, n), mm².

        For each of N geometries (N, 1, numbers); (N,).
        """
        costs = [(self.closure(each, pose, q).residual ** 2).sum() for each in slots]
        return np.array(costs)


AnyMachine = Machine | ChainMachine


def _by_row(slots: FloatArray) -> int:
    """Stride of geometries: one for all rows (1, numbers), or one for each (N, 1, numbers)."""
    return slots.shape[1] * slots.shape[2] if slots.ndim == 3 else 0


def _without_shared(closure: Closure, m: int) -> Closure:
    """Rows that the joints which chains share leave: those across their columns."""
    by_step, shared = closure.by_step[..., :m], closure.by_step[..., m:]
    good = np.isfinite(shared).all(axis=(1, 2))
    rows, count = shared.shape[1:]
    across = np.full((len(shared), rows - count, rows), np.nan)
    across[good] = np.linalg.qr(shared[good], mode="complete")[0][..., count:].swapaxes(1, 2)
    return Closure(
        (across @ closure.residual[..., None])[..., 0],
        across @ by_step,
        across @ closure.by_free,
        across @ closure.by_q,
        closure.pose,
        closure.pose_by_free,
    )
