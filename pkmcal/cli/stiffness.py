"""`pkmcal stiffness`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.cli.load_options import Payload, PayloadAt, ToolForce, Yielding
from pkmcal.cli.options import Force, Json, ParallelRobot, Radians, Seed
from pkmcal.cli.output import say
from pkmcal.cli.rows import POSE_UNITS
from pkmcal.core.library import POSE
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import carrying, three, yielding
from pkmcal.jobs.output import Output
from pkmcal.jobs.rows import numbers_on_line
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json

_DRAWN = 1000  # poses of the workspace
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


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
    cut: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="A force on the tool, N, such as that of a cut: print how far it moves the tool.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Write the stiffness pose by pose."),
    ] = None,
    rad: Radians = False,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Print how stiff a machine is, by what its file says that yields.

    At one pose also the matrix, and the static compliance as ISO 9283 tests it: forces on the tool
    along ± x y z in ten steps up to the rated load. pkmcal show draws a map of the workspace.

    Exit code 1: at some of the poses the machine is singular, does not get there, or gives way.

    Example: pkmcal stiffness hexapod 0,0,800,0,0,0 --compliance 'offset*=5e-5'
    """
    read = Inputs()
    machine = yielding(load_parallel(read.robot(robot)), compliance)
    machine = carrying(machine, payload, payload_at, tool_force)
    if poses is None:
        rows, one = pk.sample_poses(machine.rigid, _DRAWN, seed=seed), False
    else:
        row = numbers_on_line("poses", poses, POSE_UNITS, rad, POSE)
        rows, one = (read_poses(read.file(poses), machine), False) if row is None else (row, True)
    found = pk.stiffness(machine, rows)
    moved = None if cut is None else found.displacement(three("--cut", cut))
    if out is not None:
        with Output(out.parent, [out.name], read, force).draft() as draft:
            write_poses(draft / out.name, rows, _columns(found, moved), comment=read.comment())
    ok = np.isfinite(found.compliance).all(axis=(1, 2))
    table = pk.compliance_table(machine, rows[0], rated) if one and ok.all() else None
    if json:
        content = {"poses": rows, "compliance": found.compliance, "stiffness": found.matrix}
        if table is not None:
            content |= {"force": table.force, "displacement": table.displacement}
        if moved is not None:
            content["moved"] = moved
        say(as_json(content, schema="stiffness"))
    else:
        say(found)
        if moved is not None:
            say(f"\n{_by_cut(cut, moved)}")
        if table is not None:
            say(f"\n{table}")
        if out is not None:
            say(f"\nstiffness by pose: {out}")
    return 0 if ok.all() else 1


def _columns(found: pk.Stiffness, moved: FloatArray | None) -> dict[str, FloatArray]:
    """Return the columns beside the poses (N,) of a file."""
    direction, softest = found.softest
    columns = {f"along {axis} [N/mm]": found.stiffness_along(way) for axis, way in _AXES.items()}
    columns["softest [N/mm]"] = softest
    columns |= {f"softest {axis}": direction[:, k] for k, axis in enumerate(_AXES)}
    if moved is not None:
        columns |= {f"moved {axis} [mm]": moved[:, k] for k, axis in enumerate(_AXES)}
    return columns


def _by_cut(cut: str | None, moved: FloatArray) -> str:
    """Return how far a force moves the tool at the poses (N, 3)."""
    size = np.linalg.norm(moved, axis=1)
    size = size[np.isfinite(size)]
    if not len(size):
        return f"no pose at which {cut} N at the tool can be held"
    worst = f"at most {size.max():.3g} mm"
    said = worst if len(size) == 1 else f"by {np.median(size):.3g} mm (median), {worst}"
    return f"{cut} N at the tool move it {said}"
