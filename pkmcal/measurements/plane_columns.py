"""Columns that the log of a machine in a plane lacks: nobody measures out of it.

A number that is the same in every row there was not measured either: were it taken as read, its
residuals of 0 would make noise look smaller than it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal.files.csv_table import Table
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.robot import Robot

_AXES = ("x", "y", "z")
_STILL = 1e-9  # of the fastest: what does not move


def fill_in(table: Table, robot: object, targets: Sequence[str]) -> None:
    """Say of coordinates along which no point of the machine moves that they were not read."""
    if not isinstance(robot, Robot):
        return
    for axis in _still(robot):
        beside = [other for other in _AXES if other != axis]
        for point in ("", *(f"{target}." for target in targets)):
            if not all(point + other in table.columns for other in beside):
                continue
            name = point + axis
            if name in table.columns and _differs(table, name):
                continue
            if name in table.columns:
                table.note(f"{table.columns[name].name!r} is the same in all rows, and the machine"
                           " does not move along it: taken as not read")  # fmt: skip
            _put(table, name, point + beside[0], "")
        stated = all(f"target.{other}" in table.columns for other in beside)
        if stated and f"target.{axis}" not in table.columns:
            _put(table, f"target.{axis}", f"target.{beside[0]}", "0")
        _fill_in_noise(table, axis, beside)


def _fill_in_noise(table: Table, axis: str, beside: Sequence[str]) -> None:
    """Deviations of what was not read: any, for they do not count."""
    own, first = f"sigma.{axis}", f"sigma.{beside[0]}"
    if own not in table.columns and first in table.columns:
        table.columns[own] = replace(table.columns[first], name=own)
    first = f"cov.{beside[0]}.{beside[0]}"
    if f"cov.{axis}.{axis}" not in table.columns and first in table.columns:
        for other in _AXES:
            name = "cov." + ".".join(sorted((axis, other)))
            _put(table, name, first, "0")
        table.columns[f"cov.{axis}.{axis}"] = replace(
            table.columns[first], name=f"cov.{axis}.{axis}"
        )


def _still(robot: Robot) -> list[str]:
    """Axes along which no point of the platform moves, whatever the machine does."""
    twists = pose_steps.step_twists(robot, robot.home[None])[0]
    turns, shifts = (np.abs(part).max(axis=1) for part in (twists[:3], twists[3:]))
    turned = turns > _STILL * max(float(turns.max()), np.finfo(float).tiny)
    moved = shifts > _STILL * max(float(shifts.max()), np.finfo(float).tiny)
    return [axis for i, axis in enumerate(_AXES) if not moved[i] and not np.delete(turned, i).any()]


def _differs(table: Table, name: str) -> bool:
    """Return whether a column has numbers that are not all the same; of one row it is not known."""
    values = table.numbers(name, "mm", blank=True)[0]
    known = values[np.isfinite(values)]
    return len(known) < 2 or bool(np.ptp(known) > 0.0)


def _put(table: Table, name: str, like: str, cell: str) -> None:
    table.columns[name] = replace(table.columns[like], name=name, cells=(cell,) * len(table))
