"""Angles of passive joints: what a machine's own sensors of them read, and by which numbers.

Where the machine goes at its actuators, not at any pose: a passive joint closes its chain there
alone. Rates are central differences of the forward kinematics, which are exact to 1e-13 of the
machine's size; a step goes 1e-5 of it, and the rates are good to 1e-8 of theirs.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, IntArray, wrapped
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.calibratable import Calibratable

_STEP = 1e-5  # of the machine's size


def place_of(machine: Calibratable, joint: str) -> int:
    """Which passive joint a name is.

    Raises
    ------
    ValueError
        The machine has none of this name, or it slides.
    """
    names = machine.passive_names if isinstance(machine, Robot) else ()
    if joint not in names:
        raise ArgumentError(
            f"joint: {machine.name} has no passive joint {joint!r}{did_you_mean(joint, names)}"
        )
    return names.index(joint)


def angles(
    machine: Calibratable,
    q: FloatArray,
    pose: FloatArray,
    joint: str,
    approach: FloatArray | None = None,
) -> FloatArray:
    """Angles (N,) from home at coordinates (N, n), near poses (N, 6); NaN where there is none.

    `approach` (N, n) says from where the actuators came.
    """
    place, robot = place_of(machine, joint), cast(Robot, machine)
    if approach is not None:
        robot = robot.approaching(approach)
    found: FloatArray = robot.forward(q, pose).passive[:, place]
    return found


def rates(
    machine: Calibratable,
    q: FloatArray,
    pose: FloatArray,
    joint: str,
    places: IntArray,
    approach: FloatArray | None = None,
) -> FloatArray:
    """How they follow numbers of the geometry at some places, (N, p), the actuators held."""
    values, units = machine.geometry.values, machine.geometry.units
    by_unit = {"mm": _STEP * machine.length, "rad": _STEP}
    reach = max(1.0, float(np.abs(q).max()))
    found = np.empty((len(q), len(places)))
    for column, number in enumerate(places):
        step = by_unit.get(units[number], by_unit["mm"] / reach)
        ends = []
        for side in (1, -1):
            changed = values.copy()
            changed[number] += side * step
            ends.append(angles(machine.with_values(changed), q, pose, joint, approach))
        found[:, column] = wrapped(ends[0] - ends[1]) / (2 * step)
    return found
