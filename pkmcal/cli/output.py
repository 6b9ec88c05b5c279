"""Folders that verbs write into."""

from __future__ import annotations

from pathlib import Path

from pkmcal.exceptions import ArgumentError


def folder(path: Path) -> Path:
    """`path`, made if it is not there.

    Raises
    ------
    ValueError
        Something else is in its place.
    """
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"{path}: this is not a folder")
    path.mkdir(parents=True, exist_ok=True)
    return path
