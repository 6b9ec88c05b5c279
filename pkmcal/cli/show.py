"""`pkmcal show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import pkmcal as pk
from pkmcal.cli.options import Force, Json, RobotOrArm
from pkmcal.cli.output import say
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.report.as_json import as_json


def show(
    robot: RobotOrArm,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The page; by default the name of ROBOT's file with .html, here."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write a page that shows a machine and moves it, for any browser and without a network.

    Sliders move its platform or its actuators; strokes and joint cones that are exceeded are red.
    It tells how near a singularity is, where the machine gets to, and shows every assembly mode.

    Example: pkmcal show hexapod
    """
    read = Inputs()
    machine = pk.load(read.robot(robot))
    place = Path(f"{Path(robot).name.partition('.')[0]}.html") if out is None else out
    with Output(place.parent, [place.name], read, force).draft() as draft:
        pk.show(machine, draft / place.name)
    if json:
        say(as_json({"robot": machine.name, "file": str(place)}, schema="show"))
    else:
        say(f"{place}: {machine.name}; open it in a browser")
    return 0
