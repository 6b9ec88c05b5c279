"""`pkmcal new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli_output import as_json
from pkmcal.cli_robot import MACHINE
from pkmcal.new_robot import template
from pkmcal.whole_file import write_whole


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
        raise ValueError(f"{path}: is there already; take another name")
    write_whole(path, text)
    if json:
        typer.echo(as_json({"machine": machine, "file": str(path)}))
    else:
        typer.echo(f"{path}: {machine}; change what differs on your machine")
    return 0
