"""Workspace of a machine: grids of poses, extent of each coordinate, random poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, did_you_mean, number, shown, whole
from pkmcal.arrays import BoolArray, FloatArray, as_rows
from pkmcal.core.library import POSE, STATUS
from pkmcal.display import Table, displayed
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.box import in_box
from pkmcal.kinematics.complete import completed
from pkmcal.kinematics.dexterity import BLOCK, Dexterity, dexterity
from pkmcal.kinematics.limits import Feasibility
from pkmcal.kinematics.pulled import pulled
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

_STEPS = 200  # along each coordinate, in search of the end of the workspace
_SMALLEST = 0.1  # of the conditioning at home: poses nearer to a singularity are not drawn
_MOST_CELLS = 1_000_000  # along an axis
_PATIENCE = 100  # times as many draws as poses are wanted
_POWER = {1: "", 2: "²", 3: "³"}


@dataclass(frozen=True, eq=False, repr=False)
class Workspace(Result):
    """A grid of poses; coordinate k of it runs along axis k of every array.

    Attributes
    ----------
    robot : Robot
        The machine.
    axes : tuple of str
        The coordinates that the grid runs through.
    values : tuple of ndarray
        Their values, mm and rad: the middles of equal cells.
    poses : ndarray (..., 6)
        NaN where the machine has no such pose.
    feasibility : Feasibility
        Which limits are kept.
    dexterity : Dexterity
        How well the poses are held.
    pulled : ndarray of bool (...)
        At which of them no cable would have to push: under the load of the robot file or, where
        that states none, against what holds it at home. True of machines without cables.
    """

    robot: Robot
    axes: tuple[str, ...]
    values: tuple[FloatArray, ...]
    poses: FloatArray
    feasibility: Feasibility
    dexterity: Dexterity
    pulled: BoolArray

    @property
    def inside(self) -> BoolArray:
        """Mask of poses within all limits, on home's side of singularities; where cables pull."""
        return _inside(self.robot, self.feasibility, self.dexterity) & self.pulled

    @property
    def cell(self) -> float:
        """Size of one cell: the product of the steps, mm and rad."""
        return float(np.prod([axis[1] - axis[0] for axis in self.values]))

    @property
    def volume(self) -> float:
        """Cells inside times their size: mm³ where the axes are x, y and z."""
        return float(self.inside.sum()) * self.cell

    def _parts(self) -> Iterator[str | Table]:
        cells = " x ".join(str(len(axis)) for axis in self.values)
        share = 100 * float(self.inside.mean())
        inside = self.dexterity.conditioning[self.inside]
        best = f"; conditioning {inside.min():.3f} to {inside.max():.3f}" if inside.size else ""
        yield f"{self.robot.name}: grid of {cells} poses, {share:.1f} % inside{best}"
        rows = []
        for name, axis in zip(self.axes, self.values, strict=True):
            half = (axis[1] - axis[0]) / 2
            ends = (axis[0] - half, axis[-1] + half)
            (low, unit), (high, _) = (displayed(v, _unit(name)) for v in map(float, ends))
            rows.append([f"{name} [{unit}]", f"{low:.6g}", f"{high:.6g}"])
        yield Table(["axis", "from", "to"], rows, left=1)
        units = [_unit(name) for name in self.axes]
        powers = (f"{unit}{_POWER[units.count(unit)]}" for unit in dict.fromkeys(units))
        yield f"volume {self.volume:.4g} {' '.join(powers)}"


def workspace(
    robot: Robot,
    axes: Mapping[str, tuple[float, float, int]],
    at: ArrayLike | None = None,
) -> Workspace:
    """A grid through the workspace: its slices, its volume, conditioning and singularities.

    Parameters
    ----------
    robot : Robot
        The machine.
    axes : mapping
        Coordinates with their ends (mm, rad) and the number of cells between:
        ``{"y": (-100, 100, 50), "z": (300, 500, 50)}`` is a slice of 50 x 50 poses.
    at : array_like (6,), optional
        The other coordinates; home by default.

    Returns
    -------
    Workspace
        ``.inside``, ``.volume``, ``.dexterity`` …

    Raises
    ------
    ValueError
        No coordinate, an unknown one, or one that the machine does not move by itself; ends in
        the wrong order; fewer than two cells.

    Examples
    --------
    >>> import pkmcal as pk
    >>> found = pk.workspace(pk.load("2tpr2tps"), {"y": (-300, 300, 30), "z": (200, 600, 40)})
    >>> found.inside.shape, bool(found.inside[15, 20])
    ((30, 40), True)
    """
    require_parallel(robot)
    require_moved(robot, axes)
    values = tuple(_middles(name, ends) for name, ends in axes.items())
    start, given = as_rows("at", robot.home if at is None else at, 6)
    if given:
        raise ArgumentError(f"at must have shape (6,), found {(*given, 6)}")
    shape = tuple(len(axis) for axis in values)
    rows = np.repeat(start, int(np.prod(shape)), axis=0)
    for name, column in zip(axes, np.meshgrid(*values, indexing="ij"), strict=True):
        rows[:, POSE.index(name)] = column.ravel()
    blocks = [completed(robot, rows[i : i + BLOCK]) for i in range(0, len(rows), BLOCK)]
    rows = np.concatenate(blocks)
    poses = rows.reshape(*shape, 6)
    held = pulled(robot, rows).reshape(shape)
    return Workspace(
        robot, tuple(axes), values, poses, robot.feasible(poses), dexterity(robot, poses), held
    )


def sample_poses(robot: Robot, count: int = 30, seed: int = 0, *, share: float = 0.5) -> FloatArray:
    """Random poses in the workspace: within all limits, and not near a singularity.

    Of machines on cables poses at which no cable would have to push, under the load of the robot
    file or, where that states none, against what holds the platform at home.

    Parameters
    ----------
    robot : Robot
        The machine.
    count : int
        How many.
    seed : int
        Of the draws.
    share : float
        How much of the way from home to the end of each coordinate is used, up to 1. Where the
        stated workspace leaves out home, from its middle.

    Returns
    -------
    ndarray (count, 6)
        mm and rad. Drawn evenly in a box: what the coordinates `reach` one by one, times `share`.

    Raises
    ------
    ValueError
        The machine has too few such poses; a count, seed or share that does not fit.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> poses = pk.sample_poses(robot, 5)
    >>> poses.shape, bool(robot.feasible(poses).ok.all())
    ((5, 6), True)
    """
    require_parallel(robot)
    whole("count", count, 0)
    if number("share", share, least=0) > 1:
        raise ArgumentError(f"share must be from 0 to 1, found {share!r}")
    random = np.random.default_rng(checked_seed(seed))
    box = reach(robot)
    columns = [POSE.index(name) for name in box]
    middle = _middle(robot)
    start = middle[columns]
    low, high = start + share * (np.transpose(list(box.values())) - start)
    kept = np.empty((0, 6))
    for _ in range(_PATIENCE):
        drawn = np.repeat(middle[None], 2 * count, axis=0)
        drawn[:, columns] = random.uniform(low, high, (2 * count, len(columns)))
        drawn = completed(robot, drawn)
        kept = np.concatenate([kept, drawn[good_poses(robot, drawn)]])
        if len(kept) >= count:
            return kept[:count]
    raise ArgumentError(f"{robot.name}: found {len(kept)} good poses, {count} are wanted")


def reach(robot: Robot) -> dict[str, tuple[float, float]]:
    """Return how far each coordinate alone goes from home, mm and rad.

    Where the stated workspace leaves out home, from its middle.

    Returns
    -------
    dict of str to (float, float)
        Of each coordinate that the machine moves: least and most, before a limit is broken or a
        singularity is near.

    Raises
    ------
    ValueError
        Home, or that middle, is no good pose.
    """
    middle = _middle(robot)
    if not good_poses(robot, middle[None])[0]:
        if not in_box(robot.model.workspace, robot.home):
            raise ArgumentError(
                f"{robot.name}: the stated workspace leaves out home, and its middle is no pose"
                " that the machine can take"
            )
        broken = robot.feasible(robot.home[None]).broken()
        if STATUS[int(robot.forward(robot.home_actuators).status)] == "singular":
            broken = []  # the inverse starts there: it finds no pose
        why = f"home breaks a limit: {'; '.join(broken)}" if broken else "home is singular"
        if not broken and not pulled(robot, robot.home[None])[0]:
            why = "at home some cable would have to push, under the load of the file"
        raise ArgumentError(f"{robot.name}: {why.replace(' in rows 0', '')}")
    size = robot.model.mechanism.extent(robot.geometry.slots, robot.home)
    found = {}
    for name in robot.moved:
        stated = robot.model.workspace.get(name, (-np.inf, np.inf))
        step = np.radians(90.0) / _STEPS if name in POSE[3:] else 2 * size / _STEPS
        ends = []
        for sign in (-1.0, 1.0):
            ray = np.repeat(middle[None], _STEPS, axis=0)
            far = ray[:, POSE.index(name)] + sign * step * np.arange(_STEPS)
            ray[:, POSE.index(name)] = np.clip(far, *stated)
            good = good_poses(robot, completed(robot, ray))
            last = int(np.argmin(good)) - 1 if not good.all() else _STEPS - 1
            ends.append(float(ray[last, POSE.index(name)]))
        found[name] = (ends[0], ends[1])
    return found


def _middle(robot: Robot) -> FloatArray:
    """Home, with coordinates that the stated workspace leaves out in the middle of their range."""
    middle: FloatArray = robot.home.copy()
    for name in (name for name in POSE if name in robot.model.workspace):
        low, high = robot.model.workspace[name]
        k = POSE.index(name)
        if not low <= middle[k] <= high:
            middle[k] = (low + high) / 2.0
    if (middle != robot.home).any():
        middle = completed(robot, middle[None])[0]
    return middle


def require_moved(robot: Robot, axes: Mapping[str, object]) -> None:
    """Refuse axes that span nothing, or along which the machine does not move by itself.

    Raises
    ------
    ValueError, TypeError
        Naming the coordinate.
    """
    if not isinstance(axes, Mapping):
        raise ArgumentTypeError(
            f"axes must map coordinates to numbers, found {type(axes).__name__}"
        )
    if not axes:
        raise ArgumentError("axes names no coordinate")
    moved = robot.moved
    for name in axes:
        if name not in moved:
            known = did_you_mean(name, moved)
            raise ArgumentError(f"axes: {name!r} is no coordinate that {robot.name} moves{known}")


def _inside(robot: Robot, feasible: Feasibility, dexterity_there: Dexterity) -> BoolArray:
    home = dexterity(robot, robot.home)
    side = np.sign(dexterity_there.determinant) * np.sign(home.determinant)
    held = (side > 0) | (np.isnan(home.determinant) & (dexterity_there.conditioning > 0))
    return np.asarray(feasible.ok & held)


def good_poses(robot: Robot, poses: FloatArray) -> BoolArray:
    """Mark poses (N, 6) within all limits, on home's side of singularities, not near one.

    Of machines on cables those at which no cable would have to push.
    """
    there = dexterity(robot, poses)
    least = _SMALLEST * float(dexterity(robot, robot.home).conditioning)
    good = _inside(robot, robot.feasible(poses), there) & (there.conditioning > max(least, 1e-9))
    good[good] = pulled(robot, poses[good])
    return good


def _middles(name: str, ends: tuple[float, float, int]) -> FloatArray:
    try:
        given = np.asarray(ends)
    except ValueError:  # ragged
        given = np.empty(0)
    if given.dtype.kind not in "iuf" or given.shape != (3,):
        raise ArgumentError(f"axes: {name} must be (low, high, cells), found {shown(ends)}")
    low, high, cells = given.tolist()
    count = int(cells) if np.isfinite(cells) else 0
    if count != cells:
        raise ArgumentError(f"axes: {name} must have a whole number of cells, found {cells}")
    if not -np.inf < low < high < np.inf:
        raise ArgumentError(f"axes: {name} must run from low to high, found {low} to {high}")
    if count > _MOST_CELLS:
        raise ArgumentError(f"axes: {name} must have at most {_MOST_CELLS} cells, found {cells:g}")
    if count < 2:
        raise ArgumentError(f"axes: {name} must have two cells at least, found {count}")
    middles: FloatArray = low + (high - low) * (np.arange(count) + 0.5) / count
    return middles


def _unit(name: str) -> str:
    return "rad" if name in POSE[3:] else "mm"
