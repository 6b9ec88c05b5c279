"""A machine some of whose cables run over swivelling pulleys, as one of limbs between two points.

The length of such a cable is a function l of where its end D is, whose gradient t is the unit
vector along its straight part. To first order the cable is one from the point D - l t: the sphere
of radius l about it has the same value and the same gradient. So at a known pose all first
derivatives are those of the machine of limbs with these points as its anchors, and the forward
kinematics go from one such machine to the next, each solved in the core, as Newton's method goes
from one linear system to the next. What spheres bend otherwise than l is added where second
derivatives count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, Int32Array, IntArray
from pkmcal.core import instruments
from pkmcal.core.library import SLOTS, rows
from pkmcal.core.machine import Closure, Machine
from pkmcal.exceptions import ArgumentError

OWN_SLOTS = ("crank", "tilt1", "tilt2")  # the radius, and the tilts of the swivel axis
_OWN = [SLOTS.index(slot) for slot in OWN_SLOTS]
_OFFSET, _GAIN = SLOTS.index("offset"), SLOTS.index("gain")
_STEPS = 30  # from one machine of limbs to the next
_SETTLED = 1e-12  # of the machine's size: the step after which the next is rounding


class _Cables(NamedTuple):
    """The cables over pulleys at N poses, (N, pulleys, ...).

    Where they end; lengths, by D, by radius and tilts, and twice by D; swivel angles, by D, by
    radius and tilts; and how D moves with the platform's twist, (3, 6).
    """

    end: FloatArray
    length: FloatArray
    pull: FloatArray
    by_own: FloatArray
    bend: FloatArray
    swivel: FloatArray
    swivel_by_end: FloatArray
    swivel_by_own: FloatArray
    by_twist: FloatArray


class PulleyMachine(Machine):
    """A machine with limbs of the driver "pulley", with the calls of `Machine`.

    Parameters are those of `Machine`. A limb of the driver "pulley" has the frame of its swivel
    axis as its base frame, and its radius where a crank has its length.
    """

    fixed_spheres = False

    def __init__(self, map: str, limbs: list[dict[str, Any]], *args: Any, **options: Any) -> None:
        over = [limb["driver"] == "pulley" for limb in limbs]
        self._over: IntArray = np.flatnonzero(over)
        frames = [np.ravel(limbs[i]["frames"]["base"]) for i in self._over]
        self._axes: FloatArray = np.array(frames, dtype=np.float64)
        plain = [
            limb | {"driver": "length"} if o else limb for limb, o in zip(limbs, over, strict=True)
        ]
        super().__init__(map, plain, *args, **options)
        self._of_actuator = np.array(list(self.struct.actuator[0 : self.struct.limbs]))

    # cables and the machine of limbs that stands for them -----------------------------------------

    def cables(self, slots: FloatArray, pose: FloatArray) -> _Cables:
        """Look at the cables over pulleys at poses (N, 6) as given."""
        n, k = len(pose), len(self._over)
        mine = np.broadcast_to(slots[..., self._over, :], (n, k, slots.shape[-1]))
        mine = mine.reshape(n * k, slots.shape[-1])
        each = np.repeat(pose, k, axis=0)
        end, by_twist, _ = instruments.points(each, np.ascontiguousarray(mine[:, 3:6]), self.isa)
        own, joint = np.ascontiguousarray(mine[:, _OWN]), end - mine[:, 0:3]
        found = rows("pulley", own, np.tile(self._axes, (n, 1)), joint, isa=self.isa)
        parts = (end, *found, by_twist)
        return _Cables(*(part.reshape(n, k, *part.shape[1:]) for part in parts))

    def _limbs_at(self, slots: FloatArray, pose: FloatArray) -> tuple[FloatArray, _Cables]:
        """Geometries (N, limbs, SLOTS) of the machines of limbs at poses (N, 6)."""
        cables = self.cables(slots, pose)
        out = np.array(np.broadcast_to(slots, (len(pose), *slots.shape[-2:])), order="C")
        out[:, self._over, 0:3] = cables.end - cables.length[..., None] * cables.pull
        return out, cables

    def _on_map(self, pose: FloatArray) -> FloatArray:
        """Poses as the map has them."""
        return super().moved(np.ascontiguousarray(pose), np.zeros((len(pose), self.m)))[0]

    def swivels(self, slots: FloatArray, pose: FloatArray) -> tuple[FloatArray, ...]:
        """Swivel angles (N, pulleys) at poses (N, 6), with their derivatives.

        By the platform's twist (ω, v) (N, pulleys, 6) and by the numbers of their limbs
        (N, pulleys, SLOTS).
        """
        cables = self.cables(slots, pose)
        by_number = np.zeros((*cables.swivel.shape, len(SLOTS)))
        by_number[..., 0:3] = -cables.swivel_by_end
        turned = np.einsum("nkj,nkjt->nkt", cables.swivel_by_end, cables.by_twist)
        frame = rows("points", pose, np.zeros(3), isa=self.isa)[2]  # R
        by_number[..., 3:6] = np.einsum("nkj,nji->nki", cables.swivel_by_end, frame)
        by_number[..., _OWN] = cables.swivel_by_own
        return cables.swivel, turned, by_number

    def _columns(
        self, columns: Int32Array
    ) -> tuple[Int32Array, IntArray, list[tuple[int, int, int]]]:
        """What to ask of the machine of limbs for columns of the geometry.

        The columns with the offset of the limb in place of a pulley's own numbers, rising and each
        once; where each of the columns is among them; and of the own ones place, pulley and number.
        """
        limb, slot = np.divmod(columns, len(SLOTS))
        own = np.isin(limb, self._over) & np.isin(slot, _OWN)
        asked, back = np.unique(
            np.where(own, limb * len(SLOTS) + _OFFSET, columns), return_inverse=True
        )
        pulley_of = {int(i): p for p, i in enumerate(self._over)}
        which = [
            (c, pulley_of[int(limb[c])], OWN_SLOTS.index(SLOTS[slot[c]]))
            for c in np.flatnonzero(own).tolist()
        ]
        return asked.astype(np.int32), back.reshape(-1), which

    @staticmethod
    def _put_back(
        found: FloatArray, back: IntArray, own: list[tuple[int, int, int]], cables: _Cables
    ) -> FloatArray:
        """Columns (N, ..., columns) of those asked for: of own numbers as they lengthen cables."""
        out: FloatArray = found[..., back]
        for column, pulley, number in own:
            longer = cables.by_own[:, pulley, number]
            out[..., column] *= -longer.reshape(-1, *(1,) * (out.ndim - 2))
        return out

    # kinematics: as `Machine` ---------------------------------------------------------------------

    def inverse(
        self, slots: FloatArray, pose: FloatArray, near: FloatArray | None = None
    ) -> FloatArray:
        """Poses (N, 6) to actuator coordinates (N, n)."""
        return super().inverse(self._limbs_at(slots, pose)[0], pose, near)

    def forward(
        self,
        slots: FloatArray,
        q: FloatArray,
        guess: FloatArray,
        threads: int | None,
        shape: tuple[int, ...] | None = None,
    ) -> tuple[FloatArray, Int32Array, Int32Array, FloatArray]:
        """Actuator coordinates (N, n) to pose, status, iterations and residual."""
        n = len(q)
        pose, residual = np.full((n, 6), np.nan), np.full(n, np.nan)
        status, iterations = np.ones(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
        at = self._on_map(np.broadcast_to(guess, (n, 6)))
        going, limit = np.arange(n), _SETTLED * self.struct.size
        for _ in range(_STEPS):
            if not len(going):
                break
            own = slots[going] if slots.ndim == 3 else slots
            limbs, _cables = self._limbs_at(own, at[going])
            found, failed, steps, left = super().forward(limbs, q[going], at[going], threads)
            iterations[going] += steps
            moved = np.abs(found - at[going])
            moved[:, 3:] *= self.struct.length
            at[going] = found
            done = (moved.max(axis=1) <= limit) & (failed == 0)
            ended = done | (failed != 0)
            status[going[ended]], residual[going[ended]] = failed[ended], left[ended]
            pose[going[done]] = found[done]
            going = going[~ended]
        if shape is None or len(shape) == 1:
            return pose, status, iterations, residual
        parts = (status.reshape(shape), iterations.reshape(shape), residual.reshape(shape))
        return (pose.reshape(*shape, 6), *parts)

    def jacobian(self, slots: FloatArray, pose: FloatArray) -> FloatArray:
        """∂q/∂free at poses (N, 6): (N, n, m)."""
        pose = self._on_map(pose)
        return super().jacobian(self._limbs_at(slots, pose)[0], pose)

    def forward_jacobian(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, twists: bool = False
    ) -> FloatArray:
        """∂pose/∂q at poses (N, 6): (N, 6, n), or of the twist (ω, v) of the platform by them."""
        pose = self._on_map(pose)
        return super().forward_jacobian(self._limbs_at(slots, pose)[0], pose, q, twists)

    def error_jacobian(
        self,
        slots: FloatArray,
        pose: FloatArray,
        q: FloatArray,
        columns: Int32Array,
        twists: bool = False,
    ) -> FloatArray:
        """∂pose/∂(numbers at `columns` of the flattened geometry): (N, 6, columns)."""
        pose = self._on_map(pose)
        limbs, cables = self._limbs_at(slots, pose)
        asked, back, own = self._columns(columns)
        found = super().error_jacobian(limbs, pose, q, asked, twists)
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
        asked, back, own = self._columns(columns)
        residual, by_step, by_number = super().readings(limbs, pose, q, asked)
        assert by_number is not None
        return residual, by_step, self._put_back(by_number, back, own, cables)

    def limbs(
        self, slots: FloatArray, pose: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Look at each limb at poses (N, 6): q̃ and the directions of the straight parts."""
        return super().limbs(self._limbs_at(slots, pose)[0], pose)

    # along a path ---------------------------------------------------------------------------------

    def rates(self, slots: FloatArray, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators, as `Machine.rates`."""
        pose = rows("motion_pose", np.ascontiguousarray(motion[:, 0]).reshape(-1, 16))[0]
        limbs, cables = self._limbs_at(slots, pose)
        velocity, acceleration = super().rates(limbs, motion)
        extra = self._bends(slots, cables, motion) / slots[..., self._over, _GAIN]
        shared = np.array([self.struct.sharing[a] for a in self._of_actuator[self._over]])
        for k, limb in enumerate(self._over):
            acceleration[:, self._of_actuator[limb]] += extra[:, k] / shared[k]
        return velocity, acceleration

    def motion(
        self, slots: FloatArray, pose: FloatArray, q: FloatArray, q1: FloatArray, q2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The platform's motion, as `Machine.motion`; each pulley with an actuator of its own."""
        mine = self._of_actuator[self._over]
        if (np.bincount(self._of_actuator)[mine] > 1).any():
            raise ArgumentError("accelerations of pulleys that share an actuator are not known")
        limbs, cables = self._limbs_at(slots, pose)
        moving = super().motion(limbs, pose, q, q1, q2)[0]
        needed = q2.copy()
        needed[:, mine] -= self._bends(slots, cables, moving) / slots[..., self._over, _GAIN]
        return super().motion(limbs, pose, q, q1, needed)

    def _bends(self, slots: FloatArray, cables: _Cables, motion: FloatArray) -> FloatArray:
        """What cables accelerate by as their ends move, beyond what the spheres do (N, pulleys)."""
        points = np.column_stack([slots[self._over, 3:6], np.ones(len(self._over))])
        speed = np.einsum("nij,kj->nki", motion[:, 1, :3], points)
        along = np.einsum("nki,nki->nk", speed, cables.pull)
        of_sphere = ((speed**2).sum(axis=2) - along**2) / cables.length
        bent = np.einsum("nki,nkij,nkj->nk", speed, cables.bend, speed)
        difference: FloatArray = bent - of_sphere
        return difference


def has_pulleys(limbs: Sequence[dict[str, Any]]) -> bool:
    """Whether one of a machine's limbs has the driver "pulley"."""
    return any(limb["driver"] == "pulley" for limb in limbs)
