"""LinuxCNC: a kinematics component, the simulation that runs it, and lines for its own modules."""

from __future__ import annotations

import re
from os import PathLike
from typing import Any

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arguments import path as as_path
from pkmcal.arrays import FloatArray
from pkmcal.controllers import c_loaded, linuxcnc_modules
from pkmcal.controllers.c_header import text_of as header_of
from pkmcal.controllers.comp_file import comp_texts, without_laws
from pkmcal.controllers.loss import Loss, sag
from pkmcal.controllers.rendering import rendered
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot, determines_others, require_parallel

_LETTERS = dict(zip(POSE, "XYZABC", strict=True))
_FIELDS = dict(zip(POSE, ("tran.x", "tran.y", "tran.z", "a", "b", "c"), strict=True))
_MODULE = "pkm_"  # before the name, so that no module of LinuxCNC's own is replaced
_LONGEST = 24  # a pin and its module have at most 47 characters, a component 31
_DIFFERENCE = 1e-6  # of the machine's size, or rad


def linuxcnc(robot: Robot, folder: str | PathLike[str]) -> Loss | None:
    """Write a robot for LinuxCNC: its kinematics, and a headless simulation that runs them.

    The component of a machine that yields has pins for its load, ``payload.mass`` [kg],
    ``payload.x`` … ``payload.z`` [mm] and ``force.x`` … ``force.z`` [N], which begin with what its
    file states.

    Of a folder ``mill``: ``pkm_mill.c``, a component for halcompile with the numbers of this robot
    folded in, ``mill.ini`` and ``mill.hal``; where drive laws are tables and backlash alone,
    ``joint0.comp`` … of these joints, which the ini file names; and, where a module that LinuxCNC
    ships holds the robot's numbers, its `setp` lines, such as ``genhexkins.hal``.

    Parameters
    ----------
    robot : Robot
        A machine that a C header holds.
    folder : str or path
        Where to write; made if it is not there. Existing files are replaced, each whole.

    Returns
    -------
    Loss or None
        How far off the shipped module of this kind of machine is, with the numbers nearest to the
        robot; None where there is none. The component is exact.

    Raises
    ------
    ValueError
        A machine that the component cannot hold, one of which more yields than offsets of limbs in
        closed form, or backlash beside a drive law that is no table;
        nothing is written.
    OSError
        The folder cannot be written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as made:
    ...     loss = pk.export.linuxcnc(pk.load("hexapod"), f"{made}/mill")
    ...     sorted(path.name for path in pathlib.Path(made, "mill").iterdir()), loss.exact
    (['genhexkins.hal', 'mill.hal', 'mill.ini', 'pkm_mill.c'], True)
    """
    place = as_path("folder", folder)
    files, loss = contents(robot, place.resolve().name)
    place.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_whole(place / name, content)
    return loss


def contents(robot: Robot, folder: str) -> tuple[dict[str, str], Loss | None]:
    """The files for a folder of this name, and how far off LinuxCNC's own module is."""
    require_parallel(robot)
    name = re.sub(r"\W", "_", instance("folder", folder, str).lower(), flags=re.ASCII)
    if not 0 < len(name) <= _LONGEST:
        raise ArgumentError(
            f"folder must have a name of 1 to {_LONGEST} letters, for LinuxCNC's own are short,"
            f" found {folder!r}"
        )
    if (off := c_loaded.not_held(robot)) is not None:
        raise ArgumentError(
            f"robot: more of {robot.name} yields than the offsets of its limbs, which a component"
            f" cannot hold: {off}; its `rigid` can be exported"
        )
    tabled = robot
    if not robot.model.closed_form:
        _require_no_backlash(robot)
    elif not _folded(robot):  # the module is of the joints
        robot = without_laws(robot)
    module = None if robot.model.driven else linuxcnc_modules.of_robot(robot)
    says = _contents(robot, name)
    tables = _tables(tabled, robot)
    for i, joint in enumerate(says["joint_list"]):
        joint["table"] = f"joint{i}.comp" if i in tables else ""
    files = {f"joint{i}.comp": text for i, text in tables.items()}
    files |= {
        f"{_MODULE}{name}.c": rendered("kins.c.jinja", says),
        f"{name}.ini": rendered("machine.ini.jinja", says),
        f"{name}.hal": rendered("machine.hal.jinja", says),
    }
    if module is None:
        return files, None
    if robot is not robot.rigid:  # their modules know no load
        return files, sag(robot)
    if module.loss.exact:
        files[f"{module.name}.hal"] = module.lines
    return files, module.loss


def _folded(robot: Robot) -> bool:
    """Return whether the component takes the laws: one has more than a table, none backlash.

    Without such laws it is of joints behind their motors; LinuxCNC itself corrects these.
    """
    laws = [law for law in robot.model.laws if law is not None]
    curved = any(law.quadratic or law.spool or law.harmonics for law in laws)
    return not laws or (curved and not any(law.backlash for law in laws))


def _require_no_backlash(robot: Robot) -> None:
    for d, law in enumerate(robot.model.laws):
        if law is not None and law.backlash:
            raise ArgumentError(
                f"robot: limb {robot.model.limb_of_drive(d) + 1} of {robot.name} has backlash,"
                " which a component of chains of joints cannot hold"
            )


def _tables(robot: Robot, plain: Robot) -> dict[int, str]:
    """The COMP_FILE of each joint that needs one; `plain` is the robot without laws."""
    if robot.model.driven == plain.model.driven:
        return {}
    at_home = plain.inverse(plain.home, match=True)
    return comp_texts(robot, *_limits(plain, at_home, plain.machine.struct.size))


def _contents(robot: Robot, name: str) -> dict[str, Any]:
    """Fill the templates, by the names in them."""
    axes = _axes(robot)
    module = _MODULE + name
    header = header_of(robot, module, "double")
    n = robot.n_actuators
    angular = [unit == "rad" for unit in robot.actuator_units]
    size = robot.machine.struct.size
    at_home = robot.inverse(robot.home, match=True)
    if not np.isfinite(at_home).all():
        raise ArgumentError(f"robot: {robot.name} cannot reach its home pose")
    home = [_in_degrees(robot.home[k], k >= 3) for k in range(6)]
    least, most = _limits(robot, at_home, size)
    degree = repr(float(np.radians(1.0)))
    return {
        "title": re.sub(r"[^ -~]|\*/|/\*", "?", robot.name),
        "name": name,
        "module": module,
        "header": header,
        "load": robot.model.elastic is not None,
        "P": module,
        "U": module.upper(),
        "n": n,
        "letters": " ".join(_LETTERS[axis] for axis in axes),
        "joints": ", ".join("deg" if turns else "mm" for turns in angular),
        "units": ", ".join(degree if turns else "1.0" for turns in angular),
        "completes": determines_others(robot),
        "places": ", ".join(str(POSE.index(axis)) for axis in axes),
        "steps": ", ".join(repr(_DIFFERENCE * (1.0 if turns else size)) for turns in angular),
        "arm": repr(float(robot.length)),
        "settled": repr(1e-9 * size),
        "home": " ".join(home[k] if POSE[k] in axes else "0.0" for k in range(6)),
        "axes": [_axis(robot, axis, size) for axis in axes],
        "joint_list": [
            {
                "type": "ANGULAR" if turns else "LINEAR",
                "home": _in_degrees(at_home[i], turns),
                "least": _in_degrees(least[i], turns),
                "most": _in_degrees(most[i], turns),
            }
            for i, turns in enumerate(angular)
        ],
    }


def _axes(robot: Robot) -> tuple[str, ...]:
    """The coordinates that programs command: as many as there are actuators."""
    axes = robot.moved
    if len(axes) != robot.n_actuators and (
        determines_others(robot) or len(axes) > robot.n_actuators
    ):
        raise ArgumentError(
            f"robot: {robot.name} has {robot.n_actuators} actuators for {len(axes)} coordinates"
        )
    if not robot.frames.trivial and len(axes) < 6 and robot.model.map != "translation":
        raise ArgumentError(
            f"robot: {robot.name} has base or tool frames and {len(axes)} coordinates of its own;"
            " in the frames these are no axes"
        )
    return axes


def _axis(robot: Robot, axis: str, size: float) -> dict[str, Any]:
    place = POSE.index(axis)
    turns = place >= 3
    reach = np.pi if turns else size
    return {
        "letter": _LETTERS[axis],
        "field": _FIELDS[axis],
        "place": place,
        "angle": turns,
        "least": _in_degrees(robot.home[place] - reach, turns),
        "most": _in_degrees(robot.home[place] + reach, turns),
    }


def _limits(robot: Robot, at_home: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """The strokes as joint limits; where there is none, the machine's size or a turn."""
    reach = np.array([2.0 * np.pi if unit == "rad" else size for unit in robot.actuator_units])
    least, most = at_home - reach, at_home + reach
    stated: dict[int, FloatArray] = {}
    for d, drive in enumerate(robot.model.drives):
        if drive.stroke is not None:
            ends = np.sort(_ends(robot, d, drive.stroke))
            known = stated.get(drive.actuator, ends)
            stated[drive.actuator] = np.array([max(known[0], ends[0]), min(known[1], ends[1])])
    for i, ends in stated.items():
        least[i], most[i] = ends
    return least, most


def _ends(robot: Robot, d: int, stroke: tuple[float, float]) -> FloatArray:
    """The actuator coordinates (2,) at the ends of a drive's stroke."""
    machine, drive = robot.machine, robot.model.drives[d]
    if isinstance(machine, DrivenMachine):
        return machine.laws.reading(robot.slots, np.array(stroke), d)
    numbers = robot.slots.ravel()
    ends: FloatArray = (np.array(stroke) - numbers[drive.offset]) / numbers[drive.gain]
    return ends


def _in_degrees(value: float, turns: bool) -> str:
    return repr(float(np.degrees(value) if turns else value))
