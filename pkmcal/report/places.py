"""Poses of the workspace, and a slice of it, at which a report looks at a machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.core.library import POSE
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import reach, sample_poses, workspace

_CELLS, _DRAWN = 30, 500  # of the map of the workspace along an axis; of poses for its quantiles
_SHARE = 0.9  # of the way from home to the ends of the workspace


@dataclass(frozen=True, eq=False)
class Area:
    """A grid over two coordinates: where it is inside, and its poses there (M, 6)."""

    axes: tuple[str, str]
    values: tuple[FloatArray, FloatArray]
    inside: BoolArray
    poses: FloatArray

    def filled(self, values: FloatArray) -> FloatArray:
        """Values (M,) at the poses, on the grid; NaN elsewhere."""
        shown = np.full(self.inside.shape, np.nan)
        shown[self.inside] = np.where(np.isfinite(values), values, np.nan)
        return shown


@dataclass(frozen=True, eq=False)
class Places:
    """Poses all over the workspace of the calibrated machine.

    Attributes
    ----------
    poses : ndarray (N, 6)
        mm and rad; of an arm joint coordinates (N, n).
    tools : ndarray (N, 6)
        Poses of the tool there, mm and rad.
    where : str
        How the poses were chosen.
    area : Area or None
        A slice through home; of arms none.
    """

    poses: FloatArray
    tools: FloatArray
    where: str
    area: Area | None


def in_the_workspace(found: Identification) -> Places | str:
    """Choose poses in the workspace of the calibrated machine, or say why there are none."""
    machine = found.robot
    if isinstance(machine, SerialArm):
        q = found.fit.equations.table.actuators
        shape = (_DRAWN, q.shape[1])
        random = np.random.default_rng(0).uniform(q.min(axis=0), q.max(axis=0), shape)
        tools = as_machine(machine).forward(random).pose
        where = f"{_DRAWN} joint positions drawn within the range that was measured"
        return Places(random, tools, where, None)
    where = f"{_DRAWN} poses drawn in the workspace, {100 * _SHARE:.0f} % of the way to its ends"
    if _endless(machine):
        machine = machine.within(_measured_box(found, machine))
        where = f"{_DRAWN} poses drawn between those that were measured, for no strokes are stated"
    try:
        poses = sample_poses(machine, _DRAWN, share=_SHARE)
        ends = reach(machine)
    except ValueError as error:
        return str(error)
    axes = [name for name in ends if name in "xyz" and ends[name][0] < ends[name][1]][:2]
    if len(axes) < 2:
        return Places(poses, poses, where, None)
    grid = workspace(machine, {name: (*ends[name], _CELLS) for name in axes})
    names, values = (axes[0], axes[1]), (grid.values[0], grid.values[1])
    area = Area(names, values, grid.inside, grid.poses[grid.inside])
    return Places(poses, poses, where, area)


def _endless(robot: Robot) -> bool:
    """Return whether nothing limits legs, cables or carriages: the workspace may be anywhere."""
    return not robot.model.workspace and any(
        drive.stroke is None and not drive.angle for drive in robot.model.drives
    )


def _measured_box(found: Identification, robot: Robot) -> dict[str, tuple[float, float]]:
    """Ends of the measured positions, with home, along each coordinate that the robot moves."""
    poses = np.vstack([found.fit.end.pose, robot.home])
    poses = poses[np.isfinite(poses).all(axis=1)]
    return {
        name: (float(poses[:, k].min()), float(poses[:, k].max()))
        for k, name in enumerate(POSE[:3])
        if name in robot.moved
    }
