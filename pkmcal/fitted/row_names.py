"""Rows as the user knows them: file, line, group and target."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pkmcal.display import printable
from pkmcal.estimation.fit_data import FitData

_MOST = 6  # places that are listed


def row_names(datasets: Sequence[FitData], rows: Iterable[int]) -> str:
    """Name rows by line of their file, or by number, with the targets that each line has."""
    named = [int(row) for row in rows]
    where: dict[int, tuple[FitData, int]] = {}
    for data in datasets:
        mine = np.flatnonzero(np.isin(data.rows, named))
        where.update(zip(data.rows[mine].tolist(), ((data, i) for i in mine.tolist()), strict=True))
    places: dict[str, list[str]] = {}
    whole = dict[tuple[int, int], int]()
    for data, i in where.values():
        if data.measured.group is not None:
            key = id(data), int(data.measured.group[i])
            whole[key] = whole.get(key, 0) + 1
    for row in named:
        data, i = where[row]
        measured = data.measured
        if measured.group is not None:
            count = whole[id(data), int(measured.group[i])]
            if count > _MOST:
                file = f" of {printable(measured.file)}" if measured.file else ""
                places.setdefault(f"pose {measured.group[i]}{file} ({count} rows)", [])
                continue
        if measured.lines is None:
            place = f"row {row}"
        else:
            file = f"{printable(measured.file)} " if measured.file else ""
            place = f"{file}line {measured.lines[i]}"
        if measured.group is not None:
            place += f", pose {measured.group[i]}"
        targets = places.setdefault(place, [])
        if measured.target_names is not None and measured.target_index is not None:
            targets.append(printable(measured.target_names[measured.target_index[i]]))
    listed = [
        f"{place} ({', '.join(targets)})" if targets else place for place, targets in places.items()
    ]
    more = f" and {len(listed) - _MOST} more" if len(listed) > _MOST else ""
    return ", ".join(listed[:_MOST]) + more
