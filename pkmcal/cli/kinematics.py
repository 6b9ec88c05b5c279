"""`pkmcal inverse` and `pkmcal forward`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pkmcal import display
from pkmcal.arrays import FloatArray
from pkmcal.cli.output import folder
from pkmcal.cli.robot_argument import ROBOT, ROBOT_OR_ARM, contents
from pkmcal.core.library import POSE, STATUS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.provenance import comment
from pkmcal.loading import load, load_parallel
from pkmcal.measurements.calibratable import as_machine
from pkmcal.measurements.command_csv import read_commands, write_commands
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json

_RAD = typer.Option("--rad", help="Angles on the line are in radians.")
_JSON = typer.Option("--json", help="Print JSON alone; mm and rad.")
_POSE_UNITS = ("mm", "mm", "mm", "rad", "rad", "rad")


def inverse(
    robot: Annotated[str, ROBOT],
    poses: Annotated[
        str,
        typer.Argument(
            metavar="X,Y,Z,A,B,C|CSV",
            help="One pose in mm and deg, or a file of poses: 'x \\[mm]' … 'gamma \\[deg]'.",
        ),
    ],
    rad: Annotated[bool, _RAD] = False,
    match: Annotated[
        bool,
        typer.Option(
            "--match", help="Keep the coordinates that the machine determines, complete the others."
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write commands.csv, exact.")
    ] = None,
    json: Annotated[bool, _JSON] = False,
) -> int:
    """Print the actuator coordinates that lead to poses.

    Exit code 1: a limb cannot reach some of the poses, or breaks a limit there.

    Example: pkmcal inverse hexapod 20,-10,860,5,0,3
    """
    machine = load_parallel(robot)
    row = _numbers("poses", poses, _POSE_UNITS, rad)
    rows = read_poses(poses, machine) if row is None else row
    if match:
        rows = machine.complete(rows)
    q = machine.inverse(rows)
    allowed = machine.feasible(rows)
    if out is not None:
        read = contents(robot, *([Path(poses)] if row is None else []))
        units = machine.actuator_units
        write_commands(folder(out) / "commands.csv", units, q, comment=comment(read))
    if json:
        typer.echo(as_json({"actuators": q, "units": machine.actuator_units, "ok": allowed.ok}))
    else:
        heads = [f"q{i + 1}" for i in range(machine.n_actuators)]
        typer.echo(_table(heads, machine.actuator_units, q))
        for line in allowed.broken():
            typer.echo(line)
        if out is not None:
            typer.echo(f"\ncommands: {out / 'commands.csv'}")
    return 0 if allowed.ok.all() else 1


def forward(
    robot: Annotated[str, ROBOT_OR_ARM],
    actuators: Annotated[
        str,
        typer.Argument(
            metavar="Q1,Q2,…|CSV",
            help="One row of actuator coordinates in mm and deg, or a file: 'q1 \\[mm]' ….",
        ),
    ],
    rad: Annotated[bool, _RAD] = False,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write poses.csv.")] = None,
    json: Annotated[bool, _JSON] = False,
) -> int:
    """Print where actuator coordinates lead a machine.

    Exit code 1: some rows have no pose.

    Example: pkmcal forward 2tpr2tps 450,452,400,405
    """
    machine = as_machine(load(robot))
    row = _numbers("actuators", actuators, machine.actuator_units, rad)
    q = read_commands(actuators, machine.actuator_units) if row is None else row
    solved = machine.forward(q)
    if out is not None:
        read = contents(robot, *([Path(actuators)] if row is None else []))
        write_poses(folder(out) / "poses.csv", solved.pose, comment=comment(read))
    if json:
        typer.echo(as_json({"pose": solved.pose, "status": solved.status}))
    else:
        typer.echo(_table(POSE, _POSE_UNITS, solved.pose))
        for i in np.flatnonzero(~solved.ok):
            typer.echo(f"row {i}: {STATUS[int(solved.status[i])]}")
        if out is not None:
            typer.echo(f"\nposes: {out / 'poses.csv'}")
    return 0 if solved.ok.all() else 1


def _numbers(what: str, text: str, units: Sequence[str], rad: bool) -> FloatArray | None:
    """One row (1, n) in mm and rad of numbers on the line; None for the name of a file."""
    try:
        row = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return None
    if len(row) != len(units):
        raise ArgumentError(f"{what} {text}: {len(row)} numbers, the machine has {len(units)}")
    if not np.isfinite(row).all():
        raise ArgumentError(f"{what} {text}: the numbers must be finite")
    if not rad:
        row[[unit == "rad" for unit in units]] *= np.pi / 180
    return row[None]


def _table(heads: Sequence[str], units: Sequence[str], rows: FloatArray) -> str:
    """Rows to 0.1 µm and 0.0001 deg."""
    named = zip(heads, units, strict=True)
    shown = [f"{name} [{display.displayed(0.0, unit)[1]}]" for name, unit in named]
    cells = (
        [
            display.fixed(display.displayed(float(value), unit)[0], 4)
            for value, unit in zip(row, units, strict=True)
        ]
        for row in rows
    )
    return str(display.Table(["row", *shown], [[str(i), *line] for i, line in enumerate(cells)]))
