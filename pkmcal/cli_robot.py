"""The argument ROBOT, and the names of built-in machines that shells complete it with."""

from __future__ import annotations

import typer

from pkmcal import robotfile
from pkmcal.loading import machines

_HELP = "A built-in machine or a robot file."


def _parallel(incomplete: str) -> list[str]:
    return [name for name in robotfile.builtin_names() if name.startswith(incomplete)]


def _all(incomplete: str) -> list[str]:
    return [name for name in machines() if name.startswith(incomplete)]


# Where no name fits what was typed, shells go on with the names of files.
ROBOT = typer.Argument(metavar="ROBOT", help=_HELP, autocompletion=_parallel)
ROBOT_OR_ARM = typer.Argument(metavar="ROBOT", help=_HELP, autocompletion=_all)
MACHINE = typer.Argument(
    metavar="MACHINE", help="A built-in machine that is like yours.", autocompletion=_all
)
