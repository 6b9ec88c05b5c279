"""`pkmcal export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.cli.options import Json, ParallelRobot
from pkmcal.exceptions import ArgumentError
from pkmcal.loading import load_parallel
from pkmcal.report.as_json import as_json

TARGETS = ("c",)


def export(
    robot: ParallelRobot,
    target: Annotated[
        str, typer.Option("--as", metavar="TARGET", help=f"What for: {', '.join(TARGETS)}.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where to write.")],
    number: Annotated[
        str | None,
        typer.Option(metavar="TYPE", help="Of a C header: double, the default, or float."),
    ] = None,
    json: Json = False,
) -> int:
    """Write a robot for a controller.

    c: a C99 header with its inverse and forward kinematics and Jacobian.

    What a controller cannot hold is refused with the reason, and nothing is written.

    Example: pkmcal export hexapod --as c --out hexapod.h
    """
    word("--as", target, TARGETS)
    machine = load_parallel(robot)
    pk.export.c_header(machine, out, _number(number))
    if json:
        typer.echo(as_json({"robot": machine.name, "as": target, "file": str(out)}))
    else:
        typer.echo(f"{out}: {machine.name}")
    return 0


def _number(given: str | None) -> Literal["double", "float"]:
    if given is None or given == "double":
        return "double"
    if given == "float":
        return "float"
    raise ArgumentError(f"--number must be double or float, found {given!r}")
