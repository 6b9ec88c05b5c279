"""Take files that are given to a window: a machine, its configuration, or measurements.

It is the same wherever they are dropped, so that measurements never take a machine's place.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pkmcal.controllers.firmwares import Firmware, firmware_of
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.inputs import CONFIGURATIONS
from pkmcal.jobs.machine import is_built_in
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.project import Project
from pkmcal.jobs.read_files import COLUMNS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

Kind = Literal["machine", "configuration", "log", "measurements", "camera", "columns", "project"]
IMPORTED = "machine"  # the folder of what is made of a configuration
_MACHINES = (".urdf", ".xacro", ".xml")
_TABLES = (".csv", ".tsv", ".xlsx")
_MAINS = ("printer.cfg", "config.g", "maslow.yaml")  # which run or include others
_LOOKED_AT = 4_000_000  # bytes of a file
_LENS = ("camera_matrix", "distortion_coefficients", "cameraMatrix")  # of OpenCV and of ROS
_BESIDE = {"camera": "the lens of the camera", "columns": "what the measured columns are"}


@dataclass(frozen=True)
class Taken:
    """A project with files that were given to it, and what became of them."""

    project: Project
    said: tuple[str, ...] = ()


def kind_of(path: Path) -> Kind:
    """Return what a file is, by its ending and, where that does not tell, by what stands in it.

    Raises
    ------
    ValueError
        None of what a window takes.
    """
    ending = path.suffix.lower()
    if ending in _TABLES:
        return "measurements"
    text = _beginning(path)
    if ending in CONFIGURATIONS:
        return "configuration"
    if ending == ".toml":
        return _kind_of_toml(text)
    if ending in _MACHINES:
        return "machine"
    if ending in (".yaml", ".yml", ".json") and any(word in text for word in _LENS):
        return "camera"
    firmware = _firmware(text, path.name)
    if ending in (".yaml", ".yml") or firmware not in (None, "maslow"):
        return "configuration"
    if firmware == "maslow":
        return "log"
    if ending in (".txt", ".log", ".dat", ".asc", ""):
        return "measurements"
    raise ArgumentError(
        f"{printable(path.name)}: neither a machine nor measurements: a robot file, URDF, a"
        " firmware's configuration, or a table as CSV, text or XLSX"
    )


def may_be_machine(name: str) -> bool:
    """Return whether a file may be offered as another machine: not a file of pkmcal's own."""
    if name.startswith("new.") or Path(name).suffix.lower() not in (*_MACHINES, ".toml", ".cfg"):
        return False
    return kind_of(Path(name)) in ("machine", "configuration") and name != "certificate.toml"


def _kind_of_toml(text: str) -> Kind:
    try:
        keys = tomllib.loads(text).keys()
    except ValueError:
        return "machine"  # its reader says where the mistake is
    if "pkmcal-project" in keys:
        return "project"
    return "columns" if keys and keys <= {*COLUMNS} else "machine"


def _beginning(path: Path) -> str:
    """The text of a file, as far as it tells what it is."""
    with open(path, "rb") as file:
        return file.read(_LOOKED_AT).decode("utf-8", "replace")


def _firmware(text: str, place: str) -> Firmware | None:
    try:
        return firmware_of(text, place)
    except FileError:
        return None


def taken(project: Project, names: Sequence[str]) -> Taken:
    """Take files of a project's folder into it.

    One of them may be a machine, which takes the place of the one before: of several the main
    file of a firmware, or the first. Measurements come to those that there are.

    Parameters
    ----------
    project : Project
        The project as it is.
    names : sequence of str
        Files, by their names in the working folder.

    Raises
    ------
    ValueError
        A file that is none of what a window takes, or a machine within a project file.
    """
    kinds = {name: kind_of(Path(name)) for name in names}
    for name, kind in kinds.items():
        if kind == "project":
            raise ArgumentError(
                f"{printable(name)}: a project, which is its folder: pkmcal app FOLDER opens it"
            )
    found = Taken(project)
    machines = [name for name, kind in kinds.items() if kind in ("machine", "configuration")]
    logs = [name for name, kind in kinds.items() if kind == "log"]
    maslow = project.importing is not None and _is_maslow(project.importing.file)
    if not machines and not maslow and logs:
        machines = logs[:1]  # it has the anchors, too
    if machines:
        found = _of_file(found, machines, kinds)
    rest = [name for name in logs if name not in machines]
    importing = found.project.importing
    if rest and importing is not None:
        project = replace(found.project, importing=replace(importing, log=rest[0]))
        found = Taken(project, (*found.said, f"{printable(rest[0])}: the log of its calibration"))
    measured = [name for name, kind in kinds.items() if kind == "measurements"]
    if measured:
        found = _with_measurements(found, measured)
    for name, kind in kinds.items():
        if kind in _BESIDE:
            job = found.project.calibration
            lens, columns = job.reading.camera, job.reading.columns
            lens, columns = ((name,), columns) if kind == "camera" else (lens, name)
            job = replace(job, reading=replace(job.reading, camera=lens, columns=columns))
            project = replace(found.project, calibration=job)
            found = Taken(project, (*found.said, f"{printable(name)}: {_BESIDE[kind]}"))
    return found


def with_machine(project: Project, robot: str, importing: Importing | None = None) -> Taken:
    """Take a machine; what was asked of another one is not asked of it.

    Parameters
    ----------
    project : Project
        The project as it is.
    robot : str
        A built-in machine, or a robot file.
    importing : Importing, optional
        Of which configuration the robot file is made.
    """
    before = project.calibration
    files = tuple(each for each in before.files if Path(each).parts[0] != IMPORTED)
    new = Project(Calibration(robot, files, before.reading), importing=importing)
    said = [f"machine: {_called(new)}"]
    if before.robot:
        kept = replace(before, robot=robot, files=files)
        if (kept, replace(project.plan, robot=robot), project.targets) != _asked(new):
            said.append(
                f"what was asked of {_called(project)} is gone: the fit's settings, the plan, other"
                " controllers; Undo brings it back"
            )
        if files:
            said.append(f"measured files stay: {', '.join(map(printable, files))}")
    return Taken(new, tuple(said))


def _asked(project: Project) -> tuple[Calibration, Planning, tuple[str, ...]]:
    return project.calibration, project.plan, project.targets


def _of_file(found: Taken, names: Sequence[str], kinds: dict[str, Kind]) -> Taken:
    """Take the machine of one of these files."""
    project = found.project
    name = next((each for each in names if each.lower() in _MAINS), names[0])
    said = [f"{printable(each)} is kept in the project, and is not the machine"
            for each in names if each != name]  # fmt: skip
    made = kinds[name] != "machine"
    if name == (_configuration(project) if made else project.calibration.robot):
        return Taken(project, (*found.said, f"{printable(name)} is read again", *said))
    robot = f"{IMPORTED}/robot.toml" if made else name
    with_it = with_machine(project, robot, Importing(name, IMPORTED) if made else None)
    return Taken(with_it.project, (*found.said, *with_it.said, *said))


def _with_measurements(found: Taken, names: Sequence[str]) -> Taken:
    job = found.project.calibration
    reading = job.reading
    others = [each for each in names if each not in (reading.controller, job.holdout)]
    files = tuple(dict.fromkeys((*job.files, *others)))
    listed = ", ".join(map(printable, names))
    said = (*found.said, f"{listed}: measurements")
    if not job.robot:
        said = (*said, "which machine they are of is not known yet")
    return Taken(replace(found.project, calibration=replace(job, files=files)), said)


def _is_maslow(name: str) -> bool:
    path = Path(name)
    return path.is_file() and _firmware(_beginning(path), name) == "maslow"


def _configuration(project: Project) -> str | None:
    return None if project.importing is None else project.importing.file


def _called(project: Project) -> str:
    """The machine of a project as the user knows it."""
    robot = project.calibration.robot
    return robot if is_built_in(robot) else printable(_configuration(project) or robot)
