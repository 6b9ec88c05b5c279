"""Actuator coordinates in a CSV file: columns ``q1 [mm]`` … ``qn [mm]``, or angles."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.column_names import known_as
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import write_csv


def read_commands(path: str | PathLike[str], units: Sequence[str]) -> FloatArray:
    """Read rows of actuator coordinates, mm and rad.

    Parameters
    ----------
    path : str or path
        A file with the columns q1 to qn in any order; others, such as what was measured there,
        are not looked at.
    units : sequence of str, n
        "mm", "rad" or "counts": what the machine's actuators are, as `reading_units` has it. Counts
        may be called mm, too.

    Returns
    -------
    ndarray (N, n)

    Raises
    ------
    ValueError
        Naming file, line and column: one that is missing, has no unit or another, no number.
    OSError
        The file cannot be read.
    """
    table = Table(path)
    table.rename(known_as)
    names = [f"q{i + 1}" for i in range(len(units))]
    table.require(names)
    known = {"counts": ("mm", "count")}  # in mm they were written once
    columns = [
        table.numbers(name, *known.get(unit, (unit,)))[0]
        for name, unit in zip(names, units, strict=True)
    ]
    return np.stack(columns, axis=1)


def write_commands(
    path: str | PathLike[str],
    units: Sequence[str],
    commands: FloatArray,
    columns: dict[str, FloatArray] | None = None,
    *,
    comment: str = "",
) -> None:
    """Write rows (N, n) that `read_commands` reads back to the last bit, or nothing.

    Parameters
    ----------
    path : str or path
        An existing file is replaced.
    units : sequence of str, n
        "mm" or "rad".
    commands : ndarray (N, n)
        mm and rad.
    columns : dict of str to ndarray (N,), optional
        Others beside them, by heading, which says the unit.
    comment : str, optional
        Lines for its head, each with its ``#``.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    """
    others = columns or {}
    headings = [*(f"q{i + 1} [{unit}]" for i, unit in enumerate(units)), *others]
    rows = np.column_stack([commands, *others.values()]).tolist()
    write_csv(path, headings, (map(repr, row) for row in rows), comment=comment)
