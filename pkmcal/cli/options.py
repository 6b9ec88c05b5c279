"""Arguments and options that several verbs take, each written once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.geometry import robot_file
from pkmcal.loading import machines

FREE = "What is free, and what is known of it"  # a panel of options
_ROBOT = "A built-in machine or a robot file."


def _parallel(incomplete: str) -> list[str]:
    return [name for name in robot_file.builtin_names() if name.startswith(incomplete)]


def _all(incomplete: str) -> list[str]:
    return [name for name in machines() if name.startswith(incomplete)]


# Where no name fits what was typed, shells go on with the names of files.
ParallelRobot = Annotated[
    str, typer.Argument(metavar="ROBOT", help=_ROBOT, autocompletion=_parallel)
]
RobotOrArm = Annotated[str, typer.Argument(metavar="ROBOT", help=_ROBOT, autocompletion=_all)]
BuiltIn = Annotated[
    str,
    typer.Argument(
        metavar="MACHINE", help="A built-in machine that is like yours.", autocompletion=_all
    ),
]

Free = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=FREE,
        metavar="NAME",
        help="Identify this number instead of the robot's default set. Repeat it, separate names"
        " with commas, or use wildcards: 'rod*,radius'. default: that set;"
        " none: only where instruments stand.",
    ),
]
Prior = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=FREE,
        metavar="[NAME=]σ",
        help="Standard deviation of a number before anything is measured: 'base*=0.5',"
        " 'angle1=0.1deg'. Without a name, in mm, of all. What a tape says of a length:"
        " '|base1 - base2|=3000±1'.",
    ),
]
Uncertainty = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=FREE,
        metavar="NAME=σ[,common]",
        help="How wrong a number may be that is not found, one standard deviation: 'gain*=1e-3',"
        " 'target*=0.1', scale=20e-6 of the instrument. It is fitted along within that. common:"
        " all numbers that this names are wrong by one and the same amount.",
    ),
]
Consider = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=FREE,
        metavar="NAME=σ",
        help="The same of a number that has to stay where it is: ± alone allow for it.",
    ),
]
Poses = Annotated[
    Path | None,
    typer.Option(
        metavar="CSV",
        help="Poses, with columns such as 'y \\[mm]' and 'alpha \\[deg]'; by default 30 are"
        " drawn in the workspace.",
    ),
]
Radians = Annotated[bool, typer.Option("--rad", help="Angles on the line are in radians.")]
Seed = Annotated[
    int,
    typer.Option(
        metavar="N", min=0, max=2**64 - 1, help="Seed of the random numbers: one seed, one result."
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Replace files that are inputs, or that others wrote.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON alone; mm and rad.")]
