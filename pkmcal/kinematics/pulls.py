"""Loads on a machine at a pose: weights, payload, force of the tool, balancers.

All of it is in the machine's own axes, N and N mm, of rows of poses at once. A weight that moves
with the platform is part of the wrench on it; one that sits on a limb pulls at its numbers.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray, furthest_axis
from pkmcal.core.library import SLOTS
from pkmcal.core.poses import NOWHERE
from pkmcal.geometry.carried import CARRIED
from pkmcal.geometry.elastic import Elastic
from pkmcal.screw import from_pose

_BASE, _PLATFORM = SLOTS.index("base.x"), SLOTS.index("platform.x")


class Pulls:
    """The loads on a machine, by the numbers of `Elastic` and by what it carries.

    Parameters
    ----------
    elastic : Elastic
        Which masses, loads and balancers there are.
    base, tool : ndarray (6,) or None
        Poses of the machine's own frame in the user's, and of the tool in the platform's own.
    """

    def __init__(self, elastic: Elastic, base: FloatArray | None, tool: FloatArray | None) -> None:
        self.elastic = elastic
        self._index = {name: i for i, name in enumerate(elastic.units)}
        self._inward = from_pose(NOWHERE if base is None else base)[:3, :3].T
        self._tool = from_pose(NOWHERE if tool is None else tool)
        gravity = np.array(elastic.gravity)
        self._strength = float(np.linalg.norm(gravity))
        self._down = _frame(gravity / self._strength) if self._strength else np.eye(3)

    def has(self, name: str) -> bool:
        """Return whether the robot file states this number."""
        return name in self._index

    def place(self, name: str) -> int:
        """Return the place of a number among those of `Elastic`."""
        return self._index[name]

    def gravity(self, numbers: FloatArray) -> FloatArray:
        """N per kg in the machine's own axes, (..., 3)."""
        t1, t2 = self._of("gravity.tilt1", numbers), self._of("gravity.tilt2", numbers)
        down = np.stack([np.sin(t2), -np.sin(t1) * np.cos(t2), np.cos(t1) * np.cos(t2)], axis=-1)
        turned: FloatArray = self._strength * (down @ self._down.T) @ self._inward.T
        return turned

    def summed(
        self, numbers: FloatArray, carried: FloatArray | None, slots: FloatArray
    ) -> FloatArray:
        """Sum weights and tool force as numbers of the platform, (16,) or (N, 16).

        Σ m r [kg mm], Σ m [kg], gravity [N/kg], the tool [mm], the force there [N], a moment
        [N mm]: points in the platform's own axes, the rest in the machine's. `numbers` are those
        of `Elastic`, (k,) or (N, k), `carried` the numbers of a load that stands in for the stated
        payload, (10,) or (N, 10), `slots` those of the limbs.
        """
        load = self._payload(numbers) if carried is None else carried
        tool, turned = self._tool[:3, 3], self._tool[:3, :3]
        masses = [load[..., 0]]
        moments = [load[..., :1] * (tool + load[..., 1:4] @ turned.T)]
        if self.elastic.platform:
            masses.append(self._of("mass.platform", numbers))
            moments.append(masses[-1][..., None] * self._point("centre.platform", numbers))
        for i in self.elastic.rods:
            masses.append(0.5 * self._of(f"mass.limb{i + 1}", numbers))
            joint = slots[..., i, _PLATFORM : _PLATFORM + 3]
            moments.append(masses[-1][..., None] * joint)
        parts = (
            sum(moments[1:], moments[0]),
            sum(masses[1:], masses[0])[..., None],
            self.gravity(numbers),
            tool,
            load[..., 4:7] @ self._inward.T,
            load[..., 7:10] @ self._inward.T,
        )
        shape = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
        each = [np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts]
        whole: FloatArray = np.concatenate(each, axis=-1)
        return whole

    def wrench(
        self, numbers: FloatArray, carried: FloatArray | None, pose: FloatArray, slots: FloatArray
    ) -> FloatArray:
        """Moment about the platform's origin and force on it, (N, 6), at own poses (N, 6).

        With the arguments of `summed`, and the balancers.
        """
        turned = from_pose(pose)[:, :3, :3]
        pull = self.summed(numbers, carried, slots)
        found = _at(turned, pull[..., 0:3], pull[..., 4:7])
        found[:, 3:] = pull[..., 3:4] * pull[..., 4:7]
        found += _at(turned, pull[..., 7:10], pull[..., 10:13])
        found[:, :3] += pull[..., 13:16]
        for j in range(1, self.elastic.balancers + 1):
            found += self._balancer(j, numbers, turned, pose[:, :3])
        return found

    def at_anchors(self, numbers: FloatArray, limbs: int) -> FloatArray:
        """Weights that the anchors of limbs carry, (..., limbs, 3)."""
        g = self.gravity(numbers)
        masses = np.zeros((*numbers.shape[:-1], limbs))
        for i in self.elastic.rods:
            masses[..., i] += 0.5 * self._of(f"mass.limb{i + 1}", numbers)
        for i in self.elastic.anchors:
            masses[..., i] += self._of(f"mass.anchor{i + 1}", numbers)
        return masses[..., None] * g[..., None, :]

    def at_joints(self, numbers: FloatArray, pose: FloatArray, limbs: int) -> FloatArray:
        """Weights at the platform joints in the platform's own axes, (N, limbs, 3)."""
        turned, g = from_pose(pose)[:, :3, :3], self.gravity(numbers)
        found = np.zeros((len(pose), limbs, 3))
        down = np.einsum("nji,nj->ni", turned, np.broadcast_to(g, (len(pose), 3)))
        for i in self.elastic.rods:
            half = 0.5 * self._of(f"mass.limb{i + 1}", numbers)
            found[:, i] = half[..., None] * down
        return found

    def _payload(self, numbers: FloatArray) -> FloatArray:
        """The stated payload as `carried`, 0 where there is none."""
        if not self.elastic.payload:
            return np.zeros((*numbers.shape[:-1], len(CARRIED)))
        first = self._index[f"payload.{CARRIED[0]}"]
        return numbers[..., first : first + len(CARRIED)]

    def _balancer(
        self, j: int, numbers: FloatArray, turned: FloatArray, origin: FloatArray
    ) -> FloatArray:
        point = self._point(f"balancer{j}.platform", numbers)
        ends = origin + np.einsum("nij,nj->ni", turned, np.broadcast_to(point, origin.shape))
        way = self._point(f"balancer{j}.base", numbers) - ends
        length = np.linalg.norm(way, axis=1)
        pull = self._of(f"balancer{j}.rate", numbers) * (
            length - self._of(f"balancer{j}.free", numbers)
        )
        with np.errstate(invalid="ignore"):  # a spring without length pulls nowhere
            along = way / length[:, None]
        return _at(turned, point, pull[:, None] * along)

    def _of(self, name: str, numbers: FloatArray) -> FloatArray:
        return numbers[..., self._index[name]]

    def _point(self, name: str, numbers: FloatArray) -> FloatArray:
        first = self._index[f"{name}.x"]
        return numbers[..., first : first + 3]


def _at(turned: FloatArray, point: FloatArray, force: FloatArray) -> FloatArray:
    """Wrench (N, 6) of forces in base axes at points in platform axes, (3,) or (N, 3) each."""
    n = len(turned)
    arm = np.einsum("nij,nj->ni", turned, np.broadcast_to(point, (n, 3)))
    pull = np.broadcast_to(force, (n, 3))
    return np.concatenate([np.cross(arm, pull), pull], axis=1)


def _frame(down: FloatArray) -> FloatArray:
    """Right-handed axes (columns) of which the third is a unit vector."""
    first = np.zeros(3)
    first[furthest_axis(down)] = 1.0
    first -= (first @ down) * down
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(down, first), down])
