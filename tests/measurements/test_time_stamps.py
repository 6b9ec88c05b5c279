"""A time-stamp is a moment: of a clock that may be ahead of another, or begin a new day."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.measurements.time_stamps import Times, seconds

MOMENTS = st.datetimes(datetime(1990, 1, 1), datetime(2090, 1, 1))
OFFSETS = st.sampled_from([-720, -300, -210, 0, 60, 120, 345, 840])  # minutes
FORMS = ("%Y-%m-%dT%H:%M:%S.%f%z", "%Y/%m/%d %H:%M:%S.%f %z", "%d.%m.%Y %H:%M:%S,%f%z")


def read(folder: Path, points: str, log: str | None = None, join: str = "auto") -> pk.Measurements:
    (folder / "m.csv").write_text(points, "utf-8")
    if log is not None:
        (folder / "log.csv").write_text(log, "utf-8")
    controller = None if log is None else folder / "log.csv"
    return pk.read_measurements(folder / "m.csv", controller=controller, join=join)


@given(st.lists(st.tuples(MOMENTS, OFFSETS), min_size=1, max_size=6), st.sampled_from(FORMS))
def test_a_moment_is_the_same_on_every_clock(moments: list[tuple], form: str) -> None:
    at = [when.replace(tzinfo=timezone.utc) for when, _ in moments]
    zones = [timezone(timedelta(minutes=ahead)) for _, ahead in moments]
    found = seconds(
        [when.astimezone(zone).strftime(form) for when, zone in zip(at, zones, strict=True)]
    )
    assert isinstance(found, Times) and found.in_utc
    expected = [(when - at[0]).total_seconds() for when in at]
    np.testing.assert_allclose(found.seconds - found.seconds[0], expected, rtol=0, atol=2e-6)


@given(st.lists(st.floats(0.0, 43000.0), max_size=12), st.floats(0.0, 86399.0))
def test_a_clock_without_a_date_goes_on_after_midnight(steps: list[float], start: float) -> None:
    times = start + np.cumsum([0.0, *steps])
    clock = [str(timedelta(seconds=round(t % 86400.0, 3))) for t in times]
    if any("day" in each for each in clock):  # rounded up to midnight
        return
    found = seconds(clock)
    assert isinstance(found, Times)
    np.testing.assert_allclose(found.seconds, times, rtol=0, atol=1e-3)
    assert found.midnights == times[-1] // 86400.0


def test_a_tracker_in_local_time_meets_a_log_in_utc(tmp_path: Path) -> None:
    points = "time,z [mm]\n2026-03-29T10:00:05+02:00,1\n2026-03-29T10:00:15+02:00,2\n"
    log = "time,q1 [mm]\n2026-03-29T08:00:04Z,10\n2026-03-29T08:00:14Z,20\n2026-03-29T10:00:04Z,9\n"
    m = read(tmp_path, points, log)
    assert m.actuators[:, 0].tolist() == [10, 20]
    assert "1 to 1 s earlier" in m.notes[0]


@pytest.mark.parametrize("swapped", [False, True])
def test_offsets_in_one_file_alone_are_not_guessed_in_the_other(
    tmp_path: Path, swapped: bool
) -> None:
    ends = ("", "+02:00") if swapped else ("+02:00", "")
    points = "time,z [mm]\n2026-03-29T10:00:05{0},1\n2026-03-29T10:00:15{0},2\n".format(ends[0])
    log = "time,q1 [mm]\n2026-03-29T10:00:04{0},10\n2026-03-29T10:00:14{0},20\n".format(ends[1])
    with pytest.raises(pk.FileError, match=r"states how its clock is ahead of UTC, .* does not"):
        read(tmp_path, points, log, join="time")


def test_clocks_are_joined_across_midnight(tmp_path: Path) -> None:
    log = "time,q1 [mm]\n23:59:00,10\n23:59:59,20\n00:00:30,30\n00:02:00,40\n"
    both = read(tmp_path, "time,z [mm]\n23:59:30,1\n00:01:00,2\n", log)
    assert both.actuators[:, 0].tolist() == [10, 30]
    after = read(tmp_path, "time,z [mm]\n00:00:05,1\n00:01:00,2\n00:02:00,3\n", log)
    assert after.actuators[:, 0].tolist() == [20, 30, 40]


def test_midnight_is_said(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],z [mm],Time\n1,2,23:59:00\n3,4,00:01:00\n")
    assert m.time is not None and np.diff(m.time).tolist() == [120.0]
    assert "'Time' passes midnight" in m.notes[-1]


@pytest.mark.parametrize(
    ("cells", "why"),
    [
        (["03/04/2026 10:00", "04/04/2026 10:00"], "day or the month first"),
        (["10:00:00", "noon"], "not of one form"),
        (["10:00:00", "2026-03-29 10:00:00"], "not of one form"),
        (["10:00:00Z", "10:00:01"], "'10:00:01' states no offset from UTC, others do"),
        (["10:00:00", ""], "one is empty"),
        (["1.5", "nan"], "one is not finite"),
    ],
)
def test_a_column_of_times_that_cannot_be_read_is_said(
    tmp_path: Path, cells: list[str], why: str
) -> None:
    rows = "".join(f"{k},2,{cell}\n" for k, cell in enumerate(cells))
    m = read(tmp_path, "q1 [mm],z [mm],time\n" + rows)
    assert m.time is None
    assert "column 'time' not read" in m.notes[-1] and why in m.notes[-1]
