"""G-code of a plan: from pose to pose, with a pause at each to read, or with the printer's probe.

Words of firmwares, from their documents: klipper3d.org (G-Codes), docs.duet3d.com (Gcode),
marlinfw.org (G-code), linuxcnc.org (G-codes, there G4 takes seconds, and G28 homes nothing).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pkmcal.arguments import number, word
from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.plan import GCODE, Planning
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.straight_way import straight_way
from pkmcal.live.measuring_run import Rules
from pkmcal.planning.plan_poses import Plan

OPTION = "--gcode"
PROBE = "probe"  # kind of a plan for a printer's own probe
_LETTERS = dict(zip(POSE, "XYZABC", strict=True))
_OVER_BED = 5.0  # mm to which it rises between poses of a probe, where nothing else is stated
_DECIMALS = 5  # of mm and deg


@dataclass(frozen=True)
class Firmware:
    """Words of one firmware.

    Attributes
    ----------
    begin, end : sequence of str
        Lines around the poses.
    pause : str
        Waits for `ms` milliseconds or `s` seconds.
    probe : str or None
        Probes at `x`, `y`, where it stands already; None: it has no probe.
    meshes : str
        What bends its moves, and how that is switched off.
    turns : bool
        Whether A, B and C are rotations.
    ending : str
        Of a file's name.
    """

    begin: tuple[str, ...]
    pause: str
    probe: str | None
    meshes: str
    end: tuple[str, ...] = ()
    turns: bool = False
    ending: str = "gcode"


FIRMWARES: dict[str, Firmware] = {
    "klipper": Firmware(("G28", "G90"), "M400\nG4 P{ms:.0f}", "PROBE",
                        "BED_MESH_CLEAR; SET_GCODE_OFFSET Z=0"),
    "reprap": Firmware(("G21", "G28", "G90"), "M400\nG4 P{ms:.0f}", "G30 S-1",
                       "G29 S2; M290 R0 S0"),
    "marlin": Firmware(("G21", "G28", "G90"), "M400\nG4 P{ms:.0f}", "G30 X{x} Y{y}", "M420 S0"),
    "linuxcnc": Firmware(("G21 G90 G94", "G61"), "G4 P{s:g}", None, "G92.1; G49",
                         ("M2",), turns=True, ending="ngc"),
}  # fmt: skip


def firmware_of(job: Planning) -> Firmware:
    """Return the words of the firmware that a plan is written for.

    Raises
    ------
    ValueError
        It is none of these, or has no probe where one is to be used.
    """
    name = word(OPTION, job.gcode, GCODE)
    found = FIRMWARES[name]
    if job.kind == PROBE and found.probe is None:
        raise ArgumentError(f"{OPTION} {name}: it has no probe; state another --kind")
    return found


def program(job: Planning, made: Plan, head: str) -> str:
    """Return the program that drives to the poses of a plan, in its order.

    It homes, goes to the machine's home, and on in straight lines, all of which were looked at,
    by way of home where a line would leave the limits. It rises to the safe height between poses
    where one is stated, or where a printer probes.

    Parameters
    ----------
    job : Planning
        What was asked for, with the firmware.
    made : Plan
        The plan.
    head : str
        Comments of where it is from, lines with ``#``.

    Raises
    ------
    ValueError
        Another machine than one that this firmware moves, a pause or a height that is none, or a
        way that leaves the limits.
    """
    firmware, robot = firmware_of(job), made.robot
    if not isinstance(robot, Robot):
        raise ArgumentError(f"{OPTION}: of parallel machines; {robot.name} is an arm")
    axes = robot.moved
    turned = [axis for axis in axes if axis not in "xyz"]
    if turned and not firmware.turns:
        raise ArgumentError(
            f"{OPTION} {job.gcode}: drives x, y and z alone, and {robot.name} moves"
            f" {', '.join(axes)}"
        )
    if not (np.isfinite(job.dwell) and 0.0 <= job.dwell <= 3600.0):
        raise ArgumentError(f"--dwell must be from 0 to 3600 s, found {job.dwell:g}")
    if job.safe_height is not None:
        number("--safe-height", job.safe_height)
    probed = job.kind == PROBE
    height = _OVER_BED if probed and job.safe_height is None else job.safe_height
    lines = [
        f"; {str(made).splitlines()[0]}",
        *(f";{line.removeprefix('#')}" for line in head.splitlines()),
        f"; Meshes and offsets bend its moves; switch them off first: {firmware.meshes}",
        "; Read it before you run it: nothing here knows what stands in the way.",
        *firmware.begin,
        "; to the home of the robot file",
        _move(robot, robot.home),
    ]
    at = robot.home
    for k, pose in enumerate(made.poses):
        lines.append(f"; pose {k + 1} of {len(made.poses)}{_beside(made, k)}")
        above = pose.copy()
        if probed:
            above[2] += height or 0.0
        way = _way(robot, at, above, height, f"to pose {k + 1}")
        lines += [_move(robot, each) for each in way]
        if probed and firmware.probe is not None:
            lines.append(firmware.probe.format(x=_number(pose[0]), y=_number(pose[1])))
        else:
            lines.append(firmware.pause.format(ms=1000.0 * job.dwell, s=job.dwell))
        at = pose
    way = _way(robot, at, robot.home, height, "back to home")
    lines += ["; back to home", *(_move(robot, each) for each in way), *firmware.end]
    return "\n".join(lines) + "\n"


def _way(
    robot: Robot, start: FloatArray, end: FloatArray, height: float | None, where: str
) -> list[FloatArray]:
    """Return where to go from one pose to another: straight, or else by way of home.

    Raises
    ------
    ValueError
        Both leave strokes, cones or the box.
    """
    straight = _over(start, end, height)
    for way in (straight, [*_over(start, robot.home, height), *_over(robot.home, end, height)]):
        if all(_outside(robot, *each) is None for each in pairwise([start, *way])):
            return way
    ways = (_outside(robot, *each) for each in pairwise([start, *straight]))
    place = ", ".join(f"{each:.1f}" for each in next(one for one in ways if one is not None)[:3])
    raise ArgumentError(
        f"{OPTION}: the way {where} leaves the limits of {robot.name} at x, y, z = {place} mm:"
        " state --safe-height, --within or --poses"
    )


def _over(start: FloatArray, end: FloatArray, height: float | None) -> list[FloatArray]:
    """Return where to go, straight or over a height, to `end`."""
    if height is None:
        return [end]
    up, over = start.copy(), end.copy()
    up[2], over[2] = max(start[2], height), max(end[2], height)
    way = [start, up, over, end]
    return [each for last, each in pairwise(way) if (each != last).any()]


def _outside(robot: Robot, start: FloatArray, end: FloatArray) -> FloatArray | None:
    """Return the first pose of a straight way that is outside of the limits."""
    way = straight_way(start, end)
    inside = robot.feasible(way).ok
    return None if inside.all() else way[np.argmin(inside)]


def _move(robot: Robot, pose: FloatArray) -> str:
    words = []
    for axis in robot.moved:
        value = pose[POSE.index(axis)]
        words.append(_LETTERS[axis] + _number(value if axis in "xyz" else np.degrees(value)))
    return " ".join(["G1", *words, f"F{Rules.feed:g}"])


def _number(value: float) -> str:
    return f"{round(float(value), _DECIMALS) + 0.0:.{_DECIMALS}f}"


def _beside(made: Plan, k: int) -> str:
    """Comment on a pose: its kind of reading and its load, where poses differ in them."""
    said = f": {made.kinds[k]}" if len(set(made.kinds)) > 1 else ""
    return said if made.load is None else f"{said}, carrying {np.asarray(made.load.mass)[k]:g} kg"
