"""Runs a `Calibration`: reads its files and makes the arguments of `identify` of its options."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from pkmcal.arguments import word
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.asked import Role
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.effects.expansion import Expansion
from pkmcal.estimation.loss import LIMITS
from pkmcal.estimation.parameters import KNOWN, Known
from pkmcal.exceptions import ArgumentError, CalibrationWarning
from pkmcal.files.number_text import typed
from pkmcal.fitted.dropped import Found
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.effects_option import AUTO, OPTION, read_effects
from pkmcal.jobs.geometry_options import (
    free_names,
    matching,
    read_coefficients,
    read_prior,
    read_uncertainty,
)
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.read_files import read_files, read_pnp, rows_to_drop, without_lines
from pkmcal.jobs.sessions import in_sessions
from pkmcal.kinematics.calibratable import Calibratable, as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.progress import Progress, within
from pkmcal.readings.unknowns import POINT
from pkmcal.statistics.covariance import RULES

Tell = Callable[[str], object]  # takes a line on what was assumed
T = TypeVar("T")


@dataclass(frozen=True)
class Sources:
    """Files of a calibration as they were read.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine.
    measured : tuple of Measurements
        Those of each file; of a file with several cameras or boards those of each.
    file_of : tuple of int
        Which file each is of.
    held : Measurements or None
        Those of a file that is held out.
    doubts : tuple of str
        Warnings of reading.
    relative : bool
        Whether their sigma says how sure rows are beside each other alone: how sure they are in all
        is to be estimated.
    """

    robot: Robot | SerialArm
    measured: tuple[Measurements, ...]
    file_of: tuple[int, ...]
    held: Measurements | None
    doubts: tuple[str, ...]
    relative: bool = False


def run(job: Calibration, inputs: Inputs, tell: Tell) -> Identification:
    """Read the files of a calibration and identify the machine.

    Parameters
    ----------
    job : Calibration
        What is asked for.
    inputs : Inputs
        Reads the files, each once.
    tell : callable
        Takes each line on what was assumed in reading.
    """
    sources = read(job, inputs, tell)
    return identified(sources, arguments(job, sources, tell))


def read(job: Calibration, inputs: Inputs, tell: Tell) -> Sources:
    """Read machine and measurements: what does not change while only options of the fit do."""
    robot: Robot | SerialArm = load(inputs.robot(job.robot))
    machine = as_machine(robot)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", CalibrationWarning)
        several = [read_files(path, machine, job.reading, inputs, tell) for path in job.files]
    doubts = tuple(str(each.message) for each in caught)
    for doubt in doubts:
        tell(doubt)
    held = None
    if job.held_file is not None:
        found = read_files(job.held_file, machine, job.reading, inputs, tell)
        if len(found) > 1:
            raise ArgumentError(
                f"--holdout {job.held_file}: it has several cameras or boards; hold out a share, as"
                " --holdout 0.2, or a file of one"
            )
        held = found[0]
    measured = tuple(each for of_file in several for each in of_file)
    file_of = tuple(k for k, of_file in enumerate(several) for _ in of_file)
    pnp = job.reading.from_pnp
    return Sources(
        robot, measured, file_of, held, doubts, pnp is not None and read_pnp(pnp).noise is None
    )


def identified(
    sources: Sources, arguments: dict[str, Any], progress: Progress | None = None
) -> Identification:
    """Identify; what `identify` warns of is in the summary."""
    first = within(progress, 0.0, 0.5) if sources.relative else progress
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = identify(sources.robot, **arguments, progress=first)
        noise = found.chi2_per_dof**0.5
        if not sources.relative or not (math.isfinite(noise) and noise > 0.0):
            return found
        second = within(progress, 0.5, 1.0)
        return identify(sources.robot, **_with_noise(arguments, noise), progress=second)


def _with_noise(arguments: dict[str, Any], noise: float) -> dict[str, Any]:
    """Arguments of `identify` with covariances of what was measured times noise squared."""

    def scaled(measured: Measurements) -> Measurements:
        assert measured.sigma is not None
        return replace(measured, sigma=measured.sigma * noise**2)

    measured, held = arguments["measurements"], arguments["holdout"]
    several = [measured] if isinstance(measured, Measurements) else measured
    return arguments | {
        "measurements": [scaled(each) for each in several],
        "holdout": scaled(held) if isinstance(held, Measurements) else held,
    }


def arguments(job: Calibration, sources: Sources, tell: Tell) -> dict[str, Any]:
    """Arguments of `identify` beside the machine.

    Raises
    ------
    ValueError
        An option that says nothing of this machine, or of these measurements.
    """
    machine = as_machine(sources.robot)
    measured, held, dropped = _rows(job, sources, tell)
    words = {
        "loss": word("--loss", job.loss, LIMITS),
        "rule": word("--covariance", job.covariance, RULES),
    }
    free, fixed = _free(job, machine)
    return {
        "measurements": measured[0] if len(measured) == 1 else measured,
        "free": free,
        "prior": read_prior(job.prior, machine, free or ()),
        "loss": words["loss"] if words["rule"] == "auto" else tuple(words.values()),
        "unknown": _unknown(job, sources),
        "holdout": held,
        "per_session": _anew(job),
        "fix": fixed,
        "drop": dropped,
        "effects": _effects(job),
        "uncertainty": read_uncertainty(job.uncertainty, job.consider, machine),
    }


def _rows(
    job: Calibration, sources: Sources, tell: Tell
) -> tuple[list[Measurements], float | Measurements | None, list[int | Found]]:
    """Measurements to fit, those to hold out, and the rows to leave out."""
    measured = list(sources.measured)
    held: float | Measurements | None = sources.held
    if held is None and job.holdout is not None:
        number = typed(job.holdout)
        held = int(number) if number.is_integer() else number
    if job.approach is not None:
        measured = [_approached(job.approach, each) for each in measured]
        held = _approached(job.approach, held) if isinstance(held, Measurements) else held
    if job.session or _anew(job):
        files = [Path(job.files[k]) for k in sources.file_of]
        named = _for_sets("--session", job.session, job, sources) if job.session else ()
        measured, held = in_sessions(files, measured, named, job.holdout, held)
    if job.tracker is not None:
        tracker = read_tracker(job.tracker)
        measured = [_seen_by(tracker, each) for each in measured]
    dropping: Sequence[str] = job.drop
    if isinstance(held, Measurements):
        dropping, held = without_lines(dropping, held, measured, tell)
    dropped: list[int | Found] = [*rows_to_drop(dropping, measured)]
    found: dict[Found, bool] = {"outliers": job.drop_outliers, "slack": job.drop_slack}
    return measured, held, [*dropped, *(each for each, asked in found.items() if asked)]


def _free(job: Calibration, machine: Calibratable) -> tuple[list[str] | None, list[str]]:
    """Numbers to identify, and those to hold; None: all that the machine's file frees."""
    datum = word("--datum", job.datum, ("none", "auto")) == "auto"
    fixed = matching("--fix", machine, job.fix)
    held = [*fixed, *["datum"] * datum]
    if job.free == ("none",):  # frame, tool and lens alone
        return [], held
    free = [name for name in free_names(machine, job.free) if name not in fixed]
    if fixed and not free:
        raise ArgumentError(f"--fix {','.join(job.fix)}: no parameter is left free")
    return free or None, held


def _effects(job: Calibration) -> Any:
    moving = read_effects(job.effects or ["none"])
    coefficients = read_coefficients("--expansion", job.expansion)
    if coefficients is None:
        return moving
    if moving == AUTO:
        raise ArgumentError(f"{OPTION} auto is for arms, --expansion for other machines")
    return [*moving, Expansion(coefficients)]


def _anew(job: Calibration) -> list[str]:
    """Names of numbers that are found anew in each session."""
    return [name.strip() for text in job.per_session for name in text.split(",")]


def _unknown(job: Calibration, sources: Sources) -> dict[Role, Known | list[Known]]:
    """Return the unknowns by ``--frame``, ``--target`` and ``--attachment``, for each file."""
    frame, target = job.frame, job.target
    if job.reading.from_pnp is not None:  # of a camera neither is known
        frame = target = "unknown"
    return {
        "frame": _known("--frame", frame, job, sources),
        "target": _known("--target", target, job, sources),
        "attachment": _known("--attachment", job.attachment, job, sources),
    }


def _known(option: str, text: str, job: Calibration, sources: Sources) -> Known | list[Known]:
    """Return words, one for all files or one for each."""
    words = [word(option, part.strip(), KNOWN) for part in text.split(",")]
    return words[0] if len(words) == 1 else _for_sets(option, words, job, sources)


def _for_sets(option: str, given: Sequence[T], job: Calibration, sources: Sources) -> list[T]:
    """Return the words of each file, for each set of measurements."""
    if len(given) != len(job.files):
        what = "names" if option == "--session" else "words"
        raise ArgumentError(
            f"{option} {','.join(map(str, given))}: {len(given)} {what} for {len(job.files)} files"
        )
    return [given[k] for k in sources.file_of]


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
