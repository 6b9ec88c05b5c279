"""Anchors of a machine whose limbs meet in one point, from what its actuators read and no more.

Lengths l_ij from poses i to anchors j have differences of squares that are bilinear in the two,

    -(l_ij² - l_0j² - l_i0² + l_00²)/2 = (x_i - x_0)·(a_j - a_0),

a matrix of rank m. Its factors are the poses and the anchors up to a linear map, and the lengths to
the first anchor say which map: linearly in its Gram matrix. What is left, a rigid motion and a
mirror image, no length can say: the anchors are laid on those of the robot file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import BoolArray, FloatArray, as_rows
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot, require_parallel

_MAPS = {"translation": 3, "xy": 2}
_LEAST = 1e-3  # of the largest eigenvalue of the Gram matrix, for one that no rows tell
_SAME = 1e-9  # of the machine's size: platform joints that are one point
_FREE = 1e-4  # weight of a free coordinate, where a fixed one has 1
_FLAT = 1e-6  # of the largest singular value: fewer dimensions than the map has


@dataclass(frozen=True, eq=False)
class LocatedAnchors:
    """A machine whose anchors follow from lengths alone.

    Attributes
    ----------
    robot : Robot
        With these anchors, laid on those it had: a start for `identify`.
    poses : ndarray (N, 6)
        Where it then is at each row.
    misfit : float
        Share of the lengths' pattern that m dimensions do not explain: some thousandths where
        lengths are good, hundredths where a constant is missing or rows are wrong. The pattern of
        m + 1 anchors is always explained: what counts then is the share of the first squared
        lengths, which is about half as much; NaN where rows are no more than that needs.
    mirrored : float
        How much better the anchors lie on those of the file as they are than mirrored: rms
        distance mirrored over rms distance. Near 1 the file does not say which of the two it is.
    """

    robot: Robot
    poses: FloatArray
    misfit: float
    mirrored: float


def locate_anchors(robot: Robot, actuators: ArrayLike) -> LocatedAnchors:
    r"""Find the anchors of a point platform from its actuators' readings, in closed form.

    Parameters
    ----------
    robot : Robot
        A machine of pose map "translation" or "xy" with m + 1 limbs of variable length or more,
        whose platform joints are one point. Its offsets and gains hold, and coordinates of anchors
        that it does not free; the other anchors only say how the result is turned, shifted and
        mirrored.
    actuators : array_like (N, n)
        What the actuators read, m (m + 3)/2 + 1 rows or more.

    Returns
    -------
    LocatedAnchors
        ``.robot`` is the start; `identify` finds the rest.

    Raises
    ------
    ValueError, TypeError
        Another machine, too few rows, anchors or rows that span too little.

    Examples
    --------
    Three belts to a sled whose place is unknown in every row:

    >>> import os, tempfile
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> path = os.path.join(tempfile.mkdtemp(), "sled.toml")
    >>> belts = [(0, 0), (3000, 0), (1500, 2000)]
    >>> with open(path, "w") as file:
    ...     _ = file.write('name = "sled"\nunits = {length = "mm", angle = "deg"}\n')
    ...     _ = file.write('[pose]\nmap = "xy"\nhome = {x = 1500, y = 700}\n')
    ...     for x, y in belts:
    ...         _ = file.write(f'[[limb]]\nkind = "UPS"\nbase = [{x}, {y}, 0]\n')
    ...         _ = file.write("platform = [0, 0, 0]\n")
    >>> robot = pk.load(path)
    >>> true = robot.replace({"base2.x": 2800.0, "base3.x": 1300.0, "base3.y": 2300.0})
    >>> places = np.random.default_rng(0).uniform(800, 1800, (12, 6)) * [1, 1, 0, 0, 0, 0]
    >>> found = pk.locate_anchors(robot, true.inverse(places)).robot.slots[:, :2]
    >>> between = np.linalg.norm(found - np.roll(found, 1, axis=0), axis=1)
    >>> bool(np.allclose(between, [2641.97, 2800, 2745.91], atol=0.01))
    True
    """
    require_parallel(robot)
    q, _ = as_rows("actuators", actuators, robot.n_actuators)
    if not np.isfinite(q).all():
        row = int(np.argmin(np.isfinite(q).all(axis=1)))
        raise ArgumentError(f"actuators: must be finite, found {q[row].tolist()} in row {row}")
    m = _dimensions(robot)
    if len(q) < m * (m + 3) // 2 + 1:
        raise ArgumentError(
            f"actuators: {m} dimensions need {m * (m + 3) // 2 + 1} rows or more, found {len(q)}"
        )
    base, point = robot.slots[:, 0:3], robot.slots[0, 3:6]
    squares = robot.drives(q) ** 2
    if m == 2:  # belts end above or below the plane
        squares = squares - (base[:, 2] - point[2]) ** 2
    anchors, places, misfit = _solved(squares, m)
    names = [f"base{i + 1}.{axis}" for i in range(len(base)) for axis in "xyz"[:m]]
    free = set(robot.geometry.match(robot.model.free)) if robot.model.free else set(names)
    fixed = np.array([name not in free for name in names]).reshape(-1, m)
    turn, shift, mirrored = _laid(anchors, base[:, :m] - point[:m], fixed)
    values = (anchors @ turn + shift + point[:m]).reshape(-1).tolist()
    own = {name: value for name, value in zip(names, values, strict=True) if name in free}
    poses = np.zeros((len(q), 6))
    poses[:, :m] = places @ turn + shift
    return LocatedAnchors(robot.replace(own), robot.frames.outward(poses), misfit, mirrored)


def _dimensions(robot: Robot) -> int:
    """Free coordinates of a point platform with limbs of variable length."""
    drivers = [KINDS[limb.kind].driver for limb in robot.model.limbs]
    legs = not any(driver.carries or driver.bent for driver in drivers)
    beside = any(KINDS[limb.kind].all_rows(limb.couple > 0) for limb in robot.model.limbs)
    m = _MAPS.get(robot.model.map)
    joints = robot.slots[:, 3:6]
    apart = float(np.abs(joints - joints[0]).max())
    if m is None or not legs or beside or apart > _SAME * robot.machine.struct.size:
        raise ArgumentError(
            f"robot: {robot.name} is no point on limbs of variable length (pose map translation or"
            " xy, all platform joints in one point)"
        )
    if len(joints) < m + 1:
        raise ArgumentError(f"robot: {m} dimensions need {m + 1} anchors, found {len(joints)}")
    return m


def _solved(squares: FloatArray, m: int) -> tuple[FloatArray, FloatArray, float]:
    """Anchors (c, m) and poses (N, m) of squared lengths (N, c), and what m dimensions leave."""
    pattern = -0.5 * (squares - squares[:1] - squares[:, :1] + squares[0, 0])[:, 1:]
    left, size, right = np.linalg.svd(pattern, full_matrices=False)
    if not size[m - 1] > _FLAT * size[0]:
        raise ArgumentError(f"actuators: rows or anchors span fewer than {m} dimensions")
    u, v = left[:, :m] * size[:m], right[:m].T  # of the poses, of the anchors, about the first
    # l_i0² - l_00² = uᵀ M u + 2 wᵀ u, M = GᵀG the Gram matrix of the map x = G u
    rows, columns = np.triu_indices(m)
    twice = np.where(rows == columns, 1.0, 2.0)
    scale = np.abs(u).max()
    table = np.hstack([twice * u[:, rows] * u[:, columns] / scale, 2.0 * u])
    table, target = table[1:], squares[1:, 0] - squares[0, 0]
    found = np.linalg.lstsq(table, target, rcond=None)[0]
    missed, surplus = np.linalg.norm(table @ found - target), len(table) - table.shape[1]
    misfit = float("nan")
    if len(size) > m:
        misfit = float(size[m] / size[m - 1])
    elif surplus > 0:
        misfit = float(missed / np.linalg.norm(target - target.mean()))
    gram = np.zeros((m, m))
    gram[rows, columns] = gram[columns, rows] = found[: len(rows)] / scale
    values, axes = np.linalg.eigh(gram)
    if not values[-1] > 0:
        raise ArgumentError("actuators: lengths that no anchors have; check offsets, gains, order")
    least = np.where(values > 0, 0.0, _LEAST * values[-1])
    if surplus > 0:  # what noise makes of an eigenvalue: below that its sign is noise
        slopes = np.zeros((table.shape[1], m))
        slopes[: len(rows)] = twice[:, None] * axes[rows] * axes[columns] / scale
        half = np.linalg.lstsq(table.T, slopes, rcond=None)[0]
        least = missed / np.sqrt(surplus) * np.linalg.norm(half, axis=0)
    values = np.maximum(values, least)
    root = np.sqrt(values)
    to_space = axes * root  # xᵀ = uᵀ · this
    start = (found[len(rows) :] @ axes) / root  # x_0 - a_0
    anchors = np.vstack([np.zeros(m), (v @ axes) / root])
    return anchors, start + u @ to_space, misfit


def _laid(
    points: FloatArray, on: FloatArray, fixed: BoolArray
) -> tuple[FloatArray, FloatArray, float]:
    """Rotation or mirror image (m, m) and shift that lay points on others, and how sure it is.

    Which of the two is that which lies nearer on the whole; where it lies, coordinates that are
    `fixed` (c, m) say first.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    middle, other = points.mean(axis=0), on.mean(axis=0)
    left, size, right = np.linalg.svd((points - middle).T @ (on - other))
    m, off = len(size), []
    for sign in (1.0, -1.0):
        flip = np.ones(m)
        flip[-1] = sign
        turn = (left * flip) @ right
        rest = (points - middle) @ turn - (on - other)
        off.append((float(np.sqrt((rest**2).sum(axis=1).mean())), turn))
    (near, turn), (far, _) = sorted(off, key=lambda each: each[0])
    weight = np.where(fixed, 1.0, _FREE)

    def moved(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        vector = np.concatenate([np.zeros(2), u[:1]]) if m == 2 else u[:3]
        return turn @ Rotation.from_rotvec(vector).as_matrix()[:m, :m].T, u[-m:]

    def residual(u: FloatArray) -> FloatArray:
        turned, shift = moved(u)
        return (weight * (points @ turned + shift - on)).ravel()

    start = np.concatenate([np.zeros(m * (m - 1) // 2), other - middle @ turn])
    scale = np.concatenate([np.full(m * (m - 1) // 2, 1.0 / float(np.ptp(on))), np.ones(m)])
    turn_found, shift = moved(least_squares(residual, start, x_scale=scale, method="lm").x)
    return turn_found, shift, far / near if near > 0 else float("inf")
