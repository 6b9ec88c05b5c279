"""`pkmcal measure`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli import interrupt
from pkmcal.cli.options import Free, Prior, RobotOrArm, Seed
from pkmcal.cli.output import say, tell
from pkmcal.exceptions import ArgumentError, Error, words_of
from pkmcal.jobs import measuring
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.measuring import Driven
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.stated import command, quoted
from pkmcal.live import course_words, registry
from pkmcal.live.course import Course
from pkmcal.live.measuring_run import Rules

START = "start"
DEVICES = "Machine and instrument"
CHOICE = "Which poses, and when to stop"


def measure(
    robot: RobotOrArm,
    replay: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Nothing is driven: choose among rows that were measured, and say how many would"
            " have been enough.",
        ),
    ] = None,
    machine: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=DEVICES,
            metavar="WORD:ADDRESS",
            help=f"What is driven: {registry.words(registry.MACHINES)}.",
        ),
    ] = None,
    instrument: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=DEVICES,
            metavar="WORD:ADDRESS",
            help=f"What is read: {registry.words(registry.INSTRUMENTS)}.",
        ),
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            rich_help_panel=DEVICES,
            metavar="KIND",
            help="What the instrument reads, as for pkmcal plan.",
        ),
    ] = "position",
    noise: Annotated[
        str,
        typer.Option(
            rich_help_panel=DEVICES,
            metavar="MM",
            help="Noise of a reading, one standard deviation; unknown: estimate it.",
        ),
    ] = "0.02",
    actuator_noise: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=DEVICES, metavar="X", help="Noise of the actuators, mm or rad."
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=DEVICES, metavar="X,Y,Z", help="The measured point of the platform, mm."
        ),
    ] = None,
    feed: Annotated[
        float,
        typer.Option(rich_help_panel=DEVICES, metavar="MM/MIN", help="Feed rate of all moves."),
    ] = 1500.0,
    safe_height: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=DEVICES,
            metavar="Z",
            help="Height to rise to between poses, mm; without it moves are straight.",
        ),
    ] = None,
    dwell: Annotated[
        float,
        typer.Option(
            rich_help_panel=DEVICES, metavar="S", help="Time at rest before each reading."
        ),
    ] = 0.5,
    repeats: Annotated[
        int, typer.Option(rich_help_panel=DEVICES, metavar="N", help="Readings at each pose.")
    ] = 1,
    accuracy: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=CHOICE,
            metavar="MM",
            help="Stop when the predicted error is below this.",
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(rich_help_panel=CHOICE, metavar="N", help="Stop after so many poses."),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            rich_help_panel=CHOICE,
            metavar="CSV",
            help="Candidates; by default they are drawn, as by pkmcal plan.",
        ),
    ] = None,
    targets: Annotated[
        Path | None,
        typer.Option(rich_help_panel=CHOICE, metavar="CSV", help="Poses where accuracy counts."),
    ] = None,
    direction: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=CHOICE,
            metavar="X,Y,Z",
            help="Direction in which the error counts: z for a printer.",
        ),
    ] = None,
    within: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=CHOICE,
            metavar="NAME=LO:HI",
            help="Where to stay on all ways, mm and deg: 'z=2:300'. Repeat it, or use commas.",
        ),
    ] = None,
    free: Free = None,
    prior: Prior = None,
    unknown: Annotated[
        list[str] | None,
        typer.Option(metavar="WORD", help="frame or target: identified too, as for calibrate."),
    ] = None,
    seed: Seed = 0,
    out: Annotated[
        Path,
        typer.Option(
            metavar="CSV", help="The log; if it is there, the measurement goes on with it."
        ),
    ] = Path("measured.csv"),
) -> int:
    """Measure pose by pose: each row is fitted, and says which pose tells most next.

    It stops where the predicted error is there. A row that contradicts those before is told at
    once. Nothing moves before you type start; Ctrl-C stops machine and measurement.
    Exit code 1: stopped before the accuracy or count was there; every row is in the log.

    Example: pkmcal measure examples/linear-delta/robot.toml --machine person --instrument person
    --kind height --noise 0.02 --direction z --accuracy 0.05
    """
    job = Planning(
        robot,
        count=count,
        accuracy=accuracy,
        poses=None if poses is None else str(poses),
        targets=None if targets is None else str(targets),
        direction=direction,
        kind=kind,
        target=() if target is None else (target,),
        noise=noise,
        actuator_noise=actuator_noise,
        free=tuple(free or ()),
        prior=tuple(prior or ()),
        unknown=tuple(unknown or ()),
        within=tuple(within or ()),
        seed=seed,
    )
    inputs = Inputs()
    if replay is not None:
        if machine is not None or instrument is not None:
            raise ArgumentError("--replay: nothing is driven: without --machine and --instrument")
        last = _told(measuring.replay(job, str(replay), inputs))
        return _ended(last)
    if machine is None:
        raise ArgumentError(
            f"--machine: what is driven; it has {registry.words(registry.MACHINES)}; or --replay"
        )
    rules = Rules(feed, dwell, repeats, safe_height)
    with interrupt.lost_connections_are_errors():
        measurement = measuring.driven(job, machine, instrument, rules, str(out), inputs, tell)
        try:
            return _measured(measurement, job, out)
        finally:
            measurement.close()


def _measured(measurement: Driven, job: Planning, out: Path) -> int:
    course = measurement.course
    if not course.over:
        say(measurement.words)
        if not _started():
            tell("not started: nothing was moved")
            return 2
    last: list[Course] = [course]
    try:
        _told(measurement.start(), last)
    except (Error, OSError, KeyboardInterrupt) as error:
        rows = measurement.log.rows
        many = 0 if rows is None else len(rows)
        tell(f"{course_words.stopped(many, str(out))}: the same command goes on")
        if isinstance(error, KeyboardInterrupt):
            raise
        tell(words_of(error))
        return 1
    code = _ended(last[-1])
    say(quoted(command("calibrate", [job.robot, str(out)], [])))
    return code


def _started() -> bool:
    """Ask a person to start the machine."""
    try:
        return input(f"type {START} to move it: ").strip() == START
    except EOFError:
        return False


def _told(courses: Iterator[Course], last: list[Course] | None = None) -> Course | None:
    """Say what each pose told; the last course."""
    found = None
    for found in courses:
        if last is not None:
            last.append(found)
        say(course_words.line(found))
        for warning in course_words.warnings(found):
            tell(f"warning: {warning}")
    return found


def _ended(course: Course | None) -> int:
    if course is None:
        say("nothing to measure")
        return 1
    for line in course_words.conclusion(course):
        say(line)
    return 0 if course.reached or course.accuracy is None else 1
