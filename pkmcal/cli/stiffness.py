"""`pkmcal stiffness`."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.inputs import Inputs
from pkmcal.cli.load_options import Payload, PayloadAt, ToolForce, Yielding, carrying, yielding
from pkmcal.cli.options import Json, ParallelRobot, Radians, Seed
from pkmcal.cli.output import say
from pkmcal.cli.rows import POSE_UNITS, numbers_on_line
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses
from pkmcal.report.as_json import as_json

_DRAWN = 1000  # poses of the workspace


def stiffness(
    robot: ParallelRobot,
    poses: Annotated[
        str | None,
        typer.Argument(
            metavar="[X,Y,Z,A,B,C|CSV]",
            help="One pose in mm and deg, or a file of poses; by default 1000 are drawn in the"
            " workspace.",
        ),
    ] = None,
    compliance: Yielding = None,
    payload: Payload = None,
    payload_at: PayloadAt = None,
    tool_force: ToolForce = None,
    rated: Annotated[
        float, typer.Option(metavar="N", help="Largest force of the table of one pose.")
    ] = 1000.0,
    rad: Radians = False,
    seed: Seed = 0,
    json: Json = False,
) -> int:
    """Print how stiff a machine is, by what its file says that yields.

    At one pose also the static compliance as ISO 9283 tests it: forces on the tool along ± x y z in
    ten steps up to the rated load.

    Exit code 1: at some of the poses the machine is singular, does not get there, or gives way.

    Example: pkmcal stiffness hexapod 0,0,800,0,0,0 --compliance 'offset*=5e-5'
    """
    read = Inputs()
    machine = yielding(load_parallel(read.robot(robot)), compliance)
    machine = carrying(machine, payload, payload_at, tool_force)
    if poses is None:
        rows, one = pk.sample_poses(machine.rigid, _DRAWN, seed=seed), False
    else:
        row = numbers_on_line("poses", poses, POSE_UNITS, rad)
        rows, one = (read_poses(read.file(poses), machine), False) if row is None else (row, True)
    found = pk.stiffness(machine, rows)
    ok = np.isfinite(found.compliance).all(axis=(1, 2))
    table = pk.compliance_table(machine, rows[0], rated) if one and ok.all() else None
    if json:
        content = {"poses": rows, "compliance": found.compliance, "stiffness": found.matrix}
        if table is not None:
            content |= {"force": table.force, "displacement": table.displacement}
        say(as_json(content, schema="stiffness"))
    else:
        say(found)
        if table is not None:
            say(f"\n{table}")
    return 0 if ok.all() else 1
