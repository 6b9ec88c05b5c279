"""Equilibrium of a platform on cables: how it follows pose, tensions, load and geometry.

A cable whose way is l pulls with its tension t along -∂l/∂x, so cables balance a force F at the
point p of the platform where Σ t ∂l/∂x = F·∂p/∂x for each step x of the pose map. Derivatives of
∂l/∂x, by steps and by numbers of the geometry, are differences along the steps of what the core
gives exactly for cables of any kind: central ones of fourth order, good to some 1e-12.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, IntArray, mm_per_unit
from pkmcal.core import instruments
from pkmcal.geometry.load import AT, FORCE, CableLoad
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose

_STEP = 2e-4  # of the machine's size: its fourth power and what it leaves of rounding are small
_PLACES, _WEIGHTS = np.array([1, -1, 2, -2]), np.array([8, -8, -1, 1]) / 12  # of a derivative


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Forces that are left at N poses, by each of the m steps of the pose map.

    Those by angles are torques over the machine's characteristic length.

    Attributes
    ----------
    off : ndarray (N, m)
        What the cables pull less what they should, N.
    by_step : ndarray (N, m, m)
        Its derivative by the map's step, mm and rad.
    by_tension : ndarray (N, m, c)
        By the tensions.
    by_number : ndarray (N, m, p)
        By numbers of the geometry, those of the load included.
    """

    off: FloatArray
    by_step: FloatArray
    by_tension: FloatArray
    by_number: FloatArray


def equilibrium(
    robot: Robot, pose: FloatArray, tension: FloatArray, load: CableLoad, places: IntArray
) -> Equilibrium:
    """Return the missing force at poses (N, 6) under tensions (N, c) of cables, a limb each.

    `places` (p,) are those of numbers in ``robot.geometry.names``.
    """
    machine, arcs = robot.cable_machine, _arcs(robot)
    columns, chain = robot.geometry.driven(places)
    own, m = np.ascontiguousarray(robot.frames.inward(pose)), len(arcs)
    h = _STEP * float(machine.struct.size)
    steps = np.concatenate([*(k * np.eye(m) for k in _PLACES), np.zeros((1, m))]) * (h / arcs)
    at = machine.moved(np.tile(own, (len(steps), 1)), np.repeat(steps, len(own), axis=0))
    ways, by_own = machine.ways_at(robot.slots, at, columns)
    slopes = (ways / arcs).reshape(len(steps), *tension.shape, m)
    loads = pulls_of_load(robot, at, load.force, load.at).reshape(len(steps), len(own), m)
    pulled = np.einsum("snck,nc->snk", slopes, tension) - loads
    across = _derivative(pulled, m, h) * arcs[:, None, None]
    mixed = by_own.reshape(len(steps), *tension.shape, len(columns))
    mixed = np.einsum("sncp,nc->snp", _derivative(mixed, m, h), tension)
    by_number = mixed.transpose(1, 0, 2)
    if chain is not None:
        by_number = by_number @ chain
    of_load = _by_load(robot, own, load)
    for k, place in enumerate(places.tolist()):
        if (name := robot.geometry.names[place]) in of_load:
            by_number[:, :, k] = -of_load[name]
    return Equilibrium(
        pulled[-1], across.transpose(1, 2, 0), slopes[-1].transpose(0, 2, 1), by_number
    )


def balance(robot: Robot, pose: FloatArray, load: CableLoad) -> tuple[FloatArray, FloatArray]:
    """Return the wrench of unit tensions at poses (N, m, c), and the wrench to balance (N, m)."""
    own, arcs = np.ascontiguousarray(robot.frames.inward(pose)), _arcs(robot)
    ways = robot.cable_machine.ways_at(robot.slots, own, np.empty(0, dtype=np.int32))[0]
    return (ways / arcs).transpose(0, 2, 1), pulls_of_load(robot, own, load.force, load.at)


def _arcs(robot: Robot) -> FloatArray:
    """Factors (m,) to mm of the map's steps."""
    return mm_per_unit(pose_steps.step_units(robot), robot.length)


def _derivative(there: FloatArray, m: int, h: float) -> FloatArray:
    """By each of m steps (m, ...), of what was found after all steps, as far as h is a unit."""
    each = there[:-1].reshape(len(_PLACES), m, *there.shape[1:])
    return np.asarray(np.tensordot(_WEIGHTS / h, each, axes=1))


def pulls_of_load(robot: Robot, own: FloatArray, force: ArrayLike, at: ArrayLike) -> FloatArray:
    """Generalised forces (N, m) of a force (3,) at a point of the platform (3,), as `generalised`.

    `own` are poses (N, 6) in the machine's own frames; the force is in the axes of the base.
    """
    points = instruments.points(robot.frames.outward(own), np.asarray(at, dtype=np.float64))[0]
    pull = np.asarray(force)
    if robot.model.base_frame is not None:
        base = from_pose(robot.model.base_frame)
        points, pull = (points - base[:3, 3]) @ base[:3, :3], pull @ base[:3, :3]
    return generalised(robot, own, np.tile(pull, (len(own), 1)), points)


def generalised(robot: Robot, own: FloatArray, pull: FloatArray, point: FloatArray) -> FloatArray:
    """Generalised forces (N, m) of forces (N, 3) at points (N, 3): torques over the length."""
    arcs = _arcs(robot)
    wrench = np.concatenate([np.cross(point - own[:, :3], pull), pull], axis=1)
    twists = robot.cable_machine.step_twists(own)
    forces: FloatArray = (twists.transpose(0, 2, 1) @ wrench[:, :, None])[:, :, 0] / arcs
    return forces


def _by_load(robot: Robot, own: FloatArray, load: CableLoad) -> dict[str, FloatArray]:
    """Derivative (N, m) of the generalised forces, which are linear in each, by its numbers."""
    here = pulls_of_load(robot, own, load.force, load.at)
    found = {}
    for axis, unit in zip("xyz", np.eye(3), strict=True):
        found[f"{FORCE}.{axis}"] = pulls_of_load(robot, own, unit, load.at)
        there = pulls_of_load(robot, own, load.force, np.add(load.at, unit))
        found[f"{AT}.{axis}"] = there - here
    return found
