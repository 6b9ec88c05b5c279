"""Claims a folder for one server: a second one would write over what the first has."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from pkmcal.exceptions import ArgumentError

CLAIM = ".pkmcal-app.lock"


class ClaimedError(ArgumentError):
    """Another server has the folder."""


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Hold a folder until the end of the block; the system gives it up for a process that dies.

    Whoever holds it removes the file `CLAIM` when it ends.

    Raises
    ------
    ClaimedError
        Another process holds it.
    """
    path = folder / CLAIM
    while True:
        with open(path, "ab") as file:
            if not _lock(file):
                raise ClaimedError(
                    f"{folder}: its window is open already, served by another process"
                )
            if _is_there(path, file):
                yield
                return
        # the one before has removed it meanwhile: another file has that name, or none


def _is_there(path: Path, file: IO[bytes]) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> bool:
        try:
            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True

else:
    import fcntl

    def _lock(file: IO[bytes]) -> bool:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a file system without locks
            return True
        return True
