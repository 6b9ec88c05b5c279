"""Tensions of cables at poses: whether all of them can pull against what acts on the platform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray, as_rows
from pkmcal.core import instruments
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.load import CableLoad, Vector
from pkmcal.kinematics.equilibrium import generalised, pulls_of_load
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import RowResult

_HELD, _SLACK, _TORN, _NOWHERE = range(4)
_OPTIMAL, _INFEASIBLE = 0, 2  # of linprog
_BALANCED = 1e-9  # of the forces: what rounding leaves of their balance


@dataclass(frozen=True, eq=False, repr=False)
class Tensions(RowResult):
    """Tensions of cables in equilibrium, for poses of any leading shape.

    Attributes
    ----------
    tension : ndarray (..., limbs)
        N; of the distributions that are in equilibrium one whose largest tension is least. Of limbs
        that are no cables the force along them, positive where they pull; NaN where there is none.
    status : ndarray of int (...)
        0: the platform is held by cables that pull. 1: some cable would have to push, or to pull
        less than `least`. 2: some cable would have to pull more than `most`. 3: out of reach.
    """

    tension: FloatArray
    status: Int32Array
    STATUS: ClassVar = {
        _HELD: "held",
        _SLACK: "not held by cables that pull",
        _TORN: "beyond the largest tension",
        _NOWHERE: "out of reach",
    }

    def _parts(self) -> Iterator[str | Table]:
        yield f"tensions of {self._counts()}"
        if self.ok.any():
            held = self.tension[self.ok]
            rows = [
                [f"limb {i + 1}", *(f"{f(held[:, i]):.4g}" for f in (np.min, np.median, np.max))]
                for i in range(held.shape[1])
            ]
            yield Table(["N", "least", "median", "largest"], rows, left=1)


def tensions(
    robot: Robot,
    poses: ArrayLike,
    force: ArrayLike | None = None,
    *,
    at: ArrayLike | None = None,
    least: float | None = None,
    most: float | None = None,
) -> Tensions:
    """Tensions of cables that hold the platform at poses.

    The workspace of positive tension are the poses where this is `ok`: there all cables can pull at
    once, with `least` or more, and balance the force. Limbs that are no cables push as well, and
    joints that keep the platform in planes hold it there.

    What is left out is that of the robot file, ``[load]``; where that states none, no force, at the
    platform's origin, and any tension from 0 on.

    Parameters
    ----------
    robot : Robot
        A machine with cables (kinds "cable", "pulley" and "tackle").
    poses : array_like (..., 6)
        x y z in mm, α β γ in rad.
    force : array_like (3,), optional
        What acts on the platform from outside, N, in the axes of the base: of a mass of 10 kg
        ``(0, 0, -98.1)``.
    at : array_like (3,), optional
        Where it acts, in the platform's frame, mm: the centre of mass, for example.
    least, most : float, optional
        Tension that every cable must have, and may have, N.

    Returns
    -------
    Tensions
        ``.ok`` for each pose, ``.tension`` of each limb.

    Raises
    ------
    ValueError, TypeError
        A machine without cables, a wrong shape, no numbers, or neither a force nor a least tension.

    Examples
    --------
    A sled on four belts in the plane, which its own weight does not pull out of it:

    >>> import pkmcal as pk
    >>> sled = pk.load("examples/belts/robot.toml")
    >>> found = tensions(sled, [[1500, 1000, 0, 0, 0, 0], [1500, 2500, 0, 0, 0, 0]], least=5.0)
    >>> found.ok
    array([ True, False])
    >>> found.tension[0].round(3)
    array([5., 5., 5., 5.])
    """
    require_parallel(robot)
    cables = np.array([limb.cable for limb in robot.model.limbs])
    if not cables.any():
        raise ArgumentError(f"robot: {robot.name} has no cables")
    rows, shape = as_rows("poses", poses, 6)
    load = _stated(robot, force, at, least, most)
    balance = _balance(robot, rows, load)
    spheres = balance.limbs
    found = np.full((len(rows), len(cables)), np.nan)
    status = np.full(len(rows), _NOWHERE, dtype=np.int32)
    status[balance.reached] = _SLACK
    for i in np.flatnonzero(_held(balance, spheres[cables], load.least, np.inf)):
        forces = _least_largest(balance.slopes[i], balance.load[i], spheres[cables], load.least)
        if forces is None:
            continue
        found[i] = forces[spheres]
        status[i] = _TORN if (found[i, cables] > load.most).any() else _HELD
    found[status != _HELD] = np.nan
    return Tensions(found.reshape(*shape, len(cables)), status.reshape(shape))


def can_pull(robot: Robot, poses: FloatArray, load: CableLoad) -> BoolArray:
    """Mark poses (N, 6) where all cables can pull at once: where `tensions` would be ok.

    Without tensions, which take some hundred times as long.
    """
    balance = _balance(robot, poses, load)
    cables = np.array([KINDS[limb.kind].cable for limb in robot.model.limbs])
    return _held(balance, balance.limbs[cables], load.least, load.most)


def _stated(
    robot: Robot, force: ArrayLike | None, at: ArrayLike | None, least: object, most: object
) -> CableLoad:
    """The load of the robot file, with what was given in its place."""
    load = robot.model.load or CableLoad()
    if force is not None:
        load = replace(load, force=_vector("force", force))
    if at is not None:
        load = replace(load, at=_vector("at", at))
    if least is not None:
        load = replace(load, least=number("least", least, least=0.0))
    if load.least == 0.0 and not any(load.force):
        raise ArgumentError(
            "least must be above 0 where no force acts: no tension at all balances it"
        )
    if most is not None:
        high = np.inf if most == np.inf else number("most", most, above=load.least)
        load = replace(load, most=high)
    return load


def _vector(name: str, given: ArrayLike) -> Vector:
    x, y, z = as_rows(name, given, 3)[0][0].tolist()
    if not np.isfinite((x, y, z)).all():
        raise ArgumentError(f"{name} must be finite, found {[x, y, z]}")
    return x, y, z


class _Balance(NamedTuple):
    """Pulls of the closures by a unit force (N, m, rows), and the load (N, m); which are limbs'.

    Of the generalised forces of a step of the pose map, torques over the characteristic length.
    """

    slopes: FloatArray
    load: FloatArray
    limbs: IntArray

    @property
    def reached(self) -> BoolArray:
        """Mask of poses the machine can take (N,)."""
        return np.asarray(np.isfinite(self.slopes).all(axis=(1, 2)))


def _balance(robot: Robot, poses: FloatArray, load: CableLoad) -> _Balance:
    force, at = np.array(load.force), np.array(load.at)
    machine, slots = robot.cable_machine, robot.slots
    own = robot.on_map(robot.frames.inward(poses))
    directions = machine.pulls(slots, own)
    slopes = machine.closure(slots, own, machine.inverse(slots, own)).by_step.transpose(0, 2, 1)
    kinds = [1 + int(row).bit_count() for row in machine.struct.rows[0 : machine.struct.limbs]]
    first = np.concatenate([[0], np.cumsum(kinds)[:-1]]).astype(np.intp)
    for i, row in enumerate(first):  # closures are in mm to some 1e-7, forces to rounding
        joint = instruments.points(own, np.ascontiguousarray(slots[i, 3:6]))[0]
        slopes[:, :, row] = generalised(robot, own, directions[:, i], joint)
    return _Balance(slopes, pulls_of_load(robot, own, force, at), first)


def _held(balance: _Balance, cables: IntArray, least: float, most: float) -> BoolArray:
    """Mark poses (N,) where forces balance the load, cables' from `least` to `most`."""
    from scipy.optimize import nnls

    count = balance.slopes.shape[2]
    others = np.setdiff1d(np.arange(count), cables)
    low = np.zeros(count)
    low[cables] = least
    held = np.zeros(len(balance.load), dtype=bool)
    for i in np.flatnonzero(balance.reached):
        slopes, rest = balance.slopes[i], balance.load[i] - balance.slopes[i] @ low
        # tensions above the least; those of other limbs have either sign
        parts = np.hstack([slopes[:, cables], slopes[:, others], -slopes[:, others]])
        if np.isfinite(most):  # with what each cable has left up to the most
            room, m = np.eye(len(cables), parts.shape[1]), len(parts)
            parts = np.block([[parts, np.zeros((m, len(cables)))], [room, np.eye(len(cables))]])
            rest = np.concatenate([rest, np.full(len(cables), most - least)])
        size = np.linalg.norm(balance.load[i]) + np.linalg.norm(slopes[:, cables]) * least
        held[i] = nnls(parts, rest)[1] <= _BALANCED * size
    return held


def _least_largest(
    slopes: FloatArray, load: FloatArray, cables: IntArray, least: float
) -> FloatArray | None:
    """Forces (rows,) with slopes (m, rows) that balance a load (m,): the largest tension least.

    None where there are none. `cables` are the rows of cables, which pull with `least` or more.
    """
    from scipy.optimize import linprog

    count = slopes.shape[1]
    of_cables = np.zeros((len(cables), count + 1))
    of_cables[np.arange(len(cables)), cables], of_cables[:, -1] = 1.0, -1.0
    low = np.full(count + 1, -np.inf)
    low[cables] = least
    found = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=of_cables,
        b_ub=np.zeros(len(cables)),
        A_eq=np.column_stack([slopes, np.zeros(len(load))]),
        b_eq=load,
        bounds=np.column_stack([low, np.full(count + 1, np.inf)]),
        method="highs",
    )
    if found.status == _INFEASIBLE:
        return None
    if found.status != _OPTIMAL:
        raise ArgumentError(f"poses: tensions were not found: {found.message}")
    # the solver balances to its tolerance, a step of least norm to rounding
    forces: FloatArray = found.x[:-1] + np.linalg.pinv(slopes) @ (load - slopes @ found.x[:-1])
    return forces
