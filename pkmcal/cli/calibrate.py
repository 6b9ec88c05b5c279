"""`pkmcal calibrate`."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.calibration.loss import LIMITS
from pkmcal.calibration.parameters import KNOWN
from pkmcal.cli.geometry_options import free_names, read_deviations
from pkmcal.cli.options import Free, Json, Prior, RobotOrArm
from pkmcal.cli.output import contents, folder
from pkmcal.cli.progress import progress
from pkmcal.exceptions import ArgumentError
from pkmcal.files.provenance import comment
from pkmcal.measurements.calibratable import Calibratable, as_machine
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.report.as_json import as_json


def calibrate(
    robot: RobotOrArm,
    csv: Annotated[Path, typer.Argument(metavar="CSV", help="Measurements with units.")],
    free: Free = None,
    prior: Prior = None,
    holdout: Annotated[
        str | None,
        typer.Option(
            metavar="FRACTION|FILE",
            help="Measurements to compare and not to fit: a fraction (or number) of the poses,"
            " drawn at random, or another file.",
        ),
    ] = None,
    loss: Annotated[
        str, typer.Option(metavar="LOSS", help="linear, huber or cauchy: how much outliers count.")
    ] = "linear",
    frame: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="unknown: identify the frame of the instrument, too.",
        ),
    ] = "known",
    target: Annotated[
        str,
        typer.Option(metavar="WORD", help="unknown: identify the points on the platform, too."),
    ] = "known",
    attachment: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="unknown: identify where distances end, too.",
        ),
    ] = "known",
    tracker: Annotated[
        str | None,
        typer.Option(
            metavar="R,A,E[,X,Y,Z]",
            help="A laser tracker's noise in place of the file's sigma: of its range in mm, azimuth"
            " and elevation in deg; and where it stands, in mm, if the frame is known.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write robot.toml, as calibrated, and residuals.png."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write report.html, which any browser shows, report.json and robot.toml.",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Identify the geometry of a machine from measurements of it.

    Exit code 1: done, but not to be trusted; the summary says why.

    Example: pkmcal calibrate examples/linear-delta/robot.toml examples/linear-delta/probe.csv
    --report out
    """
    given = pk.load(robot)
    machine = as_machine(given)
    for option, written in (("--out", out), ("--report", report)):
        if written is not None:
            _refuse_own_input(option, written, robot)
    held = [] if holdout is None or not Path(holdout).is_file() else [Path(holdout)]
    files = contents(robot, csv, *held)
    measured = pk.read_measurements(csv, machine)
    if tracker is not None:
        measured = _seen_by(read_tracker(tracker), measured)
    chosen = free_names(machine, free)
    with progress("identifying"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the summary has them
        found = pk.identify(
            given,
            measured,
            free=chosen or None,
            prior=read_deviations("--prior", prior or [], machine, chosen),
            loss=word("--loss", loss, LIMITS),
            frame=word("--frame", frame, KNOWN),
            target=word("--target", target, KNOWN),
            attachment=word("--attachment", attachment, KNOWN),
            holdout=None if holdout is None else _read_holdout(holdout, machine),
        )
    if out is not None:
        found.robot.save(folder(out) / "robot.toml", comment(files))
        with progress("picture"):
            found.plot(out / "residuals.png")
    page = None
    if report is not None:
        with progress("report"):
            page = found.report(folder(report), files)[0]
    if json:
        typer.echo(as_json(found, "parameters", "correlations"))
    else:
        typer.echo(found.summary())
        if out is not None:
            typer.echo(f"\ncalibrated robot: {out / 'robot.toml'}")
            typer.echo(f"residuals: {out / 'residuals.png'}")
        if page is not None:
            typer.echo(f"\nreport: {page}")
    return 0 if found.converged and not found.warnings else 1


def read_tracker(text: str) -> Tracker:
    """Return the tracker of ``--tracker``: three deviations in mm and deg, and its place in mm.

    Raises
    ------
    ValueError
        Not three or six numbers, or not positive.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6):
        raise ArgumentError(
            f"--tracker {text}: expected RANGE,AZIMUTH,ELEVATION or those and X,Y,Z"
        )
    far, azimuth, elevation, x, y, z = [*numbers, 0.0, 0.0, 0.0][:6]
    try:
        return Tracker(far, math.radians(azimuth), math.radians(elevation), position=(x, y, z))
    except ValueError as error:
        raise ArgumentError(f"--tracker {text}: {error}") from None


def _seen_by(tracker: Tracker, measured: Measurements) -> Measurements:
    if measured.kind != "position":
        raise ArgumentError(
            f"--tracker: a tracker measures positions, the file has {measured.kind}s"
        )
    return replace(measured, sigma=tracker.covariance(measured.values))


def _read_holdout(text: str, robot: Calibratable) -> float | Measurements:
    """Return a fraction, a number of poses, or the measurements of a file."""
    try:
        number = float(text)
    except ValueError:
        return pk.read_measurements(text, robot)
    return int(number) if number.is_integer() else number


def _refuse_own_input(option: str, out: Path, robot: str) -> None:
    written = out / "robot.toml"
    if written.exists() and Path(robot).exists() and written.samefile(robot):
        raise ArgumentError(
            f"{option} {out}: would overwrite {robot}, which is an input; name another folder"
        )
