"""`pkmcal export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.options import Force, Json, ParallelRobot
from pkmcal.cli.output import say
from pkmcal.controllers.targets import targets
from pkmcal.jobs import exporting
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.inputs import Inputs
from pkmcal.report.as_json import as_json


def export(
    context: typer.Context,
    robot: ParallelRobot,
    target: Annotated[
        str, typer.Option("--as", metavar="TARGET", help=f"What for: {', '.join(targets())}.")
    ],
    out: Annotated[Path, typer.Option(metavar="PATH", help="Where to write: a file, or a folder.")],
    number: Annotated[
        str | None,
        typer.Option(metavar="TYPE", help="Of a C header: double, the default, or float."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Of a firmware: your printer.cfg, config.g or maslow.yaml, written with the"
            " changed numbers and otherwise as it is; by default the lines alone.",
        ),
    ] = None,
    project: Annotated[
        bool,
        typer.Option(
            "--project", help="Where a firmware cannot hold the robot: the nearest that it can."
        ),
    ] = False,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write a robot for a controller.

    {targets}

    What a controller cannot hold is refused with the reason, and nothing is written.

    Example: pkmcal export hexapod --as c --out hexapod.h
    """
    done = exporting.run(Exporting.of_options(context.params), Inputs(), force)
    if json:
        parts = {"robot": done.name, "as": target, "file": str(out), "loss": done.loss}
        say(as_json(parts, schema="export"))
    else:
        say(f"{out}: {done}")
    return 0


def _listed() -> str:
    """Say what each target writes, those of serial arms last."""
    each = targets().values()
    others = "; ".join(f"{t.name}: {t.about}" for t in each if t.takes != "arm")
    arms = "; ".join(f"{t.name}: {t.about}" for t in each if t.takes == "arm")
    return f"{others}. Of serial arms: {arms}."


export.__doc__ = (export.__doc__ or "").format(targets=_listed())
