"""Loads at the joints of an arm: weights of its links, what it carries, balancers.

From a turning joint to a point of the arm the way is Σ R_l D_l over the links behind the joint, R_l
the rotation of link l and D_l a lever that is constant in its axes. A force there turns joint i by
z_i·(Σ R_l D_l × F). All of it is of the arm without joint errors: what differs is of second order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import GRAVITY


class Balancer(NamedTuple):
    """A spring from a link to the one before it, which holds part of an arm's weight.

    Attributes
    ----------
    base, link : tuple of float
        Where it is held, on the link before the joint and on the one behind, in the base at zero,
        mm.
    rate : float
        N/mm.
    free : float
        Its length without force, mm.
    """

    base: tuple[float, float, float]
    link: tuple[float, float, float]
    rate: float
    free: float


class Posture(NamedTuple):
    """Rotations of the links (N, n, 3, 3), and axes of the joints (N, n, 3), as they stand."""

    rotation: FloatArray
    axes: FloatArray


class AtTool(NamedTuple):
    """The load at the tool, in axes of the base at zero; of all rows, or one a row (N, …).

    Attributes
    ----------
    weight : ndarray (…, 1)
        kg.
    centre : ndarray (…, 3)
        Its centre with the arm at zero, mm.
    tool : ndarray (3,)
        The tool's origin with the arm at zero, mm.
    force, moment : ndarray (…, 3)
        At the tool's origin, N and N mm, in the axes of the base.
    """

    weight: FloatArray
    centre: FloatArray
    tool: FloatArray
    force: FloatArray
    moment: FloatArray

    def of_rows(self, rows: IntArray) -> AtTool:
        """Return the load in some rows of a call."""
        weight, centre, tool, force, moment = self
        if weight.ndim == 1:
            return self
        return AtTool(weight[rows], centre[rows], tool, force[rows], moment[rows])


@dataclass(frozen=True, eq=False)
class JointPulls:
    """The weights and forces that load the joints of an arm.

    Parameters
    ----------
    axes, points : ndarray (n, 3)
        The joints' axes at zero, and a point on each, in the base, mm.
    kinds : tuple of str, n
        "revolute" or "prismatic".
    gravity : sequence of float
        m/s², in the axes of the base.
    masses : ndarray (n,) or None
        Of the link behind each joint, kg.
    centres : ndarray (n, 3) or None
        Their centres at zero, in the base, mm.
    balancers : mapping of int to Balancer
        By joint, counted from 0.
    carried : AtTool or None
        What the tool carries.
    """

    axes: FloatArray
    points: FloatArray
    kinds: tuple[str, ...]
    gravity: tuple[float, float, float] = GRAVITY
    masses: FloatArray | None = None
    centres: FloatArray | None = None
    balancers: Mapping[int, Balancer] = field(default_factory=dict)
    carried: AtTool | None = None

    def __post_init__(self) -> None:
        for joint, balancer in self.balancers.items():
            if self.kinds[joint] != "revolute":
                raise ArgumentError(f"balancer: joint {joint + 1} slides, no spring turns it")
            if not np.isfinite(np.hstack(balancer)).all() or balancer.rate < 0.0:
                raise ArgumentError(
                    f"balancer of joint {joint + 1}: needs finite numbers and a rate not below 0"
                )

    @property
    def directed(self) -> bool:
        """True if gravity has a direction."""
        return float(np.linalg.norm(self.gravity)) > 0.0

    @property
    def weighed(self) -> bool:
        """True if masses and centres of the links are known."""
        return self.masses is not None and self.centres is not None

    def under(self, carried: AtTool | None) -> JointPulls:
        """Return the loads with another load at the tool."""
        return replace(self, carried=carried)

    def of_rows(self, rows: IntArray) -> JointPulls:
        """Return the loads in some rows of a call."""
        carried = None if self.carried is None else self.carried.of_rows(rows)
        return self if carried is self.carried else self.under(carried)

    def posture(self, turns: FloatArray) -> Posture:
        """Return frames of links and axes after turns (N, n, 3, 3) about the axes at zero."""
        rotation = np.empty_like(turns)
        before: FloatArray = np.broadcast_to(np.eye(3), turns[:, 0].shape)
        for i in range(turns.shape[1]):
            before = before @ turns[:, i]
            rotation[:, i] = before
        return Posture(rotation, np.einsum("nijk,ik->nij", rotation, self.axes))

    def products(self, at: Posture) -> FloatArray:
        """Return gravity products of joint i by link l as `weights.gravity_products`, (N, n, n, 3).

        Links before a joint are not left out.
        """
        return _products(at, self._down)

    def products_turning(self, at: Posture, moments: FloatArray) -> FloatArray:
        """Differentiate the torque of `products` by moments (n, n, 3) by the joints, (N, n, n)."""
        return self._turning(at, moments, self._down)

    def torques(self, at: Posture, theta: FloatArray) -> FloatArray:
        """Torques about all joints at coordinates (N, n), N mm, (N, n)."""
        found = np.zeros(theta.shape)
        for levers, direction in self._forces:
            products = _products(at, direction)
            for i in range(theta.shape[1]):
                found[:, i] += (products[:, i, i:] * levers[..., i:, :]).sum(axis=(1, 2))
        if self.carried is not None:
            found += (at.axes * self.carried.moment[..., None, :]).sum(axis=2)
        for i, balancer in self.balancers.items():
            found[:, i] += self._spring(i, balancer, theta[:, i])[0]
        return found

    def torques_turning(self, at: Posture, theta: FloatArray) -> FloatArray:
        """Differentiate `torques` by the joints, (N, n, n)."""
        count, n = theta.shape
        found = np.zeros((count, n, n))
        behind = np.triu(np.ones((n, n)))[..., None]
        for levers, direction in self._forces:
            found += self._turning(at, behind * levers[..., None, :, :], direction)
        if self.carried is not None:
            for j in self._turned:
                carried = np.cross(at.axes[:, j, None], at.axes[:, j + 1 :])
                found[:, j + 1 :, j] += (carried * self.carried.moment[..., None, :]).sum(axis=2)
        for i, balancer in self.balancers.items():
            found[:, i, i] += self._spring(i, balancer, theta[:, i])[1]
        return found

    # --------------------------------------------------------------------------------------------

    @cached_property
    def _down(self) -> FloatArray:
        found: FloatArray = np.array(self.gravity) / np.linalg.norm(self.gravity)
        return found

    @cached_property
    def _turned(self) -> list[int]:
        """The joints that turn, counted from 0."""
        return [i for i, kind in enumerate(self.kinds) if kind == "revolute"]

    @cached_property
    def _ways(self) -> FloatArray:
        """Return the way from each joint's point to the next, 0 behind the last, (n, 3)."""
        found = np.zeros_like(self.points)
        found[:-1] = self.points[1:] - self.points[:-1]
        return found

    def _to(self, end: FloatArray) -> FloatArray:
        """Levers (…, n, 3) to a point (…, 3) on the last link."""
        found = np.array(np.broadcast_to(self._ways, (*end.shape[:-1], *self._ways.shape)))
        found[..., -1, :] = end - self.points[-1]
        return found

    @cached_property
    def _forces(self) -> list[tuple[FloatArray, FloatArray]]:
        """Levers (…, n, 3) times sizes of forces, and directions (…, 3) of these."""
        strength = float(np.linalg.norm(self.gravity))
        found: list[tuple[FloatArray, FloatArray]] = []
        weights = np.zeros_like(self.points)
        if self.masses is not None and self.centres is not None:
            behind = self.masses.sum() - np.cumsum(self.masses)
            weights = self.masses[:, None] * (self.centres - self.points)
            weights += behind[:, None] * self._ways
        if self.carried is not None:
            load = self.carried
            weights = weights + load.weight[..., None] * self._to(load.centre)
            if load.force.any():
                found.append((self._to(load.tool), load.force))
        if strength and weights.any():
            found.append((weights * strength, self._down))
        return found

    def _turning(self, at: Posture, levers: FloatArray, direction: FloatArray) -> FloatArray:
        """Differentiate Σ_l z_i·(R_l D_il × f) by the joints, (N, n, n), D (…, n, n, 3)."""
        rotation, axes = at
        found = np.zeros((*axes.shape[:2], axes.shape[1]))
        moments = (rotation[:, None] @ levers[..., None])[..., 0]
        f = direction[..., None, :]
        pulled = np.cross(f, axes)
        for j in self._turned:
            z = axes[:, j, None]
            behind = np.cross(z, moments[:, :, j:].sum(axis=2))  # links behind the joint turn
            found[:, :, j] = (behind * pulled).sum(axis=2)
            carried = np.cross(z, axes[:, j + 1 :])  # so do the axes behind it
            whole = moments[:, j + 1 :].sum(axis=2)
            found[:, j + 1 :, j] += (whole * np.cross(f, carried)).sum(axis=2)
        return found

    def _spring(
        self, i: int, balancer: Balancer, angle: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Torque of a balancer about its joint at angles (N,), and its slope."""
        z, a = self.axes[i], np.array(balancer.base) - self.points[i]
        b = np.array(balancer.link) - self.points[i]
        along, cos, sin = z * (z @ b), np.cos(angle)[:, None], np.sin(angle)[:, None]
        end = along + cos * (b - along) + sin * np.cross(z, b)
        way, moved = a - end, np.cross(z, end)
        length = np.linalg.norm(way, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):  # one without length pulls nowhere
            share = balancer.rate * (1.0 - balancer.free / length)
            growing = balancer.rate * balancer.free / length**3
        # t = z·(b × s w) = s w·(z × b), with w = a - b, db = z × b dq
        lever = (way * moved).sum(axis=1)
        slope = growing * -lever * lever - share * (moved**2).sum(axis=1)
        slope += share * (way * np.cross(z, moved)).sum(axis=1)
        return share * lever, slope


def _products(at: Posture, direction: FloatArray) -> FloatArray:
    """z_i·(R_l e × f) of unit vectors e, (N, n, n, 3), with f (3,) or (N, 3)."""
    across = np.cross(direction[..., None, :], at.axes)
    found: FloatArray = np.einsum("nlkj,nik->nilj", at.rotation, across)
    return found
