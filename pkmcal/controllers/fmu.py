"""A robot's kinematics as an FMU, what simulators exchange by FMI 3.0: the C header inside.

It has sources and no binary, for that is for one system alone; a tool that takes it compiles them
with the standard's own headers. Own code, for what writes FMUs from Python puts Python into them.
"""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from os import PathLike
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from pkmcal.arguments import path as as_path
from pkmcal.controllers.arm_tree import xml_of
from pkmcal.controllers.c_header import prefix_of
from pkmcal.controllers.c_header import text_of as header_of
from pkmcal.controllers.loss import Loss, sag
from pkmcal.controllers.rendering import rendered
from pkmcal.core.library import COORDINATE_UNITS, POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.provenance import version
from pkmcal.kinematics.robot import Robot, require_parallel

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
_DATE = (1980, 1, 1, 0, 0, 0)  # of files in the archive: the same robot is the same bytes


def fmu(robot: Robot, path: str | PathLike[str]) -> Loss | None:
    """Write a robot's kinematics as an FMU of FMI 3.0 for co-simulation, with its C sources.

    Inputs are the actuator coordinates ``q1`` and so on, and a pose ``to.x`` … ``to.gamma``;
    outputs the pose ``x`` … ``gamma`` at these coordinates, and those that the other pose needs,
    ``to.q1`` and so on; mm and rad. ``status`` and ``to.status`` are 0 where they were found, else
    as in the C header; the last values then stay, and reading them gives a warning.

    Parameters
    ----------
    robot : Robot
        A machine that a C header holds.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all. Its name is that of the
        model.

    Returns
    -------
    Loss or None
        Of a machine that yields, of which the model is the rigid one: how far it sags under what
        its file states.

    Raises
    ------
    ValueError
        A machine that a C header cannot hold; nothing is written.
    OSError
        The folder does not exist or cannot be written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import tempfile, zipfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pk.export.fmu(pk.load("hexapod"), f"{folder}/hexapod.fmu")
    ...     zipfile.ZipFile(f"{folder}/hexapod.fmu").namelist()[:2]
    ['modelDescription.xml', 'sources/buildDescription.xml']
    """
    require_parallel(robot)
    lost = None if robot is robot.rigid else sag(robot)
    robot, path = robot.rigid, as_path("path", path)
    name = prefix_of(path)
    header = header_of(robot, name, "double")
    if not np.isfinite(robot.inverse(robot.home)).all():
        raise ArgumentError(f"robot: {robot.name} cannot reach its home pose")
    token = hashlib.sha256(header.encode()).hexdigest()
    says: dict[str, Any] = {"P": name, "n": robot.n_actuators, "token": token}
    title = re.sub(r"[^ -~]|\*/|/\*", "?", robot.name)
    files = {
        "modelDescription.xml": _description(robot, name, token),
        "sources/buildDescription.xml": _build(name),
        "sources/fmu.c": rendered("fmu.c.jinja", says | {"title": title}),
        f"sources/{name}.h": header,
    }
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as made:
        for file, text in files.items():
            made.writestr(zipfile.ZipInfo(file, _DATE), text, zipfile.ZIP_DEFLATED)
    write_whole(path, archive.getvalue())
    return lost


def _description(robot: Robot, name: str, token: str) -> str:
    """The file modelDescription.xml."""
    top = Xml.Element("fmiModelDescription", fmiVersion="3.0", modelName=robot.name)
    top.set("instantiationToken", token)
    top.set("generationTool", f"pkmcal {version()}")
    able = {"modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true"}
    Xml.SubElement(top, "CoSimulation", able)
    units = Xml.SubElement(top, "UnitDefinitions")
    for unit, base in (
        ("s", {"s": "1"}),
        ("mm", {"m": "1", "factor": "0.001"}),
        ("rad", {"rad": "1"}),
    ):
        Xml.SubElement(Xml.SubElement(units, "Unit", name=unit), "BaseUnit", base)
    Xml.SubElement(top, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.01")
    variables = Xml.SubElement(top, "ModelVariables")
    structure = Xml.SubElement(top, "ModelStructure")
    count = 0

    def add(kind: str, named: str, causality: str, **given: str) -> None:
        nonlocal count
        element = Xml.SubElement(variables, kind, name=named, valueReference=str(count))
        element.set("causality", causality)
        for key, value in given.items():
            element.set(key, value)
        count += 1

    q = [(f"q{i}", unit) for i, unit in enumerate(robot.actuator_units, 1)]
    pose = list(COORDINATE_UNITS.items())
    at_home = dict(zip(POSE, robot.home.tolist(), strict=True))
    needed = dict(zip((each for each, _ in q), robot.inverse(robot.home).tolist(), strict=True))
    add("Float64", "time", "independent", variability="continuous", unit="s")
    for each, unit in q:
        add("Float64", each, "input", unit=unit, start=repr(needed[each]))
    for each, unit in pose:
        add("Float64", each, "output", unit=unit)
    for each, unit in pose:
        add("Float64", f"to.{each}", "input", unit=unit, start=repr(at_home[each]))
    for each, unit in q:
        add("Float64", f"to.{each}", "output", unit=unit)
    for each in ("status", "to.status"):
        add("Int32", each, "output", variability="discrete")
    n = len(q)
    of_q, of_pose = range(1, n + 1), range(n + 7, n + 13)
    outputs = [(i, of_q) for i in range(n + 1, n + 7)]
    outputs += [(i, of_pose) for i in range(n + 13, 2 * n + 13)]
    outputs += [(2 * n + 13, of_q), (2 * n + 14, of_pose)]
    for tag in ("Output", "InitialUnknown"):
        for i, of in outputs:
            depends = " ".join(map(str, of))
            Xml.SubElement(structure, tag, valueReference=str(i), dependencies=depends)
    return _HEAD + xml_of(top)


def _build(name: str) -> str:
    """The file buildDescription.xml."""
    top = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    built = Xml.SubElement(top, "BuildConfiguration", modelIdentifier=name)
    sources = Xml.SubElement(built, "SourceFileSet", language="C99")
    Xml.SubElement(sources, "SourceFile", name="fmu.c")
    return _HEAD + xml_of(top)
