"""A machine that yields in a C header: compliances of offsets, and the loads.

At a pose the forces along the legs, screws or about the cranks are known, so that the inverse is
that of the rigid machine and a solve of the size of its closures; forward goes through it until
the actuators stay.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pkmcal.controllers import c_source
from pkmcal.controllers.c_source import Number
from pkmcal.controllers.loss import Loss, sag
from pkmcal.geometry.carried import CARRIED
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.loaded import LoadedMachine
from pkmcal.kinematics.resting import MOST_STEPS
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose


def holds(robot: Robot) -> bool:
    """Return whether a header can hold the compliances: of offsets, each of its own actuator."""
    model = robot.model
    if model.elastic is None or not model.closed_form or model.driven:
        return False
    alone = robot.n_actuators == len(model.limbs)
    return alone and all(spring.of_drive for spring in model.elastic.springs)


def not_held(robot: Robot) -> Loss | None:
    """Return the error of a header without sag; None where it holds all, or nothing sags."""
    return None if robot.model.elastic is None or holds(robot) else sag(robot)


def contents(robot: Robot, number: Number) -> dict[str, Any]:
    """Fill the template for loads, by the names in it."""
    machine, elastic, geometry = robot.machine, robot.model.elastic, robot.geometry
    assert isinstance(machine, LoadedMachine) and elastic is not None
    one, several, whole = c_source.writers(number)
    limbs = range(1, len(robot.model.limbs) + 1)
    values = dict(geometry.items())
    springs = {spring.number: spring for spring in elastic.springs}
    numbers = np.array(robot.slots[0, machine.rigid(robot.slots).shape[1] :])
    base, tool = (
        from_pose(np.zeros(6) if frame is None else frame)
        for frame in (robot.model.base_frame, robot.model.tool_frame)
    )
    struct = machine.struct
    return {
        "compliance": several(values.get(f"{COMPLIANCE}offset{i}", 0.0) for i in limbs),
        "growing": several(values.get(f"{COMPLIANCE}offset{i}{PER_LENGTH}", 0.0) for i in limbs),
        "grows": any(spring.drive >= 0 for spring in elastic.springs),
        "at": several(springs[f"offset{i}"].at if f"offset{i}" in springs else 0.0 for i in limbs),
        "payload": several(values.get(f"payload.{name}", 0.0) for name in CARRIED),
        "gravity": several(machine.pulls.gravity(numbers)),
        "axes": several(base[:3, :3].T),
        "tool_axes": several(tool[:3, :3]),
        "tool_place": several(tool[:3, 3]),
        "platform_mass": one(values.get("mass.platform", 0.0)),
        "platform_centre": several(_point(values, "centre.platform")),
        "rods": several(values.get(f"mass.limb{i}", 0.0) for i in limbs) if elastic.rods else "",
        "anchors": several(_at_anchor(values, i) for i in limbs),
        "weighty": bool(elastic.rods or elastic.anchors),
        "balancers": [
            {
                "base": several(_point(values, f"balancer{j}.base")),
                "platform": several(_point(values, f"balancer{j}.platform")),
                "rate": one(values[f"balancer{j}.rate"]),
                "free": one(values[f"balancer{j}.free"]),
            }
            for j in range(1, elastic.balancers + 1)
        ],
        "steps": MOST_STEPS,
        "angle": whole(struct.angle[i - 1] for i in limbs),
        "settled": [one(1e-14 if number == "double" else 1e-7),
                    one((1e-14 if number == "double" else 1e-7) * struct.size)],
        "most": [one(0.1), one(1e-2 * struct.size)],
    }  # fmt: skip


def _point(values: Mapping[str, float], name: str) -> list[float]:
    return [values.get(f"{name}.{axis}", 0.0) for axis in "xyz"]


def _at_anchor(values: Mapping[str, float], i: int) -> float:
    """Mass, kg, that the anchor of limb i carries: its own, and half its rod's."""
    return values.get(f"mass.anchor{i}", 0.0) + 0.5 * values.get(f"mass.limb{i}", 0.0)
