"""A robot's kinematics as one C99 header, its numbers folded in."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arguments import path as as_path
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray
from pkmcal.controllers import c_chains, c_limbs, c_loaded, c_source
from pkmcal.controllers.c_source import Number
from pkmcal.controllers.laws import require_no_tackles
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.rendering import rendered
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.laws import MOST_STEPS, ROUNDING, LawNumbers
from pkmcal.core.library import MAPS, SLOTS
from pkmcal.core.poses import invert
from pkmcal.core.pulleys import OWN_SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot, require_parallel

# benchmarks of the hexapod: docs/controllers.md says how
_MEASURED = (
    "double 3.9 kB, 590 instructions an inverse, 10 000 a forward from home;\n"
    " * float 3.7 kB, 660 and 8 100"
)
_ENUMERATORS = tuple(slot.upper().replace(".", "_") for slot in SLOTS)
_GAIN = SLOTS.index("gain")
_GROOVE = [SLOTS.index(slot) for slot in OWN_SLOTS]
_NEARER, _TIE = 1e-12, 1e-15  # of turns that agree, as agreed_turn of csrc/inverse.h has them
# rad, of sines: below it the multiples of the parts of π/2 that they take off are exact
_MOST_ANGLE: dict[Number, float] = {"double": 1e5, "float": 6e3}


def c_header(robot: Robot, path: str | PathLike[str], number: Number = "double") -> Loss | None:
    """Write a C99 header with a robot's inverse and forward kinematics and Jacobian.

    Its functions are named after the file: ``delta.h`` has ``delta_inverse``, ``delta_forward`` and
    ``delta_jacobian``. They allocate nothing, keep no state, and use of the C library only the
    square root and the absolute value. In double their inverse gives the bits of `Robot.inverse`,
    or, where limbs are chains of joints, its numbers but for rounding.

    Parameters
    ----------
    robot : Robot
        A machine; of chains of joints, one with as many closures as free coordinates.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    number : {"double", "float"}
        Type of its numbers.

    Returns
    -------
    Loss or None
        Of a machine that yields: by how much what the header holds of it is off under the payload
        that its file states. None where nothing yields, or only offsets (legs, screws, cranks) of
        limbs in closed form do: then ``delta_inverse_loaded`` and ``delta_forward_loaded`` take a
        load as well, and the other functions are those of the machine where nothing pulls.

    Raises
    ------
    ValueError
        The machine has chains with more closures than free coordinates, joints behind its platform,
        or passive joints that chains share; nothing is written.
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
    return c_loaded.not_held(robot)


def prefix_of(path: Path) -> str:
    """Return the prefix of names in C, from the name of a file."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    return f"robot_{name}" if name[:1].isdigit() else name


def text_of(robot: Robot, prefix: str, number: Number) -> str:
    """The header whose names begin with `prefix`."""
    word("number", number, ("double", "float"))
    loaded = c_loaded.contents(robot, number) if c_loaded.holds(robot) else None
    robot = robot.rigid
    require_no_tackles(robot, "a header")
    return rendered("robot.h.jinja", _contents(robot, loaded, prefix, number))


def _contents(
    robot: Robot, loaded: dict[str, Any] | None, prefix: str, number: Number
) -> dict[str, Any]:
    """Fill the template, by the names in it; `loaded` fills the part on loads."""
    machine, model = robot.machine, robot.model
    map = model.map
    laws = _laws(robot)
    _require_sines(robot, laws, number)
    made = c_limbs if model.closed_form else c_chains
    own, called = made.contents(robot, prefix, number)
    needed = ["pose_frame", *([] if robot.frames.trivial else ["pose_compose"])]
    needed += [f"map_{map}_{part}" for part in _MAP_PARTS] + called
    needed += _LAWS[: 2 if laws else 0] + _LAWS[2:3] * _any(laws, "waves")
    if loaded is not None:
        needed += [f"{driver['name']}_carry" for driver in own["drivers"]]
    functions = c_source.with_callees(needed + _LAWS[3:] * _any(laws, "points"))
    state = int(
        re.findall(r"state\[(\d+)\]", c_source.functions()[f"map_{map}_frame"].arguments)[0]
    )
    one, several, whole = c_source.writers(number)
    texts = [c_source.as_c99(f, prefix, number, c_limbs.ENUMERATORS) for f in functions]
    numbers, texts = made.numbers(robot, texts, prefix, several)
    own |= numbers
    wide = number == "double"
    size = machine.struct.size
    inverse, step, unknowns = own.pop("calls")
    says: dict[str, Any] = own | {
        "load": loaded,
        "title": re.sub(r"[^ -~]|\*/|/\*", "?", robot.name),
        "P": prefix,
        "U": prefix.upper(),
        "real": number,
        "measured": _MEASURED,
        "n": machine.actuators,
        "m": machine.m,
        "map": map,
        "free": ", ".join(MAPS[map]),
        "lengths": sum(name in "xyz" for name in MAPS[map]),
        "state": state,
        "units": ", ".join(f"q{i} [{unit}]" for i, unit in enumerate(robot.actuator_units, 1)),
        "sqrt": "sqrt" if wide else "sqrtf",
        "fabs": "fabs" if wide else "fabsf",
        "home": several(robot.home),
        "turn": one(2.0 * np.pi),
        "beta": MAPS[map].index("beta") if machine.turns_freely else None,
        "laws": [
            {
                "base": several(law.base),
                "waves": [several(wave) for wave in law.waves],
                "points": [several(point) for point in law.points],
                "span": several(
                    np.clip(law.span, -c_source.largest(number), c_source.largest(number))
                ),
            }
            for law in laws
        ],
        "waves": _starts(laws, "waves"),
        "points": _starts(laws, "points"),
        "most": several(law.most for law in laws),
        "corrected": whole(bool(law.waves or law.points) for law in laws),
        "most_steps": MOST_STEPS,
        "law_rounding": one(ROUNDING if wide else 1e-6),
        "framed": None
        if robot.frames.trivial
        else {
            name: several(pose)
            for frame_name, given in (("base", model.base_frame), ("tool", model.tool_frame))
            for name, pose in _both_ways(frame_name, given)
        },
        "functions": texts,
        "length": f"{robot.length:.6g}",
        "arm": one(robot.length),
        # so far apart are the drives of a limb's branches; rounding and what a step leaves are less
        "folded": one((1e-6 if wide else 1e-3) * size),
        "per_length": one(1.0 / robot.length),
        "size": one(size),
        "largest": "DBL_MAX" if wide else "FLT_MAX",
        "zero": one(0.0),
        "half": one(0.5),
        "one": one(1.0),
        "shift": one(1.5 * 2.0 ** (52 if wide else 23)),
        "most_angle": one(_MOST_ANGLE[number]),
        "c": {name: one(value) for name, value in _constants(number).items()},
        "rounding": f"{4e-7 * size:.1g}",
        "inverse_operations": _counted(functions, inverse),
        "step_operations": _counted(functions, step, elimination=unknowns),
    }
    return says


_MAP_PARTS = ("from_pose", "frame", "retract", "angles", "pull", "free")
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
        limb = robot.model.limb_of_drive(d) + 1
        raise ArgumentError(f"robot: limb {limb} of {robot.name}: its drive law: {why}")
    return machine.laws.numbers_of(robot.slots)


def _require_sines(robot: Robot, laws: list[LawNumbers], number: Number) -> None:
    """Refuse harmonics of so many waves over a stroke that their sines are not known."""
    for d, law in enumerate(laws):
        stroke = robot.model.drives[d].stroke
        if stroke is None or not law.waves:
            continue
        machine = robot.machine
        assert isinstance(machine, DrivenMachine)
        ends = machine.laws.reading(robot.slots, np.array(stroke), d)
        angle = max(abs(k) for k, _, _ in law.waves) * float(np.abs(ends).max())
        if angle > _MOST_ANGLE[number]:
            limb = robot.model.limb_of_drive(d) + 1
            raise ArgumentError(
                f"robot: limb {limb} of {robot.name}: its drive law: k q of a harmonic goes to"
                f" {angle:.4g} rad, a header in {number} knows sines up to"
                f" {_MOST_ANGLE[number]:g} rad"
            )


def _any(laws: list[LawNumbers], part: str) -> bool:
    return any(getattr(law, part) for law in laws)


def _starts(laws: list[LawNumbers], part: str) -> str:
    """Return the start of each law's harmonics or points in one common table; empty without any."""
    counts = [len(getattr(law, part)) for law in laws]
    starts = np.cumsum([0, *counts]).tolist()
    return ", ".join(map(str, starts)) if starts[-1] else ""


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


_SINCOS = np.array([18, 20, 0, 0])  # its operations: +, *, /, sqrt


def _counted(functions: list[c_source.CFunction], calls: list[str], elimination: int = 0) -> str:
    """Operations of calls, with those of their sines and arctangents, and of an elimination."""
    by_name = {function.name: function for function in functions}
    count = np.zeros(4, dtype=int)
    for name in calls:
        if name == "sincos":
            count += _SINCOS
            continue
        count += by_name[name].operations
        body = by_name[name].body
        count += body.count("FN(sincos)(") * _SINCOS
        count += body.count("arctangent2(") * np.array([16, 19, 1, 0])
    m = elimination
    products = sum((m - k - 1) * (m - k) for k in range(m)) + m * (m - 1) // 2
    count += (products, products, m * (m - 1) // 2 + m, 0)
    add, times, over, root = count
    return f"{add} +, {times} *, {over} /, {root} sqrt"
