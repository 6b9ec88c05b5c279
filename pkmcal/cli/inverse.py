"""`pkmcal inverse`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.load_options import Payload, PayloadAt, ToolForce
from pkmcal.cli.options import Force, Json, ParallelRobot, Radians
from pkmcal.cli.output import say
from pkmcal.cli.rows import POSE_UNITS, table
from pkmcal.cli.taken import Taken
from pkmcal.core.library import POSE
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import carrying
from pkmcal.jobs.output import Output
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.loading import load_parallel
from pkmcal.measurements.command_csv import write_commands
from pkmcal.measurements.pose_csv import read_poses
from pkmcal.report.as_json import as_json


def inverse(
    robot: ParallelRobot,
    poses: Annotated[
        str,
        typer.Argument(
            metavar="X,Y,Z,A,B,C|CSV",
            help="One pose in mm and deg, or a file of poses: 'x \\[mm]' … 'gamma \\[deg]'.",
        ),
    ],
    rad: Radians = False,
    match: Annotated[
        bool,
        typer.Option(
            "--match/--no-match",
            help="Complete poses that the limbs do not allow (default), or take them as given.",
        ),
    ] = True,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write commands.csv, exact.")
    ] = None,
    payload: Payload = None,
    payload_at: PayloadAt = None,
    tool_force: ToolForce = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Print the actuator coordinates that lead to poses.

    Of a pose that the limbs do not allow the machine keeps as many coordinates as it can move,
    those that its file declares, and the others follow.

    Exit code 1: no pose keeps these coordinates, the closures miss a pose, a limb cannot reach it,
    or breaks a limit there.

    Example: pkmcal inverse hexapod 20,-10,860,5,0,3
    """
    read = Inputs()
    machine = carrying(load_parallel(read.robot(robot)), payload, payload_at, tool_force)
    row = numbers_on_line("poses", poses, POSE_UNITS, rad, POSE)
    rows = read_poses(read.file(poses), machine) if row is None else row
    output = None if out is None else Output(out, ["commands.csv"], read, force)
    taken = Taken.of(machine, rows, match)
    q, allowed = taken.actuators, machine.feasible(taken.asked)
    ok = allowed.ok & taken.ok
    units = reading_units(machine)
    if output is not None:
        with output.draft() as draft:
            write_commands(draft / "commands.csv", units, q, comment=read.comment())
    if json:
        say(
            as_json(
                {"actuators": q, "units": units, "ok": ok, "pose": taken.pose},
                schema="inverse",
            )
        )
    else:
        heads = [f"q{i + 1}" for i in range(machine.n_actuators)]
        say(table(heads, units, q))
        for line in (*taken.said(), *allowed.broken()):
            say(line)
        if output is not None:
            say(f"\ncommands: {output.paths[0]}")
    return 0 if ok.all() else 1
