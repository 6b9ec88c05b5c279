"""The steps of each screen as command lines, to be typed in the folder of the project."""

from __future__ import annotations

from pathlib import PurePath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pkmcal.controllers.target import Target
from pkmcal.controllers.targets import targets
from pkmcal.exceptions import Error
from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import quoted

if TYPE_CHECKING:
    from pkmcal.arms.arm import SerialArm
    from pkmcal.kinematics.robot import Robot

REPORT, PLAN = "report", "plan"  # folders of the calibrated machine, and of planned poses
OUTPUTS = frozenset(target.file for target in targets().values())


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
    known = targets().get(target)
    name = f"for_{target}.txt" if known is None else known.file
    return Exporting(str(PurePath(REPORT) / "robot.toml"), target, name)


def offered(machine: Robot | SerialArm) -> list[Target]:
    """Return the targets that the window offers for a machine."""
    from pkmcal.kinematics.calibratable import as_machine  # the server needs no NumPy for commands

    takes = (as_machine(machine).kind, "any")
    named = [each for each in targets().values() if each.label and each.takes in takes]
    return [each for each in named if not each.tried or _holds(each, machine)]


def _holds(target: Target, machine: Robot | SerialArm) -> bool:
    with TemporaryDirectory(prefix="pkmcal-") as folder:
        try:
            target.export(machine, PurePath(folder) / "numbers")
        except Error:
            return False
    return True
