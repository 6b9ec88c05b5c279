"""`pkmcal compensate`."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Annotated, cast

import numpy as np
import typer

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.cli.inputs import Inputs
from pkmcal.cli.options import Force, Json, ParallelRobot, Seed
from pkmcal.cli.output import Output, say
from pkmcal.compensation.compensate import Method, Orientation
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json

_BESIDE = re.compile(r"q\d+|sigma(\..+)?|group")  # in a file of measurements, and not needed here


def compensate(
    robot: ParallelRobot,
    desired: Annotated[Path, typer.Argument(metavar="DESIRED.csv", help="Desired poses.")],
    measured: Annotated[
        Path,
        typer.Argument(
            metavar="MEASURED.csv",
            help="Where the commands of the inverse kinematics led the machine, row by row:"
            " poses, or positions 'x \\[mm], y \\[mm], z \\[mm]'.",
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
        typer.Option(metavar="NUMBER", help="Of the swarm's corrections, mm or rad."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write poses, commands, corrections: DIR/corrected.csv."),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Correct the commands of a machine by measured poses (eq. 18 of the 2TPR&2TPS paper).

    Exit code 1: a limb cannot reach some of the poses, or a measured error is implausibly large.

    Example: pkmcal compensate 2tpr2tps examples/2tpr2tps-compensation/desired.csv
    examples/2tpr2tps-compensation/measured.csv
    """
    read = Inputs()
    machine = load_parallel(read.robot(robot))
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
        units = [f"[{unit}]" for unit in machine.actuator_units]
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
    table.require(wanted)
    return np.stack(
        [table.numbers(name, "rad" if name in POSE[3:] else "mm")[0] for name in wanted], axis=1
    )


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
