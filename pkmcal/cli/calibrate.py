"""`pkmcal calibrate`."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated

import typer

from pkmcal.calibration.identification import Identification
from pkmcal.cli.camera_options import (
    BoardSize,
    BoardSizeKnown,
    BoardsSeen,
    CameraOn,
    Lenses,
    LensFound,
)
from pkmcal.cli.measured import (
    Columns,
    Controller,
    FromPnp,
    Ignore,
    InvertPoses,
    JoinBy,
    ProbeOffset,
    Rename,
    Rotation,
    Units,
)
from pkmcal.cli.options import FREE, Consider, Force, Free, Json, Prior, RobotOrArm, Uncertainty
from pkmcal.cli.output import say, tell
from pkmcal.cli.progress import progress
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import MOST_ROBOT
from pkmcal.jobs import calibrating
from pkmcal.jobs.calibration import Calibration, Writing
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.project import Project
from pkmcal.jobs.written import Written
from pkmcal.report.as_json import as_json

UNKNOWN = "What is unknown besides"
ROWS = "Which rows, and how they count"
WRITTEN = "What is written"
EFFECTS = (
    "What arms do beside their geometry: sag, the joints that gravity turns most; sag=all,"
    " sag=2:3:5, sag=tied by known masses; harmonics=1:2 waves a turn, harmonics=200@3 of joint 3;"
    " coupling=5.4, joint 5 turned by 4; backlash; auto: what helps at poses left out; none."
    " Of other machines elasticity=offset*, compliances of legs and screws, by loads of the rows."
    " Separate several with commas."
)


def calibrate(
    context: typer.Context,
    robot: RobotOrArm = "",
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="CSV...", help="Measurements: one file or several."),
    ] = None,
    project: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML",
            help="A project file, which says machine, files and options; beside it only what is"
            " written.",
        ),
    ] = None,
    free: Free = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=FREE,
            metavar="NAME",
            help="Hold this number as it is. Repeat it, separate names with commas, or use"
            " wildcards.",
        ),
    ] = None,
    prior: Prior = None,
    uncertainty: Uncertainty = None,
    consider: Consider = None,
    per_session: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=FREE,
            metavar="NAME",
            help="Find this number anew in each session, such as 'offset*' or 'frame*'; all others"
            " are common. Repeat it, or separate names with commas.",
        ),
    ] = None,
    datum: Annotated[
        str,
        typer.Option(
            rich_help_panel=FREE,
            metavar="WORD",
            help="auto: hold the numbers that only say where frames lie that nobody measured: of"
            " base and platform, and between the joints of an arm. All others then have a finite"
            " ±. none: hold none.",
        ),
    ] = "none",
    frame: Annotated[
        str,
        typer.Option(
            rich_help_panel=UNKNOWN,
            metavar="WORD",
            help="unknown: identify the frame of the instrument, too. Of several files one word"
            " each, with commas, if they have different frames.",
        ),
    ] = "known",
    target: Annotated[
        str,
        typer.Option(
            rich_help_panel=UNKNOWN,
            metavar="WORD",
            help="unknown: identify the points on the platform, too.",
        ),
    ] = "known",
    attachment: Annotated[
        str,
        typer.Option(
            rich_help_panel=UNKNOWN,
            metavar="WORD",
            help="unknown: identify where distances end, too.",
        ),
    ] = "known",
    lens: LensFound = "none",
    find_size: BoardSize = False,
    size_sigma: BoardSizeKnown = 0.0,
    effects: Annotated[
        list[str] | None, typer.Option(rich_help_panel=UNKNOWN, metavar="WORDS", help=EFFECTS)
    ] = None,
    expansion: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=UNKNOWN,
            metavar="[PART=]NUMBER",
            help="How the machine expands, in 1/K, of steel 11.5e-6: all of it, or base, platform,"
            " limbs, limb3. With a column temperature the numbers are those at 20 °C. Repeat it for"
            " other parts, or separate them with commas.",
        ),
    ] = None,
    holdout: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="FRACTION|FILE",
            help="Measurements to compare and not to fit: a fraction (or number) of the poses,"
            " drawn at random, or another file.",
        ),
    ] = None,
    drop: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="ROW|FILE:LINE",
            help="Leave this row out: its number, as outliers are named, or a line of a file."
            " Repeat it, or separate rows with commas.",
        ),
    ] = None,
    drop_outliers: Annotated[
        bool,
        typer.Option(
            "--drop-outliers",
            rich_help_panel=ROWS,
            help="Leave out the rows that the others contradict.",
        ),
    ] = False,
    drop_slack: Annotated[
        bool,
        typer.Option(
            "--drop-slack",
            rich_help_panel=ROWS,
            help="Leave out readings of cables that the others show to be slack, and keep the rest"
            " of their rows.",
        ),
    ] = False,
    session: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="NAME",
            help="The session of a file: once for each file. Else files have a column session, or"
            " their own names.",
        ),
    ] = None,
    approach: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="WORD",
            help="order: the machine was driven from row to row as they stand in a file, which says"
            " from where each actuator came; for backlash.",
        ),
    ] = None,
    tracker: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="R,A,E[,X,Y,Z]",
            help="A laser tracker's noise in place of the file's sigma: of its range in mm, azimuth"
            " and elevation in deg; and where it stands, in mm, if the frame is known.",
        ),
    ] = None,
    loss: Annotated[
        str,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="LOSS",
            help="linear, huber or cauchy: how much outliers count.",
        ),
    ] = "linear",
    covariance: Annotated[
        str,
        typer.Option(
            rich_help_panel=ROWS,
            metavar="WORD",
            help="How uncertain parameters are: cluster, where rows of one pose share errors;"
            " classical, where none do; auto: as the residuals show.",
        ),
    ] = "auto",
    controller: Controller = None,
    join: JoinBy = "auto",
    ignore: Ignore = None,
    rename: Rename = None,
    columns: Columns = None,
    units: Units = None,
    rotation: Rotation = None,
    invert_poses: InvertPoses = False,
    from_pnp: FromPnp = None,
    probe_offset: ProbeOffset = None,
    camera: Lenses = None,
    camera_on: CameraOn = "base",
    board: BoardsSeen = None,
    out: Annotated[
        Path | None,
        typer.Option(
            rich_help_panel=WRITTEN,
            metavar="DIR",
            help="Write robot.toml, as calibrated, residuals.png, and of a camera camera.yaml, its"
            " lens and where it is.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            rich_help_panel=WRITTEN,
            metavar="DIR",
            help="Write report.html, which any browser shows, report.json and robot.toml.",
        ),
    ] = None,
    certificate: Annotated[
        Path | None,
        typer.Option(
            rich_help_panel=WRITTEN,
            metavar="FILE",
            help="Begin the report with a certificate: a TOML file states machine, serial,"
            " customer, operator, date, instrument, temperature, method.",
        ),
    ] = None,
    pdf: Annotated[
        bool,
        typer.Option(
            "--pdf",
            rich_help_panel=WRITTEN,
            help="Print report.pdf beside it, on A4, by a Chromium that is installed.",
        ),
    ] = False,
    force: Force = False,
    json: Json = False,
) -> int:
    """Identify the geometry of a machine from measurements of it.

    Exit code 1: done, but doubtful or not calibrated; the first line says why.

    Example: pkmcal calibrate examples/linear-delta/robot.toml examples/linear-delta/probe.csv
    --report out
    """
    given = context.params
    job = Calibration.of_options(given) if project is None else _of_project(project, context)
    if not job.robot or not job.files:
        missing = "CSV..." if job.robot else "ROBOT"
        raise ArgumentError(f"Missing argument '{missing}' (see {context.command_path} --help)")
    return carried_out(job, Writing.of_options(given), json)


def carried_out(job: Calibration, asked: Writing, json: bool) -> int:
    """Calibrate, write what is asked for, print the rest, and return the exit code."""
    inputs = Inputs()
    sources = calibrating.read(job, inputs, tell)
    arguments = calibrating.arguments(job, sources, tell)
    written = Written.planned(asked, job.robot, sources.robot, sources.measured, inputs)
    with progress("identifying") as moved:
        found = calibrating.identified(sources, arguments, moved)
    rigid = None
    if written.machine is not None:
        with progress("picture"):
            rigid = written.write_machine(found)
    if written.report is not None:
        with progress("report"):
            written.write_report(found)
    say(
        as_json(found, "parameters", "correlations", schema="calibrate")
        if json
        else found.summary()
    )
    if not json:
        _say_written(written, found, rigid)
    complete = written.pdf is None or _printed(written, json)
    good = found.verdict.state == "calibrated" and not sources.doubts
    return 0 if good and complete else 1


def _of_project(path: Path, context: typer.Context) -> Calibration:
    """The calibration of a project file, beside which only what is written is an option."""
    beside = {"project", "json", *(each.name for each in fields(Writing))}
    for each in context.command.params:
        source = context.get_parameter_source(each.name or "")
        if each.name not in beside and source is not None and source.name == "COMMANDLINE":
            raise ArgumentError(f"--project says what {each.opts[0]} says: one of the two")
    content = Inputs().file(path).content(MOST_ROBOT)
    return Project.of_text(content, str(path)).in_folder(path.parent).calibration


def _say_written(written: Written, found: Identification, rigid: object) -> None:
    """Name the files that were written, and what to do with them."""
    machine, report = written.machine, written.report
    if machine is not None:
        last = f" (of session {printable(found.sessions[-1])})" if found.sessions else ""
        say(f"\ncalibrated robot{last}: {machine.paths[0]}")
        say(f"residuals: {machine.paths[1]}")
        if written.urdf:
            how = f"; {rigid}" if rigid else ""
            say(f"URDF with the joint errors in its origins: {machine.paths[2]}{how}")
        for path in (each for each in machine.paths if each.name in written.instruments):
            say(f"camera as found, its lens and where it is: {path}")
    if report is not None:
        say(f"\nreport: {report.paths[0]}")
    first = report or machine
    controller = found.fit.parameters.robot.model.controller
    if first is not None and controller is not None:
        robot_file = next(path for path in first.paths if path.name == "robot.toml")
        say(f"for its firmware: {controller.command(str(robot_file))}")


def _printed(written: Written, json: bool) -> bool:
    """Print the report that has been written; whether that could be done."""
    try:
        with progress("PDF"):
            pdf = written.print_report()
    except ArgumentError as error:
        tell(f"{error}; the report itself is complete")
        return False
    if not json:
        say(f"the same to print: {pdf}")
    return True
