"""Two tables as one: what an instrument measured, and the actuators that the controller logged."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pkmcal.arguments import word
from pkmcal.arrays import IntArray
from pkmcal.display import printable
from pkmcal.exceptions import FileError
from pkmcal.files.column_names import BESIDE
from pkmcal.files.csv_table import Column, Table
from pkmcal.measurements.actuator_columns import actuators_in
from pkmcal.measurements.field import Field
from pkmcal.measurements.table_layout import split
from pkmcal.measurements.time_stamps import DAY, Times, times_in

Join = Literal["auto", "name", "row", "time"]
JOINS: tuple[Join, ...] = ("auto", "name", "row", "time")
_LATE = re.compile(r"row([+-][1-9][0-9]{0,5})")
_ENOUGH = 0.5  # of the points have to be found by a key for it to be one
_NUMBER = re.compile(r"([0-9]+)\D*$")
_LISTED = 3
_EPOCH = 1e8  # s: seconds since 1970 are more

Rows = list[int | None]  # of the log, for each row of the instrument


def way_and_shift(given: object) -> tuple[Join, int]:
    """Return the way of joining, and the rows by which the log is late: of "row+1" one.

    Raises
    ------
    ValueError, TypeError
        No such word.

    Examples
    --------
    >>> way_and_shift("row+1"), way_and_shift("name")
    (('row', 1), ('name', 0))
    """
    late = _LATE.fullmatch(given) if isinstance(given, str) else None
    return ("row", int(late[1])) if late else (word("join", given, JOINS), 0)


def join(table: Table, log: Table, how: Join, shift: int = 0, fields: Sequence[Field] = ()) -> None:
    """Give the rows of an instrument the actuators of a controller's log; what was done is a note.

    By name: the point's name, its pose or its group is that of a row of the log. By time: each
    point takes the last row of the log at or before it. By row: as many rows, in the same order,
    or a row of the log for each pose; with a shift, the row that many after it. Points without a
    row are left out. Beside actuators the log gives those of the `fields` that are logged.

    Raises
    ------
    ValueError
        The tables cannot be joined so; the message says why for each way that was tried.
    """
    actuators = actuators_in(log)
    if not actuators:
        raise log.header_error(f"no actuators: expected columns q1, q2 …{_columns(log)}")
    tries = {"name": _by_name, "time": _by_time, "row": _by_row}
    refused = []
    for way, pair in tries.items():
        if how not in ("auto", way):
            continue
        found = pair(table, log)
        if how == "auto" and way == "time" and not isinstance(found, str) and _relative(table):
            found = "seconds may count from different starts; --join time takes them as they are"
        if isinstance(found, str):
            refused.append(f"by {way}: {found}")
            continue
        rows, said = found
        if shift:
            rows = [_within(row, shift, len(log)) for row in rows]
            said += f", each with the row {abs(shift)} {'after' if shift > 0 else 'before'} it"
        said = f"joined with {log.path} by {way}: {said}"
        _put(table, log, actuators, rows, said, [each for each in fields if each.logged])
        return
    raise FileError(f"{table.path}: cannot be joined with {log.path}; {'; '.join(refused)}")


def rows_after(table: Table, shift: int) -> None:
    """Give each row of a file the actuators of the row `shift` after it, or before it; a note.

    Raises
    ------
    ValueError
        A file without actuators.
    """
    actuators = actuators_in(table)
    if not actuators:
        raise table.header_error(f"no actuators to be taken from another row{_columns(table)}")
    rows = [_within(i, shift, len(table)) for i in range(len(table))]
    lines = [str(table.lines[i]) for i, row in enumerate(rows) if row is None]
    columns = {
        name: table.columns[name].take([row for row in rows if row is not None])
        for name in actuators
    }
    table.take([i for i, row in enumerate(rows) if row is not None])
    for name, column in columns.items():
        table.put(name, column)
    listed = ", ".join(lines[:_LISTED]) + (", …" if len(lines) > _LISTED else "")
    table.notes.append(
        f"actuators are those of the row {abs(shift)} {'after' if shift > 0 else 'before'} each;"
        f" without one, left out: line{'s' * (len(lines) > 1)} {listed}"
    )


def _within(row: int | None, shift: int, count: int) -> int | None:
    return row + shift if row is not None and 0 <= row + shift < count else None


def _put(
    table: Table,
    log: Table,
    actuators: Sequence[str],
    rows: Rows,
    said: str,
    logged: Sequence[Field],
) -> None:
    chosen = [row for row in rows if row is not None]
    said += _left_out(table, log, rows)
    table.take([i for i, row in enumerate(rows) if row is not None])
    for field in logged:
        own = [name for name in table.columns if _is_of(name, field)]
        if field.log_first and own and any(_is_of(name, field) for name in log.columns):
            table.notes.append(
                f"column {table.columns[own[0]].name!r} left out: the {field.name} in {log.path} is"
                " taken for the machine's"
            )
            table.leave_out(own)
    of_fields = [name for name in log.columns if any(_is_of(name, field) for field in logged)]
    beside = [name for name in of_fields if name not in table.columns]
    for name in [*actuators, *beside]:
        table.put(name, log.columns[name].take(chosen))
    table.elsewhere += [
        f"{log.path}: {note}" for note in [*log.notes, *_not_used(log, [*actuators, *of_fields])]
    ]
    table.notes.append(said)
    log.leave_out([name for name in log.columns if name not in (*actuators, *of_fields)])
    table.take_over(log)


def _left_out(table: Table, log: Table, rows: Rows) -> str:
    """Say how many points have no row of the log, and how many of its rows no point."""
    said = ""
    unmatched = [i for i, row in enumerate(rows) if row is None]
    if unmatched:
        lines = ", ".join(str(table.lines[i]) for i in unmatched[:_LISTED])
        more = ", …" if len(unmatched) > _LISTED else ""
        said += (
            f"; {len(unmatched)} of {len(rows)} points without a row left out: lines {lines}{more}"
        )
    unused = len(log) - len({row for row in rows if row is not None})
    return f"{said}; {unused} of its {len(log)} rows not used" if unused else said


def _is_of(name: str, field: Field) -> bool:
    return name.partition(".")[0] == field.name


def _not_used(log: Table, used: Sequence[str]) -> list[str]:
    """A line that names the columns of a log of which nothing is taken."""
    looked_at = {*used, *BESIDE, "group", "target"}
    rest = [repr(column.name) for name, column in log.columns.items() if name not in looked_at]
    more = f" and {len(rest) - _LISTED} more" if len(rest) > _LISTED else ""
    return [f"not used: {', '.join(rest[:_LISTED])}{more}"] if rest else []


def _by_name(table: Table, log: Table) -> tuple[Rows, str] | str:
    theirs = {n: log.columns[n] for n in ("name", "group", "target") if n in log.columns}
    mine: dict[str, Sequence[str]] = {}
    for name in ("name", "target"):
        if name in table.columns:
            points = table.columns[name].cells
            written = table.columns[name].name
            parts = split(points)
            if parts:
                mine[f"the pose in {written!r}"] = parts[0]
            mine[f"{written!r}"] = points
    if "group" in table.columns:
        mine[f"{table.columns['group'].name!r}"] = table.columns["group"].cells
    if not theirs or not mine:
        who = log.path if mine else table.path
        return f"{who} has no column of names"
    best: tuple[int, Rows, str] | None = None
    for loose in (False, True):
        for what, cells in mine.items():
            for column in theirs.values():
                rows = _found(cells, column.cells, loose)
                count = 0 if rows is None else sum(row is not None for row in rows)
                if rows is not None and count and (best is None or count > best[0]):
                    said = f"{what} is {column.name!r}" + (" by its number" if loose else "")
                    best = count, rows, said
    if best is not None and best[0] >= _ENOUGH * len(table):
        return best[1], best[2]
    for cells in mine.values():
        for column in theirs.values():
            if twice := _twice(cells, column):
                return twice
    some = next(iter(mine.values()))[0]
    other = next(iter(theirs.values())).cells[0]
    return f"names such as {some!r} and {other!r} are not the same"


def _twice(names: Sequence[str], column: Column) -> str:
    """Say that a log has two rows of one name, where its names are those of the points."""
    keys = [_key(each, loose=False) for each in column.cells]
    logged = {*keys}
    if sum(_key(each, loose=False) in logged for each in names) < _ENOUGH * len(names):
        return ""
    first: dict[str, int] = {}
    for row, key in enumerate(keys):
        if key and (before := first.setdefault(key, row)) != row:
            return (
                f"{column.place}, lines {column.lines[before]} and {column.lines[row]} are both"
                f" called {printable(column.cells[row])!r}: leave one of them out"
            )
    return ""


def _found(names: Sequence[str], logged: Sequence[str], loose: bool) -> Rows | None:
    """Rows of the log by name; None where names of both do not stand for the same."""
    keys, others = ([_key(each, loose) for each in cells] for cells in (names, logged))
    place = {key: row for row, key in enumerate(others) if key}
    if len(place) < sum(key != "" for key in others) or len(set(keys)) < len(set(names)):
        return None
    numbered = all(key.isdigit() for key in (*keys, *place))
    if numbered and set(keys) - set(place) and set(place) - set(keys):
        return None  # 1 to 20 and 0 to 19 count differently
    return [place.get(key) if key else None for key in keys]


def _key(name: str, loose: bool) -> str:
    if not loose:
        return " ".join(name.lower().split())
    match = _NUMBER.search(name)
    return str(int(match[1])) if match else ""


def _by_time(table: Table, log: Table) -> tuple[Rows, str] | str:
    both: list[Times] = []
    for each in (table, log):
        if "time" not in each.columns:
            return f"{each.path} has no time-stamps"
        found = times_in(each)
        if isinstance(found, str):
            return f"the time-stamps of {each.path} cannot be read: {found}"
        both.append(found)
    mine, theirs = both
    if mine.since != theirs.since:
        return f"time-stamps count from {mine.since} in one and from {theirs.since} in the other"
    if mine.in_utc != theirs.in_utc:
        stated, other = (table, log) if mine.in_utc else (log, table)
        return f"{stated.path} states how its clock is ahead of UTC, {other.path} does not"
    logged = theirs.seconds
    if (np.diff(logged) < 0).any():
        row = int(np.argmax(np.diff(logged) < 0)) + 1
        return f"{log.path}, line {log.lines[row]}: time goes back"
    last = logged[-1] + max(np.diff(logged).max(initial=0.0), 1.0)
    days = (0.0, DAY, -DAY) if mine.since == "midnight" else (0.0,)  # one may begin a day later
    taken = [mine.seconds + day for day in days]
    times = max(taken, key=lambda at: int(((at >= logged[0]) & (at <= last)).sum()))
    rows = np.searchsorted(logged, times, side="right") - 1
    inside = (rows >= 0) & (times <= last)
    if inside.mean() < _ENOUGH:
        return "the time-stamps do not overlap"
    moving = _moving(log, rows[inside])
    late = (times - logged[np.maximum(rows, 0)])[inside]
    said = (
        "each point has the last row at or before it,"
        f" {late.min():.3g} to {late.max():.3g} s earlier"
    )
    if moving:
        said += f"; at {moving} of them the actuators change until the next row"
    return [int(r) if ok else None for r, ok in zip(rows, inside, strict=True)], said


def _moving(log: Table, rows: IntArray) -> int:
    """Count rows of a sampled log that differ from the next; 0 of a log of single poses."""
    used = np.unique(rows)
    if len(log) < 2 * len(used):
        return 0
    cells = [log.columns[name].cells for name in actuators_in(log)]
    here = list(zip(*cells, strict=True))
    return sum(here[i] != here[min(i + 1, len(here) - 1)] for i in rows)


def _relative(table: Table) -> bool:
    """Return whether time-stamps are small numbers, as of seconds since a start."""
    found = times_in(table)
    if isinstance(found, str):
        return False
    return found.since == "a start" and float(found.seconds.max()) < _EPOCH


def _by_row(table: Table, log: Table) -> tuple[Rows, str] | str:
    if len(table) == len(log):
        return list(range(len(log))), f"{len(log)} rows in the same order"
    counted = ""
    for name in ("group", "name", "target"):
        if name not in table.columns:
            continue
        logged = table.columns[name].cells
        parts = split(logged)
        poses = parts[0] if parts else list(logged)
        order = {pose: i for i, pose in enumerate(dict.fromkeys(poses))}
        if len(order) == len(log):
            what = f"{len(log)} poses of {table.columns[name].name!r} in the same order"
            return [order[pose] for pose in poses], what
        if len(order) < len(table) and not counted:
            counted = f" of {len(order)} poses by {table.columns[name].name!r}"
    if "target" in table.columns and len(table) % len(log) == 0:
        cells = table.columns["target"].cells
        each = len(table) // len(log)
        if all(cells[i] == cells[i % each] for i in range(len(cells))) and len(set(cells)) == each:
            what = f"{each} targets for each of its {len(log)} rows, in the same order"
            return [i // each for i in range(len(cells))], what
    mine = f"{len(table)} rows{counted}" if counted else f"{len(table)}"
    return f"{mine} and {len(log)} rows"


def _columns(table: Table) -> str:
    names = [column.name for column in table.columns.values()]
    return f"; found {', '.join(names[:8])}" + (", …" if len(names) > 8 else "")
