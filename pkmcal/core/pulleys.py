"""A machine with cables whose length is none between two points, as one of limbs between points.

Over a swivelling pulley or over several points, the length of a cable is a function l of where
its end D is, with the gradient s t: the unit vector t, and s = 1 over a pulley, or as many parts as
pull along t. To first order l/s is the distance from the point D - t l/s: the sphere of that radius
about it has the same value and the same gradient. So at a known pose all first derivatives are
those of the machine of limbs with these points as its anchors, and offsets and gains over s. The
forward kinematics go from one such machine to the next, each solved in the core, as Newton's method
goes from one linear system to the next. What spheres bend otherwise than l/s is added where second
derivatives count; with more rows than coordinates `balance` has it of the rows at displaced poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, Int32Array, IntArray
from pkmcal.core import instruments
from pkmcal.core.core_machine import CoreMachine, Found, unwritten
from pkmcal.core.library import SLOTS, rows
from pkmcal.core.machine import Closure, Machine
from pkmcal.exceptions import ArgumentError

OWN_SLOTS = ("crank", "tilt1", "tilt2")  # the radius, and the tilts of the swivel axis
BENT = ("pulley", "tackle")  # drivers of limbs that are no distance between two points
_OWN = [SLOTS.index(slot) for slot in OWN_SLOTS]
_END = (3, 4, 5)
_OFFSET, _GAIN = SLOTS.index("offset"), SLOTS.index("gain")
_STEPS = 30  # from one machine of limbs to the next
_SETTLED = 1e-12  # of the machine's size: the step after which the next is rounding


class _Cables(NamedTuple):
    """Cables at N poses, (N, cables, ...), their lengths over s.

    Where they end; s; lengths over s, by D, by the numbers of their limbs and twice by D; and how D
    moves with the platform's twist, (3, 6).
    """

    end: FloatArray
    parts: FloatArray
    length: FloatArray
    pull: FloatArray
    by_number: FloatArray
    bend: FloatArray
    by_twist: FloatArray


class _Swivels(NamedTuple):
    """Angles of swivels (N, pulleys), by D, and by radius and tilts."""

    turned: FloatArray
    by_end: FloatArray
    by_own: FloatArray


class PulleyMachine(Machine):
    """A machine with limbs of the drivers "pulley" and "tackle", with the calls of `Machine`.

    Parameters are those of `Machine`. A limb of the driver "pulley" has the frame of its swivel
    axis as its base frame, and its radius where a crank has its length. One of the driver "tackle"
    has `parts`, how many run from each of its points: from its base point, and from those that are
    behind the other numbers of its limb.
    """

    fixed_spheres = False

    def __init__(
        self,
        map: str,
        limbs: list[dict[str, Any]],
        length: float,
        slots: FloatArray,
        *args: Any,
        **options: Any,
    ) -> None:
        drivers = np.array([limb["driver"] for limb in limbs])
        self._over: IntArray = np.flatnonzero(np.isin(drivers, BENT))
        self._of_pulleys: IntArray = np.flatnonzero(drivers[self._over] == "pulley")
        self._pulleys: IntArray = self._over[self._of_pulleys]
        frames = [np.ravel(limbs[i]["frames"]["base"]) for i in self._pulleys]
        self._axes: FloatArray = np.array(frames, dtype=np.float64).reshape(-1, 9)
        self._tackles = [
            (k, np.array(limbs[i]["parts"], dtype=np.float64))
            for k, i in enumerate(self._over)
            if drivers[i] == "tackle"
        ]
        plain = [limb | {"driver": "length"} if limb["driver"] in BENT else limb for limb in limbs]
        narrow = np.ascontiguousarray(slots[:, : len(SLOTS)])
        super().__init__(map, plain, length, narrow, *args, **options)
        self._of_actuator = np.array(list(self.struct.actuator[0 : self.struct.limbs]))

    # cables and the machine of limbs that stands for them -----------------------------------------

    def _ends(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The cables' numbers, where they end at poses (N, 6), and by twists, (N, cables, ...)."""
        n, k, width = len(pose), len(self._over), slots.shape[-1]
        mine = np.broadcast_to(slots[..., self._over, :], (n, k, width))
        joints = np.ascontiguousarray(mine[..., 3:6]).reshape(n * k, 3)
        end, by_twist, _ = instruments.points(np.repeat(pose, k, axis=0), joints, self.isa)
        return mine, end.reshape(n, k, 3), by_twist.reshape(n, k, 3, 6)

    def cables(self, slots: FloatArray, pose: FloatArray) -> _Cables:
        """Look at the cables at poses (N, 6) as given."""
        mine, end, by_twist = self._ends(slots, pose)
        n, k, width = mine.shape
        found = _Cables(
            end,
            np.ones((n, k)),
            np.empty((n, k)),
            np.empty((n, k, 3)),
            np.zeros((n, k, width)),
            np.empty((n, k, 3, 3)),
            by_twist,
        )
        if len(self._pulleys):
            length, pull, by_own, bend, *_ = self._over_pulleys(mine, found.end)
            at = self._of_pulleys
            found.length[:, at], found.pull[:, at], found.bend[:, at] = length, pull, bend
            found.by_number[:, at[:, None], _OWN] = by_own
        for place, parts in self._tackles:
            self._over_points(found, mine[:, place], place, parts)
        return found

    def _over_pulleys(self, mine: FloatArray, end: FloatArray) -> tuple[FloatArray, ...]:
        """Compute pulleys in the core, (N, pulleys, ...)."""
        n, p = len(end), len(self._pulleys)
        numbers = mine[:, self._of_pulleys].reshape(n * p, mine.shape[2])
        joint = end[:, self._of_pulleys].reshape(n * p, 3) - numbers[:, 0:3]
        own = np.ascontiguousarray(numbers[:, _OWN])
        found = rows("pulley", own, np.tile(self._axes, (n, 1)), joint, isa=self.isa)
        return tuple(part.reshape(n, p, *part.shape[1:]) for part in found)

    def _over_points(self, found: _Cables, mine: FloatArray, at: int, parts: FloatArray) -> None:
        """Fill in a cable over several points, its limb's numbers (N, numbers) given."""
        n, points = len(mine), len(parts)
        places = [0, 1, 2, *range(len(SLOTS), len(SLOTS) + 3 * (points - 1))]
        joint = found.end[:, at, None] - mine[:, places].reshape(n, points, 3)
        length, pull, bend = (
            each.reshape(n, points, *each.shape[1:])
            for each in rows("strand", np.ascontiguousarray(joint).reshape(-1, 3), isa=self.isa)
        )
        along = parts @ pull
        s = np.linalg.norm(along, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):  # parts that pull against each other
            found.parts[:, at], found.length[:, at] = s, length @ parts / s
            found.pull[:, at] = along / s[:, None]
            found.bend[:, at] = np.einsum("p,npij->nij", parts, bend) / s[:, None, None]
            by_points = -(parts[:, None] * pull).reshape(n, 3 * points) / s[:, None]
        found.by_number[:, at, places] = by_points

    def _limbs_at(self, slots: FloatArray, pose: FloatArray) -> tuple[FloatArray, _Cables]:
        """Geometries (N, limbs, SLOTS) of the machines of limbs at poses (N, 6)."""
        cables = self.cables(slots, pose)
        narrow = slots[..., : len(SLOTS)]
        out = np.array(np.broadcast_to(narrow, (len(pose), *narrow.shape[-2:])), order="C")
        out[:, self._over, 0:3] = cables.end - cables.length[..., None] * cables.pull
        with np.errstate(invalid="ignore", divide="ignore"):  # parts that pull against each other
            for number in (_OFFSET, _GAIN):
                out[:, self._over, number] /= cables.parts
        return out, cables

    def _on_map(self, pose: FloatArray) -> FloatArray:
        """Poses as the map has them."""
        return super().moved(np.ascontiguousarray(pose), np.zeros((len(pose), self.m)))

    def swivels(self, slots: FloatArray, pose: FloatArray) -> tuple[FloatArray, ...]:
        """Swivel angles (N, pulleys) at poses (N, 6), with their derivatives.

        By the platform's twist (ω, v) (N, pulleys, 6) and by the numbers of their limbs
        (N, pulleys, SLOTS).
        """
        mine, end, by_twist = self._ends(slots, pose)
        found = _Swivels(*self._over_pulleys(mine, end)[4:])
        by_number = np.zeros((*found.turned.shape, len(SLOTS)))
        by_number[..., 0:3] = -found.by_end
        turned = np.einsum("nkj,nkjt->nkt", found.by_end, by_twist[:, self._of_pulleys])
        frame = rows("points", pose, np.zeros(3), isa=self.isa)[2]  # R
        by_number[..., 3:6] = np.einsum("nkj,nji->nki", found.by_end, frame)
        by_number[..., _OWN] = found.by_own
        return found.turned, turned, by_number

    def _columns(
        self, columns: Int32Array, width: int
    ) -> tuple[Int32Array, IntArray, list[tuple[int, int, int]]]:
        """Return the columns to ask of the machine of limbs for columns of the geometry.

        The columns with the offset of the limb in place of numbers that lengthen its cable, rising
        and each once; where each of the columns is among them; and of those that are others here
        place, cable and number.
        """
        limb, slot = np.divmod(columns, width)
        cable_of = {int(i): k for k, i in enumerate(self._over)}
        pulleys = set(self._pulleys.tolist())
        asked = limb * len(SLOTS) + slot
        which = []
        for c, (i, number) in enumerate(zip(limb.tolist(), slot.tolist(), strict=True)):
            if i not in cable_of or number in _END or (i in pulleys and number not in _OWN):
                continue
            if number != _GAIN:
                asked[c] = i * len(SLOTS) + _OFFSET
            which.append((c, cable_of[i], number))
        asked, back = np.unique(asked, return_inverse=True)
        return asked.astype(np.int32), back.reshape(-1), which

    @staticmethod
    def _put_back(
        found: FloatArray, back: IntArray, own: list[tuple[int, int, int]], cables: _Cables
    ) -> FloatArray:
        """Columns (N, ..., columns) of those asked for: of own numbers as they lengthen cables."""
        out: FloatArray = found[..., back]
        for column, cable, number in own:
            longer = -cables.by_number[:, cable, number]
            if number in (_OFFSET, _GAIN):
                longer = 1.0 / cables.parts[:, cable]
            out[..., column] *= longer.reshape(-1, *(1,) * (out.ndim - 2))
        return out

    # kinematics: as `Machine` ---------------------------------------------------------------------

    def inverse(
        self,
        slots: FloatArray,
        pose: FloatArray,
        near: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Poses (N, 6) to actuator coordinates (N, n)."""
        return super().inverse(self._limbs_at(slots, pose)[0], pose, near, out)

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
        n = len(q)
        at = self._on_map(np.broadcast_to(guess, (n, 6)))
        pose, status, iterations, residual = unwritten(n) if out is None else out
        for each, value in ((pose, np.nan), (status, 1), (iterations, 0), (residual, np.nan)):
            each.fill(value)
        going, limit = np.arange(n), _SETTLED * self.struct.size
        open_ = self.with_tolerance(np.inf)  # on the way closures need not agree
        for _ in range(_STEPS):
            if not len(going):
                break
            own = slots[going] if slots.ndim == 3 else slots
            limbs, _cables = self._limbs_at(own, at[going])
            found, failed, steps, left = Machine.forward(open_, limbs, q[going], at[going], threads)
            iterations[going] += steps
            moved = np.abs(found - at[going])
            moved[:, 3:] *= self.struct.length
            at[going] = found
            done = (moved.max(axis=1) <= limit) & (failed == 0)
            if self.rows > self.m and done.any():
                last = super().forward(limbs[done], q[going[done]], found[done], threads)
                failed[done] = last[1]
            there = done & (failed == 0)
            ended = done | (failed != 0)
            status[going[ended]], residual[going[ended]] = failed[ended], left[ended]
            pose[going[there]] = found[there]
            going = going[~ended]
        if shape is None or len(shape) == 1:
            return pose, status, iterations, residual
        parts = (status.reshape(shape), iterations.reshape(shape), residual.reshape(shape))
        return (pose.reshape(*shape, 6), *parts)

    forward_machines = CoreMachine.forward_machines  # where the rope leaves depends on the pose

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m)."""
        pose = self._on_map(pose)
        return super().jacobian(self._limbs_at(slots, pose)[0], pose)

    def _by_actuators(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool
    ) -> FloatArray:
        pose = self._on_map(pose)
        return super()._by_actuators(self._limbs_at(slots, pose)[0], pose, q, twists)

    def _by_numbers(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array, twists: bool
    ) -> FloatArray:
        pose = self._on_map(pose)
        limbs, cables = self._limbs_at(slots, pose)
        asked, back, own = self._columns(columns, slots.shape[-1])
        found = super()._by_numbers(limbs, pose, q, asked, twists)
        return self._put_back(found, back, own, cables)

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> Closure:
        """The closure rows and their derivatives at poses (N, 6) and coordinates (N, n)."""
        pose = self._on_map(pose)
        return super().closure(self._limbs_at(slots, pose)[0], pose, q)

    def closure_cost(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
        """Sum of the squared closures over poses (M, 6) and coordinates (M, n), of N geometries."""
        return np.array([(self.closure(each, pose, q).residual ** 2).sum() for each in slots])

    def readings(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Closures in units of what was read, as `Machine.readings`."""
        limbs, cables = self._limbs_at(slots, pose)
        if columns is None:
            return super().readings(limbs, pose, q)
        asked, back, own = self._columns(columns, slots.shape[-1])
        residual, by_step, by_number = super().readings(limbs, pose, q, asked)
        assert by_number is not None
        return residual, by_step, self._put_back(by_number, back, own, cables)

    def limbs(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Look at each limb at poses (N, 6): q̃ and the directions in which limbs pull."""
        limbs, cables = self._limbs_at(slots, pose)
        drive, base, platform = super().limbs(limbs, pose)
        drive[:, self._over] *= cables.parts
        return drive, base, platform

    def pulls(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """Force on the platform by tensions of 1, away from it, as `Machine.pulls`."""
        limbs, cables = self._limbs_at(slots, pose)
        pulls = super().limbs(limbs, pose)[1]
        pulls[:, self._over] *= cables.parts[..., None]
        return pulls

    # along a path ---------------------------------------------------------------------------------

    def rates(
        self, slots: FloatArray, motion: FloatArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, as `Machine.rates`."""
        pose = rows("motion_pose", np.ascontiguousarray(motion[:, 0]).reshape(-1, 16))[0]
        limbs, cables = self._limbs_at(slots, pose)
        velocity, acceleration = super().rates(limbs, motion, q)
        extra = self._bends(slots, cables, motion) / limbs[:, self._over, _GAIN]
        shared = np.array([self.struct.sharing[a] for a in self._of_actuator[self._over]])
        for k, limb in enumerate(self._over):
            acceleration[:, self._of_actuator[limb]] += extra[:, k] / shared[k]
        return velocity, acceleration

    def _met(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Accelerations as of `Machine`; each of these cables needs an actuator of its own."""
        mine = self._of_actuator[self._over]
        if (np.bincount(self._of_actuator)[mine] > 1).any():
            raise ArgumentError(
                "accelerations of cables over pulleys or several points that share an actuator are"
                " not known"
            )
        limbs, cables = self._limbs_at(slots, pose)
        moving = super()._met(limbs, pose, q, q1, q2)[0]
        needed = q2.copy()
        needed[:, mine] -= self._bends(slots, cables, moving) / limbs[:, self._over, _GAIN]
        return super()._met(limbs, pose, q, q1, needed)

    def _bends(self, slots: FloatArray, cables: _Cables, motion: FloatArray) -> FloatArray:
        """Return accelerations of cables as their ends move, beyond the spheres', (N, cables)."""
        points = np.column_stack([slots[self._over, 3:6], np.ones(len(self._over))])
        speed = np.einsum("nij,kj->nki", motion[:, 1, :3], points)
        along = np.einsum("nki,nki->nk", speed, cables.pull)
        of_sphere = ((speed**2).sum(axis=2) - along**2) / cables.length
        bent = np.einsum("nki,nkij,nkj->nk", speed, cables.bend, speed)
        difference: FloatArray = bent - of_sphere
        return difference


def has_bent(limbs: Sequence[dict[str, Any]]) -> bool:
    """Return whether one of a machine's limbs has a driver of `BENT`."""
    return any(limb["driver"] in BENT for limb in limbs)
