"""What each screen does, as lines for a terminal in the folder of the project."""

from __future__ import annotations

from pathlib import PurePath

from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import quoted

REPORT = "report"  # folder of the calibrated machine


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
    lines["plan"].append(quoted(project.planning.argv(job.robot)))
    if job.files:
        reading = [*job.files, *job.reading.options()]
        lines["measure"].append(quoted(["pkmcal", "check", job.robot, *reading]))
        lines["result"].append(quoted([*job.argv(), *Writing(report=REPORT).options()]))
        lines["out"] += [quoted(export(target)) for target in project.targets]
    return lines


def export(target: str) -> list[str]:
    """Return the command that writes the calibrated machine for a controller."""
    names = {"c": "machine.h", "linuxcnc": "linuxcnc", "mjcf": "machine.xml", "fmu": "machine.fmu",
             "urdf": "machine.urdf", "sdf": "machine.sdf"}  # fmt: skip
    robot = str(PurePath(REPORT) / "robot.toml")
    out = names.get(target, f"{target}.txt")
    return ["pkmcal", "export", robot, "--as", target, "--out", out]
