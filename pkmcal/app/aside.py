"""Sets aside what somebody has changed in a file that the window is about to write again."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path

from pkmcal.files.seal import has_seals, is_sealed


def free_place(wanted: Path) -> Path:
    """Return a path, with a number in its name where it is taken."""
    numbered = (wanted.with_name(f"{wanted.stem}.{k}{wanted.suffix}") for k in count(1))
    return next(each for each in chain([wanted], numbered) if not each.exists())


def set_aside(paths: Iterable[Path]) -> list[str]:
    """Copy files that are not as they were written into the project's folder, and say so.

    There the window offers them: a machine as another machine, a table as measurements. Files of
    a kind that cannot say whether it was changed, such as a printer's configuration, are left out.
    """
    said = []
    for path in paths:
        if not path.is_file() or not has_seals(path.suffix):
            continue
        if not is_sealed(path.read_bytes(), path.suffix):
            copy = free_place(Path(f"my_{path.name}"))
            shutil.copy2(path, copy)
            said.append(
                f"{path.as_posix()} was changed since it was written, and is written again: what"
                f" was in it is kept as {copy}"
            )
    return said
