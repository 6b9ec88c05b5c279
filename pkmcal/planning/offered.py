"""The choice of a plan: candidates that can be measured, and the information of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import word, words
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray, IntArray, as_rows
from pkmcal.effects.effect import Effects
from pkmcal.effects.stated import effects_on
from pkmcal.estimation.parameters import Parameters, Prior
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.calibratable import Calibratable, as_machine, as_parallel
from pkmcal.kinematics.perturbed import ideal
from pkmcal.kinematics.pulled import pulled
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.planning.optimal_design import Criterion, Design
from pkmcal.planning.planned import (
    Unknown,
    as_measured,
    brought,
    design_of,
    equations_of,
    information,
    planned,
    read_at,
    stated_loads,
    together,
    under,
)
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import KINDS, Kind, as_reading

Planned = Kind | Reading
PLANNED: tuple[Kind, ...] = tuple(each for each, of in KINDS.items() if of.planned)

_ERROR = 0.5  # mm; what numbers may be off by that have no prior
_TIMES, _MACHINES = 2.0, 16  # so many machines with so many times these errors must get there
_FOUND = 1e-6  # mm, rad: how near to a pose forward kinematics must end


@dataclass(frozen=True, eq=False)
class Offered:
    """Candidates that can be measured, each of every kind under every load, and what they bring.

    Attributes
    ----------
    poses, actuators : ndarray (N, 6), (N, n)
        Of the candidates.
    indices : ndarray of int (N,)
        Which of those that were given they are.
    given : int
        How many those were.
    unpulled : int
        At how many within limits some cable would have to push.
    kinds : sequence of str or Reading
        What can be measured.
    loads : sequence of Load or None
        What the machine carries in turn.
    sort : ndarray of int (kinds × loads × N,)
        Which of the kinds each choice of `design` is.
    points : dict of kinds to ndarray (k, 3)
        Measured points that were stated.
    parameters : Parameters
        What a calibration is to find.
    design : Design
        What each choice brings.
    own_frame : bool
        Whether predicted errors are those in the machine's own frame.
    noise : float
        Of the instrument, mm; NaN unless all readings have one.
    """

    machine: Calibratable
    poses: FloatArray
    actuators: FloatArray
    indices: IntArray
    given: int
    unpulled: int
    kinds: Sequence[Planned]
    loads: Sequence[Load | None]
    sort: IntArray
    points: Mapping[Any, FloatArray]
    parameters: Parameters
    design: Design
    own_frame: bool
    noise: float


def offered(
    robot: Robot | SerialArm,
    candidates: ArrayLike,
    kinds: Sequence[Planned],
    *,
    targets: ArrayLike | None,
    direction: ArrayLike | None,
    criterion: Criterion,
    target: ArrayLike | Mapping[Any, ArrayLike] | None,
    noise: float | Tracker | Mapping[Any, float | Tracker],
    free: str | Sequence[str] | None,
    prior: Prior,
    unknown: Unknown | Sequence[Unknown],
    actuator_noise: ArrayLike | None,
    payloads: Sequence[float | Load],
    effects: Effects,
    measured: Measurements | None,
) -> Offered:
    """Candidates to choose from; arguments as `plan_poses` takes them.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit; no candidate within limits; unidentifiable parameters that
        move the targets.
    """
    machine = as_machine(robot)
    machine, others, of_effects = effects_on(machine, effects)
    if others:
        raise ArgumentError(f"effects: {others[0].name} follows rows, which a plan has not yet")
    loads = stated_loads(machine, payloads)
    poses, q, inside, given, unpulled = _within_limits(machine, candidates, loads)
    mounted = not all(as_reading(each).placed for each in kinds)
    able = read_at(machine, q, kinds)
    if not able.any():
        raise ArgumentError(
            f"candidates: at none of {len(q)} is the whole board in the picture: offer"
            " poses at which it is before the camera (--poses, --within)"
        )
    poses, q, inside = poses[able], q[able], inside[able]
    aims = (poses, q) if targets is None else _aims(machine, targets)
    distinct, place = np.unique(q, axis=0, return_inverse=True)
    stated = {each: _of("target", target, each, kinds) for each in kinds}
    points = {k: as_rows("target", at, 3)[0] for k, at in stated.items() if at is not None}
    noises = [_of("noise", noise, each, kinds) for each in kinds]
    sets = [
        planned(machine, distinct, each, points.get(each), own, actuator_noise, load)
        for each, own in zip(kinds, noises, strict=True)
        for load in loads
    ]
    before = [] if measured is None else [_before(machine, measured, unknown)]
    equations = equations_of(machine, [*sets, *before], free, prior, unknown, of_effects)
    equations, of_before = equations[: len(sets)], equations[len(sets) :]
    there = brought(of_before) if of_before else None
    parameters = equations[0].parameters
    safe = _safe(parameters, poses, q)
    rows = place.reshape(-1)[safe]
    blocks = together([information(each, len(distinct))[rows] for each in equations])
    sort = np.repeat(np.arange(len(kinds)), len(loads) * len(rows))
    design, own_frame = design_of(
        parameters, blocks, sort, *aims, criterion, loads, mounted, there, _unit(direction)
    )
    return Offered(
        machine=machine,
        poses=poses[safe],
        actuators=q[safe],
        indices=inside[safe],
        given=given,
        unpulled=unpulled,
        kinds=kinds,
        loads=loads,
        sort=sort,
        points=points,
        parameters=parameters,
        design=design,
        own_frame=own_frame,
        noise=_one_noise(kinds, noises),
    )


def known_kind(kind: Planned) -> Planned:
    """A kind of reading that can be planned.

    Raises
    ------
    ValueError
        A word that is none.
    """
    return kind if isinstance(kind, Reading) else word("kind", kind, PLANNED)


def name_of(kind: Planned) -> str:
    """Return the word that stands for a kind of reading."""
    return as_reading(kind).name


def along(direction: FloatArray | None) -> str:
    """Words for the direction in which errors count: its axis, or its numbers."""
    if direction is None:
        return ""
    axes = np.flatnonzero(direction)
    shown = "xyz"[axes[0]] if len(axes) == 1 else ",".join(f"{x:g}" for x in direction)
    return f" along {shown}"


def _unit(direction: ArrayLike | None) -> FloatArray | None:
    if direction is None:
        return None
    found = as_rows("direction", direction, 3)[0]
    length = np.linalg.norm(found)
    if found.shape != (1, 3) or not length > 0.0:
        raise ArgumentError(f"direction: expected three numbers, not all 0; found {direction!r}")
    return np.asarray(found[0] / length, dtype=np.float64)


def _one_noise(kinds: Sequence[Planned], noises: Sequence[float | Tracker]) -> float:
    """The deviation of all readings, mm; NaN where they have several, or read angles."""
    lengths = all(set(as_reading(each).units) == {"mm"} for each in kinds)
    if not lengths or any(isinstance(own, Tracker) for own in noises) or len(set(noises)) > 1:
        return float("nan")
    return float(noises[0])  # type: ignore[arg-type]


def _before(
    machine: Calibratable, measured: Measurements, unknown: Unknown | Sequence[Unknown]
) -> Measurements:
    if not isinstance(measured, Measurements):
        raise ArgumentTypeError(f"measured must be Measurements, found {measured!r}")
    if "target" in words("unknown", unknown):
        raise ArgumentError("measured, unknown: rows that are there need a target that is known")
    return as_measured(machine, measured)


def _of(name: str, given: Any, kind: Planned, kinds: Sequence[Planned]) -> Any:
    """Value of an argument for one kind: one for all, or by kind."""
    if not isinstance(given, Mapping):
        return given
    for each in given:
        if each not in kinds:
            raise ArgumentError(
                f"{name}: the plan has {', '.join(map(name_of, kinds))}; found {each!r}"
            )
    if not given or (kind not in given and name == "noise"):
        raise ArgumentError(f"{name}: of {name_of(kind)} not stated; found {given!r}")
    return given.get(kind)


def _commanded(name: str, robot: Calibratable, places: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Poses and actuators of poses, or of an arm's joint coordinates; NaN where there are none."""
    if (parallel := as_parallel(robot)) is not None:
        there, q, _ = ideal(parallel, as_rows(name, places, 6)[0])
    else:
        there, q, _ = robot.commanded(as_rows(name, places, robot.n_actuators)[0])
    return there, q


def _aims(robot: Calibratable, targets: ArrayLike) -> tuple[FloatArray, FloatArray]:
    there, q = _commanded("targets", robot, targets)
    unreached = np.flatnonzero(~np.isfinite(there).all(axis=1))
    if len(unreached):
        raise ArgumentError(f"targets: {robot.name} has no such pose (row {unreached[0]})")
    return there, q


def _within_limits(
    robot: Calibratable, candidates: ArrayLike, loads: Sequence[Load | None]
) -> tuple[FloatArray, FloatArray, IntArray, int, int]:
    """Poses and actuators of the candidates that can be measured, which ones, and of how many.

    Last, at how many within limits some cable would have to push.
    """
    there, q = _commanded("candidates", robot, candidates)
    good = np.asarray(np.isfinite(there).all(axis=1))
    unpulled = 0
    if (parallel := as_parallel(robot)) is not None:  # the file of an arm has no limits
        good[good] = parallel.feasible(there[good]).ok
        held = pulled(parallel, there[good])
        unpulled = int((~held).sum())
        good[good] = held
    # `identify` starts from home, too, and must find them
    good[good] = np.abs(robot.forward(q[good]).pose - there[good]).max(axis=1) < _FOUND
    for load in loads:
        if load is not None:  # beside a singularity a machine gives way
            good[good] = under(robot, load).forward(q[good]).ok
    inside = np.flatnonzero(good)
    if not len(inside):
        raise ArgumentError(
            f"candidates: none of {len(there)} is within the limits of {robot.name}"
            + (f"; at {unpulled} some cable would have to push" if unpulled else "")
        )
    return there[inside], q[inside], inside, len(there), unpulled


def _safe(chosen: Parameters, poses: FloatArray, q: FloatArray) -> BoolArray:
    """Mask of candidates that machines with errors reach, too: none beside a singularity."""
    k = len(chosen.places)
    sigma = np.minimum(chosen.prior, _ERROR * chosen.scale)[:k]
    random, values = np.random.default_rng(0), chosen.robot.geometry.values
    safe = np.ones(len(q), dtype=bool)
    for _ in range(_MACHINES):
        erroneous = values.copy()
        erroneous[chosen.places] += _TIMES * sigma * random.standard_normal(k)
        machine = chosen.robot.with_values(erroneous)
        safe[safe] = machine.forward(q[safe], guess=poses[safe]).ok
    if not safe.any():
        raise ArgumentError(
            "candidates: all are so near a singularity that errors bar the way there"
        )
    return safe
