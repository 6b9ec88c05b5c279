"""`pkmcal calibrate`."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.calibration.asked import Role
from pkmcal.calibration.rigid import rigid_arm
from pkmcal.cli.camera_options import BoardSeen, BoardSize, CameraOn, Lens, LensFound, camera
from pkmcal.cli.effects_option import AUTO, HELP, OPTION, read_effects
from pkmcal.cli.geometry_options import (
    free_names,
    matching,
    read_coefficients,
    read_prior,
    read_uncertainty,
)
from pkmcal.cli.inputs import Inputs
from pkmcal.cli.measured import (
    Columns,
    Controller,
    Ignore,
    InvertPoses,
    JoinBy,
    ProbeOffset,
    Reading,
    Rename,
    Rotation,
    Units,
    rows_to_drop,
    without_lines,
)
from pkmcal.cli.options import Consider, Force, Free, Json, Prior, RobotOrArm, Uncertainty
from pkmcal.cli.output import Output, say
from pkmcal.cli.progress import progress
from pkmcal.cli.sessions import in_sessions
from pkmcal.display import printable
from pkmcal.estimation.loss import LIMITS
from pkmcal.estimation.parameters import KNOWN, Known
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.files.reading import Input
from pkmcal.fitted.dropped import Found
from pkmcal.kinematics.calibratable import Calibratable, as_machine
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.unknowns import POINT
from pkmcal.report.as_json import as_json
from pkmcal.statistics.covariance import RULES


def calibrate(
    robot: RobotOrArm,
    csv: Annotated[
        list[Path], typer.Argument(metavar="CSV...", help="Measurements: one file or several.")
    ],
    free: Free = None,
    prior: Prior = None,
    uncertainty: Uncertainty = None,
    consider: Consider = None,
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
            help="unknown: identify the frame of the instrument, too. Of several files one word"
            " each, with commas, if they have different frames.",
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
    per_session: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Find this number anew in each session, such as 'offset*' or 'frame*'; all others"
            " are common. Repeat it, or separate names with commas.",
        ),
    ] = None,
    session: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="The session of a file: once for each file. Else files have a column session, or"
            " their own names.",
        ),
    ] = None,
    approach: Annotated[
        str | None,
        typer.Option(
            metavar="WORD",
            help="order: the machine was driven from row to row as they stand in a file, which says"
            " from where each actuator came; for backlash.",
        ),
    ] = None,
    covariance: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="How uncertain parameters are: cluster, where rows of one pose share errors;"
            " classical, where none do; auto: as the residuals show.",
        ),
    ] = "auto",
    fix: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Hold this number as it is. Repeat it, separate names with commas, or use"
            " wildcards.",
        ),
    ] = None,
    datum: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="auto: hold as many numbers as only say where the frames of base and platform"
            " lie, if they are not known, and those between an arm's joints; the others then have"
            " finite ±. none: hold none.",
        ),
    ] = "none",
    expansion: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[PART=]NUMBER",
            help="How the machine expands, in 1/K, of steel 11.5e-6: all of it, or base, platform,"
            " limbs, limb3. With a column temperature the numbers are those at 20 °C. Repeat it for"
            " other parts, or separate them with commas.",
        ),
    ] = None,
    effects: Annotated[list[str] | None, typer.Option(metavar="WORDS", help=HELP)] = None,
    drop: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROW|FILE:LINE",
            help="Leave this row out: its number, as outliers are named, or a line of a file."
            " Repeat it, or separate rows with commas.",
        ),
    ] = None,
    drop_outliers: Annotated[
        bool,
        typer.Option("--drop-outliers", help="Leave out the rows that the others contradict."),
    ] = False,
    drop_slack: Annotated[
        bool,
        typer.Option(
            "--drop-slack",
            help="Leave out readings of cables that the others show to be slack, and keep the rest"
            " of their rows.",
        ),
    ] = False,
    controller: Controller = None,
    join: JoinBy = "auto",
    ignore: Ignore = None,
    rename: Rename = None,
    columns: Columns = None,
    units: Units = None,
    rotation: Rotation = None,
    invert_poses: InvertPoses = False,
    probe_offset: ProbeOffset = None,
    lens_file: Lens = None,
    camera_on: CameraOn = "base",
    board: BoardSeen = None,
    lens: LensFound = "none",
    find_size: BoardSize = False,
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
    certificate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Begin the report with a certificate: a TOML file states machine, serial,"
            " customer, operator, date, instrument, temperature, method.",
        ),
    ] = None,
    pdf: Annotated[
        bool,
        typer.Option(
            "--pdf", help="Print report.pdf beside it, on A4, by a Chromium that is installed."
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
    read = Inputs()
    given = pk.load(read.robot(robot))
    machine = as_machine(given)
    reading = Reading(
        controller, join, ignore, rename, columns, units, rotation, probe_offset, invert_poses,
        camera(lens_file, camera_on, board, lens, find_size),
    )  # fmt: skip
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always", pk.CalibrationWarning)
        measured = [reading.measurements(path, read, machine) for path in csv]
    for doubt in doubts:
        say(f"pkmcal: {doubt.message}", err=True)
    held = None if holdout is None else _read_holdout(holdout, read, machine, reading)
    if approach is not None:
        measured = [_approached(approach, each) for each in measured]
        held = _approached(approach, held) if isinstance(held, Measurements) else held
    anew = [name.strip() for text in per_session or [] for name in text.split(",")]
    if session or anew:
        measured, held = in_sessions(csv, measured, session or [], holdout, held)
    urdf = isinstance(given, pk.SerialArm) and given.source is not None
    names = ["robot.toml", "residuals.png", *["robot.urdf"] * urdf]
    output = None if out is None else Output(out, names, read, force)
    reported, printed = (None, None) if report is None else _report(report, read, force, pdf)
    if report is None and (certificate is not None or pdf):
        option = "--pdf" if certificate is None else "--certificate"
        raise ArgumentError(f"{option}: it is part of the report, --report DIR")
    stated = None if certificate is None else _checked_statement(certificate, read)
    if tracker is not None:
        seen = read_tracker(tracker)
        measured = [_seen_by(seen, each) for each in measured]
    if drop and drop_outliers:
        raise ArgumentError("--drop names rows, --drop-outliers finds them: one of the two")
    named = drop or []
    if isinstance(held, Measurements):
        named, held = without_lines(named, held, measured)
    dropped = rows_to_drop(named, measured)
    fixed = matching("--fix", machine, fix or [])
    held_machine = free == ["none"]  # frame, tool and lens alone
    wanted = [] if held_machine else free_names(machine, free)
    chosen = [name for name in wanted if name not in fixed]
    if fixed and not chosen and not held_machine:
        raise ArgumentError(f"--fix {','.join(fix or [])}: no parameter is left free")
    found_rows: dict[Found, bool] = {"outliers": drop_outliers, "slack": drop_slack}
    held_by_datum = ["datum"] if word("--datum", datum, ("none", "auto")) == "auto" else []
    moving = read_effects(effects or ["none"])
    weight, rule = word("--loss", loss, LIMITS), word("--covariance", covariance, RULES)
    coefficients = read_coefficients("--expansion", expansion or [])
    if coefficients is not None:
        if moving == AUTO:
            raise ArgumentError(f"{OPTION} auto is for arms, --expansion for other machines")
        moving = [*moving, pk.Expansion(coefficients)]
    with progress("identifying"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the summary has them
        found = pk.identify(
            given,
            measured[0] if len(measured) == 1 else measured,
            free=chosen if held_machine else chosen or None,
            prior=read_prior(prior or [], machine, chosen),
            loss=weight if rule == "auto" else (weight, rule),
            unknown=_unknown(frame, target, attachment, measured),
            holdout=held,
            per_session=anew,
            fix=[*fixed, *held_by_datum],
            drop=[*dropped, *(each for each, asked in found_rows.items() if asked)],
            effects=moving,
            uncertainty=read_uncertainty(uncertainty or [], consider or [], machine),
        )
    rigid = rigid_arm(found) if output is not None and urdf else None
    if output is not None:
        with progress("picture"), output.draft() as draft:
            _save(found, draft / "robot.toml", read, robot)
            found.plot(draft / "residuals.png")
            if isinstance(found.robot, pk.SerialArm) and urdf:
                (rigid.arm if rigid else found.robot).save_urdf(draft / "robot.urdf")
    if reported is not None:
        with progress("report"), reported.draft() as draft:
            found.report(draft, read.contents(), certificate=stated)
            _save(found, draft / "robot.toml", read, robot)
    if json:
        say(as_json(found, "parameters", "correlations", schema="calibrate"))
    else:
        say(found.summary())
        if output is not None:
            last = f" (of session {printable(found.sessions[-1])})" if found.sessions else ""
            say(f"\ncalibrated robot{last}: {output.paths[0]}")
            say(f"residuals: {output.paths[1]}")
            if urdf:
                how = f"; {rigid}" if rigid else ""
                say(f"URDF with the joint errors in its origins: {output.paths[2]}{how}")
        if reported is not None:
            say(f"\nreport: {reported.paths[0]}")
        written = [each for each in (reported, output) if each is not None]
        if written and isinstance(found.robot, pk.Robot) and found.robot.model.controller:
            robot_file = next(path for path in written[0].paths if path.name == "robot.toml")
            say(f"for its firmware: {found.robot.model.controller.command(str(robot_file))}")
    complete = printed is None or _printed(printed, json)
    return 0 if found.verdict.state == "calibrated" and not doubts and complete else 1


def _report(folder: Path, read: Inputs, force: bool, pdf: bool) -> tuple[Output, Output | None]:
    """Where the report and its PDF go; that nothing prints one is said before the work."""
    # they import all that a report needs: only if there is one
    from pkmcal.report.pdf import browser
    from pkmcal.report.report import FILES, PDF

    if pdf:
        browser()
    return Output(folder, FILES, read, force), Output(folder, [PDF], read, force) if pdf else None


def _printed(output: Output, json: bool) -> bool:
    """Print the report that has been written; whether that could be done."""
    from pkmcal.report.pdf import print_page
    from pkmcal.report.report import FILES

    (pdf,) = output.paths
    try:
        with progress("PDF"), output.draft() as draft:
            print_page(pdf.with_name(FILES[0]), draft / pdf.name)
    except ArgumentError as error:
        say(f"pkmcal: {error}; the report itself is complete", err=True)
        return False
    if not json:
        say(f"the same to print: {pdf}")
    return True


def _checked_statement(certificate: Path, read: Inputs) -> Input:
    """The file of ``--certificate``: a mistake in it is said before the work."""
    from pkmcal.report.certificate import read as statement

    statement(file := read.file(certificate))
    return file


def _save(found: pk.Identification, path: Path, read: Inputs, robot: str) -> None:
    """Write the calibrated robot; in the words of the user's file, where there is one."""
    calibrated, source = found.robot, read.robot(robot)
    if isinstance(calibrated, pk.SerialArm) or isinstance(source, str):
        calibrated.save(path, read.comment())
        return
    chosen = found.fit.parameters
    sigma = {each.name: each.stderr for each in found.nuisances}
    sigma |= dict(zip(found.free, found.stderr.tolist(), strict=True))
    names = [calibrated.geometry.names[place] for place in chosen.places]
    known = {
        name: sigma[chosen.names[column]]
        for name, column in zip(names, chosen.geometry_of().tolist(), strict=True)
    }
    calibrated.save(path, read.comment(), like=source, deviations=known)


def read_tracker(text: str) -> Tracker:
    """Return the tracker of ``--tracker``: three deviations in mm and deg, and its place in mm.

    Raises
    ------
    ValueError
        Not three or six numbers, or not positive.
    """
    try:
        numbers = [typed(part) for part in text.split(",")]
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
    if measured.instrument.components != POINT:
        raise ArgumentError(
            f"--tracker: a tracker measures positions, the file has {measured.kind}s"
        )
    return replace(measured, sigma=tracker.covariance(measured.values))


def _approached(text: str, measured: Measurements) -> Measurements:
    word("--approach", text, ("order",))
    if measured.approach is not None:
        raise ArgumentError(f"--approach: {measured.file} has columns approach")
    return replace(measured, approach="order")  # type: ignore[arg-type]


def _unknown(
    frame: str, target: str, attachment: str, measured: Sequence[Measurements]
) -> dict[Role, Known | list[Known]]:
    """What ``--frame``, ``--target`` and ``--attachment`` say of each file."""
    return {
        "frame": _known("--frame", frame, measured),
        "target": _known("--target", target, measured),
        "attachment": _known("--attachment", attachment, measured),
    }


def _known(option: str, text: str, measured: Sequence[Measurements]) -> Known | list[Known]:
    """One word for all files, or one for each."""
    words = [word(option, part.strip(), KNOWN) for part in text.split(",")]
    if len(words) not in (1, len(measured)):
        raise ArgumentError(f"{option} {text}: {len(words)} words for {len(measured)} files")
    return words[0] if len(words) == 1 else words


def _read_holdout(
    text: str, read: Inputs, robot: Calibratable, reading: Reading
) -> float | Measurements:
    """Return a fraction, a number of poses, or the measurements of a file."""
    try:
        number = typed(text)
    except ValueError:
        return reading.measurements(text, read, robot)
    return int(number) if number.is_integer() else number
