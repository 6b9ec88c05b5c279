"""`pkmcal forward`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.options import Json, Radians, RobotOrArm
from pkmcal.cli.output import contents, folder
from pkmcal.cli.rows import POSE_UNITS, numbers_on_line, table
from pkmcal.core.library import POSE, STATUS
from pkmcal.files.provenance import comment
from pkmcal.measurements.calibratable import as_machine
from pkmcal.measurements.command_csv import read_commands
from pkmcal.measurements.pose_csv import write_poses
from pkmcal.report.as_json import as_json


def forward(
    robot: RobotOrArm,
    actuators: Annotated[
        str,
        typer.Argument(
            metavar="Q1,Q2,…|CSV",
            help="One row of actuator coordinates in mm and deg, or a file: 'q1 \\[mm]' ….",
        ),
    ],
    rad: Radians = False,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write poses.csv.")] = None,
    json: Json = False,
) -> int:
    """Print where actuator coordinates lead a machine.

    Exit code 1: some rows have no pose.

    Example: pkmcal forward 2tpr2tps 450,452,400,405
    """
    machine = as_machine(pk.load(robot))
    row = numbers_on_line("actuators", actuators, machine.actuator_units, rad)
    q = read_commands(actuators, machine.actuator_units) if row is None else row
    solved = machine.forward(q)
    if out is not None:
        read = contents(robot, *([Path(actuators)] if row is None else []))
        write_poses(folder(out) / "poses.csv", solved.pose, comment=comment(read))
    if json:
        typer.echo(as_json({"pose": solved.pose, "status": solved.status}))
    else:
        typer.echo(table(POSE, POSE_UNITS, solved.pose))
        for i in np.flatnonzero(~solved.ok):
            typer.echo(f"row {i}: {STATUS[int(solved.status[i])]}")
        if out is not None:
            typer.echo(f"\nposes: {out / 'poses.csv'}")
    return 0 if solved.ok.all() else 1
