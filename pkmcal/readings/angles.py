"""Angles of passive joints, by their own sensors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.readings import joint_angles
from pkmcal.readings.distances import ZERO
from pkmcal.readings.reading import At, Components, Predicted, Reading
from pkmcal.readings.unknowns import Dependence, Found, Start, always

_ZERO = ZERO


@dataclass(frozen=True)
class Angle(Reading):
    """The angle of a passive joint, less its zero."""

    name: str = "angle"
    components: Components = (("angle", "rad"),)
    by_machine: bool = True
    starts_by_pose = True

    def predict(self, at: At, zero: FloatArray = ZERO, **_: FloatArray) -> Predicted:
        m, joint = at.measured, str(at.measured.joint)
        found, by_twist = np.empty(len(m)), np.empty((len(m), 6))
        follows = True
        for machine, rows in at.machines():
            pose = at.pose[rows]
            if joint_angles.follows_pose(machine, joint):
                none = np.empty(0, dtype=np.intp)
                found[rows], by_twist[rows], _ = joint_angles.swivels(machine, pose, joint, none)
                continue
            follows, state = False, m.drive_state.at(rows)
            found[rows] = joint_angles.angles(machine, m.actuators[rows], pose, joint, state)
        return read_angles(found, by_twist if follows else None, zero=zero)

    def by_geometry(self, at: At, places: IntArray) -> FloatArray | None:
        m = at.measured
        found = np.empty((len(m), 1, len(places)))
        for machine, rows in at.machines():
            q, pose = m.actuators[rows], at.pose[rows]
            if joint_angles.follows_pose(machine, m.joint):
                found[rows, 0] = joint_angles.swivels(machine, pose, m.joint, places)[2]
                continue
            state = m.drive_state.at(rows)
            found[rows, 0] = joint_angles.rates(machine, q, pose, m.joint, places, state)
        return found

    def dependences(self, data: Any) -> Iterator[Dependence]:
        joints = [data.measured.joint] * len(data.measured)
        yield always("zero", "angle", (("zero", "rad"),), joints, data.starts)

    def starts(self, machine: Any, sets: Sequence[tuple[Any, FloatArray]], found: Found) -> None:
        off: dict[str, list[FloatArray]] = {}
        for data, pose in sets:
            m, joint = data.measured, str(data.measured.joint)
            off.setdefault(joint, []).append(
                joint_angles.angles(machine, m.actuators, pose, joint, m.drive_state) - m.values
            )
        for joint, parts in off.items():
            turns = np.exp(1j * np.concatenate(parts))
            found["angle", joint] = Start((0,), np.array([np.angle(np.nansum(turns))]))


def read_angles(
    angles: FloatArray, by_twist: FloatArray | None = None, zero: FloatArray = _ZERO
) -> Predicted:
    """Readings of a passive joint that is turned by angles (N,): these less a zero, rad.

    A passive joint of a chain is where that closes, for which the pose alone does not say enough:
    without `by_twist` (N, 6) it does not follow the pose. How it follows the machine's numbers is
    not among these derivatives.
    """
    rows = len(angles)
    values = angles[:, None] - np.broadcast_to(zero, (rows, 1))
    moves = np.zeros((rows, 1, 6)) if by_twist is None else by_twist[:, None, :]
    return Predicted(values, moves, {"zero": np.full((rows, 1, 1), -1.0)})
