"""Makes a plan of poses of a `Planning`, and writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arguments import did_you_mean, word
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.core.library import COORDINATE_UNITS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.geometry.box import RADIUS, Box
from pkmcal.jobs.effects_option import AUTO, OPTION, read_effects
from pkmcal.jobs.geometry_options import free_names, read_prior
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import mass, yielding
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.plan_gcode import PROBE, firmware_of, program
from pkmcal.jobs.planned_camera import planned_camera
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import good_poses, sample_poses
from pkmcal.loading import load
from pkmcal.measurements.command_csv import read_commands, write_commands
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.planning.offered import PLANNED
from pkmcal.planning.optimal_design import CRITERIA
from pkmcal.planning.plan_poses import Plan, plan_poses
from pkmcal.planning.planned import UNKNOWN
from pkmcal.readings.registry import Kind

_RINGS = 8  # of places on the bed
_WHOLE = 1e-3  # mm, of the places that a probe goes to
DRAWN, _SHARE = 500, 0.9  # candidates where none are given, and how far out they reach


@dataclass(frozen=True)
class Sources:
    """Files of a plan as they were read.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine, within where it is to stay.
    poses, targets : ndarray or None
        Candidates, and poses where accuracy counts, of files: (N, 6), or an arm's joints (N, n).
    measured : Measurements or None
        Rows that are there.
    """

    robot: Robot | SerialArm
    poses: FloatArray | None
    targets: FloatArray | None
    measured: Measurements | None = None


def run(job: Planning, inputs: Inputs) -> Plan:
    """Read the files of a plan and choose its poses.

    Parameters
    ----------
    job : Planning
        What is asked for.
    inputs : Inputs
        Reads the files, each once.

    Raises
    ------
    ValueError
        An option that says nothing of this machine, or of what is measured.
    """
    return planned(job, read(job, inputs))


def read(job: Planning, inputs: Inputs) -> Sources:
    """Read machine, candidates and targets."""
    robot: Robot | SerialArm = load(inputs.robot(job.robot))
    box = _box(robot, job.within)
    if isinstance(robot, Robot):
        robot = yielding(robot.within(box), job.compliance)
    poses = None if job.poses is None else _places(robot, inputs.file(job.poses))
    targets = None if job.targets is None else _places(robot, inputs.file(job.targets))
    measured = None
    if job.measured is not None:
        measured = read_measurements(inputs.file(job.measured), as_machine(robot))
        if measured.sigma is None and measured.components:
            noise = _noise(job.noise, kinds_of(job))
            of_kind = noise.get(measured.kind) if isinstance(noise, dict) else noise
            if of_kind is None:
                raise ArgumentError(
                    f"--measured: its rows of kind {measured.kind} have no sigma, and --noise says"
                    " none of them"
                )
            sigma = VirtualMachine(robot, of_kind).deviations(measured.units)
            measured = replace(measured, sigma=sigma)
    return Sources(robot, poses, targets, measured)


def planned(job: Planning, sources: Sources) -> Plan:
    """Choose the poses of a plan whose files have been read."""
    several = isinstance(kinds_of(job), dict)
    payloads = [] if job.payloads is None else job.payloads.split(",")
    return plan_poses(
        sources.robot,
        candidates(job, sources),
        count=30 if job.count is None and job.accuracy is None and not several else job.count,
        accuracy=job.accuracy,
        travel_weight=job.travel_weight,
        payloads=[mass("--payloads", each) for each in payloads],
        measured=sources.measured,
        **options(job, sources),
    )


def options(job: Planning, sources: Sources) -> dict[str, Any]:
    """Arguments that plans and the choice of a next pose share, beside machine and candidates.

    Raises
    ------
    ValueError
        An option that says nothing of this machine, or of what is measured.
    """
    seen = as_machine(sources.robot)
    free = free_names(seen, job.free)
    kinds = kinds_of(job)
    # a printer's own probe is for the height of its nozzle over the bed
    direction = job.direction or ("z" if job.kind == PROBE else None)
    pictures = planned_camera(job) if kinds == "pixel" else None
    if pictures is None and (job.camera is not None or job.board is not None):
        raise ArgumentError("--camera, --board: they are of pictures; state --kind pixel")
    return {
        "targets": sources.targets,
        "criterion": word("--criterion", job.criterion, CRITERIA),
        "kind": kinds if pictures is None else pictures,
        "target": _points(job.target, kinds),
        "noise": _noise(job.noise, kinds),
        "actuator_noise": job.actuator_noise,
        "effects": _effects(job.effects or ["none"]),
        "free": free or None,
        "prior": read_prior(job.prior, seen, free),
        "unknown": [word("--unknown", each, UNKNOWN) for each in job.unknown],
        "direction": None if direction is None else axis(direction),
    }


def candidates(job: Planning, sources: Sources) -> FloatArray:
    """Poses to choose from."""
    return _candidates(job, sources.robot) if sources.poses is None else sources.poses


def axis(text: str) -> list[float]:
    """The direction of ``--direction``: x, y or z of the base, or three numbers.

    Raises
    ------
    ValueError
        Something else.
    """
    if text in ("x", "y", "z"):
        return [float(text == each) for each in "xyz"]
    try:
        found = [typed(each) for each in text.split(",")]
    except ValueError:
        found = []
    if len(found) != 3:
        raise ArgumentError(f"--direction {text}: expected x, y or z, or X,Y,Z")
    return found


def files(job: Planning) -> list[str]:
    """Names of the files that a plan is written to."""
    kinds = kinds_of(job)
    several = isinstance(kinds, dict)
    commands = [f"commands-{each}.csv" for each in kinds] if several else ["commands.csv"]
    program = [] if job.gcode is None else [f"poses.{firmware_of(job).ending}"]
    return ["poses.csv", *commands, *program]


def kinds_of(job: Planning) -> Kind | dict[Kind, int]:
    """Return the kinds to be measured: one, or several with the number of poses of each.

    Raises
    ------
    ValueError
        No kind, or a number of poses beside those of each kind.
    """
    kinds = "height" if job.kind == PROBE else _kinds(job.kind)
    if isinstance(kinds, dict) and "pixel" in kinds:
        raise ArgumentError(f"--kind {job.kind}: pictures are planned by themselves")
    if isinstance(kinds, dict) and (job.count is not None or job.accuracy is not None):
        raise ArgumentError(
            f"--kind {job.kind}: says how many poses, without --count and --accuracy"
        )
    return kinds


def _kinds(text: str) -> Kind | dict[Kind, int]:
    """Return one kind, or the number of poses of each of several."""
    if "=" not in text:
        return word("--kind", text, PLANNED)
    found: dict[Kind, int] = {}
    for part in text.split(","):
        name, _, number = (each.strip() for each in part.partition("="))
        if not number.isdecimal():
            raise ArgumentError(f"--kind {text}: expected KIND=N, such as position=20,distance=10")
        found[word("--kind", name, PLANNED)] = int(number)
    return found


def _points(given: Sequence[str], kinds: Kind | dict[Kind, int]) -> Any:
    """Points (k, 3) of all kinds, or by kind; None where none are given."""
    found: dict[str, list[list[float]]] = {}
    for text in given:
        name, equals, numbers = text.partition("=")
        try:
            point = [typed(each) for each in (numbers if equals else name).split(",")]
        except ValueError:
            point = []
        if len(point) != 3:
            raise ArgumentError(f"--target {text}: expected X,Y,Z in mm, or KIND=X,Y,Z")
        found.setdefault(
            _of_plan("--target", text, name.strip(), kinds) if equals else "", []
        ).append(point)
    return _by_kind("--target", found)


def _noise(text: str, kinds: Kind | dict[Kind, int]) -> Any:
    """Deviations of all kinds, or by kind."""
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (each.strip() for each in part.partition("="))
        try:
            value = typed(number if equals else name)
        except ValueError:
            raise ArgumentError(f"--noise {text}: expected a number, or KIND=NUMBER") from None
        found[_of_plan("--noise", text, name, kinds) if equals else ""] = value
    return _by_kind("--noise", found)


def _of_plan(option: str, text: str, name: str, kinds: Kind | dict[Kind, int]) -> str:
    known = [*kinds] if isinstance(kinds, dict) else [kinds]
    if name not in known:
        raise ArgumentError(f"{option} {text}: the plan has {', '.join(known)}; found {name!r}")
    return name


def _by_kind(option: str, found: dict[str, Any]) -> Any:
    """Return the value for all, or a mapping of kinds to their own; None of nothing."""
    if "" in found and len(found) > 1:
        raise ArgumentError(f"{option}: one without a kind stands alone, for all")
    return found.get("", found or None)


def _box(machine: Robot | SerialArm, given: Sequence[str]) -> Box:
    """Ends of coordinates, mm and rad, as ``--within`` states them.

    Raises
    ------
    ValueError
        No such coordinate, no numbers.
    """
    if isinstance(machine, SerialArm):
        units = {f"q{i + 1}": unit for i, unit in enumerate(machine.actuator_units)}
    else:
        units = {**COORDINATE_UNITS, RADIUS: "mm"}
    box = {}
    for text in (part.strip() for each in given for part in each.split(",")):
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        if name.strip() not in units:
            known = did_you_mean(name.strip(), units)
            raise ArgumentError(f"--within {text}: {name.strip()!r} is no coordinate{known}")
        try:
            numbers = typed(low), typed(high)
        except ValueError:
            raise ArgumentError(f"--within {text}: expected NAME=LO:HI, such as z=0:300") from None
        if not numbers[0] < numbers[1]:
            raise ArgumentError(f"--within {text}: from {low.strip()} to {high.strip()} is nothing")
        factor = np.radians(1.0) if units[name.strip()] == "rad" else 1.0
        box[name.strip()] = (numbers[0] * factor, numbers[1] * factor)
    return box


def _candidates(job: Planning, machine: Robot | SerialArm) -> FloatArray:
    """Poses to choose from, where no file states them."""
    if job.kind == PROBE:
        return _on_bed(machine)
    return _drawn(machine, _box(machine, job.within), job.seed)


def _on_bed(machine: Robot | SerialArm) -> FloatArray:
    """Poses (N, 6) of a printer at z = 0 that it reaches: rings about the middle.

    Raises
    ------
    ValueError
        The robot file does not say how large the bed is, or nothing of it is reached.
    """
    stated = machine.model.workspace if isinstance(machine, Robot) else {}
    ends = [stated[name][1] for name in ("radius", "x", "y") if name in stated]
    if not isinstance(machine, Robot) or not ends:
        raise ArgumentError(
            "--kind probe: the robot file does not say how large the bed is: state it, --within"
            " radius=0:100"
        )
    rings = [np.zeros((1, 2))]
    for ring in range(1, _RINGS + 1):
        turns = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        rings.append(min(ends) * ring / _RINGS * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    poses = np.zeros((sum(map(len, rings)), 6))
    poses[:, :2] = np.trunc(np.concatenate(rings) / _WHOLE) * _WHOLE  # no rounding leads beyond it
    reached: FloatArray = poses[good_poses(machine, poses)]
    if not len(reached):
        raise ArgumentError(f"--kind probe: {machine.name} reaches nothing of its bed at z = 0")
    return reached


def _drawn(machine: Robot | SerialArm, box: Box, seed: int) -> FloatArray:
    if not isinstance(machine, SerialArm):
        return sample_poses(machine, DRAWN, seed, share=_SHARE)
    ends = machine.limits()
    for name, (low, high) in box.items():
        i = int(name[1:]) - 1
        ends[i] = max(low, ends[i, 0]), min(high, ends[i, 1])
    unknown = [f"q{i + 1}" for i in np.flatnonzero(~np.isfinite(ends).all(axis=1))]
    if unknown:
        raise ArgumentError(
            f"--poses: {machine.name} is a serial arm, and the limits of {', '.join(unknown)} are"
            f" not known: state them ('--within {unknown[0]}=-90:90'), or give a file of joint"
            " coordinates to choose from, with columns such as 'q1 [deg]'"
        )
    return np.random.default_rng(seed).uniform(ends[:, 0], ends[:, 1], (DRAWN, len(ends)))


def _places(machine: Robot | SerialArm, path: PathLike[str]) -> FloatArray:
    """Poses of a file, or an arm's joint coordinates."""
    if isinstance(machine, SerialArm):
        return read_commands(path, machine.actuator_units)
    return read_poses(path, machine)


def write(job: Planning, made: Plan, out: Path, head: str) -> None:
    """Write the files of a plan.

    Raises
    ------
    ValueError
        G-code of another machine than its firmware moves, or a way that leaves the limits.
    """
    if job.gcode is not None:
        name = f"poses.{firmware_of(job).ending}"
        (out / name).write_bytes(program(job, made, head).encode())
    kinds = list(dict.fromkeys(made.kinds))
    several = {"kind": made.kinds} if len(kinds) > 1 else {}
    carried = {} if made.load is None else {"payload [kg]": np.asarray(made.load.mass)}
    write_poses(out / "poses.csv", made.poses, {**several, **carried}, comment=head)
    for kind in kinds:
        points = made.target.get(kind, np.empty((1, 0)))
        own = np.array(made.kinds) == kind
        mine = made.actuators[own]
        at = np.tile(points, (len(mine), 1))
        write_commands(
            out / (f"commands-{kind}.csv" if several else "commands.csv"),
            reading_units(made.robot),
            np.repeat(mine, len(points), axis=0),
            {f"target.{axis} [mm]": place for axis, place in zip("xyz", at.T, strict=False)}
            | {name: np.repeat(kg[own], len(points)) for name, kg in carried.items()},
            comment=head,
        )


def _effects(given: Sequence[str]) -> list[Any]:
    """The effects that the calibration is to find as well."""
    read = read_effects(given)
    if isinstance(read, str):
        raise ArgumentError(f"{OPTION}: {AUTO} is decided by rows, which a plan has not yet")
    return read
