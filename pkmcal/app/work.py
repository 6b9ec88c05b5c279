"""The computations of the window: machine, plan, files as read, fit, rows taken away.

Each operation takes the table of the project and what the page gives besides, and returns plain
data. Words of results are those of the package.
"""

from __future__ import annotations

import difflib
import itertools
import os
import re
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import pkmcal as pk
from pkmcal.app import looking, taking, telling
from pkmcal.app.aside import Kept
from pkmcal.app.commands import PLAN, REPORT, export, offered
from pkmcal.app.folder import named
from pkmcal.app.names import safe_name
from pkmcal.app.sheet import sheet
from pkmcal.checks.check_geometry import check_geometry
from pkmcal.controllers.firmwares import Firmware
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError, Error, words_of
from pkmcal.files.atomic import write_whole
from pkmcal.geometry.controller import Controller
from pkmcal.jobs import calibrating, exporting, importing, planning
from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import quoted
from pkmcal.jobs.written import Written, save_robot
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.live import registry
from pkmcal.live.measuring_run import Rules
from pkmcal.progress import Progress
from pkmcal.view import page

Table = dict[str, Any]
Say = Callable[..., None]
_LINES, _AROUND = 12, 2  # of a file that are shown as they are, and around a mistake
_LONGEST = 2000  # bytes of a line that are shown


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
    kept: Kept = field(default_factory=Kept)

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

    def fit(self, project: Project, progress: Progress | None = None) -> pk.Identification:
        """Identify, if anything changed since."""
        sources = self.read(project)
        asked = (self.key, project.calibration)
        if self.found is None or self.fitted != asked:
            given = calibrating.arguments(project.calibration, sources, self.notes.append)
            self.found = calibrating.identified(sources, given, progress)
            self.fitted = asked
        return self.found

    def lines(self, project: Project) -> telling.Lines:
        """Return where the rows of a calibration stand in its files."""
        sources = self.read(project)
        held = [] if sources.held is None else telling.lines_of(sources.held)
        return telling.Lines(
            [one for each in sources.measured for one in telling.lines_of(each)], held
        )


def take(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Take files, or a built-in machine, into the project, and say what became of it."""
    project = Project.of_table(state)
    if "builtin" in given:
        taken = taking.with_machine(project, str(given["builtin"]))
    else:
        names = given.get("files")
        if not isinstance(names, list):
            raise ArgumentError("files: a list of names is needed")
        taken = taking.taken(project, [_in_folder(name) for name in names])
    return {"state": taken.project.table(), "said": list(taken.said)}


def machine(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Take in a firmware's configuration, check the machine, and show it."""
    project = Project.of_table(state)
    found: Table = {"firmwares": list(get_args(Firmware)), "machines": _machines(project),
                    "findings": [], "notes": [], "stored": []}  # fmt: skip
    inputs = Inputs()
    try:
        if project.importing is not None:
            say("reading the configuration")
            printer = importing.run(project.importing, inputs)
            paths = [Path(project.importing.out) / name for name in importing.files(printer)]
            with work.kept.aside(paths) as aside:
                importing.write(project.importing, printer, inputs, force=True)
            found["notes"] = [*str(printer).splitlines(), *aside]
            found["machines"] = _machines(project)
            found["stored"] = [str(each) for each in paths[1:]]
        robot = pk.load(inputs.robot(project.calibration.robot))
    except (Error, OSError) as error:
        return {**found, "error": told(error)}
    say("drawing the machine", 0.5)
    findings = [telling.finding(each) for each in check_geometry(robot).findings]
    return {**found, "name": robot.name, "findings": findings, "view": page.machine(robot)}


def _machines(project: Project) -> list[str]:
    """Files of the project that another machine may be made of."""
    now = {project.calibration.robot, project.importing.file if project.importing else ""}
    files = sorted(each.name for each in Path().iterdir() if each.is_file())
    return [each for each in files if each not in now and taking.may_be_machine(each)]


def _in_folder(name: object) -> str:
    """The name of a file of the project.

    Raises
    ------
    ValueError
        No such file in the folder itself.
    """
    if not isinstance(name, str) or safe_name(name) != name or not Path(name).is_file():
        raise ArgumentError(f"there is no file {printable(str(name))} in this project")
    return name


def plan(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Choose poses, write them as the command does, and show them."""
    project, inputs = Project.of_table(state), Inputs()
    sources = planning.read(project.plan, inputs)
    say("choosing poses", 0.1)
    made = planning.planned(project.plan, sources)
    output = Output(Path(PLAN), planning.files(project.plan), inputs, True)
    with work.kept.aside(output.paths) as said, output.draft() as draft:
        planning.write(project.plan, made, draft, inputs.comment())
    shown = page.machine(made.robot, cloud=False)
    shown["places"] = page.places("planned poses", made.robot, made.poses)
    files = [str(each) for each in output.paths]
    return {"words": made.paragraphs(), "table": "\n".join(made.tables()), "files": files,
            "view": shown, "said": said, "sheet": sheet(made)}  # fmt: skip


def look(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Show files as they are and as they are understood; a mistake is marked in its line."""
    project = Project.of_table(state)
    job = project.calibration
    names = [*job.files, *filter(None, [job.reading.controller])]
    inputs = Inputs()
    machine = as_machine(pk.load(inputs.robot(job.robot)))
    found: Table = {
        "files": {name: _lines(name) for name in names},
        "meanings": looking.meanings(machine),
        "units": looking.units(),
        "joins": looking.joins(job, machine, inputs),
    }
    try:
        sources = work.read(project)
    except (Error, OSError) as error:
        mistake = told(error)
        for name in names:
            if Path(name).name == mistake.get("file"):
                found["files"][name] = _lines(name, mistake["line"])
        return {**found, "columns": looking.headings(names), "error": mistake}
    measured = sources.measured
    return {
        **found,
        "columns": looking.columns(measured),
        "notes": list(
            dict.fromkeys([*work.notes, *(note for each in measured for note in each.notes)])
        ),
        "text": [looking.listed(each, machine) for each in measured],
    }


def devices(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Say which machines can be driven and which instruments read, with what addresses."""
    rules = {name: value for name, value in vars(Rules()).items() if value is not None}
    return {"machines": _addresses(registry.MACHINES), "rules": rules,
            "instruments": _addresses(registry.INSTRUMENTS)}  # fmt: skip


def _addresses(kinds: dict[str, Any]) -> list[tuple[str, str]]:
    return [(word, kind.ADDRESS) for word, kind in kinds.items()]


def fit(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Calibrate: the verdict, the table, rows and numbers, the machine with its residuals."""
    project = Project.of_table(state)
    say("reading", 0.1)
    work.read(project)
    say("identifying", 0.2)
    found = work.fit(project, lambda done, of: say("identifying", 0.2 + 0.5 * done / of))
    say("judging", 0.7)
    return telling.calibration(found, project.calibration, work.lines(project))


def out(work: Work, state: Table, given: Table, say: Say) -> Table:
    """Write the calibrated machine and the configuration, and say what changes in it."""
    project = Project.of_table(state)
    found = work.fit(project)
    sources = work.read(project)
    output = Output(Path(REPORT), ["robot.toml"], work.inputs, True)
    with work.kept.aside(output.paths) as aside, output.draft() as draft:
        save_robot(found, draft / "robot.toml", work.inputs, project.calibration.robot)
    files = [_file(f"{REPORT}/robot.toml", "the calibrated machine")]
    robot = sources.robot
    exports = [export(target) for target in project.targets]
    asked = dict(zip((job.out for job in exports), project.targets, strict=True))
    own = None
    if isinstance(robot, pk.Robot) and robot.model.controller:
        own = robot.model.controller.firmware
        exports.insert(0, own_export(robot.model.controller, f"{REPORT}/robot.toml"))
    inputs = {each.resolve() for each in work.inputs.paths}
    changed: list[str] = []
    for number, job in enumerate(exports):
        say(f"writing {job.out}", 0.3 + 0.6 * number / len(exports))
        name = str(job.out)
        try:
            if Path(name).resolve() in inputs:
                raise ArgumentError(f"{name} is an input: give your file another name")
            with work.kept.aside([Path(name)]) as others:
                said = str(exporting.run(job, Inputs(), force=True))
            aside += others
            file = _file("" if Path(name).is_dir() else name, f"{name}: {said}")
            files.append({**file, "target": asked.get(job.out)})
        except Error as error:
            files.append({**_file("", f"{job.target}: {error}"), "target": asked.get(job.out)})
            continue
        if job.config is not None:
            old, new = (Path(each).read_text("utf-8", "replace").splitlines()
                        for each in (job.config, name))  # fmt: skip
            changed += difflib.unified_diff(old, new, job.config, name, n=1, lineterm="")
    there = (*project.targets, own)
    offers = [(each.name, each.label) for each in offered(robot) if each.name not in there]
    return {"files": files, "changed": changed, "targets": offers, "said": aside,
            "certificate": telling.stated(Path("certificate.toml")),
            "commands": [quoted(job.argv()) for job in exports]}  # fmt: skip


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
    Written.planned(
        asked, project.calibration.robot, sources.robot, sources.measured, work.inputs
    ).write_report(found)
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
    each.__name__: each
    for each in (take, machine, plan, look, devices, fit, out, report, wait, crash)
}


def told(error: BaseException) -> Table:
    """Return an error's words, and the file and line that they begin with."""
    found: Table = {"message": words_of(error)}
    place = re.match(r"(?:.*/)?([^/:]+), line (\d+)\b", found["message"])
    return {**found, "file": place[1], "line": int(place[2])} if place else found


def own_export(controller: Controller, robot: str) -> Exporting:
    """Return what writes a robot file into the configuration that it was made of."""
    config = controller.file or None
    if config is not None and Path(config).name != config:
        raise ArgumentError(f"the robot file's controller: {config} is not a file of this project")
    return Exporting(robot, controller.firmware, safe_name(controller.new), config=config)


def _lines(name: str, at: int = 0) -> list[tuple[int, str]]:
    """Return a file's first lines with their numbers, and those around one, whatever is in it."""
    first = range(1, _LINES + 1)
    shown = {*first, *range(at - _AROUND, at + _AROUND + 1)} if at > _LINES else {*first}
    found = list[tuple[int, str]]()
    with open(name, "rb") as file:
        for number, line in enumerate(itertools.islice(file, max(shown)), 1):
            if number in shown:
                text = line[:_LONGEST].decode("utf-8", "replace").rstrip("\r\n")
                found.append((number, text))
    return found


def _file(name: str, *words: str) -> Table:
    return {"file": name, "what": " ".join(words)}
