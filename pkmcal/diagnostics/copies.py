"""Rows that equal others of their set to the last digit, and sets all rows of which do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.estimation.equations import Equations
from pkmcal.estimation.pose_table import CHANCE
from pkmcal.measurements import repeats

_LISTED = 5  # rows that a sentence names


@dataclass(frozen=True)
class Copied:
    """Rows that equal others.

    Attributes
    ----------
    rows : tuple of int
        The rows by number.
    first : tuple of int
        The earlier row that each of them equals.
    whole : bool
        Whether they are a whole set; `first` is then the first row of the other set.
    """

    rows: tuple[int, ...]
    first: tuple[int, ...]
    whole: bool = False

    def __str__(self) -> str:
        if self.whole:
            return (
                f"all {len(self.rows)} rows from row {self.rows[0]} equal rows from row"
                f" {self.first[0]} to the last digit: the same measurements twice?"
            )
        pairs = zip(self.rows[:_LISTED], self.first[:_LISTED], strict=True)
        listed = ", ".join(f"{row} of {first}" for row, first in pairs)
        more = ", …" if len(self.rows) > _LISTED else ""
        return (
            f"{len(self.rows)} rows equal others to the last digit (row {listed}{more}): copied,"
            " not measured again?"
        )


def copies(equations: Equations) -> Iterator[Copied]:
    """Find them; of readings of actuators alone, which may well occur twice, whole sets."""
    earlier, start = list[tuple[str, int, set[bytes]]](), 0
    for measured, pose in zip(equations.table.sets, equations.table.pose_of, strict=True):
        rows = equations.table.rows[start : start + len(measured)]
        start += len(measured)
        table = np.column_stack([
            measured.actuators,
            np.empty((len(measured), 0)) if measured.other is None else measured.other,
            measured.values.reshape(len(measured), -1),
            repeats.targets(measured),
        ])  # fmt: skip
        keys = {row.tobytes() for row in table} if len(equations.table.sets) > 1 else set()
        for kind, first, others in earlier:
            if kind == measured.kind and len(keys) > CHANCE and keys <= others:
                yield Copied(tuple(rows.tolist()), (first,), whole=True)
        earlier.append((measured.kind, int(rows[0]), keys))
        if not measured.components or len(np.unique(pose)) == len(pose):
            continue
        _, twin, inverse = np.unique(table, axis=0, return_index=True, return_inverse=True)
        twins = twin[inverse.reshape(-1)]
        copied = np.flatnonzero(twins != np.arange(len(measured)))
        if len(copied):
            yield Copied(tuple(rows[copied].tolist()), tuple(rows[twins[copied]].tolist()))
