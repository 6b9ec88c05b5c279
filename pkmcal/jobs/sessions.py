"""The session of each file of measurements, as the command line names it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements


def in_sessions(
    files: Sequence[Path],
    measured: Sequence[Measurements],
    named: Sequence[str],
    holdout: str | None,
    held: float | Measurements | None,
) -> tuple[list[Measurements], float | Measurements | None]:
    """Measurements with the session of every row: of its column, of ``--session``, of its file.

    Parameters
    ----------
    files : sequence of Path
        The file of each set that is fitted.
    measured : sequence of Measurements
        The sets.
    named : sequence of str
        What ``--session`` says, one name for each, or nothing.
    holdout, held : str, Measurements
        The same of a file that is held out.

    Raises
    ------
    ValueError
        A name for a file that has a column session.
    """
    for path, each in zip(files, measured, strict=True):
        if named and each.session is not None:
            raise ArgumentError(f"--session: {path} has a column session")
    paths = [*files, *([Path(holdout)] if isinstance(held, Measurements) and holdout else [])]
    stems = {path.resolve(): path.stem for path in paths}
    short = len(set(stems.values())) == len(stems)
    names = list(named) or [_name(path, short) for path in files]
    given = [_named(each, name) for each, name in zip(measured, names, strict=True)]
    if isinstance(held, Measurements):
        same = dict(zip((path.resolve() for path in files), names, strict=True))
        held = _named(held, same.get(paths[-1].resolve(), _name(paths[-1], short)))
    return given, held


def _name(path: Path, short: bool) -> str:
    text = path.stem if short else str(path.with_suffix(""))
    return " ".join(text.replace("@", " ").split())


def _named(measured: Measurements, name: str) -> Measurements:
    if measured.session is not None:
        return measured
    return replace(measured, session=np.full(len(measured), name))
