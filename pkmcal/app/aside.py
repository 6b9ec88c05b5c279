"""Keep what somebody else has put into a file that the window writes."""

from __future__ import annotations

import filecmp
import hashlib
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path

from pkmcal.files.seal import is_sealed


def free_place(wanted: Path) -> Path:
    """Return a path, with a number in its name where it is taken."""
    numbered = (wanted.with_name(f"{wanted.stem}.{k}{wanted.suffix}") for k in count(1))
    return next(each for each in chain([wanted], numbered) if not each.exists())


class Kept:
    """Files that the window wrote; other contents are kept when it writes them again.

    A file with a seal says by itself whether it was changed. Of others, such as a printer's
    configuration, a process knows what it wrote.
    """

    def __init__(self) -> None:
        self._own = set[str]()

    @contextmanager
    def aside(self, paths: Iterable[Path]) -> Iterator[list[str]]:
        """Write these files within the block; yield sentences on those of somebody else.

        Its content is kept in the project's folder, where the window offers it: a machine as
        another machine, a table as measurements.
        """
        paths = list(paths)
        copies = {
            path: Path(shutil.copy2(path, free_place(Path(f"my_{path.name}"))))
            for path in paths
            if path.is_file() and not self._is_own(path)
        }
        said: list[str] = []
        try:
            yield said
        finally:
            for path, copy in copies.items():
                if path.is_file() and filecmp.cmp(path, copy, shallow=False):
                    copy.unlink()
                else:
                    said.append(
                        f"{path.as_posix()} had been changed outside of this window and was written"
                        f" again; the changed file is kept as {copy}"
                    )
            self._own |= {_digest(each) for each in paths if each.is_file()}

    def _is_own(self, path: Path) -> bool:
        return is_sealed(path.read_bytes(), path.suffix) or _digest(path) in self._own


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
