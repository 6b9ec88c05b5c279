"""`pkmcal compensate`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Annotated, cast, get_args

import numpy as np
import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray
from pkmcal.cli.load_options import Payload, PayloadAt, ToolForce, ToolLoads
from pkmcal.cli.options import Force, Json, ParallelRobot, Seed
from pkmcal.cli.output import say
from pkmcal.cli.rows import POSE_UNITS
from pkmcal.compensation.compensate import Method, Orientation
from pkmcal.compensation.program import GcodeFirmware
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import carrying, loads_by_tool
from pkmcal.jobs.output import Output
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json

PROGRAMS = (".ngc", ".nc", ".gcode", ".g", ".tap")
_BESIDE = re.compile(r"q\d+|sigma(\..+)?|group|session")  # of measurements, and not needed here


def compensate(
    robot: ParallelRobot,
    desired: Annotated[
        Path,
        typer.Argument(
            metavar="DESIRED.csv|PROGRAM", help="Desired poses, or a program in plain G-code."
        ),
    ],
    measured: Annotated[
        Path,
        typer.Argument(
            metavar="MEASURED.csv|CALIBRATED",
            help="Where the commands of the inverse kinematics led the machine, row by row:"
            " poses, or positions 'x \\[mm], y \\[mm], z \\[mm]'. Of a program: the calibrated"
            " robot, where ROBOT is as the controller has it.",
        ),
    ],
    method: Annotated[
        str, typer.Option(metavar="WORD", help="exact, or pso: a particle swarm, as published.")
    ] = "exact",
    orientation: Annotated[
        str | None,
        typer.Option(
            metavar="WORD",
            help="measured, assumed (as desired) or from-position (beta of a 2TPR&2TPS). By"
            " default what the file and the machine allow.",
        ),
    ] = None,
    match: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Coordinates that count: 'x,y,z,alpha'; else all six."),
    ] = None,
    common: Annotated[bool, typer.Option("--common", help="One correction for all poses.")] = False,
    seed: Seed = 0,
    bounds: Annotated[
        float | None,
        typer.Option(metavar="NUMBER", help="Largest correction of the swarm, mm or rad."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write DIR/corrected.csv, or the program by its name."),
    ] = None,
    chord: Annotated[
        float | None,
        typer.Option(
            metavar="MM", help="Of a program: largest distance from its lines, 0.01 by default."
        ),
    ] = None,
    joints: Annotated[
        bool, typer.Option("--joints", help="Of a program: write actuator coordinates.")
    ] = False,
    start: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,A,B,C", help="Of a program: the pose where it begins, mm and deg."
        ),
    ] = None,
    firmware: Annotated[
        str | None,
        typer.Option(metavar="WORD", help=f"Of a program: {', '.join(get_args(GcodeFirmware))}."),
    ] = None,
    passed: Annotated[
        list[str] | None,
        typer.Option(
            "--pass",
            metavar="WORD",
            help="Of a program: a word that moves nothing and changes no mode and no coordinate.",
        ),
    ] = None,
    payload: Payload = None,
    payload_at: PayloadAt = None,
    tool_force: ToolForce = None,
    load: ToolLoads = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Correct the commands of a machine by measured poses (eq. 18 of the 2TPR&2TPS paper).

    Or a program (.ngc, .nc, .gcode, .g, .tap) for a controller that has other numbers than the
    calibrated machine: its G0 and G1 are written with poses that lead where they are meant, long
    ones in parts, and nothing else is changed. --firmware says what its words mean.

    Exit code 1: a limb cannot reach some of the poses, or a measured error is implausibly large.

    Example: pkmcal compensate 2tpr2tps examples/2tpr2tps-compensation/desired.csv
    examples/2tpr2tps-compensation/measured.csv
    """
    read = Inputs()
    machine = load_parallel(read.robot(robot))
    if desired.suffix.lower() in PROGRAMS:
        beside = {"orientation": orientation, "match": match, "common": common, "bounds": bounds}
        _refuse(beside | {"seed": seed, "method": method != "exact"}, "a program")
        calibrated = load_parallel(read.robot(str(measured)))
        if out is None:
            raise ArgumentError("--out is needed: the folder for the corrected program")
        if firmware is None:
            known = ", ".join(get_args(GcodeFirmware))
            raise ArgumentError(f"--firmware is needed, words mean different things: {known}")
        calibrated = carrying(calibrated, payload, payload_at, tool_force)
        program = read.file(desired)
        correct = partial(
            pk.compensate_program,
            machine,
            calibrated,
            program,
            firmware=word("--firmware", firmware, get_args(GcodeFirmware)),
            chord=0.01 if chord is None else chord,
            joints=joints,
            start=_start(start),
            passed=passed or (),
            loads=loads_by_tool(load),
        )
        return _program(desired, Output(out, [desired.name], read, force), json, correct)
    of_programs = {"chord": chord, "joints": joints, "start": start}
    _refuse(of_programs | {"firmware": firmware, "pass": passed, "load": load}, "a table of poses")
    machine = carrying(machine, payload, payload_at, tool_force)
    poses = read_poses(read.file(desired), machine)
    reached = read_reached(read.file(measured))
    output = None if out is None else Output(out, ["corrected.csv"], read, force)
    if len(reached) != len(poses):
        raise ArgumentError(f"{measured}: {len(reached)} rows for the {len(poses)} of {desired}")
    found = pk.compensate(
        machine,
        poses,
        reached,
        method=cast(Method, method),
        orientation=cast(Orientation, orientation) or _orientation(machine, reached, measured),
        match=None if match is None else [name.strip() for name in match.split(",")],
        common=common,
        seed=seed,
        bounds=bounds,
    )
    if output is not None:
        units = [f"[{unit}]" for unit in found.units]
        columns = {
            f"{word}{i + 1} {unit}": values[:, i]
            for word, values in (("q", found.actuators), ("dq", found.correction))
            for i, unit in enumerate(units)
        }
        with output.draft() as draft:
            write_poses(draft / "corrected.csv", poses, columns, comment=read.comment())
    if json:
        say(as_json(found, schema="compensate"))
    else:
        say(found)
        if output is not None:
            say(f"\ncommands: {output.paths[0]}")
    return 0 if np.isfinite(found.actuators).all() and not found.gross.any() else 1


def _refuse(given: Mapping[str, object], what: str) -> None:
    """Refuse options that say nothing of what is compensated."""
    for name, value in given.items():
        if value:
            raise ArgumentError(f"--{name} says nothing of {what}")


def _program(
    path: Path, output: Output, json: bool, correct: Callable[..., pk.CorrectedProgram]
) -> int:
    """Write a corrected program."""
    with output.draft() as draft:
        if json:  # holds it, too
            found = correct()
            (draft / path.name).write_bytes(found.text.encode("utf-8", errors="surrogateescape"))
        else:
            found = correct(out=draft / path.name)
    say(as_json(found) if json else f"{found}\nprogram: {output.paths[0]}")
    return 0


def _start(text: str | None) -> FloatArray | None:
    """The pose where a program begins."""
    if text is None:
        return None
    row = numbers_on_line("--start", text, POSE_UNITS, rad=False)
    if row is None:
        raise ArgumentError(f"--start must be six numbers, found {text!r}")
    pose: FloatArray = row[0]
    return pose


def read_reached(path: str | PathLike[str]) -> FloatArray:
    """Measured poses (N, 6) or positions (N, 3) of a file, mm and rad.

    Raises
    ------
    ValueError
        Naming file, line and column: some angles without the others, an unknown column, a missing
        unit, a cell without a number.
    OSError
        The file cannot be read.
    """
    table = Table(path)
    table.refuse_unknown(
        lambda name: name in POSE or _BESIDE.fullmatch(name) is not None, list(POSE)
    )
    wanted = POSE if any(name in table.columns for name in POSE[3:]) else POSE[:3]
    return table.stacked(wanted, ["rad" if name in POSE[3:] else "mm" for name in wanted])


def _orientation(robot: Robot, reached: FloatArray, path: Path) -> Orientation:
    """Choose where the orientation comes from if the command does not say."""
    if reached.shape[1] == 6:
        return "measured"
    if robot.model.map == "2tpr2tps":
        return "from-position"
    if robot.model.map == "translation":
        return "assumed"
    raise ArgumentError(
        f"{path}: positions do not determine the orientation of {robot.name};"
        " measure it, or assume the desired one: --orientation assumed"
    )
