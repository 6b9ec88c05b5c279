"""Poses in a CSV file: columns ``x [mm]`` … ``gamma [deg]`` in any order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike

import numpy as np

from pkmcal import display
from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.files.column_names import BESIDE, known_as
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import write_csv
from pkmcal.kinematics.robot import Robot

_DECIMALS = {"mm": 6, "deg": 8}


def read_poses(path: str | PathLike[str], robot: Robot) -> FloatArray:
    """Read the poses of a file, mm and rad.

    Parameters
    ----------
    path : str or path
        A file with columns ``x [mm]`` … ``gamma [deg]``, or other units of length and angle;
        other spellings as in `read_measurements`.
    robot : Robot
        Whose home pose stands for columns that are not there.

    Returns
    -------
    ndarray (N, 6)
        x y z in mm, α β γ in rad.

    Raises
    ------
    ValueError
        Naming file, line and column: an unknown column, a missing unit, a cell without a number.
    OSError
        The file cannot be read.
    """
    table = Table(path)
    table.rename(known_as)
    table.leave_out((*BESIDE, "kind"))
    table.refuse_unknown(POSE.__contains__, POSE)
    poses = np.repeat(robot.home[None], len(table), axis=0)
    for k, name in enumerate(POSE):
        if name in table.columns:
            poses[:, k], _ = table.numbers(name, "mm" if k < 3 else "rad")
    return poses


def write_poses(
    path: str | PathLike[str],
    poses: FloatArray,
    columns: Mapping[str, FloatArray | Sequence[str]] | None = None,
    *,
    comment: str = "",
) -> None:
    """Write poses (N, 6), angles in degrees, and other columns beside them.

    Parameters
    ----------
    path : str or path
        `read_poses` reads it back, to 1e-6 mm, where there are no other columns.
    poses : ndarray (N, 6)
        mm and rad.
    columns : dict of str to ndarray (N,) or sequence of str, optional
        By heading, which says the unit.
    comment : str, optional
        Lines for its head, each with its ``#``.
    """
    units = ["mm" if k < 3 else "deg" for k in range(6)]
    others = columns or {}
    headings = [f"{name} [{unit}]" for name, unit in zip(POSE, units, strict=True)]
    shown = np.concatenate([poses[:, :3], np.degrees(poses[:, 3:])], axis=1)
    cells = (
        [
            *(display.fixed(float(v), _DECIMALS[u]) for v, u in zip(row, units, strict=True)),
            *(_cell(column[i]) for column in others.values()),
        ]
        for i, row in enumerate(shown)
    )
    write_csv(path, [*headings, *others], cells, comment=comment)


def _cell(value: object) -> str:
    return value if isinstance(value, str) else f"{value:.8g}"
