"""A parallel machine as data for the page: what moves it, what it looks like, what stops it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainMachine
from pkmcal.core.library import MAPS, POSE, SLOTS
from pkmcal.core.machine import Machine
from pkmcal.core.poses import NOWHERE, invert
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Cone
from pkmcal.geometry.model import Model
from pkmcal.kinematics.dexterity import dexterity
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose
from pkmcal.view import chains, drives, memory, ranges, words, yielding

_OFFSET, _GAIN = SLOTS.index("offset"), SLOTS.index("gain")
_TRACK = 25  # points of the path of a crank's end


def beyond(model: Model) -> str:
    """List parts of a machine that the page cannot draw; empty where there are none."""
    if model.bent:
        return "tackles" if model.limbs[model.bent[0]].parts else "pulleys"
    if model.mechanism.loose:
        return "chains that hold each other by joints they share"
    return ""


def data(robot: Robot, cloud: bool) -> dict[str, Any]:
    """Return the page's data of a robot as JSON has it; mm and rad.

    With `cloud` the positions of good poses too, which take a while to find.
    """
    given, robot = robot, robot.rigid
    model = robot.model
    machine, slots = drives.within(robot)
    laws = drives.laws(robot)
    if what := beyond(model):
        raise ArgumentError(f"robot: {model.name} has {what}, which the page cannot draw")
    said = words.of_robot(given) + words.of_yielding(given)
    size = float(machine.struct.size)
    if isinstance(machine, Machine):
        blob, numbers, strokes = memory.limbs(machine, slots), 0, _strokes(robot)
    else:
        assert isinstance(machine, ChainMachine) and model.chains is not None
        blob, numbers = memory.chains(machine, slots)
        strokes = chains.strokes(model.chains, robot.slots)
    if laws is not None:
        strokes = drives.strokes(robot)
    most = ranges.farthest(robot, strokes)
    spans = ranges.poses(robot, size, most)
    moves = ranges.actuators(robot, strokes, spans)
    at_home = dexterity(robot, robot.home)
    shared = machine.struct.shared if isinstance(machine, ChainMachine) else 0
    found = {
        "kind": "limbs" if model.closed_form else "chains",
        "name": robot.name,
        "what": said,
        "numbers": numbers,
        "geometry": numbers or len(blob) - slots.nbytes,
        "map": model.map,
        "free": [POSE.index(name) for name in MAPS[model.map]],
        "moved": [POSE.index(name) for name in spans],
        "rows": machine.rows + shared,
        "shared": shared,
        "size": size,
        "length": robot.length,
        "home": robot.home.tolist(),
        "conditioning": _number(float(at_home.conditioning)),
        "poses": ranges.sliders(robot, spans, most),
        "reach": [list(ends) for ends in spans.values()],
        "actuators": [
            {"unit": unit, "reading": reading, "range": ends, "stroke": stroke}
            for unit, reading, ends, stroke in zip(
                robot.actuator_units, reading_units(robot), moves, strokes, strict=True
            )
        ],
        "turns": [_number(turn) for turn in machine.turns(slots).tolist()],
        "near": machine.reference(slots).tolist(),
        "frames": _frames(robot),
        "modes": ranges.modes(robot),
        "machine": blob,
        "laws": laws,
    }
    if cloud:
        poses, found["cloud"] = ranges.cloud(robot, spans)
        if given is not robot:
            found["stiffness"] = yielding.data(given, poses)
    if model.closed_form:
        return found | {"limbs": _limbs(robot, np.array(moves))}
    assert isinstance(machine, ChainMachine)
    return found | chains.looks(robot, machine, slots, drives.ways(robot, np.array(moves).T).T)


def _strokes(robot: Robot) -> list[tuple[float, float] | None]:
    """Return what strokes of all an actuator's limbs leave of its coordinate."""
    found: list[tuple[float, float] | None] = [None] * robot.n_actuators
    for limb, numbers in zip(robot.model.limbs, robot.slots, strict=True):
        if limb.stroke is None:
            continue
        low, high = sorted((end - numbers[_OFFSET]) / numbers[_GAIN] for end in limb.stroke)
        before = found[limb.actuator] or (-np.inf, np.inf)
        found[limb.actuator] = (max(float(low), before[0]), min(float(high), before[1]))
    return found


def _limbs(robot: Robot, moves: FloatArray) -> list[dict[str, Any]]:
    share = np.linspace(0.0, 1.0, _TRACK)[:, None]
    way = robot.limb_machine.spheres(robot.slots, moves[:, 0] + share * (moves[:, 1] - moves[:, 0]))
    made = []
    for i, limb in enumerate(robot.model.limbs):
        driver = KINDS[limb.kind].driver
        along = slice(None, None, _TRACK - 1) if driver.slides else slice(None)
        made.append(
            {
                "kind": limb.kind,
                "carries": driver.carries,
                "actuator": limb.actuator,
                "base": robot.slots[i, :3].tolist(),
                "axis": limb.frame[:, 2].tolist() if driver.turns else None,
                "track": way[along if driver.carries else slice(0), i, 3:6].round(3).tolist(),
                "stroke": limb.stroke,
                "base_cone": _cone(limb.base_cone),
                "platform_cone": _cone(limb.platform_cone),
            }
        )
    return made


def _cone(cone: Cone | None) -> dict[str, Any] | None:
    return None if cone is None else {"axis": cone.axis.tolist(), "angle": cone.angle}


def _frames(robot: Robot) -> dict[str, Any] | None:
    """Base and tool frames as poses with their inverses, and the base's as a matrix."""
    model = robot.model
    if model.base_frame is None and model.tool_frame is None:
        return None
    base, tool = (
        NOWHERE if frame is None else np.ascontiguousarray(frame, dtype=np.float64)
        for frame in (model.base_frame, model.tool_frame)
    )
    poses = {"base": base, "tool": tool, "base_inverse": invert(base), "tool_inverse": invert(tool)}
    named = {name: np.ravel(pose).tolist() for name, pose in poses.items()}
    return named | {"matrix": from_pose(base)[:3].ravel().tolist()}


def _number(value: float) -> float | None:
    """Return a number for JSON; None where it has none."""
    return value if np.isfinite(value) else None
