"""`pkmcal forward`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.load_options import Payload, PayloadAt, ToolForce
from pkmcal.cli.options import Force, Json, Radians, RobotOrArm
from pkmcal.cli.output import say
from pkmcal.cli.rows import POSE_UNITS, table
from pkmcal.core.library import POSE, STATUS
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import carrying
from pkmcal.jobs.output import Output
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.reading_units import reading_units
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
    payload: Payload = None,
    payload_at: PayloadAt = None,
    tool_force: ToolForce = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Print where actuator coordinates lead a machine.

    Exit code 1: some rows have no pose.

    Example: pkmcal forward 2tpr2tps 450,452,400,405
    """
    read = Inputs()
    loaded = pk.load(read.robot(robot))
    machine = as_machine(carrying(loaded, payload, payload_at, tool_force))
    units = reading_units(machine)
    row = numbers_on_line("actuators", actuators, units, rad)
    q = read_commands(read.file(actuators), units) if row is None else row
    output = None if out is None else Output(out, ["poses.csv"], read, force)
    solved = machine.forward(q)
    if output is not None:
        with output.draft() as draft:
            write_poses(draft / "poses.csv", solved.pose, comment=read.comment())
    if json:
        say(as_json({"pose": solved.pose, "status": solved.status}, schema="forward"))
    else:
        say(table(POSE, POSE_UNITS, solved.pose))
        for i in np.flatnonzero(~solved.ok):
            say(f"row {i}: {STATUS[int(solved.status[i])]}")
        if output is not None:
            say(f"\nposes: {output.paths[0]}")
    return 0 if solved.ok.all() else 1
