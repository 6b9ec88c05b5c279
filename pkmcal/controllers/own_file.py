"""Numbers written for a firmware: as lines of their own, or into the user's own file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from typing import NamedTuple, TypeVar

from pkmcal.arguments import flag
from pkmcal.arguments import path as as_path
from pkmcal.controllers.loss import Loss
from pkmcal.files.atomic import write_whole

Content = TypeVar("Content")
Path = str | PathLike[str]


class Wanted(NamedTuple):
    """Options of what is written.

    Attributes
    ----------
    project : bool
        Whether the nearest numbers are, where the firmware cannot hold the robot.
    place : str
        What messages call the user's file; "" without one.
    """

    project: bool
    place: str


def write_for(
    path: Path,
    project: bool,
    config: Path | None,
    read: Callable[[Path], Content],
    made: Callable[[Wanted, Content | None], tuple[str | bytes, Loss]],
) -> Loss:
    """Write what `made` makes of a robot and of the user's file, None where none is given.

    Characters that are no text in the user's file stay as they are.

    Raises
    ------
    ValueError, OSError
        Wrong arguments, and what `read` and `made` raise; nothing is written.
    """
    place = as_path("path", path)
    wanted = Wanted(
        flag("project", project), "" if config is None else str(as_path("config", config))
    )
    new, lost = made(wanted, None if config is None else read(config))
    write_whole(place, new.encode("utf-8", "surrogateescape") if isinstance(new, str) else new)
    return lost
