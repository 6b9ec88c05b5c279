"""The kinematics of limbs with a driver and a sphere row, `pkmcal.geometry.limbs.Limbs`.

As `pkmcal.kinematics.limb_kinematics` asks for them.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import SLOTS
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.kinematics import Kinematics
from pkmcal.kinematics.limits import Feasibility, feasibility
from pkmcal.screw import from_pose

_ROD = SLOTS.index("rod")


def limits(robot: Kinematics, own: FloatArray, q: FloatArray | None) -> Feasibility:
    """Compare limbs with their limits, by actuators (N, n) or by those that the poses ask."""
    drive, on_base, on_platform = robot.limb_machine.limbs(robot.slots, own)
    reach = np.isfinite(drive)
    if q is not None:
        drive = robot.drives(q)
    size = robot.machine.struct.size
    return feasibility(robot.model.limbs, reach, drive, on_base, on_platform, size)


def transmission(robot: Kinematics, own: FloatArray, q: FloatArray, by_q: FloatArray) -> FloatArray:
    """Return the least abs(cos) between a limb and the motion of its actuator, (N,)."""
    slopes = np.abs(robot.machine.slopes(robot.slots, q))
    least = np.full(len(by_q), np.inf)
    row = 0
    for i, limb in enumerate(robot.model.limbs):
        kind = KINDS[limb.kind]
        arm = slopes[:, i]
        if kind.driver.arm and kind.actuator_unit == "rad":
            arm = arm * abs(float(robot.model.geometry[f"{kind.driver.arm}{i + 1}"]))
        least = np.minimum(least, np.abs(by_q[:, row, limb.actuator]) / arm)
        row += 1 + len(kind.all_rows(limb.couple > 0))
    return least


def lines(robot: Kinematics, own: FloatArray, q: FloatArray) -> list[FloatArray]:
    """Return base joint, carried joint if there is one, and platform joint of each limb."""
    slots = robot.slots
    direction = robot.limb_machine.limbs(slots, own)[1]
    platform = np.column_stack([slots[:, 3:6], np.ones(len(slots))])
    ends = (from_pose(own) @ platform.T).transpose(0, 2, 1)[..., :3]
    found = []
    for i, limb in enumerate(robot.model.limbs):
        line = [np.broadcast_to(slots[i, :3], (len(own), 3)), ends[:, i]]
        if KINDS[limb.kind].driver.carries:
            line.insert(1, ends[:, i] - slots[i, _ROD] * direction[:, i])
        found.append(np.stack(line, axis=1))
    return found
