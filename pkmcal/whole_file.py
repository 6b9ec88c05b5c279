"""Files that are written as a whole or not at all."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path


def write_whole(path: str | PathLike[str], text: str) -> None:
    """Write a text file in UTF-8: beside its place first, then moved there.

    Parameters
    ----------
    path : str or path
        Where to write; an existing file is replaced.
    text : str
        What to write, line ends included.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written; what was there before is untouched.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(beside, "w", encoding="utf-8", newline="") as file:
            file.write(text)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
