"""Content of a file, read once and up to a limit.

A pipe can be read only once, and a file may change between two readings: an `Input` keeps what was
read, so that what is computed and the checksum that is stated are of the same bytes.
"""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path

from pkmcal import arguments
from pkmcal.exceptions import FileError, MissingFileError

MB = 1_000_000
MOST_TABLE = 500 * MB  # bytes of a CSV file
MOST_WORKBOOK = 50 * MB  # bytes of an Excel workbook, packed and unpacked
MOST_ROBOT = 1 * MB  # bytes of a TOML file
MOST_URDF = 10 * MB
MOST_TEXT = 100 * MB  # G-code, and configurations of controllers
MOST_CELLS = 20_000_000  # of a table
MOST_COLUMNS = 1_000
LONGEST_NAME = 200  # characters of a name, a heading or a key
_BLOCK = 1 << 20


class Input(PathLike[str]):
    """A file that is read when it is first asked for, and never again.

    It is taken wherever a path is.

    Parameters
    ----------
    path : str or path
        A file, a pipe, or a device such as ``/dev/stdin``.
    called : str, optional
        What the user called it, where that also says which part of it is meant.
    """

    def __init__(self, path: str | PathLike[str], called: str | None = None) -> None:
        self._path = arguments.path("path", path)
        self.called = str(self._path) if called is None else called
        self._content: bytes | None = None

    def __fspath__(self) -> str:
        return str(self._path)

    def __str__(self) -> str:
        return str(self._path)

    def content(self, most: int) -> bytes:
        """Return the file's content.

        Raises
        ------
        ValueError
            More than `most` bytes.
        FileNotFoundError
            No such file; which is an `Error` of the package, too.
        OSError
            The file cannot be read.
        """
        if self._content is None:
            self._content = _read(self._path, most)
        return self._content


def content(path: str | PathLike[str], most: int) -> bytes:
    """Return a file's content; of an `Input`, the content that was read before.

    Parameters
    ----------
    path : str or path
        The file.
    most : int
        Bytes that it may have.

    Raises
    ------
    ValueError
        It has more.
    FileNotFoundError
        No such file.
    OSError
        It cannot be read.
    """
    given = path if isinstance(path, Input) else Input(path)
    return given.content(most)


def _read(path: Path, most: int) -> bytes:
    """Read a file whole; of one without end no more than the limit."""
    if not path.exists():
        if str(path) == "-":
            raise MissingFileError("-: no such file; standard input is /dev/stdin")
        near = (each.name for each in path.parent.glob(f"*{path.suffix}"))
        raise MissingFileError(
            f"{path}: no such file{arguments.did_you_mean(path.name, near, listed=0)}"
        )
    try:
        return _up_to(path, most)
    except OSError as error:  # of a device or a network that fails: names nothing
        if error.filename or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def _up_to(path: Path, most: int) -> bytes:
    """Return the result of `_read` for a file that exists."""
    found = bytearray()
    with open(path, "rb", buffering=0) as file:
        expected = os.fstat(file.fileno()).st_size
        while expected <= most and len(found) <= most:
            block = file.read(_BLOCK)
            if not block:
                return bytes(found)
            found += block
    raise FileError(f"{path}: larger than {most // MB} MB, the most that is read")
