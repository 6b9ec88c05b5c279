"""A box that poses have to stay in: the workspace that a robot file states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.core.library import COORDINATE_UNITS, POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.toml_table import Table, shown

Box = Mapping[str, tuple[float, float]]  # least and largest value of coordinates, mm and rad

RADIUS = "radius"  # the distance from the z axis, beside the coordinates of a pose
_UNITS = {**COORDINATE_UNITS, RADIUS: "mm"}
_ROUNDING = 1e-12  # relative: a pose at an end is inside


def read_box(table: Table) -> Box:
    """The box of a table ``[workspace]``: of coordinates, and of the distance from the z axis."""
    table.only(_UNITS)
    box = {}
    for name in (name for name in _UNITS if name in table):
        ends = table.list_of(name, 2, "the least and the largest value")
        low, high = (table.as_number(name, end, _UNITS[name]) for end in ends)
        if not low < high:
            table.fail(name, f"the least value must be below the largest, found {shown(ends)}")
        box[name] = (low, high)
    return box


def both(own: Box, other: Box) -> Box:
    """Return the common part of two boxes.

    Raises
    ------
    ValueError
        No coordinate of a pose, or ends between which nothing is left.
    """
    found = dict(own)
    for name, (low, high) in other.items():
        if name not in _UNITS:
            raise ArgumentError(f"within: {name!r} is no coordinate{did_you_mean(name, _UNITS)}")
        least, most = found.get(name, (-np.inf, np.inf))
        found[name] = (max(float(low), least), min(float(high), most))
        if not found[name][0] < found[name][1]:
            raise ArgumentError(f"within: nothing is left of {name} from {low:g} to {high:g}")
    return found


def in_box(box: Box, poses: FloatArray) -> BoolArray:
    """Mark poses (..., 6) that are inside."""
    inside = np.ones(poses.shape[:-1], dtype=bool)
    for name, (low, high) in box.items():
        across = name == RADIUS
        value = np.hypot(poses[..., 0], poses[..., 1]) if across else poses[..., POSE.index(name)]
        room = _ROUNDING * (abs(low) + abs(high))
        inside &= (value >= low - room) & (value <= high + room)
    return inside
