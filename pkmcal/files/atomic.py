"""Files that are written as a whole or not at all."""

from __future__ import annotations

import os
from os import PathLike

from pkmcal import arguments


def write_whole(path: str | PathLike[str], content: str | bytes) -> None:
    """Write a file: beside its place first, then moved there.

    Parameters
    ----------
    path : str or path
        Where to write; an existing file is replaced.
    content : str or bytes
        What to write; text in UTF-8, line ends as they are.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written; what was there before is untouched.
    """
    path = arguments.path("path", path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
