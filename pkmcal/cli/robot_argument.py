"""The argument ROBOT, and the names of built-in machines that shells complete it with."""

from __future__ import annotations

from pathlib import Path

import typer

from pkmcal.geometry import robot_file
from pkmcal.loading import machines

_HELP = "A built-in machine or a robot file."


def _parallel(incomplete: str) -> list[str]:
    return [name for name in robot_file.builtin_names() if name.startswith(incomplete)]


def _all(incomplete: str) -> list[str]:
    return [name for name in machines() if name.startswith(incomplete)]


# Where no name fits what was typed, shells go on with the names of files.
ROBOT = typer.Argument(metavar="ROBOT", help=_HELP, autocompletion=_parallel)
ROBOT_OR_ARM = typer.Argument(metavar="ROBOT", help=_HELP, autocompletion=_all)
MACHINE = typer.Argument(
    metavar="MACHINE", help="A built-in machine that is like yours.", autocompletion=_all
)


def contents(robot: str, *paths: Path) -> dict[str, bytes]:
    """What a command reads, by name; a built-in machine by its own.

    Parameters
    ----------
    robot : str
        A name or a file, as `load` takes it.
    *paths : Path
        Other files.

    Raises
    ------
    ValueError, OSError
        No such machine; a file that cannot be read.
    """
    content, place, file = robot_file.located(robot)
    return {Path(file).name if file else place: content} | {p.name: p.read_bytes() for p in paths}
