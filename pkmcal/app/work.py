"""The computations of the window: machine, plan, files as read, fit, rows taken away.

Each operation takes the table of the project and what the page gives besides, and returns plain
data. Words of results are those of the package.
"""

from __future__ import annotations

import difflib
import os
import re
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pkmcal as pk
from pkmcal.app import telling
from pkmcal.app.commands import PLAN, REPORT, export
from pkmcal.app.folder import named
from pkmcal.app.names import safe_name
from pkmcal.checks.check_geometry import check_geometry
from pkmcal.exceptions import ArgumentError, Error
from pkmcal.files.atomic import write_whole
from pkmcal.files.reading import MOST_TABLE
from pkmcal.geometry.controller import Controller
from pkmcal.jobs import calibrating, exporting, importing, planning
from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import quoted
from pkmcal.jobs.written import Written, save_robot
from pkmcal.view import page

Table = dict[str, Any]
Say = Callable[..., None]
_LINES = 12  # of a file that are shown as they are


@dataclass
class Work:
    """A cache of what was read and fitted last.

    Attributes
    ----------
    key : object
        What was read depends on it: the calibration's sources and the files' times.
    """

    key: object = None
    inputs: Inputs = field(default_factory=Inputs)
    sources: calibrating.Sources | None = None
    notes: list[str] = field(default_factory=list)
    found: pk.Identification | None = None
    fitted: object = None

    def read(self, project: Project) -> calibrating.Sources:
        """Read the files of a calibration, if they or what is asked of them changed."""
        job = project.calibration
        files = [each for each in map(Path, named(project)) if each.is_file()]
        times = ((str(each), each.stat().st_mtime_ns, each.stat().st_size) for each in files)
        key = (job.sources, tuple(times))
        if self.sources is None or key != self.key:
            inputs, notes = Inputs(), list[str]()
            self.sources = calibrating.read(job, inputs, notes.append)
            self.key, self.inputs, self.notes = key, inputs, notes
            self.fitted = None
        return self.sources

    def fit(self, project: Project) -> pk.Identification:
        """Identify, if anything changed since."""
        sources = self.read(project)
        asked = (self.key, project.calibration)
        if self.found is None or self.fitted != asked:
            given = calibrating.arguments(project.calibration, sources, self.notes.append)
            self.found = calibrating.identified(sources, given)
            self.fitted = asked
        return self.found


def machine(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Take in a firmware's configuration, check the machine, and show it."""
    project = Project.of_table(state)
    notes: list[str] = []
    inputs = Inputs()
    if project.importing is not None:
        say("reading the configuration")
        printer = importing.run(project.importing, inputs)
        importing.write(project.importing, printer, inputs, force=True)
        notes = str(printer).splitlines()
    robot = pk.load(inputs.robot(project.calibration.robot))
    say("drawing the machine", 0.5)
    found = check_geometry(robot)
    stored = [] if project.importing is None else list(importing.tables(printer))
    folder = Path(project.calibration.robot).parent
    return {
        "name": robot.name,
        "findings": [telling.finding(each) for each in found.findings],
        "notes": notes,
        "stored": [str(folder / name) for name in stored],
        "view": page.machine(robot),
    }


def plan(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Choose poses, write them as the command does, and show them."""
    project, inputs = Project.of_table(state), Inputs()
    sources = planning.read(project.plan, inputs)
    say("choosing poses", 0.1)
    made = planning.planned(project.plan, sources)
    output = Output(Path(PLAN), planning.files(project.plan), inputs, True)
    with output.draft() as draft:
        planning.write(made, draft, inputs.comment())
    shown = page.machine(made.robot, cloud=False)
    shown["places"] = page.places("planned poses", made.robot, made.poses)
    return {"text": str(made), "files": [str(each) for each in output.paths], "view": shown}


def look(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Show files as they are and as they are understood; a mistake is marked in its line."""
    project = Project.of_table(state)
    job = project.calibration
    names = [*job.files, *filter(None, [job.reading.controller])]
    found: Table = {"files": {name: _head(name) for name in names}}
    try:
        sources = work.read(project)
    except (Error, OSError) as error:
        return {**found, "error": told(error)}
    measured = sources.measured
    return {
        **found,
        "notes": list(
            dict.fromkeys([*work.notes, *(note for each in measured for note in each.notes)])
        ),
        "text": [str(each) for each in measured],
        "rows": sum(map(len, measured)),
    }


def fit(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Calibrate: the verdict, the table, rows and numbers, the machine with its residuals."""
    project = Project.of_table(state)
    say("reading", 0.1)
    work.read(project)
    say("identifying", 0.2)
    found = work.fit(project)
    say("judging", 0.7)
    return telling.calibration(found, project.calibration, _lines(work))


def out(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Write the calibrated machine and the configuration, and say what changes in it."""
    project = Project.of_table(state)
    found = work.fit(project)
    sources = work.read(project)
    with Output(Path(REPORT), ["robot.toml"], work.inputs, True).draft() as draft:
        save_robot(found, draft / "robot.toml", work.inputs, project.calibration.robot)
    files = [_file(f"{REPORT}/robot.toml", "the calibrated machine")]
    exports = [export(target) for target in project.targets]
    robot = sources.robot
    if isinstance(robot, pk.Robot) and robot.model.controller:
        exports.insert(0, own_export(robot.model.controller, f"{REPORT}/robot.toml"))
    inputs = {each.resolve() for each in work.inputs.paths}
    changed: list[str] = []
    for number, job in enumerate(exports):
        say(f"writing {job.out}", 0.3 + 0.6 * number / len(exports))
        name = str(job.out)
        try:
            if Path(name).resolve() in inputs:
                raise ArgumentError(f"{name} is an input: give your file another name")
            said = str(exporting.run(job, Inputs(), force=True))
            files.append(_file("" if Path(name).is_dir() else name, f"{name}: {said}"))
        except Error as error:
            files.append(_file("", str(error)))
            continue
        if job.config is not None:
            old, new = (Path(each).read_text("utf-8", "replace").splitlines()
                        for each in (job.config, name))  # fmt: skip
            changed += difflib.unified_diff(old, new, job.config, name, n=1, lineterm="")
    return {"files": files, "changed": changed, "commands": [quoted(job.argv()) for job in exports]}


def report(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Write the report; with a certificate where its statements are given."""
    project = Project.of_table(state)
    found = work.fit(project)
    certificate = given.get("certificate")
    if certificate:
        say("certificate", 0.1)
        write_whole("certificate.toml", telling.certificate(certificate))
    say("report", 0.3)
    asked = Writing(
        report=REPORT, certificate="certificate.toml" if certificate else None, force=True
    )
    sources = work.read(project)
    Written.planned(asked, project.calibration.robot, sources.robot, work.inputs).write_report(
        found
    )
    command = quoted([*project.calibration.argv(), *asked.options()])
    return {"files": [_file(f"{REPORT}/report.html", "the report, one file that needs no network"),
                      _file(f"{REPORT}/report.json", "all results as data")],
            "command": command}  # fmt: skip


def wait(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Do nothing for ten seconds, for tests of stopping."""
    for step in range(100):
        say("waiting", step / 100)
        time.sleep(0.1)
    return {}


def crash(work: Work, state: Table, given: Table, say: Say) -> Table:
    """End by a signal, for tests of what follows."""
    os.kill(os.getpid(), signal.SIGSEGV)
    return {}


OPERATIONS: dict[str, Callable[[Work, Table, Table, Say], Table]] = {
    each.__name__: each for each in (machine, plan, look, fit, out, report, wait, crash)
}


def told(error: BaseException) -> Table:
    """Return an error's words, and the file and line that they begin with."""
    found: Table = {"message": str(error)}
    place = re.match(r"(?:.*/)?([^/:]+), line (\d+)\b", found["message"])
    return {**found, "file": place[1], "line": int(place[2])} if place else found


def own_export(controller: Controller, robot: str) -> Exporting:
    """Return what writes a robot file into the configuration that it was made of."""
    config = controller.file or None
    if config is not None and Path(config).name != config:
        raise ArgumentError(f"the robot file's controller: {config} is not a file of this project")
    return Exporting(robot, controller.firmware, safe_name(controller.new), config=config)


def _head(name: str) -> list[str]:
    """Return the first lines of a file, as text whatever is in it."""
    with open(name, "rb") as file:
        begin = file.read(min(MOST_TABLE, 8192))
    return begin.decode("utf-8", "replace").splitlines()[:_LINES]


def _file(name: str, *words: str) -> Table:
    return {"file": name, "what": " ".join(words)}


def _lines(work: Work) -> list[tuple[str, int]]:
    """Return the file and line of each measured row, in the order of the rows."""
    assert work.sources is not None
    found: list[tuple[str, int]] = []
    for each in work.sources.measured:
        lines = getattr(each, "lines", None)
        numbers = [-1] * len(each) if lines is None else [int(one) for one in lines]
        found += [(Path(str(each.file)).name, one) for one in numbers]
    return found
