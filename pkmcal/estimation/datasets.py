"""Measurements as `identify` is given them, with what is unknown of each set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from pkmcal.arguments import instance, word
from pkmcal.effects.effect import Effect
from pkmcal.estimation.closures import has_equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import KNOWN, Known
from pkmcal.estimation.pose_table import tells_actuators
from pkmcal.estimation.runs import runs_apart
from pkmcal.estimation.sessions import in_sessions, set_names
from pkmcal.estimation.shapes import require_members
from pkmcal.estimation.starts import with_starts
from pkmcal.estimation.tensioned_poses import unknown_tensions
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.pose_steps import surplus
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading

Said = Mapping[str, Known | Sequence[Known]]  # of "frame", "target" and "attachment"


def as_fit_data(
    robot: Calibratable,
    measurements: Measurements | Sequence[Measurements],
    said: Said,
    sessions: bool,
    effects: tuple[Effect, ...] = (),
) -> list[FitData]:
    """The sets of measurements with what is unknown of each, as `identify` was told.

    With `sessions` every row gets a session.
    """
    sets = list(measurements) if isinstance(measurements, Iterable) else [measurements]
    for measured in sets:
        _check(robot, measured, "measurements")
    if not sets:
        raise ArgumentError("measurements: none given")
    _require_one_class(sets)
    sets = runs_apart(sets)
    if sessions:
        sets = in_sessions(sets)
    datasets, first = [], 0
    unknown = zip(*(_unknown(name, given, len(sets)) for name, given in said.items()), strict=True)
    for measured, flags, name in zip(sets, unknown, set_names(sets), strict=True):
        rows = np.arange(first, first + len(measured))
        frame, target, attachment = flags
        datasets.append(FitData(measured, rows, frame, target, attachment, name, effects=effects))
        first += len(measured)
    known = [data.measured.actuator_sigma is not None for data in datasets]
    if any(known) and not all(known):
        raise ArgumentError("measurements: state actuator_sigma of all sets, or of none")
    if any(data.unknown_frame for data in datasets) and not any(data.framed for data in datasets):
        raise ArgumentError(f"frame: {_of_kinds(sets)} do not depend on it, it cannot be unknown")
    _require_one_frame(datasets)
    attached = any(data.measured.instrument.unknown_with_attachment for data in datasets)
    if any(data.unknown_attachment for data in datasets) and not attached:
        raise ArgumentError(f"attachment: {_of_kinds(sets)} have none, it cannot be unknown")
    return with_starts(robot, datasets)


def _of_kinds(sets: Sequence[Measurements]) -> str:
    """What was measured, in words."""
    return " and ".join(dict.fromkeys(measured.instrument.noun() for measured in sets))


def _require_one_frame(datasets: Sequence[FitData]) -> None:
    """Refuse readings of different things that would share a frame."""
    first = dict[tuple[str, str], Reading]()
    for data in datasets:
        if data.frame is None:
            continue
        mine = data.measured.instrument
        two = (first.setdefault(data.frame, mine), mine)
        if two[0].stands_by != mine.stands_by:
            one, other = (each.stands_by or "another instrument" for each in two)
            cure = next(filter(None, (each.told_apart_by for each in two)), "state frame_name")
            raise ArgumentError(
                f"measurements: {one} and {other} stand each in a place of its own: {cure}"
            )


def informative(machine: Calibratable, datasets: list[FitData]) -> tuple[list[FitData], int]:
    """Leave rows out that say nothing, and count them.

    Those are rows of which nothing was read, where actuators are no more than closures need: the
    pose takes whatever they read. Rows of one `group` have a pose that another one may tell.
    """
    sets = [data.measured for data in datasets]
    if unknown_tensions(machine, sets):
        return datasets, 0
    sigmas = [measured.actuator_sigma for measured in sets]
    equations = has_equations(machine, sigmas, tells_actuators(sets))
    spare = surplus(machine) > 0
    kept, unread = [], 0
    for data in datasets:
        values = data.measured.values.reshape(len(data.measured), -1)
        told = spare or data.measured.group is not None
        if equations and told and not data.measured.instrument.tells_actuators:
            kept.append(data)
            continue
        read = np.asarray(np.isfinite(values).any(axis=1))
        unread += int((~read).sum())
        if read.all():
            kept.append(data)
        elif read.any():
            kept.append(data.select(read))
    if not kept:
        raise ArgumentError(
            f"measurements: nothing was read but the actuators; poses of {machine.name} follow from"
            " these, which then say nothing of its geometry: measure where its platform is, or how"
            " far from something"
        )
    return kept, unread


def as_fitted(
    robot: Calibratable, holdout: Measurements, datasets: Sequence[FitData], sessions: bool
) -> tuple[FitData, int]:
    """Hold other measurements out, with what is unknown of the fitted set of their kind.

    And with the noise of its actuators, where their own is not stated. With `sessions`, rows that
    state none are of that of their file if it was fitted, else of another.
    """
    _check(robot, holdout, "holdout")
    fitted = dict.fromkeys(name for data in datasets for name in data.measured.sessions)
    if sessions and holdout.session is None:
        file = PurePath(holdout.file).stem
        holdout = in_sessions([holdout], () if file in fitted else fitted, "holdout")[0]
    alike = [i for i, data in enumerate(datasets) if data.measured.kind == holdout.kind]
    alike.sort(key=lambda i: not {*datasets[i].measured.sessions} & {*holdout.sessions})
    i = alike[0] if alike else 0
    of_actuators = datasets[i].measured.actuator_sigma
    if holdout.actuator_sigma is None and of_actuators is not None:
        holdout = replace(holdout, actuator_sigma=np.sqrt(np.mean(of_actuators**2, axis=0)))
    of_cells = datasets[i].measured.tension_sigma
    if holdout.tension_sigma is None and of_cells is not None and holdout.tension is not None:
        holdout = replace(holdout, tension_sigma=np.sqrt(np.mean(of_cells**2, axis=0)))
    (holdout,) = runs_apart([holdout], [data.measured for data in datasets])
    data = replace(datasets[i], measured=holdout, rows=np.arange(len(holdout)))
    return with_starts(robot, [data])[0], i


def roles_of(datasets: Sequence[FitData]) -> tuple[str, ...]:
    """The roles of what some readings depend on that `identify` may be told to find."""
    words = ("frame", "target", "attachment")
    return tuple(dict.fromkeys(r for data in datasets for word in words for r in data.roles(word)))


def by_set(said: Said, datasets: Sequence[FitData]) -> frozenset[str]:
    """Return the roles that are unknown in several sets, apart for each."""
    apart = [
        name
        for name, given in said.items()
        if not isinstance(given, str)
        and isinstance(given, Iterable)
        and list(given).count("unknown") > 1
    ]
    return frozenset(role for name in apart for data in datasets for role in data.roles(name))


def _require_one_class(sets: Sequence[Measurements]) -> None:
    """Refuse readings of two classes that have one name, by which they would be taken for alike."""
    found = dict[str, type]()
    for of in (type(measured.instrument) for measured in sets):
        if (other := found.setdefault(of.name, of)) is not of:
            classes = " and ".join(f"{each.__module__}.{each.__qualname__}" for each in (other, of))
            raise ArgumentError(
                f"measurements: the classes {classes} have one name, {of.name!r}, and are no one"
                " kind of reading; give one of them another name"
            )


def _check(robot: Calibratable, measured: Measurements, argument: str) -> None:
    n = instance(argument, measured, Measurements).actuators.shape[1]
    require_members(measured, robot.length)
    if n != robot.n_actuators:
        raise ArgumentError(
            f"{argument}: {robot.name} has {robot.n_actuators} actuators, found {n} per row"
        )
    if measured.actuator_units not in (None, robot.actuator_units):
        raise ArgumentError(
            f"{argument}: the actuators of {robot.name} are in {', '.join(robot.actuator_units)},"
            f" found {', '.join(measured.actuator_units or ())}"
        )


def _unknown(argument: str, given: str | Sequence[str], count: int) -> list[bool]:
    alone = isinstance(given, str) or not isinstance(given, Iterable)
    said = [given] * count if alone else list(given)
    if len(said) != count:
        raise ArgumentError(f"{argument}: one word for each of {count} sets, found {len(said)}")
    return [word(argument, each, KNOWN) == "unknown" for each in said]
