"""Information that planned poses would bring to a calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import word, words
from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.identifiability import as_sum, sparse_basis
from pkmcal.estimation.parameters import Asked, Parameters, Prior
from pkmcal.estimation.starts import with_starts
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.fitted.machine_accuracy import UNDETERMINED
from pkmcal.geometry.carried import Load
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.planning.optimal_design import Criterion, Design
from pkmcal.readings import orientation
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import Kind, as_reading
from pkmcal.statistics.linear_fit import column_basis

Unknown = Literal["frame", "target"]
UNKNOWN: tuple[Unknown, ...] = ("frame", "target")

_MANY = 12  # equations of a pose, such as a picture has
_TOGETHER = 1024  # targets of which derivatives are made at once, as many as caches hold
_NOTHING = 1e-12  # share of what the most telling direction is told, that is rounding


def planned(
    robot: Calibratable,
    q: FloatArray,
    kind: Kind | Reading,
    several: FloatArray | None,
    noise: float | Tracker,
    actuator_noise: ArrayLike | None,
    load: Load | None = None,
) -> Measurements:
    """Make the planned measurements, rows of a pose one after another; `several` are targets."""
    if robot.model.balanced_load is not None:
        raise ArgumentError(
            f"robot: plans know no load cells, and tensions of {robot.name} are to balance its load"
            " ([load] balance)"
        )
    surplus = pose_steps.surplus(robot) > 0
    if surplus and actuator_noise is None:
        raise ArgumentError(
            f"actuator_noise: {robot.name} has more actuators than ways to move, which are"
            " measured, too: state how well they are read"
        )
    count = 1 if several is None else len(several)
    instrument = as_reading(kind)
    if needed := (*instrument.per_row, *instrument.labels):
        raise ArgumentError(
            f"kind: {instrument.noun()} state {needed[0]} for every row, and poses of a plan have"
            " none yet"
        )
    rows, instrument = instrument.of_poses(np.repeat(q, count, axis=0))
    if not instrument.components:
        if not surplus:
            raise ArgumentError(
                f"kind: poses of {robot.name} follow from its actuators, which alone say nothing of"
                " its geometry: measure something else"
            )
        measured = Measurements(
            rows, None, instrument, actuator_units=robot.actuator_units, load=load
        )
    else:
        places = None if several is None else np.tile(several, (len(q), 1))
        measured = VirtualMachine(robot, noise).measure(rows, instrument, places, load=load)
        if measured.sigma is None:
            raise ArgumentError(
                f"noise must be above 0, found {noise}: without it any poses will do"
            )
        # a frame laid through noise is tilted by as much as heights can tell, and what is never
        # seen of a level machine would seem to be
        exact = VirtualMachine(robot, 0.0).measure(rows, instrument, places, load=load)
        measured = replace(measured, values=exact.values)
        if several is not None:
            index = np.tile(np.arange(count), len(q))
            measured = replace(measured, target=several, target_index=index)
    if actuator_noise is None:
        if not instrument.tells_actuators:
            return measured
        actuator_noise = 0.0
    return replace(measured, actuator_sigma=np.asarray(actuator_noise, dtype=np.float64))


def as_measured(robot: Calibratable, measured: Measurements) -> Measurements:
    """Rows that are there, as this machine would read them without noise.

    Raises
    ------
    ValueError
        Their noise is not known, a value is missing, or they state what a plan does not follow.
    """
    instrument = measured.instrument
    for name in ("load", "tension", "temperature", "approach"):
        if getattr(measured, name) is not None:
            raise ArgumentError(f"measured: rows state {name}, which plans do not follow")
    if needed := (*instrument.per_row, *instrument.labels):
        raise ArgumentError(f"measured: {instrument.noun()} state {needed[0]}: plans know none")
    if not instrument.components:
        raise ArgumentError("measured: rows of actuators alone are not followed by plans yet")
    if measured.sigma is None:
        raise ArgumentError("measured: state sigma, what their noise is, as in Measurements")
    values = measured.values.reshape(len(measured), -1)
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise ArgumentError(f"measured: row {first} is not read whole; select the others")
    places = measured.target
    if places is not None and measured.target_index is not None:
        places = places[measured.target_index]
    exact = VirtualMachine(robot, 0.0).measure(measured.actuators, instrument, places)
    if not np.isfinite(exact.values).all():
        raise ArgumentError(f"measured: at some of the rows {robot.name} has no pose")
    return replace(measured, values=exact.values)


def read_at(robot: Calibratable, q: FloatArray, kinds: Sequence[Kind | Reading]) -> BoolArray:
    """Poses (N,) at which every instrument reads all that it has to."""
    able = np.ones(len(q), dtype=bool)
    for instrument in map(as_reading, kinds):
        rows, own = instrument.required(q)
        if len(rows) > len(q):
            seen = np.isfinite(VirtualMachine(robot, 0.0).measure(rows, own).values)
            able &= seen.reshape(len(q), -1).all(axis=1)
    return able


def stated_loads(robot: Calibratable, payloads: Sequence[float | Load]) -> list[Load | None]:
    """Return the loads to be carried; `[None]` where the file states them.

    Raises
    ------
    ValueError, TypeError
        Nothing of the machine yields, no payload, a load of several rows.
    """
    if isinstance(payloads, int | float | Load) or not all(
        isinstance(each, int | float | np.number | Load) for each in payloads
    ):
        raise ArgumentTypeError(
            f"payloads must be several masses in kg, or Loads, such as [0, 100]; found {payloads!r}"
        )
    found = [each if isinstance(each, Load) else Load(mass=each) for each in payloads]
    for each in found:
        each.rows(())
        if not robot.yields:
            what = "joint*" if robot.kind == "arm" else "offset*"
            raise ArgumentError(
                f"payloads: nothing of {robot.name} yields: plan with effects="
                f"[pk.Elasticity('{what}')], --effects 'elasticity={what}', state stiffness in its"
                " file, or give robot.yielding(…)"
            )
    return [*found] or [None]


def under(robot: Calibratable, load: Load | None) -> Calibratable:
    """The machine with what it is to carry."""
    return robot if load is None else robot.under(load)


def equations_of(
    robot: Calibratable,
    sets: Sequence[Measurements],
    free: str | Sequence[str] | None,
    prior: Prior,
    unknown: str | Sequence[str],
    of_effects: Mapping[str, float],
) -> list[Equations]:
    """The equations that each set has in the calibration to come of all.

    `of_effects` are numbers that effects free beside, with deviations of what is known of each.
    """
    roles = words("unknown", unknown)
    for each in roles:
        word("unknown", each, UNKNOWN)
    datasets = [
        FitData(measured, np.arange(len(measured)), "frame" in roles, "target" in roles)
        for measured in sets
    ]
    datasets = with_starts(robot, datasets)
    chosen = parameters(robot, datasets, Asked(free, prior, of_effects=of_effects))
    return [Equations.of([data], chosen) for data in datasets]


def information(equations: Equations, poses: int) -> FloatArray:
    """Return the information of each pose (N, k, n): its derivatives, whitened and scaled."""
    equations, rows = _derivatives(equations)
    block_of_row = equations.blocks.block_of_row
    first = np.arange(0, len(block_of_row), len(block_of_row) // poses)
    if not equations.machines.unknowns:  # rows are blocks, in their order
        return compressed(rows.reshape(poses, -1, rows.shape[1]))
    units: FloatArray = rows.reshape(len(equations.blocks.components), -1, rows.shape[1])
    return units[block_of_row[first]]


def brought(equations: Sequence[Equations]) -> FloatArray:
    """Return the information of all rows of some sets (p, n), as `information` of poses has it."""
    rows = [_derivatives(each)[1] for each in equations]
    return np.asarray(np.linalg.qr(np.vstack(rows), mode="r"), dtype=np.float64)


def _derivatives(equations: Equations) -> tuple[Equations, FloatArray]:
    """Equations at their start, and their rows by the parameters, whitened and scaled."""
    equations, at = equations.begin(equations.with_exact_actuators().start())
    rows = equations.by_parameters(at, np.ones(len(equations.blocks.unstated)))
    rows *= equations.parameters.scale
    return equations, rows


def compressed(blocks: FloatArray) -> FloatArray:
    """Blocks (N, k, n) that say as much with fewer rows, where they have many."""
    if blocks.shape[1] <= _MANY:
        return blocks
    _, size, axes = np.linalg.svd(blocks, full_matrices=False)
    told = int((size > _NOTHING * size.max()).sum(axis=1).max(initial=1))
    return np.asarray(size[:, :told, None] * axes[:, :told], dtype=np.float64)


def together(parts: Sequence[FloatArray]) -> FloatArray:
    """Blocks (N, k, n) of several sets as one, with rows of zeros where one has fewer equations."""
    if len(parts) == 1:
        return parts[0]
    most = max(part.shape[1] for part in parts)
    padded = [np.pad(part, ((0, 0), (0, most - part.shape[1]), (0, 0))) for part in parts]
    return np.concatenate(padded)


def design_of(
    chosen: Parameters,
    blocks: FloatArray,
    sort: IntArray,
    aims: FloatArray,
    aims_at: FloatArray,
    criterion: Criterion,
    loads: Sequence[Load | None] = (None,),
    mounted: bool = False,
    there: FloatArray | None = None,
    direction: FloatArray | None = None,
) -> tuple[Design, bool]:
    """The design, and whether its errors, under each load, are in the machine's own frame.

    `mounted`: what is on the platform has to be found, so that its frame is the machine's own, too.
    `there` (p, n) is what rows that are measured already bring. Errors count along `direction`
    (1, 3) alone, where one is stated.
    """
    aimed = np.concatenate([_aimed(chosen, load, aims, aims_at) for load in loads])
    aims = np.tile(aims, (len(loads), 1))
    along = np.eye(3) if direction is None else direction
    if direction is not None:
        aimed = direction @ aimed
    if not np.isfinite(blocks).all() or not np.isfinite(aimed).all():
        raise ArgumentError(
            "candidates or targets: one is singular, where nothing holds the platform"
        )

    def design(aimed: FloatArray) -> Design:
        rows = chosen.prior_rows(chosen.start)
        if there is not None:
            rows = np.vstack([rows, there])
        return Design(blocks, rows, aimed, criterion, chosen.robot.length, sort)

    made = design(aimed)
    moved = aimed.reshape(-1, len(chosen)) @ made.unidentifiable
    if np.abs(moved).max(initial=0.0) <= UNDETERMINED:
        return made, False
    motions = _rigid_motions(aims[:, :3])
    if mounted:  # points of the platform, as far from its origin everywhere
        turned = orientation.rotations(aims[:, 3:])
        motions = np.concatenate([motions, turned], axis=2)
    motions = along @ motions
    rigid = column_basis(motions.reshape(-1, motions.shape[2]))
    within = rigid.T @ moved
    if np.abs(moved - rigid @ within).max() <= UNDETERMINED * np.abs(moved).max():
        ways, sizes, _ = np.linalg.svd(within)
        frame = rigid @ ways[:, : np.count_nonzero(sizes > UNDETERMINED * sizes[0])]
        flat = aimed.reshape(len(moved), -1)
        return design((flat - frame @ (frame.T @ flat)).reshape(aimed.shape)), True
    first = sparse_basis(made.unidentifiable, chosen.families)[:, 0]
    unknown = as_sum(first, chosen.names, chosen.units, chosen.scale)
    raise ArgumentError(
        f"candidates: not even all of them identify {unknown}, which moves the targets;"
        " offer others, free fewer parameters or state a prior"
    )


def _aimed(
    chosen: Parameters, load: Load | None, aims: FloatArray, aims_at: FloatArray
) -> FloatArray:
    """Return the derivatives of targets (T, 3, n) by the scaled parameters, under a load."""
    k, machine = len(chosen.places), under(chosen.robot, load)
    found = np.zeros((len(aims), 3, len(chosen)))
    for some in lots(len(aims), _TOGETHER):
        twists = machine.error_twists(aims[some], aims_at[some])
        np.multiply(twists[:, 3:, chosen.places], chosen.scale[:k], out=found[some, :, :k])
    return found


def _rigid_motions(points: FloatArray) -> FloatArray:
    """Return rigid motions of points (T, 3), (T, 3, 6): shifts, then turns about their middle."""
    away = (points - points.mean(axis=0))[:, None]
    turns = np.cross(np.eye(3)[None], away).transpose(0, 2, 1)
    shifts = np.broadcast_to(np.eye(3), turns.shape)
    return np.concatenate([shifts, turns], axis=2)
