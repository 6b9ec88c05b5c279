"""Section of a report on a machine that yields: its stiffness, and the effect of a cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.stiffness import (
    ComplianceTable,
    Stiffness,
    compliance_table,
    matrix_cells,
    stiffness,
)
from pkmcal.report.places import Places
from pkmcal.view.yielding import WAYS

FORCE = 100.0  # N, of a cut and of the table of one pose


@dataclass(frozen=True, eq=False)
class Way:
    """Stiffness along a direction, N/mm, and how far `FORCE` along it moves the tool, mm."""

    name: str
    least: float
    median: float
    largest: float
    moved: float
    moved_most: float


@dataclass(frozen=True, eq=False)
class Map:
    """The stiffness along the softest direction over two coordinates, N/mm; NaN outside."""

    axes: tuple[str, str]
    values: tuple[FloatArray, FloatArray]
    softest: FloatArray


@dataclass(frozen=True, eq=False)
class Yielding:
    """Stiffness of a machine, for its report.

    Attributes
    ----------
    force : float
        N, that `Way.moved` and `static` are of.
    where : str
        How the poses of `ways` were chosen.
    softest : ndarray (N,)
        N/mm along the softest direction at each of them that has one.
    ways : list of Way
        Along the axes of the base, and along the softest direction of each pose.
    direction, pose : ndarray (3,), (6,)
        The softest direction of all, and the pose where it is.
    map : Map or None
    matrix : ndarray (6, 6)
        At home: N mm/rad, N and N/mm.
    home : float
        N/mm along the softest direction at home.
    static : ComplianceTable or None
        At home; None where the machine does not hold it.
    """

    force: float
    where: str
    softest: FloatArray
    ways: list[Way]
    direction: FloatArray
    pose: FloatArray
    map: Map | None
    matrix: FloatArray
    home: float
    static: ComplianceTable | None

    def matrix_rows(self) -> list[list[str]]:
        """The numbers of the matrix as they are shown."""
        return matrix_cells(self.matrix)

    def static_rows(self) -> list[tuple[float, list[float]]]:
        """List forces with the tool's motion along +x, -x, +y, -y, +z, -z, mm."""
        if self.static is None:
            return []
        sizes = np.linalg.norm(self.static.displacement, axis=2).T
        return list(zip(self.static.force.tolist(), sizes.tolist(), strict=True))


def of(robot: Robot | SerialArm, places: Places | None) -> Yielding | None:
    """Return the stiffness at poses and at home; None for arms and where nothing yields."""
    if isinstance(robot, SerialArm) or robot is robot.rigid:
        return None
    home = robot.home
    at_home = stiffness(robot, home)
    poses = home[None] if places is None else places.poses
    found = stiffness(robot, poses)
    direction, softest = found.softest
    good = np.isfinite(softest)
    worst = int(np.argmin(np.where(good, softest, np.inf)))
    try:
        static = compliance_table(robot, home, FORCE)
    except ArgumentError:
        static = None
    return Yielding(
        force=FORCE,
        where="at home" if places is None else places.where,
        softest=softest[good],
        ways=_ways(found, softest, good),
        direction=direction[worst],
        pose=poses[worst],
        map=None if places is None else _map(robot, places),
        matrix=at_home.matrix,
        home=float(at_home.softest[1]),
        static=static,
    )


def _ways(found: Stiffness, softest: FloatArray, good: np.ndarray) -> list[Way]:
    if not good.any():
        return []
    along = {name: found.stiffness_along(way)[good] for name, way in WAYS.items()}
    along["softest"] = softest[good]
    ways = []
    for name, each in along.items():
        moved = FORCE / each
        sizes = (each.min(), np.median(each), each.max(), np.median(moved), moved.max())
        ways.append(Way(name, *map(float, sizes)))
    return ways


def _map(robot: Robot, places: Places) -> Map | None:
    if places.area is None:
        return None
    softest = stiffness(robot, places.area.poses).softest[1]
    return Map(places.area.axes, places.area.values, places.area.filled(softest))
