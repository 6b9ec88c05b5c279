"""The limbs of a robot in a C header: their numbers, drivers, rows and turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import c_source
from pkmcal.controllers.c_source import Number
from pkmcal.core.drive_turns import AGREE, MOST_TURNS, PER_TURN
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.library import AXES, DRIVERS, ROWS, SLOTS
from pkmcal.core.pulleys import OWN_SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Limb
from pkmcal.kinematics.robot import Robot

ENUMERATORS = tuple(slot.upper().replace(".", "_") for slot in SLOTS)
_GAIN = SLOTS.index("gain")
_GROOVE = [SLOTS.index(slot) for slot in OWN_SLOTS]
_NEARER, _TIE = 1e-12, 1e-15  # of turns that agree, as agreed_turn of csrc/inverse.h has them
_UNUSED_FRAME = np.zeros(9)
_DRIVER_PARTS = ("inverse", "anchor", "radius", "derivatives")


def contents(robot: Robot, prefix: str, number: Number) -> tuple[dict[str, Any], list[str]]:
    """Fill the template for limbs, and list the generated functions that it calls."""
    machine, model = robot.machine, robot.model
    limbs = model.limbs
    m, n = machine.m, machine.actuators
    of_limb = [_driver(limb) for limb in limbs]
    drivers = [driver for driver in DRIVERS if driver in of_limb]
    rows = _rows(robot)
    actuators = [limb.actuator for limb in limbs]
    turning = [bool(each) for each in machine.struct.angle[0 : len(limbs)]]
    geared, over = _geared(robot), [i in model.pulleys for i in range(len(limbs))]
    one, several, whole = c_source.writers(number)
    first, second, frame, axis = prepared(robot)
    wide = number == "double"
    size = machine.struct.size
    says = {
        "chains": 0,
        "limbs": len(limbs),
        "axes": len(AXES),
        "first": [several(row) for row in first],
        "second": [several(row) for row in second],
        "frame": [several(row) for row in frame],
        "axis": [", ".join(f"{{ {several(each)} }}" for each in row) for row in axis],
        "branch": several([float(limb.branch) for limb in limbs]),
        "rows": rows,
        "drivers": [{"name": driver} for driver in drivers],
        "driver": whole(drivers.index(driver) for driver in of_limb),
        "shared": n < len(limbs),
        "which": f"{prefix}_actuator[i]" if n < len(limbs) else "i",
        "actuator": whole(actuators),
        "leads": whole(actuators.index(actuator) == i for i, actuator in enumerate(actuators)),
        "sharing": several([float(actuators.count(i)) for i in range(n)]),
        "turning": any(turning),
        "all_turning": all(turning),
        "angle": whole(turning),
        "near": several(
            machine.struct.near[i] if turns else 0.0 for i, turns in enumerate(turning)
        ),
        "geared": whole(geared) if any(geared) else "",
        "about": several(_about(robot)) if model.driven and any(geared) else "",
        "most_turns": MOST_TURNS,
        "agree": one(AGREE if wide else 3e-4),
        "per_turn": one(PER_TURN),
        "nearer": one(_NEARER),
        "tie": one(_TIE),
        "pulleys": any(over),
        "all_pulleys": all(over),
        "on_pulley": whole(over),
        "over": machine.rows > m,
        "closures": machine.rows,
        "weight": several(machine.struct.weight[0 : machine.rows]),
        "tolerance": one(min(machine.struct.closure_tolerance, c_source.largest(number))),
        "groove": [
            several(g[_GROOVE] if has else 0.0 * g[_GROOVE])
            for g, has in zip(robot.slots, over, strict=True)
        ],
        **_limits(machine.rows > m, number, size),
        "shortest": one(1e-30 if wide else 1e-15),
        "longest": one(1e30 if wide else 1e15),
        "calls": (_inverse_calls(robot), _step_calls(robot, rows), m),
    }
    return says, _needed(robot, drivers, [row["name"] for row in rows])


def _limits(over: bool, number: Number, size: float) -> dict[str, str]:
    """Step after which a pose is known, and the least pivot.

    What a step leaves is its square by pivot and size: 3e-14 and 2e-7 of the size. With more
    closures than coordinates it is a share of it, and the normal equations square the pivot.
    """
    one, _, _ = c_source.writers(number)
    if over:
        settled, pivot = (5e-12, 4e-10) if number == "double" else (2e-6, 1e-6)
    else:
        settled, pivot = (1e-9, 2e-5) if number == "double" else (2e-5, 1e-3)
    return {"settled": one(settled * size), "least_pivot": one(pivot)}


def numbers(
    robot: Robot, texts: list[str], prefix: str, several: Callable[[Any], str]
) -> tuple[dict[str, Any], list[str]]:
    """Numbers of limbs at the slots that functions read, and the functions that read these."""
    slots = c_source.slots_read(texts, prefix, ENUMERATORS)
    _, own, _ = robot.machine.bare(robot.slots, np.zeros((1, robot.n_actuators)))
    places = [ENUMERATORS.index(slot) for slot in slots]
    says = {
        "slots": [f"{prefix}_{name}" for name in slots],
        "numbers": [several(row[places]) for row in own],
    }
    return says, c_source.of_slots(texts, prefix, ENUMERATORS, slots)


def _geared(robot: Robot) -> list[bool]:
    """Mark the first limb of each actuator whose whole turns may leave another limb elsewhere.

    As `pkmcal.core` finds the turn that suits all: with laws always, else where gears differ.
    """
    angles = [KINDS[limb.kind].actuator_unit == "rad" for limb in robot.model.limbs]
    actuators = [limb.actuator for limb in robot.model.limbs]
    gears = [abs(g[_GAIN]) if angle else None for angle, g in zip(angles, robot.slots, strict=True)]
    found = []
    for i, actuator in enumerate(actuators):
        sharing = [j for j, other in enumerate(actuators) if other == actuator]
        differ = robot.model.driven or len({gears[j] for j in sharing}) > 1
        found.append(angles[i] and len(sharing) > 1 and sharing[0] == i and differ)
    return found


def _driver(limb: Limb) -> str:
    """The core's driver of a limb: a cable over a pulley is one of limbs between two points."""
    return KINDS[limb.kind].driver.core


def _needed(robot: Robot, drivers: Sequence[str], rows: Sequence[str]) -> list[str]:
    """Names of the generated functions that the template calls."""
    needed = ["limb_joint", "limb_drive", "limb_command", "sphere_row"]
    needed += [f"{driver}_{part}" for driver in drivers for part in _DRIVER_PARTS]
    needed += ["pulley"] if robot.model.pulleys else []
    return needed + [f"{row}_row" for row in rows]


def _about(robot: Robot) -> FloatArray:
    """The ways of the drives near which angles are given."""
    machine = robot.machine
    assert isinstance(machine, DrivenMachine)
    reference = machine.reference(robot.slots)
    about: FloatArray = machine.laws.ways(robot.slots, reference[None]).way[0]
    return about


def _rows(robot: Robot) -> list[dict[str, Any]]:
    """The kinds of rows beside the sphere that some limb has."""
    limbs = robot.model.limbs
    of_limb = [KINDS[limb.kind].all_rows(limb.couple > 0) for limb in limbs]
    levers = {limb.couple for limb in limbs if limb.couple > 0} or {0.0}
    if len(levers) > 1:
        raise ArgumentError(f"robot: the limbs of {robot.name} have different couple lengths")
    (lever,) = levers
    places = c_source.axes_of_rows()
    return [
        {
            "name": row,
            "base": places[row][0],
            "platform": places[row][1],
            "lever": repr(lever),
            "everywhere": all(row in rows for rows in of_limb),
            "has": ", ".join(str(int(row in rows)) for rows in of_limb),
        }
        for row in ROWS
        if any(row in rows for rows in of_limb)
    ]


def prepared(robot: Robot) -> tuple[list[FloatArray], ...]:
    """Compute of each limb what follows from its numbers alone, as the core does.

    First and second direction of its anchor, the fixed frame of its base axis, and its axes.
    """
    first, second, frames, axes = [], [], [], []
    for limb, g in zip(robot.model.limbs, robot.slots.tolist(), strict=True):
        driver = _driver(limb)
        names = dict(zip(ENUMERATORS, range(len(SLOTS)), strict=True))
        given = {"g": g, **names, "F": limb.frame.ravel().tolist()}
        one, other = c_source.evaluate(f"{driver}_directions", given, ("first", "second"))
        own = np.zeros((len(AXES), 3))
        for place, axis in enumerate(AXES):
            if axis in limb.frames:
                frame = {"F": limb.frames[axis].ravel().tolist()}
                own[place] = c_source.evaluate(f"{axis}_axis", given | frame, ("axis",))[0]
        first.append(np.array(one))
        second.append(np.array(other))
        turned = KINDS[limb.kind].driver.has_base_axis
        frames.append(limb.frame.ravel() if turned else _UNUSED_FRAME)
        axes.append(own)
    return first, second, frames, axes


def _inverse_calls(robot: Robot) -> list[str]:
    calls = ["pose_frame"]
    for limb in robot.model.limbs:
        calls += ["limb_joint", f"{_driver(limb)}_inverse", "limb_command"]
        calls += ["limb_joint", "pulley"] if KINDS[limb.kind].driver.swivels else []
    return calls


def _step_calls(robot: Robot, rows: list[dict[str, Any]]) -> list[str]:
    map = robot.model.map
    calls = [f"map_{map}_frame", f"map_{map}_retract"]
    for limb in robot.model.limbs:
        own = KINDS[limb.kind].all_rows(limb.couple > 0)
        calls += ["limb_joint", "pulley"] if KINDS[limb.kind].driver.swivels else []
        for row in ("sphere", *(row["name"] for row in rows if row["name"] in own)):
            calls += [f"{row}_row", f"map_{map}_pull"]
    return calls
