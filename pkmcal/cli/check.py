"""`pkmcal check`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.measured import (
    Columns,
    Controller,
    Ignore,
    InvertPoses,
    JoinBy,
    ProbeOffset,
    Rename,
    Rotation,
    Units,
)
from pkmcal.cli.options import Json, RobotOrArm
from pkmcal.cli.output import say, tell
from pkmcal.display import first_rows
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.read_files import read_file
from pkmcal.jobs.reading import Reading
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.report.as_json import as_json


def check(
    context: typer.Context,
    robot: RobotOrArm,
    measurements: Annotated[
        Path | None,
        typer.Argument(metavar="CSV", help="Measurements of it: columns, units, numbers."),
    ] = None,
    controller: Controller = None,
    join: JoinBy = "auto",
    ignore: Ignore = None,
    rename: Rename = None,
    columns: Columns = None,
    units: Units = None,
    rotation: Rotation = None,
    invert_poses: InvertPoses = False,
    probe_offset: ProbeOffset = None,
    json: Json = False,
) -> int:
    """Look for mistakes in the geometry of a machine.

    Limbs that differ, joints off their circle, angles used as lengths, other wrong units, strokes
    that cannot be used, singular machines, contradictions to what the file states; of a serial arm
    wrong units and joints on one axis; each with its numbers and a suggestion. Of measurements the
    rows at which the machine has no pose. Exit code 1: problems were found.

    Example: pkmcal check hexapod
    """
    read = Inputs()
    machine = pk.load(read.robot(robot))
    measured = None
    if measurements is not None:
        given = {**asdict(Reading()), **context.params}  # a camera is for `calibrate`
        file, reading = str(measurements), Reading.of_options(given)
        measured = read_file(file, as_machine(machine), reading, read, tell)
    found = pk.check_geometry(machine)
    unsolved: list[int] = []
    if measured is not None:
        unsolved = np.flatnonzero(~as_machine(machine).forward(measured.actuators).ok).tolist()
    if json:
        said = None
        if measured is not None:
            said = {"kind": measured.kind, "rows": len(measured), "without_pose": unsolved}
        parts = {"robot": machine, "findings": found.findings, "ok": found.ok, "measurements": said}
        say(as_json(parts, schema="check"))
    else:
        say(found)
        if measured is not None:
            rows = f"{len(measured)} row{'s' * (len(measured) > 1)} of kind {measured.kind}"
            say(f"{measurements}: {rows}, readable")
    if unsolved:
        say(
            f"{measurements}: {machine.name} has no pose at the actuators of {len(unsolved)}"
            f" of them (rows {first_rows(unsolved, 10)});\ncheck their units, signs and columns",
            err=json,
        )
    return 0 if found.ok and not unsolved else 1
