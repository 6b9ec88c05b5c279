"""The files that are written: nothing of the user's is replaced."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.seal import is_sealed, sealed
from pkmcal.jobs.inputs import Inputs


class Output:
    """A folder that a verb writes into.

    Each file is sealed, if files of its kind are. One that is there is replaced if it has its seal
    and was not read, or if `force` says so.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    names : sequence of str
        The files.
    read : Inputs
        What the verb has read.
    force : bool
        Whether to replace what is there.

    Raises
    ------
    ValueError
        Something that would not be replaced is in the place of a file, or of the folder.
    """

    def __init__(self, folder: Path, names: Sequence[str], read: Inputs, force: bool) -> None:
        if folder.exists() and not folder.is_dir():
            raise ArgumentError(f"{folder}: this is not a folder")
        self._read, self._force = read, force
        self.paths = [folder / name for name in names]
        for path in self.paths:
            self._refuse_to_lose(path)

    @contextmanager
    def draft(self) -> Iterator[Path]:
        """A folder to write the files into; at the end they are moved to theirs, sealed."""
        with tempfile.TemporaryDirectory(prefix="pkmcal-") as made:
            draft = Path(made)
            yield draft
            for path in self.paths:
                path.parent.mkdir(parents=True, exist_ok=True)
                self._refuse_to_lose(path)  # it may be new
                write_whole(path, seal(draft / path.name))

    def _refuse_to_lose(self, path: Path) -> None:
        if not os.path.lexists(path):
            return
        if path.is_dir():
            raise ArgumentError(f"{path}: this is a folder")
        if self._force:
            return
        how = "name another place with --out, or give --force"
        inputs = (each for each in self._read.paths if each.exists())
        if path.exists() and any(map(path.samefile, inputs)):
            raise ArgumentError(f"{path}: would be replaced, and is an input; {how}")
        if not path.is_file() or not is_sealed(path.read_bytes(), path.suffix):
            raise ArgumentError(
                f"{path}: would be replaced, and pkmcal did not write it or it was changed since;"
                f" {how}"
            )


def seal(path: Path) -> bytes:
    """Seal a file that is not yet, in its place, and return its content."""
    content = path.read_bytes()
    if not is_sealed(content, path.suffix):
        content = sealed(content, path.suffix)
        path.write_bytes(content)
    return content
