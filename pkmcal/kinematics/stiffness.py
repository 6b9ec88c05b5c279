"""Stiffness of a machine that yields: matrices at poses, and how far it gives under test loads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance, number
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.display import Table, fixed
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.complete import completed
from pkmcal.kinematics.loaded import LoadedMachine
from pkmcal.kinematics.robot import Robot
from pkmcal.result import Result
from pkmcal.screw import from_pose

_NONE = 1e-12  # of the largest: a compliance that is none
_SHOWN = 1e-9  # of the geometric mean of two diagonals: a stiffness beside them that is none
_STEPS = np.arange(1, 11) / 10.0  # of the rated load
_WAYS = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True, eq=False, repr=False)
class Stiffness(Result):
    """Stiffness of a machine at its tool, for poses of any leading shape.

    Of small forces beside those that act already: moments first, then forces, in the axes of the
    base. NaN where the machine has no such pose, is singular or gives way.

    Attributes
    ----------
    compliance : ndarray (..., 6, 6)
        Turning and motion of the tool by moment and force: rad/(N mm), rad/N = mm/(N mm), mm/N.
    """

    compliance: FloatArray

    @cached_property
    def matrix(self) -> FloatArray:
        """Moment and force by turning and motion, (..., 6, 6): N mm/rad, N and N/mm.

        A coordinate that does not yield at all has an infinite stiffness of its own, and none
        with others. NaN where the machine does not yield in some other direction either.
        """
        flat = self.compliance.reshape(-1, 6, 6)
        out = np.full(flat.shape, np.nan)
        for found, given in zip(out, flat, strict=True):
            if not np.isfinite(given).all():
                continue
            free = np.diagonal(given) > 0.0
            part = given[np.ix_(free, free)]
            size = 1.0 / np.sqrt(np.diagonal(part))  # compares lengths with angles
            scaled = part * np.outer(size, size)
            if free.any() and np.linalg.svd(scaled, compute_uv=False)[-1] > _NONE:
                found[:] = np.diag(np.where(free, 0.0, np.inf))
                inverse = np.linalg.inv(scaled) * np.outer(size, size)
                found[np.ix_(free, free)] = 0.5 * (inverse + inverse.T)
        return out.reshape(self.compliance.shape)

    def along(self, direction: ArrayLike) -> FloatArray:
        """Return how far the tool gives along a direction by a force along it, mm/N.

        Parameters
        ----------
        direction : array_like (3,)
            In the axes of the base; of any length but 0.

        Returns
        -------
        ndarray (...)
        """
        rows, shape = as_rows("direction", direction, 3)
        if shape != () or not np.isfinite(rows).all() or not rows.any():
            raise ArgumentError(f"direction must be three numbers, not all 0, found {direction!r}")
        unit = rows[0] / np.linalg.norm(rows[0])
        return np.asarray(unit @ self.compliance[..., 3:, 3:] @ unit)

    def stiffness_along(self, direction: ArrayLike) -> FloatArray:
        """The force along a direction that moves the tool by 1 mm along it, N/mm, (...).

        The tool is free to go aside. Infinite where it does not yield along the direction.

        Parameters
        ----------
        direction : array_like (3,)
            As for `along`.
        """
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.maximum(self.along(direction), 0.0))

    def displacement(self, force: ArrayLike) -> FloatArray:
        """Return how far a force at the tool, such as that of a cut, moves it: mm, (..., 3).

        Parameters
        ----------
        force : array_like (3,)
            N, in the axes of the base.
        """
        rows, shape = as_rows("force", force, 3)
        if shape != ():
            raise ArgumentError(f"force must have shape (3,), found {np.shape(force)}")
        return np.asarray(self.compliance[..., 3:, 3:] @ rows[0])

    @cached_property
    def softest(self) -> tuple[FloatArray, FloatArray]:
        """The direction in which a force moves the tool most, (..., 3), and N/mm along it (...).

        The direction's largest component is positive.
        """
        flat = self.compliance[..., 3:, 3:].reshape(-1, 3, 3)
        direction, stiffness = np.full((len(flat), 3), np.nan), np.full(len(flat), np.nan)
        good = np.isfinite(flat).all(axis=(1, 2))
        values, vectors = np.linalg.eigh(flat[good])
        way = vectors[..., -1]
        largest = np.argmax(np.abs(way), axis=1)[:, None]
        way = way * np.sign(np.take_along_axis(way, largest, axis=1))
        with np.errstate(divide="ignore"):  # nothing yields
            stiffness[good] = 1.0 / values[:, -1]
        direction[good] = way
        shape = self.compliance.shape[:-2]
        return direction.reshape(*shape, 3), stiffness.reshape(shape)

    def _parts(self) -> Iterator[str | Table]:
        direction, stiffness = self.softest
        known = np.isfinite(stiffness)
        yield f"stiffness at {int(known.sum())} of {known.size} poses"
        if not known.any():
            return
        ways = {"along x": [1, 0, 0], "along y": [0, 1, 0], "along z": [0, 0, 1]}
        found = {name: self.stiffness_along(way)[known] for name, way in ways.items()}
        found["softest"] = stiffness[known]
        measures = (np.min, np.median, np.max)
        yield Table(
            ["N/mm", "least", "median", "largest"],
            [[name, *(f"{f(each):.4g}" for f in measures)] for name, each in found.items()],
            left=1,
        )
        worst = np.nanargmin(stiffness)
        x, y, z = direction.reshape(-1, 3)[worst].round(3) + 0.0
        yield f"softest along ({x:g}, {y:g}, {z:g}) of the base"
        if known.size == 1:
            names = [f"{what} {axis}" for what in ("moment", "force") for axis in "xyz"]
            shown = zip(names, matrix_cells(self.matrix.reshape(6, 6)), strict=True)
            heads = ["N mm/rad, N, N/mm", "turn x", "turn y", "turn z", "x", "y", "z"]
            yield Table(heads, [[name, *row] for name, row in shown], left=1)


def matrix_cells(matrix: FloatArray) -> list[list[str]]:
    """Show the numbers of a stiffness matrix (6, 6); what is no more than rounding is 0."""
    size = np.sqrt(np.diagonal(matrix))
    with np.errstate(invalid="ignore"):
        least = _SHOWN * np.outer(size, size)
        shown = np.where(np.abs(matrix) < least, 0.0, matrix)
    return [[f"{number:.4g}".replace("inf", "∞") for number in row] for row in shown.tolist()]


def stiffness(
    robot: Robot | SerialArm,
    poses: ArrayLike,
    *,
    load: Load | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0),
) -> Stiffness:
    """Compute stiffness at poses, by the compliances of the machine's numbers.

    Parameters
    ----------
    robot : Robot or SerialArm
        One in which something yields.
    poses : array_like (..., 6) or (..., n)
        Where the tool is under the load, x y z in mm, α β γ in rad. Of a pose that the machine
        cannot take, the coordinates that its file declares are kept (`Robot.complete`). Of an arm
        its joint coordinates as they are commanded, rad.
    load : Load, optional
        What it carries in place of the payload that its file states.
    at : array_like (3,), optional
        The point of the tool that forces act on and whose motion is meant, in the frame of the
        tool, mm; its origin by default.

    Returns
    -------
    Stiffness
        ``.matrix``, ``.compliance``, ``.softest``, ``.along(direction)``.

    Raises
    ------
    ValueError, TypeError
        Nothing of the machine yields, a wrong shape, or no numbers.

    Examples
    --------
    A hexapod on legs of 20 kN/mm, pushed from above:

    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod").yielding({"offset*": 1 / 20e3})
    >>> round(float(pk.stiffness(robot, robot.home).matrix[5, 5]), 6)
    111923.203972
    """
    _require_yielding(robot)
    carrying = robot if load is None else robot.under(load)
    point, point_shape = as_rows("at", at, 3)
    if point_shape != ():
        raise ArgumentError(f"at must have shape (3,), found {point_shape}")
    if isinstance(carrying, SerialArm):
        rows, shape = as_rows("poses", poses, carrying.n_actuators)
        twists, compliance, turned = _of_arm(carrying, rows)
    else:
        rows, shape = as_rows("poses", poses, 6)
        twists, compliance, turned = _of_robot(carrying, rows)
    lever = turned @ point[0]
    twists[:, 3:] += np.cross(twists[:, :3], lever[:, :, None], axis=1)
    found = np.einsum("nis,ns,njs->nij", twists, compliance, twists)
    return Stiffness(found.reshape(*shape, 6, 6))


def _of_robot(robot: Robot, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Twists of the tool (N, 6, s) by what yields, compliances (N, s), and how the tool stands."""
    rows = completed(robot, rows)
    own = np.ascontiguousarray(robot.frames.inward(rows))
    machine, slots = robot.machine, robot.slots
    assert isinstance(machine, LoadedMachine)
    q = machine.inverse(slots, own)
    twists = robot.frames.twists_outward(own, machine.yielding_twists(slots, own, q))
    twists[~np.isfinite(q).all(axis=1)] = np.nan
    return twists, machine.compliances(slots, q), from_pose(rows)[:, :3, :3]


def _of_arm(arm: SerialArm, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Twists, compliances and stand as `_of_robot`, of an arm at commands (N, n)."""
    yields = {
        term.joint: value
        for term, value in arm.joint_laws.numbers.items()
        if term.kind == "compliance"
    }
    twists = arm.joint_jacobian(theta, frame="tip")[..., [*yields]]
    compliance = np.tile(list(yields.values()), (len(theta), 1))
    return twists, compliance, arm.forward(theta)[:, :3, :3]


@dataclass(frozen=True, eq=False, repr=False)
class ComplianceTable(Result):
    """Displacement of the tool under loads along the axes, solved anew for each.

    Attributes
    ----------
    rated : float
        N.
    force : ndarray (10,)
        10 … 100 % of the rated load, N.
    displacement : ndarray (6, 10, 3)
        Of the tool by each force along +x, -x, +y, -y, +z, -z of the base, mm; NaN where the
        machine gives way.
    """

    rated: float
    force: FloatArray
    displacement: FloatArray

    @property
    def compliance(self) -> FloatArray:
        """Displacement along the force per newton, (6, 10), mm/N."""
        signs = np.array([1.0, -1.0] * 3)[:, None]
        along = np.stack([self.displacement[i, :, i // 2] for i in range(6)])
        return np.asarray(signs * along / self.force)

    def _parts(self) -> Iterator[str | Table]:
        yield f"static compliance up to {self.rated:g} N, mm by force along the axes of the base"
        rows = []
        for j, force in enumerate(self.force.tolist()):
            sizes = np.linalg.norm(self.displacement[:, j], axis=1)
            rows.append([f"{force:g}", *(fixed(float(size), 4) for size in sizes)])
        rows.append(["mm/N, at most", *(f"{np.abs(each).max():.3g}" for each in self.compliance)])
        yield Table(["force [N]", *_WAYS], rows, left=1)


def compliance_table(
    robot: Robot | SerialArm, pose: ArrayLike, rated: float = 1000.0, *, load: Load | None = None
) -> ComplianceTable:
    """Static compliance at a pose as ISO 9283 tests it: forces on the tool, axis by axis.

    The actuators stay where they hold the pose without the force. Each force is solved for itself,
    so that the table bends where the machine does.

    Parameters
    ----------
    robot : Robot or SerialArm
        One in which something yields.
    pose : array_like (6,) or (n,)
        x y z in mm, α β γ in rad; of an arm its joint coordinates as they are commanded, rad.
    rated : float
        The largest force, N.
    load : Load, optional
        What the machine carries besides, in place of the payload that its file states.

    Returns
    -------
    ComplianceTable
        Displacements by ± x y z and 10 … 100 % of the rated load.

    Raises
    ------
    ValueError, TypeError
        Nothing of the machine yields, it cannot hold the pose, or a wrong argument.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod").yielding({"offset*": 1 / 20e3})
    >>> table = pk.compliance_table(robot, robot.home, rated=500)
    >>> table.compliance[4].round(8)[:3]  # along +z
    array([8.93e-06, 8.93e-06, 8.93e-06])
    """
    _require_yielding(robot)
    limit = number("rated", rated, above=0.0)
    size = robot.n_actuators if isinstance(robot, SerialArm) else 6
    rows, shape = as_rows("pose", pose, size)
    if shape != ():
        raise ArgumentError(f"pose must have shape ({size},), found {np.shape(pose)}")
    sense = np.repeat(np.eye(3), 2, axis=0) * np.array([1.0, -1.0] * 3)[:, None]
    forces = (sense[:, None] * (limit * _STEPS)[:, None]).reshape(-1, 3)
    forces = np.vstack([np.zeros((1, 3)), forces])
    if isinstance(robot, SerialArm):
        moved = _arm_under(robot, rows, load, forces)
    else:
        moved = _robot_under(robot, rows, load, forces)
    away = (moved[1:] - moved[0]).reshape(6, len(_STEPS), 3)
    return ComplianceTable(limit, limit * _STEPS, away)


def _robot_under(
    robot: Robot, rows: FloatArray, load: Load | None, forces: FloatArray
) -> FloatArray:
    """Places (N, 3) of the tool under forces (N, 3), at what holds a pose (1, 6) without them."""
    carried = Load.stated(dict(robot.geometry.items())) if load is None else load
    held = robot.under(_with_force(carried, np.zeros((1, 3))))
    at = completed(held, rows)
    q = held.inverse(at)
    if not np.isfinite(q).all():
        raise ArgumentError(f"pose: {robot.name} cannot hold it")
    there = robot.under(_with_force(carried, forces))
    return there.forward(np.repeat(q, len(forces), axis=0), guess=at[0]).pose[:, :3]


def _arm_under(
    arm: SerialArm, theta: FloatArray, load: Load | None, forces: FloatArray
) -> FloatArray:
    """Places as `_robot_under`, of an arm at commands (1, n)."""
    there = arm.under(_with_force(Load() if load is None else load, forces))
    found: FloatArray = there.forward(np.repeat(theta, len(forces), axis=0))[:, :3, 3]
    return found


def _require_yielding(robot: Robot | SerialArm) -> None:
    if isinstance(robot, SerialArm):
        yields, how = robot.joint_laws.yielding, "state stiffness of its joints"
    else:
        instance("robot", robot, Robot, " or a SerialArm")
        yields = isinstance(robot.machine, LoadedMachine)
        how = "state stiffness or [compliance] in its file"
    if not yields:
        raise ArgumentError(f"robot: nothing of {robot.name} yields: {how}")


def _with_force(load: Load, force: FloatArray) -> Load:
    """The load, one for all rows, with forces (N, 3) besides."""
    load.rows(())
    return Load(load.mass, load.centre, np.asarray(load.force) + force, load.moment)
