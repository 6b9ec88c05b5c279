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
        group = data.measured.group
        if group is not None and (count := whole[id(data), int(group[i])]) > _MOST:
            file = f" of {printable(data.measured.file)}" if data.measured.file else ""
            places.setdefault(f"pose {pose_name(data, i)}{file} ({count} rows)", [])
            continue
        targets = places.setdefault(_place(data, i), [])
        targets += _target(data, i)
    listed = [
        f"{place} ({', '.join(targets)})" if targets else place for place, targets in places.items()
    ]
    more = f" and {len(listed) - _MOST} more" if len(listed) > _MOST else ""
    return ", ".join(listed[:_MOST]) + more


def name_of(data: FitData, i: int) -> str:
    """Name the row in place `i` of a set, as `row_names` names one alone."""
    targets = _target(data, i)
    return f"{_place(data, i)} ({targets[0]})" if targets else _place(data, i)


def _place(data: FitData, i: int) -> str:
    """Line of a file, or number of the row, and its pose."""
    measured = data.measured
    place = f"row {data.rows[i]}"
    if measured.lines is not None:
        file = f"{printable(measured.file)} " if measured.file else ""
        place = f"{file}line {measured.lines[i]}"
    return place if measured.group is None else f"{place}, pose {pose_name(data, i)}"


def pose_name(data: FitData, i: int) -> str:
    """Name the pose of the row in place `i` of a set: by its name, its group, or this row."""
    measured = data.measured
    if measured.pose_name is not None:
        return printable(measured.pose_name[i])
    return f"row {data.rows[i]}" if measured.group is None else str(measured.group[i])


def _target(data: FitData, i: int) -> list[str]:
    """The name of the target that a row measured, if it has one."""
    measured = data.measured
    if measured.target_names is None or measured.target_index is None:
        return []
    return [printable(measured.target_names[measured.target_index[i]])]
