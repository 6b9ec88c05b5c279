"""A machine and a calibration as plain data for a page, in the package's own words."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.checks.finding import Finding
from pkmcal.display import decimals, fixed, printable
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.calibration import Calibration
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.measurements.measurements import Measurements
from pkmcal.report import contents, machine_view
from pkmcal.report.rows import rows as every_row
from pkmcal.view import page

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

Table = dict[str, Any]
LEVELS = {"grave": "not calibrated", "doubt": "doubtful", "remark": "note"}
_MOST_ROWS, _MOST_ARROWS = 3000, 1000  # that are listed and drawn: the worst
ROWS = {
    "caption": "Measured rows: their distance from where the machine is by its numbers, mm",
    "heads": ["use", "row", "before", "after", "remark"],
}
NUMBERS = {
    "caption": "Numbers that are found; ± is one standard deviation",
    "heads": ["find", "number", "value", "±", "change", "unit", "knowledge"],
}
STATEMENTS = ("machine", "serial", "customer", "operator", "date", "instrument", "temperature",
               "method")  # fmt: skip


def finding(found: Finding) -> Table:
    """Return what a check of a machine's geometry says."""
    return {"what": found.what, "suggestion": found.suggestion}


@dataclass(frozen=True)
class Lines:
    """File and line of each row, -1 without one.

    Attributes
    ----------
    measured, held : sequence of (str, int)
        Of the files that are fitted, in the order of the rows, and of the one that is held out.
    """

    measured: Sequence[tuple[str, int]]
    held: Sequence[tuple[str, int]] = ()


def lines_of(measured: Measurements) -> list[tuple[str, int]]:
    """Return file and line of each row of a table."""
    lines = measured.lines
    numbers = [-1] * len(measured) if lines is None else [int(one) for one in lines]
    return [(Path(str(measured.file)).name, one) for one in numbers]


def calibration(found: Identification, job: Calibration, lines: Lines) -> Table:
    """Return what a page shows of a fit.

    Parameters
    ----------
    found : Identification
        The fit.
    job : Calibration
        What was asked, for the remedies that change it.
    lines : Lines
        Where the rows stand in their files.
    """
    verdict, free = found.verdict, set(found.free)
    names = list(as_machine(found.robot).geometry.names)
    rows, arrows = _rows(found, lines, _dropped(job))
    return {
        "name": found.robot.name,
        "verdict": {
            "state": verdict.state,
            "head": _head(str(verdict)),
            "said": [_said(each, job) for each in verdict.said],
        },
        "summary": found.summary(),
        "rows": rows,
        "of_rows": ROWS,
        "numbers": _numbers(found),
        "of_numbers": NUMBERS,
        "machine": names,
        "others": [name for name in names if name not in free],
        "held": [(name, "held") for name in job.fix],
        "view": _view(found, arrows),
    }


def _head(text: str) -> str:
    """The verdict alone; what else is said stands by itself, with what helps."""
    sentence = " ".join(line.strip() for line in text.splitlines())
    return re.split(r" (?=also: |note: )", sentence)[0]


def _said(said: Any, job: Calibration) -> Table:
    remedies = []
    for remedy in said.remedies:
        try:
            changed = job.with_remedy(remedy)
        except ArgumentError:
            continue  # of which only the user knows the value
        if changed != job:
            remedies.append({"option": remedy.option, "fit": changed.table().get("fit", {})})
    return {
        "check": said.check,
        "level": LEVELS[said.level],
        "text": said.text,
        "remedies": remedies,
    }


def _dropped(job: Calibration) -> set[str]:
    """Return the rows that are left out, as they are named."""
    return {part.strip() for each in job.drop for part in each.split(",")}


def _rows(
    found: Identification, lines: Lines, dropped: set[str]
) -> tuple[list[Table], list[Table]]:
    """Return all rows, those left out first and then the worst, and those with a place, as drawn.

    A row is left out by its key, its number, for a line may have several; of a file that is held
    out by `drop`, its line. `use` and `said` are there where a row is not as most are.
    """
    listed = every_row(found)
    elsewhere = bool(lines.held)
    told, arrows = list[Table](), list[Table]()
    off = np.where(np.isfinite(listed.off), listed.off, -np.inf)
    aside = np.array([use != "left out" for use in listed.use])
    for k in np.lexsort((-off, aside)).tolist():
        use, row = listed.use[k], int(listed.row[k])
        held = use == "held out" and elsewhere
        of = lines.held if held else lines.measured
        file, line = of[row] if row < len(of) else ("", -1)
        by_line = f"{file}:{line}" if line > 0 else None
        one: Table = {"key": f"held {row}" if held else str(row), "name": listed.name[k],
                      "off": [_off(listed.off_before[k]), _off(listed.off[k])]}  # fmt: skip
        if held:
            one["drop"] = by_line
        if by_line in dropped:
            one["line"] = by_line
        if use != "fitted":
            one["use"] = use
        if listed.outlier[k] or use != "fitted":
            one["said"] = "outlier" if listed.outlier[k] else use
        told.append(one)
        vectors = [listed.at[k], listed.before[k], listed.after[k]]
        if np.isfinite(vectors).all():
            at, first, last = (_vector(each) for each in vectors)
            arrow = {"key": one["key"], "name": one["name"], "at": at, "before": first,
                     "after": last, "outlier": bool(listed.outlier[k])}  # fmt: skip
            arrows.append(arrow if use == "fitted" else {**arrow, "aside": use})
    return told[:_MOST_ROWS], arrows[:_MOST_ARROWS]


def _numbers(found: Identification) -> list[Table]:
    rows = []
    for each in contents.parameters(found):
        angle = each["unit"] == "rad"
        scale = math.degrees(1.0) if angle else 1.0
        before, after, stderr = (each[key] * scale for key in ("before", "after", "stderr"))
        known = np.isfinite(stderr) and stderr > 0
        places = min(8, decimals(stderr, 2)) if known else 3
        shown = [fixed(after, places), fixed(stderr, places) if known else "∞",
                 fixed(after - before, places)]  # fmt: skip
        rows.append({"name": each["name"], "unit": "deg" if angle else each["unit"],
                     "shown": shown, "stderr": _number(stderr),
                     "knowledge": each["knowledge"]})  # fmt: skip
    return rows


def _view(found: Identification, arrows: list[Table]) -> Table | None:
    robot = found.robot
    if page.beyond(robot):
        return None  # the page's core does not hold such a machine
    data = page.machine(robot, cloud=False)
    data["places"] = machine_view.measured_poses(found)
    data["calibration"] = {"points": arrows, "change": machine_view.change(found)}
    return data


def certificate(stated: Mapping[str, object]) -> str:
    """Return the statements of a certificate as TOML.

    Raises
    ------
    ValueError
        A statement of another name, or one that is no text.
    """
    import tomli_w

    for name, value in stated.items():
        if name not in STATEMENTS or not isinstance(value, str):
            raise ArgumentError(
                f"certificate: {printable(str(name))} is none of {', '.join(STATEMENTS)}"
            )
    return tomli_w.dumps({name: value for name, value in stated.items() if value})


def stated(path: Path) -> dict[str, str]:
    """Return what a certificate's file states, empty where it states nothing."""
    found = tomllib.loads(path.read_text("utf-8")) if path.is_file() else {}
    return {name: str(found.get(name, "")) for name in STATEMENTS}


def _number(value: float, digits: int = 7) -> float | None:
    """Return a number with the digits that a page needs; None where it is none."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def _off(value: float) -> str:
    """Return a distance as it is shown, in mm."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


def _vector(values: FloatArray | Iterable[float]) -> list[float]:
    return [float(f"{value:.5g}") for value in values]
