"""A robot's kinematics as one C99 header, its numbers folded in."""

from __future__ import annotations

import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arguments import path as as_path
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray
from pkmcal.controllers import c_source
from pkmcal.controllers.c_source import Number
from pkmcal.controllers.rendering import rendered
from pkmcal.core.drive_turns import AGREE, MOST_TURNS, PER_TURN
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.laws import MOST_STEPS, ROUNDING, LawNumbers
from pkmcal.core.library import AXES, DRIVERS, MAPS, ROWS, SLOTS
from pkmcal.core.poses import invert
from pkmcal.core.pulleys import OWN_SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.model import Limb
from pkmcal.kinematics.robot import Robot, require_parallel

# benchmarks of the hexapod: docs/controllers.md says how
_MEASURED = (
    "double 3.9 kB, 720 instructions an inverse, 10 000 a forward from home;\n"
    " * float 3.7 kB, 780 and 8 100"
)
_ENUMERATORS = tuple(slot.upper().replace(".", "_") for slot in SLOTS)
_GAIN = SLOTS.index("gain")
_GROOVE = [SLOTS.index(slot) for slot in OWN_SLOTS]
_NEARER, _TIE = 1e-12, 1e-15  # of turns that agree, as agreed_turn of csrc/inverse.h has them
_UNUSED_FRAME = np.zeros(9)


def c_header(robot: Robot, path: str | PathLike[str], number: Number = "double") -> None:
    """Write a C99 header with a robot's inverse and forward kinematics and Jacobian.

    Its functions are named after the file: ``delta.h`` has ``delta_inverse``, ``delta_forward`` and
    ``delta_jacobian``. They allocate nothing, keep no state, and use of the C library only the
    square root and the absolute value. In double their inverse gives the bits of `Robot.inverse`.

    Parameters
    ----------
    robot : Robot
        A machine with as many closures as free coordinates.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    number : {"double", "float"}
        Type of its numbers.

    Raises
    ------
    ValueError
        The machine has more closures than free coordinates; nothing is written.
    OSError
        The folder does not exist or cannot be written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pk.export.c_header(pk.load("hexapod"), f"{folder}/hexapod.h")
    ...     "int hexapod_forward(" in pathlib.Path(folder, "hexapod.h").read_text(encoding="utf-8")
    True
    """
    require_parallel(robot)
    path = as_path("path", path)
    write_whole(path, text_of(robot, prefix_of(path), number))


def prefix_of(path: Path) -> str:
    """What names in C begin with, after the name of a file."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    return f"robot_{name}" if name[:1].isdigit() else name


def text_of(robot: Robot, prefix: str, number: Number) -> str:
    """The header whose names begin with `prefix`."""
    word("number", number, ("double", "float"))
    machine = robot.machine
    if robot.model.chains is not None:
        raise ArgumentError(f"robot: {robot.name} has chains of joints; a header holds other limbs")
    if machine.rows != machine.m:
        raise ArgumentError(
            f"robot: {robot.name} has {machine.rows} closures for {machine.m} free coordinates;"
            " a header holds machines with as many of both"
        )
    return rendered("robot.h.jinja", _contents(robot, prefix, number))


def _geared(robot: Robot) -> list[bool]:
    """Which limbs are the first of an actuator whose whole turns may leave another elsewhere.

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
    driver = KINDS[limb.kind].driver
    return "length" if driver == "pulley" else driver


def _contents(robot: Robot, prefix: str, number: Number) -> dict[str, Any]:
    """What the template says, by the names in it."""
    machine, model = robot.machine, robot.model
    limbs = model.limbs
    map, m, n = model.map, machine.m, machine.actuators
    of_limb = [_driver(limb) for limb in limbs]
    drivers = [driver for driver in DRIVERS if driver in of_limb]
    rows = _rows(robot)
    actuators = [limb.actuator for limb in limbs]
    lengths = sum(name in "xyz" for name in MAPS[map])
    laws = _laws(robot)
    turning = [bool(each) for each in machine.struct.angle[0 : len(limbs)]]
    geared, over = _geared(robot), [i in model.pulleys for i in range(len(limbs))]
    needed = _needed(robot, drivers, [row["name"] for row in rows])
    needed += _LAWS[: 2 if laws else 0] + _LAWS[2:3] * _any(laws, "waves")
    functions = c_source.with_callees(needed + _LAWS[3:] * _any(laws, "points"))
    state = int(
        re.findall(r"state\[(\d+)\]", c_source.functions()[f"map_{map}_frame"].arguments)[0]
    )

    def one(value: float) -> str:
        return c_source.literal(value, number)

    def several(values: Any) -> str:
        return ", ".join(one(value) for value in np.ravel(list(values)))

    def whole(values: Any) -> str:
        return ", ".join(str(int(value)) for value in values)

    first, second, frame, axis = prepared(robot)
    texts = [c_source.as_c99(f, prefix, number, _ENUMERATORS) for f in functions]
    slots = c_source.slots_read(texts, prefix, _ENUMERATORS)
    blank = np.zeros((1, n))
    _, own, _ = machine.bare(robot.slots, blank)
    wide = number == "double"
    size = machine.struct.size
    return {
        "title": re.sub(r"[^ -~]|\*/|/\*", "?", robot.name),
        "P": prefix,
        "U": prefix.upper(),
        "real": number,
        "measured": _MEASURED,
        "n": n,
        "m": m,
        "limbs": len(limbs),
        "map": map,
        "free": ", ".join(MAPS[map]),
        "lengths": lengths,
        "state": state,
        "units": ", ".join(f"q{i} [{unit}]" for i, unit in enumerate(robot.actuator_units, 1)),
        "sqrt": "sqrt" if wide else "sqrtf",
        "fabs": "fabs" if wide else "fabsf",
        "home": several(robot.home),
        "slots": [f"{prefix}_{name}" for name in slots],
        "axes": len(AXES),
        "numbers": [several(row[[_ENUMERATORS.index(slot) for slot in slots]]) for row in own],
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
        "turning": any(turning),
        "all_turning": all(turning),
        "angle": whole(turning),
        "near": several(
            machine.struct.near[i] if turns else 0.0 for i, turns in enumerate(turning)
        ),
        "turn": one(2.0 * np.pi),
        "geared": whole(geared) if any(geared) else "",
        "about": several(_about(robot)) if laws and any(geared) else "",
        "most_turns": MOST_TURNS,
        "agree": one(AGREE if wide else 3e-4),
        "per_turn": one(PER_TURN),
        "nearer": one(_NEARER),
        "tie": one(_TIE),
        "pulleys": any(over),
        "all_pulleys": all(over),
        "over": whole(over),
        "groove": [
            several(g[_GROOVE] if has else 0.0 * g[_GROOVE])
            for g, has in zip(robot.slots, over, strict=True)
        ],
        "beta": MAPS[map].index("beta") if machine.turns_freely else None,
        "laws": [
            {
                "base": several(law.base),
                "waves": [several(wave) for wave in law.waves],
                "points": [several(point) for point in law.points],
                "span": several(np.clip(law.span, -_largest(number), _largest(number))),
            }
            for law in laws
        ],
        "waves": _starts(laws, "waves"),
        "points": _starts(laws, "points"),
        "most": several(law.most for law in laws),
        "corrected": whole(bool(law.waves or law.points) for law in laws),
        "most_steps": MOST_STEPS,
        "law_rounding": one(ROUNDING if wide else 1e-6),
        "sharing": several([float(actuators.count(i)) for i in range(n)]),
        "framed": None
        if robot.frames.trivial
        else {
            name: several(pose)
            for frame_name, given in (("base", model.base_frame), ("tool", model.tool_frame))
            for name, pose in _both_ways(frame_name, given)
        },
        "functions": c_source.of_slots(texts, prefix, _ENUMERATORS, slots),
        "length": f"{robot.length:.6g}",
        "per_length": one(1.0 / robot.length),
        "size": one(size),
        # what a step leaves is its square by pivot and size: 3e-14 and 2e-7 of the size
        "settled": one((1e-9 if wide else 2e-5) * size),
        "least_pivot": one(2e-5 if wide else 1e-3),
        "shortest": one(1e-30 if wide else 1e-15),
        "longest": one(1e30 if wide else 1e15),
        "largest": "DBL_MAX" if wide else "FLT_MAX",
        "zero": one(0.0),
        "half": one(0.5),
        "one": one(1.0),
        "shift": one(1.5 * 2.0 ** (52 if wide else 23)),
        "most_angle": one(1e5 if wide else 1e3),
        "c": {name: one(value) for name, value in _constants(number).items()},
        "rounding": f"{4e-7 * size:.1g}",
        "inverse_operations": _counted(functions, _inverse_calls(robot)),
        "step_operations": _counted(functions, _step_calls(robot, rows), elimination=m),
    }


def _needed(robot: Robot, drivers: Sequence[str], rows: Sequence[str]) -> list[str]:
    """Names of the generated functions that the template calls."""
    map = robot.model.map
    needed = ["pose_frame", *([] if robot.frames.trivial else ["pose_compose"])]
    needed += [f"map_{map}_{part}" for part in _MAP_PARTS]
    needed += ["limb_joint", "limb_drive", "limb_command", "sphere_row"]
    needed += [f"{driver}_{part}" for driver in drivers for part in _DRIVER_PARTS]
    needed += ["pulley"] if robot.model.pulleys else []
    return needed + [f"{row}_row" for row in rows]


_MAP_PARTS = ("from_pose", "frame", "retract", "angles", "pull", "free")
_DRIVER_PARTS = ("inverse", "anchor", "radius", "derivatives")


_LAWS = ["law_drive", "law_drive_inverse", "law_harmonic", "law_segment"]


def _laws(robot: Robot) -> list[LawNumbers]:
    """The laws of the drives; empty where none has one.

    Raises
    ------
    ArgumentError
        A law without an inverse.
    """
    machine = robot.machine
    if not isinstance(machine, DrivenMachine):
        return []
    for d, why in machine.laws.doubts(robot.slots).items():
        raise ArgumentError(f"robot: limb {d + 1} of {robot.name}: its drive law: {why}")
    return machine.laws.numbers_of(robot.slots)


def _about(robot: Robot) -> FloatArray:
    """The ways of the drives near which angles are given."""
    machine = robot.machine
    assert isinstance(machine, DrivenMachine)
    reference = machine.reference(robot.slots)
    about: FloatArray = machine.laws.ways(robot.slots, reference[None]).way[0]
    return about


def _any(laws: list[LawNumbers], part: str) -> bool:
    return any(getattr(law, part) for law in laws)


def _starts(laws: list[LawNumbers], part: str) -> str:
    """Where the harmonics or points of each law begin in one table of all; empty without any."""
    counts = [len(getattr(law, part)) for law in laws]
    starts = np.cumsum([0, *counts]).tolist()
    return ", ".join(map(str, starts)) if starts[-1] else ""


def _largest(number: Number) -> float:
    return float(np.finfo(np.float64 if number == "double" else np.float32).max)


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
    """Of each limb what follows from its numbers alone, as the core computes it.

    First and second direction of its anchor, the fixed frame of its base axis, and its axes.
    """
    first, second, frames, axes = [], [], [], []
    for limb, g in zip(robot.model.limbs, robot.slots.tolist(), strict=True):
        driver = _driver(limb)
        names = dict(zip(_ENUMERATORS, range(len(SLOTS)), strict=True))
        given = {"g": g, **names, "F": limb.frame.ravel().tolist()}
        one, other = c_source.evaluate(f"{driver}_directions", given, ("first", "second"))
        own = np.zeros((len(AXES), 3))
        for place, axis in enumerate(AXES):
            if axis in limb.frames:
                frame = {"F": limb.frames[axis].ravel().tolist()}
                own[place] = c_source.evaluate(f"{axis}_axis", given | frame, ("axis",))[0]
        first.append(np.array(one))
        second.append(np.array(other))
        turned = driver != "length" or limb.kind == "pulley"
        frames.append(limb.frame.ravel() if turned else _UNUSED_FRAME)
        axes.append(own)
    return first, second, frames, axes


def _both_ways(name: str, pose: FloatArray | None) -> tuple[tuple[str, FloatArray], ...]:
    there = np.zeros(6) if pose is None else np.ascontiguousarray(pose, dtype=np.float64)
    return (name, there), (f"{name}_inverse", invert(there))


def _constants(number: Number) -> dict[str, float]:
    """Coefficients of the elementary functions; π/2 in parts whose multiples are exact."""
    known = dict(c_source.constants())
    if number == "float":
        left = known["HALF_PI"]
        for k in range(2):
            part = float(np.float32(np.ldexp(np.round(np.ldexp(left, 11 + 13 * k)), -11 - 13 * k)))
            known[f"HALF_PI_PART{k}"] = part
            left -= part
        known["HALF_PI_PART2"] = left
    return known


def _inverse_calls(robot: Robot) -> list[str]:
    calls = ["pose_frame"]
    for limb in robot.model.limbs:
        calls += ["limb_joint", f"{_driver(limb)}_inverse", "limb_command"]
        calls += ["limb_joint", "pulley"] if limb.kind == "pulley" else []
    return calls


def _step_calls(robot: Robot, rows: list[dict[str, Any]]) -> list[str]:
    map = robot.model.map
    calls = [f"map_{map}_frame", f"map_{map}_retract"]
    for limb in robot.model.limbs:
        own = KINDS[limb.kind].all_rows(limb.couple > 0)
        calls += ["limb_joint", "pulley"] if limb.kind == "pulley" else []
        for row in ("sphere", *(row["name"] for row in rows if row["name"] in own)):
            calls += [f"{row}_row", f"map_{map}_pull"]
    return calls


def _counted(functions: list[c_source.CFunction], calls: list[str], elimination: int = 0) -> str:
    """Operations of calls, with those of their sines and arctangents, and of an elimination."""
    by_name = {function.name: function for function in functions}
    count = np.zeros(4, dtype=int)
    for name in calls:
        count += by_name[name].operations
        body = by_name[name].body
        count += body.count("FN(sincos)(") * np.array([18, 20, 0, 0])
        count += body.count("arctangent2(") * np.array([16, 19, 1, 0])
    m = elimination
    products = sum((m - k - 1) * (m - k) for k in range(m)) + m * (m - 1) // 2
    count += (products, products, m * (m - 1) // 2 + m, 0)
    add, times, over, root = count
    return f"{add} +, {times} *, {over} /, {root} sqrt"
