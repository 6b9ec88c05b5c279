"""Time of each row, and time-stamps of instruments and controllers, in seconds."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from typing import Any, Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.display import printable
from pkmcal.files.csv_table import Table
from pkmcal.measurements.field import Field, row_numbers
from pkmcal.readings.reading import Reading

DAY = 86400.0  # s
_CLOCKS = ("%H:%M:%S.%f", "%I:%M:%S.%f %p", "%H:%M")
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y%m%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%d-%b-%Y")
_FORMS = (*_CLOCKS, *(f"{date} {clock}" for date in _DATES for clock in _CLOCKS))
_ZONE = re.compile(r"(?<=[0-9mM])\s*(?:Z|UTC|([+-])([0-9]{2}):?([0-9]{2}))$")
_FINER = re.compile(r"([.,][0-9]{6})[0-9]+")  # of a second, beyond what is kept
_WHOLE = re.compile(r"(:[0-9]{2}:[0-9]{2})(?![.,:0-9])")  # seconds without a fraction


class Time(Field):
    """Time of each row, in seconds from any start."""

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Seconds (N,)."""
        return row_numbers(self.name, given, len(m))

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Time-stamps, and the date where they are of a time of day."""
        return {self.name, "date"}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Seconds, where the time-stamps can be read."""
        if self.name not in table.columns:
            return None
        name, found = table.columns[self.name].name, times_in(table)
        if isinstance(found, str):
            table.note(f"column {name!r} not read, so that the rows have no times: {found}")
            return None
        if found.midnights:
            table.note(
                f"the clock in column {name!r} passes midnight, and what follows is a day later"
            )
        return found.seconds


@dataclass(frozen=True)
class Times:
    """The time-stamps of a file.

    Attributes
    ----------
    seconds : ndarray of float64, shape (rows,)
    since : str
        What they count from: the start of something, midnight, or the year 1900.
    in_utc : bool
        Whether they state their offset from UTC, in which they are then.
    midnights : int
        How often a clock without a date passed midnight: each adds a day to what follows.
    """

    seconds: FloatArray
    since: Literal["a start", "midnight", "1900"]
    in_utc: bool = False
    midnights: int = 0


def seconds(cells: Sequence[str]) -> Times | str:
    """The seconds of each time-stamp, or why they cannot be read.

    All have one form: a number of seconds, a time of day, or a date and a time; with an offset from
    UTC in all of them or in none. Where day and month cannot be told apart, all must be of one day.
    A time of day that goes back by more than half a day has passed midnight.

    Examples
    --------
    >>> found = seconds(["23:59:59", "00:00:01.5"])
    >>> found.seconds.tolist(), found.since, found.midnights
    ([86399.0, 86401.5], 'midnight', 1)
    >>> seconds(["01:59:59+02:00", "00:00:00.5Z"]).seconds.tolist()
    [-1.0, 0.5]
    """
    texts = [cell.strip() for cell in cells]
    for text in texts:
        if not text:
            return "one is empty"
    try:
        numbers = np.array([float(text.replace(",", ".")) for text in texts])
    except ValueError:
        pass
    else:
        return Times(numbers, "a start") if np.isfinite(numbers).all() else "one is not finite"
    zones = [_ZONE.search(text) for text in texts]
    if any(zones) and not all(zones):
        without = texts[[zone is None for zone in zones].index(True)]
        return f"{printable(without)!r} states no offset from UTC, others do"
    return _clocks(texts, np.array([_offset(zone) for zone in zones if zone]))


def _clocks(texts: Sequence[str], offsets: FloatArray) -> Times | str:
    """Times of day, or dates and times, less their offsets from UTC, if they have any."""
    plain = [_ZONE.sub("", text).replace("T", " ") for text in texts]
    plain = [_WHOLE.sub(r"\1.0", _FINER.sub(r"\1", text)).replace(",", ".") for text in plain]
    fitting = [(found, form) for form in _FORMS if (found := _read(plain, form)) is not None]
    if not fitting:
        return f"such as {printable(texts[0])!r}, they are not of one form that is known"
    found, form = fitting[0]
    if any(not np.array_equal(np.diff(found), np.diff(other)) for other, _ in fitting[1:]):
        return f"{printable(texts[0])!r} may name the day or the month first"
    if len(offsets):
        found = found - offsets
    if "%d" in form:
        return Times(found, "1900", bool(len(offsets)))
    days = np.cumsum(np.diff(found, prepend=found[0]) < -DAY / 2)
    return Times(found + days * DAY, "midnight", bool(len(offsets)), int(days[-1]))


def times_in(table: Table) -> Times | str:
    """The column of time-stamps of a table, each after the date that another column has."""
    cells: Sequence[str] = table.columns["time"].cells
    dates = table.columns.get("date")
    if dates is not None and not any(len(cell) > 15 for cell in cells):
        cells = [f"{date} {cell}" for date, cell in zip(dates.cells, cells, strict=True)]
    return seconds(cells)


def _offset(zone: re.Match[str]) -> float:
    """Seconds by which a clock is ahead of UTC."""
    sign, hours, minutes = zone.groups()
    if sign is None:
        return 0.0
    ahead = timedelta(hours=int(hours), minutes=int(minutes)).total_seconds()
    return -ahead if sign == "-" else ahead


def _read(texts: Sequence[str], form: str) -> FloatArray | None:
    try:
        times = [datetime.strptime(text, form).replace(tzinfo=timezone.utc) for text in texts]
    except ValueError:
        return None
    start = datetime(1900, 1, 1, tzinfo=timezone.utc)
    found = np.array([(time - start).total_seconds() for time in times])
    return found if math.isfinite(found.sum()) else None
