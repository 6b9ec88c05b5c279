"""Files that are written as a whole or not at all."""

from __future__ import annotations

import os
import secrets
import time
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from pkmcal.exceptions import MissingFileError

_PART = ".pkmcal-{}.part"  # short: a name may be as long as the file system allows
_GONE = 3600.0  # seconds after which whoever wrote a part was killed
# Windows replaces no file that somebody has open, as scanners for viruses have it for a moment:
# seconds after which it is tried again.
_WAITS = () if os.name == "posix" else (0.01, 0.03, 0.1, 0.3, 0.6)


def write_whole(path: str | PathLike[str], content: str | bytes) -> None:
    """Write a file: beside its place first, then moved there.

    Who reads meanwhile sees the old file or the new one, also if several write at once. What is
    written is on the disk before it takes the place of what was there, and keeps its mode; a
    symbolic link is followed.

    Parameters
    ----------
    path : str or path
        Where to write; an existing file is replaced.
    content : str or bytes
        What to write; text in UTF-8, line ends as they are.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written, the disk is full, or, on Windows, another
        program has the file open: with the path; what was there before is untouched.
    """
    write_pieces(path, [content.encode() if isinstance(content, str) else content])


def write_pieces(path: str | PathLike[str], pieces: Iterable[bytes]) -> None:
    """Write a file as `write_whole` does, of pieces that are made one after the other.

    Parameters
    ----------
    path : str or path
        Where to write; an existing file is replaced when all pieces are made.
    pieces : iterable of bytes
        What to write.

    Raises
    ------
    OSError
        As of `write_whole`.
    """
    if not isinstance(path, Path):
        from pkmcal import arguments  # it imports NumPy, which the window's server does without

        path = arguments.path("path", path)
    place = Path(os.path.realpath(path))
    if not place.parent.is_dir():
        raise MissingFileError(f"{path}: the folder {place.parent} does not exist")
    if place.is_dir():
        raise IsADirectoryError(f"{path}: this is a folder")
    _sweep(place.parent)
    beside = place.with_name(_PART.format(secrets.token_hex(8)))
    try:
        _write(beside, pieces)
        if place.exists():
            os.chmod(beside, place.stat().st_mode & 0o7777)
        _move(beside, place)
        _synchronise(place.parent)
    except OSError as error:  # names the part
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        beside.unlink(missing_ok=True)


def _write(path: Path, pieces: Iterable[bytes]) -> None:
    with open(path, "xb") as file:
        for piece in pieces:
            file.write(piece)
        file.flush()
        os.fsync(file.fileno())


def _move(part: Path, place: Path) -> None:
    for wait in _WAITS:
        try:
            return os.replace(part, place)
        except PermissionError:
            time.sleep(wait)
    os.replace(part, place)


def _synchronise(folder: Path) -> None:
    """Have the new name on the disk, too, where the system can."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:  # a file system without it; the file itself is on the disk
        pass
    finally:
        os.close(handle)


def _sweep(folder: Path) -> None:
    """Remove parts of writers that were killed."""
    for part in folder.glob(_PART.format("*")):
        try:
            if time.time() - part.stat().st_mtime > _GONE:
                part.unlink()
        except OSError:  # another swept it, or it is another's
            continue
