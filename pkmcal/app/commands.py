"""The steps of each screen as command lines, to be typed in the folder of the project."""

from __future__ import annotations

from pathlib import PurePath

from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import quoted

REPORT, PLAN = "report", "plan"  # folders of the calibrated machine, and of planned poses
_NAMES = {"c": "machine.h", "linuxcnc": "linuxcnc", "mjcf": "machine.xml", "fmu": "machine.fmu",
          "urdf": "machine.urdf", "sdf": "machine.sdf"}  # fmt: skip

OUTPUTS = frozenset(_NAMES.values())


def commands(project: Project) -> dict[str, list[str]]:
    """Return the lines of each screen, empty where it has nothing to do yet."""
    job = project.calibration
    lines: dict[str, list[str]] = {
        name: [] for name in ("machine", "plan", "measure", "result", "out")
    }
    if not job.robot:
        return lines
    if project.importing is not None:
        lines["machine"].append(quoted(project.importing.argv()))
    lines["machine"].append(quoted(["pkmcal", "show", job.robot, "--out", "machine.html"]))
    lines["plan"].append(quoted([*project.plan.argv(), "--out", PLAN]))
    if job.files:
        reading = [*job.files, *job.reading.options()]
        lines["measure"].append(quoted(["pkmcal", "check", job.robot, *reading]))
        lines["result"].append(quoted([*job.argv(), *Writing(report=REPORT).options()]))
        lines["out"] += [quoted(export(target).argv()) for target in project.targets]
    return lines


def export(target: str) -> Exporting:
    """Return what writes the calibrated machine for a controller."""
    name = _NAMES.get(target, f"for_{target}.txt")
    return Exporting(str(PurePath(REPORT) / "robot.toml"), target, name)
