"""When each row was measured, and time-stamps of instruments and controllers, in seconds."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.csv_table import Table
from pkmcal.measurements.field import Field, row_numbers
from pkmcal.readings.reading import Reading

_CLOCKS = ("%H:%M:%S.%f", "%I:%M:%S.%f %p", "%H:%M")
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y%m%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%d-%b-%Y")
_FORMS = (*_CLOCKS, *(f"{date} {clock}" for date in _DATES for clock in _CLOCKS))
_ZONE = re.compile(r"\s*(?:Z|[+-][0-9]{2}:?[0-9]{2})$")
_FINER = re.compile(r"([.,][0-9]{6})[0-9]+")  # of a second, beyond what is kept
_WHOLE = re.compile(r"(:[0-9]{2}:[0-9]{2})(?![.,:0-9])")  # seconds without a fraction


class Time(Field):
    """When each row was measured, in seconds from any start."""

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
        found = seconds(with_date(table, table.columns[self.name].cells))
        return None if found is None else found[0]


def seconds(cells: Sequence[str]) -> tuple[FloatArray, str] | None:
    """Seconds of each time-stamp, and what they count from; None where they are not times.

    All have one form: a number of seconds, a time of day, or a date and a time. Where day and
    month cannot be told apart, all must be of one day.

    Examples
    --------
    >>> times, since = seconds(["10:00:00", "10:00:01.5"])
    >>> times.tolist(), since
    ([36000.0, 36001.5], 'midnight')
    """
    texts = [_ZONE.sub("", cell.strip()).replace("T", " ") for cell in cells]
    try:
        numbers = np.array([float(text.replace(",", ".")) for text in texts])
    except ValueError:
        numbers = None
    if numbers is not None:
        return (numbers, "a start") if np.isfinite(numbers).all() else None
    texts = [_WHOLE.sub(r"\1.0", _FINER.sub(r"\1", text)).replace(",", ".") for text in texts]
    fitting = [found for form in _FORMS if (found := _read(texts, form)) is not None]
    if not fitting:
        return None
    first, since = fitting[0]
    steps = [np.diff(found) for found, _ in fitting]
    if any(not np.array_equal(steps[0], other) for other in steps[1:]):
        return None  # 03/04 to 04/04: a day or a month
    return first, since


def with_date(table: Table, cells: Sequence[str]) -> Sequence[str]:
    """Times of day after the date that another column has."""
    dates = table.columns.get("date")
    if dates is None or any(len(cell) > 15 for cell in cells):
        return cells
    return [f"{date} {cell}" for date, cell in zip(dates.cells, cells, strict=True)]


def _read(texts: Sequence[str], form: str) -> tuple[FloatArray, str] | None:
    try:
        times = [datetime.strptime(text, form).replace(tzinfo=timezone.utc) for text in texts]
    except ValueError:
        return None
    start = datetime(1900, 1, 1, tzinfo=timezone.utc)
    since = "1900" if "%d" in form else "midnight"
    found = np.array([(time - start).total_seconds() for time in times])
    return (found, since) if math.isfinite(found.sum()) else None
