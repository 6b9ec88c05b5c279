"""`pkmcal new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.robot_argument import MACHINE
from pkmcal.cli.robot_template import template
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.report.as_json import as_json


def new(
    machine: Annotated[str, MACHINE],
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="MACHINE.toml by default.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON alone.")] = False,
) -> int:
    """Write a robot file to start from, with words on every key.

    A file that is there already is left alone, and refused.

    Example: pkmcal new linear-delta my-printer.toml
    """
    text = template(machine)
    path = Path(f"{machine}.toml") if file is None else file
    if path.exists():
        raise ArgumentError(f"{path}: is there already; take another name")
    write_whole(path, text)
    if json:
        typer.echo(as_json({"machine": machine, "file": str(path)}))
    else:
        typer.echo(f"{path}: {machine}; change what differs on your machine")
    return 0
