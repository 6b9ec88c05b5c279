"""`pkmcal calibrate`."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import typer

from pkmcal.arguments import word
from pkmcal.cli.output import folder
from pkmcal.cli.progress import progress
from pkmcal.cli.robot_argument import ROBOT_OR_ARM, contents
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import UNITS
from pkmcal.files.provenance import comment
from pkmcal.loading import load
from pkmcal.measurements.calibratable import Calibratable, as_machine
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.report.as_json import as_json

_FRAME = dict(zip(POSE, ("mm", "mm", "mm", "rad", "rad", "rad"), strict=True))
_DEVIATION = re.compile(
    r"(?:(?P<name>[^=]+)=)?\s*"
    r"(?P<number>[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(?P<unit>\D*)"
)


def calibrate(
    robot: Annotated[str, ROBOT_OR_ARM],
    csv: Annotated[Path, typer.Argument(metavar="CSV", help="What was measured, with units.")],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Find this number instead of the robot's default set. Repeat it, separate names"
            " with commas, or use wildcards: 'rod*,radius'.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]σ",
            help="How far a number may be off before anything is measured, one standard"
            " deviation: 'base*=0.5', 'angle1=0.1deg'. Without a name, in mm, for all.",
        ),
    ] = None,
    holdout: Annotated[
        str | None,
        typer.Option(
            metavar="FRACTION|FILE",
            help="Compare these measurements instead of fitting them: a fraction (or number) of"
            " the poses, drawn at random, or another file.",
        ),
    ] = None,
    loss: Annotated[
        str, typer.Option(metavar="LOSS", help="linear, huber or cauchy: what outliers count.")
    ] = "linear",
    frame: Annotated[
        str,
        typer.Option(metavar="WORD", help="unknown: the instrument is not in the base frame."),
    ] = "known",
    target: Annotated[
        str,
        typer.Option(metavar="WORD", help="unknown: find the measured points of the platform."),
    ] = "known",
    attachment: Annotated[
        str,
        typer.Option(metavar="WORD", help="unknown: find where on the platform distances end."),
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
    json: Annotated[bool, typer.Option("--json", help="Print JSON alone; mm and rad.")] = False,
) -> int:
    """Find the geometry of a machine from measurements of it.

    Exit code 1: done, but not to be trusted; the summary says why.

    Example: pkmcal calibrate examples/linear-delta/robot.toml examples/linear-delta/probe.csv
    --report out
    """
    from pkmcal.calibration.identify import identify
    from pkmcal.calibration.loss import LIMITS
    from pkmcal.calibration.parameters import KNOWN

    given = load(robot)
    machine = as_machine(given)
    for option, written in (("--out", out), ("--report", report)):
        if written is not None:
            _refuse_own_input(option, written, robot)
    held = [] if holdout is None or not Path(holdout).is_file() else [Path(holdout)]
    files = contents(robot, csv, *held)
    measured = read_measurements(csv, machine)
    if tracker is not None:
        measured = _seen_by(read_tracker(tracker), measured)
    chosen = free_names(machine, free)
    with progress("identifying"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the summary has them
        found = identify(
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


def free_names(robot: Calibratable, given: Sequence[str] | None) -> list[str]:
    """Names that ``--free`` chooses, or the robot's default set.

    Raises
    ------
    ValueError
        A name that the robot does not have, or that a parameter drives.
    """
    if not given:
        return list(robot.model.free)
    patterns = [name.strip() for text in given for name in text.split(",")]
    try:
        return robot.geometry.match(patterns)
    except ValueError as error:
        raise ArgumentError(f"--free: {error}") from None


def read_deviations(
    option: str, given: Sequence[str], robot: Calibratable, names: Sequence[str]
) -> float | Mapping[str, float] | None:
    """Standard deviations from the command line; None where none is given.

    Parameters
    ----------
    option : str
        Which option gave them, for messages: ``--prior`` of identification, ``--sigma`` of
        tolerances.
    given : sequence of str
        "σ" for all numbers in mm, or "NAME=σ"; σ may have a unit, and for angles must.
    robot : Calibratable
        The machine.
    names : sequence of str
        The numbers of its geometry that may have one.

    Raises
    ------
    ValueError
        No number, a unit that does not fit, a wildcard over lengths and angles.
    """
    sigmas: dict[str, float] = {}
    for text in given:
        try:
            name, sigma = _deviation(text, robot, names)
            if not name and len(given) > 1:
                raise ArgumentError("a number without a name stands alone, for all")
        except ValueError as error:
            raise ArgumentError(f"{option} {text}: {error}") from None
        if not name:
            return sigma
        sigmas[name] = sigma
    return sigmas or None


def _deviation(text: str, robot: Calibratable, names: Sequence[str]) -> tuple[str, float]:
    """Name or wildcard, "" for all, and σ in mm, rad or 1."""
    match = _DEVIATION.fullmatch(text.strip())
    if match is None:
        raise ArgumentError("expected NAME=NUMBER, such as base1.x=0.5")
    name = (match["name"] or "").strip()
    unit = _unit_of(name, robot, names) if name else "mm"
    return name, _in_unit(float(match["number"]), match["unit"].strip(), unit, name)


def read_tracker(text: str) -> Tracker:
    """A tracker from ``--tracker``: three deviations in mm and deg, and its place in mm.

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


def _unit_of(pattern: str, robot: Calibratable, names: Sequence[str]) -> str:
    """Unit of the numbers that a pattern covers; what is not known is a length."""
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    known = {name: str(units[name]) for name in names}
    known |= {f"frame.{name}": unit for name, unit in _FRAME.items()}
    covered = {known[name] for name in known if fnmatchcase(name, pattern)}
    if len(covered) > 1:
        raise ArgumentError(
            "covers lengths, angles or ratios together; name them apart, or give one number"
            " without a name"
        )
    return covered.pop() if covered else "mm"


def _in_unit(number: float, unit: str, quantity: str, name: str) -> float:
    """A number in mm, rad or 1."""
    factors = UNITS.get(quantity, {})
    if not unit and quantity == "rad":
        raise ArgumentError(f"{name} is an angle; give it a unit, such as 0.1deg")
    if not unit:
        return number
    if unit not in factors:
        expected = f"one of {', '.join(u for u in factors if u.isascii())}" if factors else "none"
        raise ArgumentError(f"unit {unit!r}; expected {expected}")
    times, over = factors[unit]
    return number * times / over


def _read_holdout(text: str, robot: Calibratable) -> float | Measurements:
    """A fraction, a number of poses or a file."""
    try:
        number = float(text)
    except ValueError:
        return read_measurements(text, robot)
    return int(number) if number.is_integer() else number


def _refuse_own_input(option: str, out: Path, robot: str) -> None:
    written = out / "robot.toml"
    if written.exists() and Path(robot).exists() and written.samefile(robot):
        raise ArgumentError(
            f"{option} {out}: would replace {robot}, which is read; take another folder"
        )
