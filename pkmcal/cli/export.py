"""`pkmcal export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.options import Force, Json, ParallelRobot
from pkmcal.cli.output import say
from pkmcal.jobs import exporting
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.exporting import TARGETS
from pkmcal.jobs.inputs import Inputs
from pkmcal.report.as_json import as_json


def export(
    context: typer.Context,
    robot: ParallelRobot,
    target: Annotated[
        str, typer.Option("--as", metavar="TARGET", help=f"What for: {', '.join(TARGETS)}.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="PATH", help="Where to write: a file; of LinuxCNC a folder.")
    ],
    number: Annotated[
        str | None,
        typer.Option(metavar="TYPE", help="Of a C header: double, the default, or float."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Of Klipper, RepRapFirmware, a Maslow: your printer.cfg, config.g or maslow.yaml,"
            " written with the changed numbers and otherwise as it is; by default the lines alone.",
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

    c: a C99 header with its inverse and forward kinematics and Jacobian. klipper: the numbers of a
    linear or rotary delta for Klipper or Kalico; reprap, marlin: its M665 and M666, or M669;
    hangprinter: M669 and M666. maslow: the anchors of a maslow.yaml. linuxcnc: a kinematics
    component, and a simulation that runs it. mjcf: a model for MuJoCo. fmu: an FMU for
    co-simulation. Of serial arms: urdf and sdf, a tree of links; dh and dh-modified, a table of
    Denavit-Hartenberg numbers; ur, the lists of a calibration.conf of Universal Robots.

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
