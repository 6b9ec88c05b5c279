"""Angles of passive joints: what a machine's own sensors of them read, and by which numbers.

The swivel of a pulley follows from the pose and its limb's numbers, in closed form. A joint of a
chain is known where the machine goes at its actuators, not at any pose: it closes its chain there
alone. Its rates are central differences of the forward kinematics, which are exact to 1e-13 of the
machine's size; a step goes 1e-5 of it, and the rates are good to 1e-8 of theirs.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, IntArray, wrapped
from pkmcal.core.library import SLOTS
from pkmcal.core.pulleys import PulleyMachine
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.drive_state import DriveState
from pkmcal.kinematics.robot import Robot

_STEP = 1e-5  # of the machine's size


def place_of(machine: Calibratable, joint: str) -> int:
    """Return the passive joint of this name.

    Raises
    ------
    ValueError
        The machine has none of this name, or it slides.
    """
    names = machine.passive_names
    if joint not in names:
        raise ArgumentError(
            f"joint: {machine.name} has no passive joint {joint!r}{did_you_mean(joint, names)}"
        )
    return names.index(joint)


def follows_pose(machine: Calibratable, joint: str) -> bool:
    """Return whether the angle of a joint follows from the pose: of a pulley's swivel it does."""
    return machine.model.closed_form


def swivels(
    machine: Calibratable, pose: FloatArray, joint: str, places: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles (N,) of a pulley at poses (N, 6), by the platform's twist (N, 6) and by numbers.

    Those of the geometry at `places` (p,), the pose held: (N, p).
    """
    robot, which = cast(Robot, machine), place_of(machine, joint)
    core, slots, _ = robot.machine.bare(robot.slots, np.zeros((1, robot.n_actuators)))
    assert isinstance(core, PulleyMachine)
    own = np.ascontiguousarray(robot.frames.inward(pose))
    angle, by_own, by_limb = (part[:, which] for part in core.swivels(slots, own))
    outward = robot.frames.twists_outward(own, np.tile(np.eye(6), (len(own), 1, 1)))
    by_twist = np.linalg.solve(outward.transpose(0, 2, 1), by_own[:, :, None])[:, :, 0]
    limb, width = int(joint.removeprefix("swivel")) - 1, robot.slots.shape[1]
    at = robot.geometry.slot_index - limb * width
    mine = np.flatnonzero((at >= 0) & (at < len(SLOTS)))  # those behind do not turn it
    return angle, by_twist, by_limb[:, at[mine]] @ robot.geometry.chain[mine][:, places]


def angles(
    machine: Calibratable,
    q: FloatArray,
    pose: FloatArray,
    joint: str,
    state: DriveState,
) -> FloatArray:
    """Angles (N,) from home at coordinates (N, n), near poses (N, 6); NaN where there is none.

    `state` is that of the drives.
    """
    place, robot = place_of(machine, joint), state.of(cast(Robot, machine))
    found: FloatArray = robot.forward(q, pose).passive[:, place]
    return found


def rates(
    machine: Calibratable,
    q: FloatArray,
    pose: FloatArray,
    joint: str,
    places: IntArray,
    state: DriveState,
) -> FloatArray:
    """Differentiate angles by numbers of the geometry at some places, (N, p), actuators held."""
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
            ends.append(angles(machine.with_values(changed), q, pose, joint, state))
        found[:, column] = wrapped(ends[0] - ends[1]) / (2 * step)
    return found
