"""Folders that verbs write into, and the record of what they read that their files begin with."""

from __future__ import annotations

from pathlib import Path

from pkmcal.exceptions import ArgumentError
from pkmcal.geometry import robot_file


def folder(path: Path) -> Path:
    """Return `path`, made if it does not exist.

    Raises
    ------
    ValueError
        Something else is in its place.
    """
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"{path}: this is not a folder")
    path.mkdir(parents=True, exist_ok=True)
    return path


def contents(robot: str, *paths: Path) -> dict[str, bytes]:
    """Return the bytes of what a verb reads, by name; a built-in machine by its own.

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
