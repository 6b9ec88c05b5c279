"""Files of measurements as they were understood: each column, and how a log may be joined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pkmcal.exceptions import Error
from pkmcal.files.column_names import KNOWN_NAMES
from pkmcal.files.csv_table import Table as CsvTable
from pkmcal.files.understood import Understood
from pkmcal.files.units import UNITS
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.read_files import read_file
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.measurements.listing import table, title
from pkmcal.measurements.measurements import Measurements

Table = dict[str, Any]
WAYS = ("auto", "name", "time", "row", "row+1", "row-1")  # in which rows of a log may be found
_MOST_JOINED = 2_000_000  # bytes of files that are joined in all ways, for a look at each
_PREVIEW = 5  # rows


def columns(measured: Sequence[Measurements]) -> list[Table]:
    """Return what was made of each column of files that could be read."""
    found: dict[tuple[str, str], Understood] = {}
    for each in measured:
        for one in each.understood:
            if found.get((one.file, one.heading), one).meaning is None:
                found.pop((one.file, one.heading), None)
            found.setdefault((one.file, one.heading), one)
    return [
        {"file": one.file, "heading": one.heading, "unit": one.unit, "said": _said(one)}
        for one in found.values()
    ]


def listed(measured: Measurements, machine: Calibratable) -> str:
    """Return the rows as they were read, in units of what the machine's actuators read."""
    return f"{title(measured)}\n{table(measured, reading_units(machine))}"


def headings(names: Iterable[str]) -> list[Table]:
    """Columns as files head them, where what they mean is not known yet."""
    return [each for name in names for each in _headings(name)]


def _headings(name: str) -> Iterator[Table]:
    try:
        table = CsvTable(Path(name))
    except (Error, OSError):
        return  # a mistake in its lines, which is told
    for heading, column in table.columns.items():
        yield {"file": name, "heading": heading, "unit": column.unit, "said": "not read yet"}


def meanings(machine: Calibratable) -> list[str]:
    """Return names that a column may be read as."""
    drives = (f"q{i + 1}" for i in range(len(machine.actuator_units)))
    return list(dict.fromkeys([*drives, *KNOWN_NAMES]))


def units() -> list[str]:
    """Return units that a column may have."""
    return list(dict.fromkeys(unit for of in UNITS.values() for unit in of if unit.isalnum()))


def joins(job: Calibration, machine: Calibratable, inputs: Inputs) -> list[Table]:
    """Return what each way of joining with a log gives: its words, and its first rows."""
    log = job.reading.controller
    if log is None:
        return []
    ways = dict.fromkeys((*WAYS, job.reading.join))
    if sum(Path(each).stat().st_size for each in (*job.files, log)) > _MOST_JOINED:
        return [{"way": way, "said": "", "text": ""} for way in ways]
    return [_joined(way, job, machine, inputs) for way in ways]


def _joined(way: str, job: Calibration, machine: Calibratable, inputs: Inputs) -> Table:
    reading = replace(job.reading, join=way)
    said, shown = list[str](), list[str]()
    try:
        for name in job.files:
            read = read_file(name, machine, reading, inputs, lambda note: None)
            said += [note.partition(": ")[2] for note in read.notes if "joined with" in note]
            shown.append(listed(read.select(range(min(_PREVIEW, len(read)))), machine))
    except (Error, OSError) as error:
        return {"way": way, "said": str(error).partition("; ")[2] or str(error), "text": ""}
    return {"way": way, "said": "; ".join(said), "text": "\n".join(shown)}


def _said(each: Understood) -> str:
    if each.meaning is None:
        return "left out"
    if each.unit is None:
        return f"read as {each.meaning}"
    if each.unit_from == "heading":
        return f"read as {each.meaning} in {each.unit}"
    stated = each.unit_from
    if stated == "options":
        stated = "the units stated here"
    elif not stated.startswith("line "):
        stated = f"column {stated}"
    return f"read as {each.meaning} in {each.unit}, the unit of {stated}"
