"""A machine and a calibration as plain data for a page, in the package's own words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.checks.finding import Finding
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.calibration import Calibration
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.report import contents, machine_view
from pkmcal.report.rows import rows as every_row
from pkmcal.view import page, parallel

Table = dict[str, Any]
LEVELS = {"grave": "not calibrated", "doubt": "doubtful", "remark": "note"}
_MOST_ROWS, _MOST_ARROWS = 3000, 1000  # that are listed and drawn: the worst
_STATEMENTS = ("machine", "serial", "customer", "operator", "date", "instrument", "temperature",
               "method")  # fmt: skip


def finding(found: Finding) -> Table:
    """Return what a check of a machine's geometry says."""
    return {"what": found.what, "suggestion": found.suggestion}


def calibration(found: Identification, job: Calibration, lines: Sequence[tuple[str, int]]) -> Table:
    """Return what a page shows of a fit.

    Parameters
    ----------
    found : Identification
        The fit.
    job : Calibration
        What was asked, for the remedies that change it.
    lines : sequence of (str, int)
        File and line of each row.
    """
    verdict, free = found.verdict, set(found.free)
    names = list(as_machine(found.robot).geometry.names)
    rows, left_out, arrows = _rows(found, lines)
    return {
        "name": found.robot.name,
        "verdict": {
            "state": verdict.state,
            "text": str(verdict),
            "said": [_said(each, job) for each in verdict.said],
        },
        "summary": found.summary(),
        "rows": rows,
        "numbers": _numbers(found),
        "machine": names,
        "others": [name for name in names if name not in free],
        "dropped": left_out,
        "view": _view(found, arrows),
    }


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


def _rows(
    found: Identification, lines: Sequence[tuple[str, int]]
) -> tuple[list[Table], list[Table], list[Table]]:
    """Return rows that were fitted, those left out, and the worst with a place, as drawn."""
    listed = every_row(found)
    fitted, left_out, arrows = list[Table](), list[Table](), list[Table]()
    worst = np.argsort(np.where(np.isfinite(listed.off), -listed.off, np.inf), kind="stable")
    for k in worst.tolist():
        use, row = listed.use[k], int(listed.row[k])
        if use == "held out":
            continue  # of another file it has a number of its own
        file, line = lines[row] if row < len(lines) else ("", -1)
        told = {
            "row": row, "file": file, "line": line, "outlier": bool(listed.outlier[k]),
            "before": _number(listed.off_before[k], 5), "after": _number(listed.off[k], 5),
        }  # fmt: skip
        (fitted if use == "fitted" else left_out).append(told)
        vectors = [listed.at[k], listed.before[k], listed.after[k]]
        if use == "fitted" and np.isfinite(vectors).all():
            at, first, last = (_vector(each) for each in vectors)
            arrows.append({"row": row, "name": f"row {row}", "at": at, "before": first,
                           "after": last, "outlier": told["outlier"]})  # fmt: skip
    left_out.sort(key=lambda told: int(told["row"]))
    return fitted[:_MOST_ROWS], left_out, arrows[:_MOST_ARROWS]


def _numbers(found: Identification) -> list[Table]:
    rows = []
    for each in contents.parameters(found):
        angle = each["unit"] == "rad"
        scale = math.degrees(1.0) if angle else 1.0
        shown = {key: _number(each[key] * scale) for key in ("before", "after", "stderr", "half95")}
        rows.append({"name": each["name"], "unit": "deg" if angle else each["unit"], **shown,
                     "knowledge": each["knowledge"]})  # fmt: skip
    return rows


def _view(found: Identification, arrows: list[Table]) -> Table | None:
    robot = found.robot
    if isinstance(robot, Robot) and parallel.beyond(robot.model):
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
        if name not in _STATEMENTS or not isinstance(value, str):
            raise ArgumentError(
                f"certificate: {printable(str(name))} is none of {', '.join(_STATEMENTS)}"
            )
    return tomli_w.dumps({name: value for name, value in stated.items() if value})


def _number(value: float, digits: int = 7) -> float | None:
    """Return a number with the digits that a page needs; None where it is none."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def _vector(values: FloatArray | Iterable[float]) -> list[float]:
    return [float(f"{value:.5g}") for value in values]
