"""Measures pose by pose what a plan chooses: with a machine that is driven, or out of a log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arguments import number, whole
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError, Error
from pkmcal.files import provenance
from pkmcal.jobs import planning
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.plan import Planning
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.live import registry
from pkmcal.live.course import UNSTATED, Course
from pkmcal.live.device import Instrument, Machine
from pkmcal.live.measuring_run import MeasuringRun, Rules, measured_already
from pkmcal.live.person import Ask
from pkmcal.live.replay import places, replayed
from pkmcal.live.row_log import RowLog
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.planning.next_pose import next_pose
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import as_reading

UNKNOWN = "unknown"  # of ``--noise``: readings tell it
Tell = Callable[[str], object]


def replay(job: Planning, path: str, inputs: Inputs) -> Iterator[Course]:
    """Measure again what a log holds, and yield what is known after each pose.

    Raises
    ------
    ValueError
        An option that says nothing of this machine or of this log.
    """
    stated, job = _noise_of(job)
    sources = planning.read(job, inputs)
    robot = sources.robot
    log = read_measurements(inputs.file(path), as_machine(robot))
    if stated and log.sigma is None and log.components:
        log = replace(log, sigma=VirtualMachine(robot, float(job.noise)).deviations(log.units))
    elif not stated:
        log = replace(log, sigma=None)
    candidates, rows = places(robot, log)
    options = planning.options(job, sources)
    options["kind"] = log.instrument
    if options["target"] is None and log.target is not None:
        options["target"] = np.unique(log.target, axis=0) if log.target.ndim == 2 else log.target
    choice = next_pose(robot, candidates, **options)
    yield from replayed(_course(job, choice, stated, options), log, rows)


@dataclass(frozen=True)
class Driven:
    """A measurement with a machine that is connected, before anything moves.

    Attributes
    ----------
    course : Course
        What rows that are there have told, and the next pose.
    log : RowLog
        Where rows go.
    words : str
        What is going to happen, for the person who starts it.
    """

    course: Course
    log: RowLog
    words: str
    _run: MeasuringRun
    _devices: tuple[Machine | Instrument, ...]

    def start(self) -> Iterator[Course]:
        """Drive and measure; see `MeasuringRun.start`."""
        return self._run.start(self.course)

    def stop(self) -> None:
        """Stop at once."""
        self._run.stop()

    def close(self) -> None:
        """Close log, machine and instrument; who does not answer any more has said so before."""
        _close([self.log, *self._devices])


def driven(
    job: Planning,
    machine: str,
    instrument: str | None,
    rules: Rules,
    out: str,
    inputs: Inputs,
    tell: Tell,
    ask: Ask | None = None,
) -> Driven:
    """Connect machine and instrument, and open the log, or go on with one that is there.

    Parameters
    ----------
    job : Planning
        Machine, candidates, what is read, and the accuracy or the number of poses wanted.
    machine, instrument : str
        As `registry` takes them: ``moonraker:http://…``, ``serial:…``; None: nothing is read but
        actuators.
    rules : Rules
        How poses are measured.
    out : str
        The log.
    inputs : Inputs
        Reads files.
    tell : callable
        Takes lines on what happens.
    ask : callable, optional
        Asks a person and returns what is typed; by default the terminal does.

    Raises
    ------
    ValueError
        An option that does not fit.
    DeviceError
        Machine or instrument are not there.
    OSError
        The log cannot be written.
    """
    stated, job = _noise_of(job)
    sources = planning.read(job, inputs)
    robot = sources.robot
    if isinstance(robot, SerialArm):
        raise ArgumentError(f"--machine: {robot.name} is a serial arm, which none of them drives")
    options = planning.options(job, sources)
    if isinstance(options["kind"], dict) or sources.measured is not None:
        raise ArgumentError(
            "measure: one kind of readings, and without --measured: the log has them"
        )
    kind = as_reading(options["kind"])
    _checked(job, rules, kind, instrument)
    target = None if options["target"] is None else np.array(options["target"]).reshape(-1, 3)
    if target is not None and len(target) > 1:
        raise ArgumentError("--target: one point is measured at a time")
    sigma = VirtualMachine(robot, float(job.noise)).deviations(kind.units) if stated else None
    if sigma is not None and not len(sigma):
        sigma = None
    candidates = planning.candidates(job, sources)
    opened: list[Any] = []
    try:
        own = Inputs()
        own.robot(job.robot)
        head = provenance.comment({Path(at).name: file for at, file in own.contents().items()})
        log = RowLog(Path(out), robot, kind, sigma, None if target is None else target[0], head)
        opened.append(log)
        for note in log.notes:
            tell(note)
        done = measured_already(robot, candidates, log)
        choice = next_pose(
            robot, candidates, done=done, measured=_there(log.rows, robot, sigma, job), **options
        )
        course = _course(job, choice, stated, options, log.rows, len(done))
        opened.append(registry.machine(machine, robot, ask))
        if instrument is not None:
            opened.append(registry.instrument(instrument, kind.units, ask))
    except BaseException:
        _close(opened)
        raise
    devices = opened[1:]
    run = MeasuringRun(robot, devices[0], devices[1] if instrument else None, log, rules, tell)
    words = _words(machine, instrument, rules, candidates[choice.indices], robot, out)
    return Driven(course, log, words, run, tuple(devices))


def _close(opened: list[Any]) -> None:
    for each in opened:
        with suppress(Error, OSError):
            each.close()


def _noise_of(job: Planning) -> tuple[bool, Planning]:
    """Read the noise: True if it is stated, and the plan with a number for it."""
    if job.noise == UNKNOWN:
        return False, replace(job, noise=str(UNSTATED))
    return True, job


def _course(
    job: Planning,
    choice: Any,
    stated: bool,
    options: dict[str, Any],
    rows: Measurements | None = None,
    poses: int = 0,
) -> Course:
    accuracy = None if job.accuracy is None else number("--accuracy", job.accuracy, above=0)
    last = choice.predicted_at_last
    if accuracy is not None and stated and not accuracy > last:
        raise ArgumentError(
            f"--accuracy {accuracy:g}: all {choice.left} candidates together predict {last:.3g} mm;"
            " offer others, or a better instrument"
        )
    asked = {name: options[name] for name in ("free", "prior", "unknown", "effects")}
    count = None if job.count is None else whole("--count", job.count, 1, choice.left + poses)
    return Course(choice, stated, accuracy, count, asked, rows, poses).fitted()


def _there(
    rows: Measurements | None, robot: Robot, sigma: FloatArray | None, job: Planning
) -> Measurements | None:
    """Rows of a log for the plan, which needs their noise."""
    if rows is None or sigma is not None or not rows.components:
        return rows
    return replace(rows, sigma=VirtualMachine(robot, float(job.noise)).deviations(rows.units))


def _checked(job: Planning, rules: Rules, kind: Reading, instrument: str | None) -> None:
    number("--feed", rules.feed, above=0)
    number("--dwell", rules.dwell, least=0)
    whole("--repeats", rules.repeats, 1, 1000)
    if rules.safe_height is not None:
        number("--safe-height", rules.safe_height)
    if job.accuracy is None and job.count is None:
        raise ArgumentError("--accuracy or --count: state when to stop")
    if (instrument is None) == bool(kind.components):
        raise ArgumentError(
            f"--instrument: what reads the {kind.noun()}; it has"
            f" {registry.words(registry.INSTRUMENTS)}"
            if kind.components
            else "--instrument: of kind closure nothing is read but the actuators"
        )


def _words(
    machine: str,
    instrument: str | None,
    rules: Rules,
    candidates: FloatArray,
    robot: Robot,
    out: str,
) -> str:
    """Announcement of the moves, for the person who starts them."""
    low, high = candidates[:, :3].min(axis=0), candidates[:, :3].max(axis=0)
    ends = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", low, high, strict=True))
    over = (
        "straight from pose to pose: there is no safe height"
        if rules.safe_height is None
        else f"between poses up to z {rules.safe_height:g}"
    )
    return (
        f"{robot.name} will be driven by {machine}\n"
        f"within {ends} mm, {over}, at {rules.feed:g} mm/min\n"
        f"{instrument or 'nothing but its actuators'} is read {rules.repeats} times at each pose,"
        f" {rules.dwell:g} s after it has come to rest; rows go to {out}"
    )
