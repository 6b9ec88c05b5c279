"""The rows of all sets of measurements, and the distinct poses they were read at."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, held_once
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.tensioned_poses import Cells, cells_of, check_cells
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.drive_state import DriveState
from pkmcal.measurements import repeats
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tension import filled_tension
from pkmcal.result import ReadOnly
from pkmcal.statistics.linear_fit import numbered

_ENOUGH = 8  # rows of a pose, of two numbers each, from which they tell how actuators scatter
CHANCE = 3  # rows of a set that may equal those of another one by coarse digits alone


@dataclass(frozen=True, eq=False)
class PoseTable(ReadOnly):
    """The rows of all sets, and the distinct poses that they were read at.

    Rows with the same actuators, and the same noise of these, are at one pose. Where nothing else
    was read, each such row is a reading of the actuators that has a pose of its own.

    Attributes
    ----------
    sets : tuple of Measurements
        The rows of each set.
    rows : ndarray of int (N,)
        Their numbers in what the user gave.
    set_of : ndarray of int (N,)
        Which set each row is of.
    count : ndarray of int (N,)
        How many numbers were read in each row.
    pose_of : tuple of ndarray of int
        Which pose each row of each set is at.
    other_of : tuple of ndarray of int or None
        At which other pose it ends, of distances between two.
    actuators : ndarray (K, n)
        What the actuators read at each pose.
    actuator_sigma : ndarray (K, n) or None
        Its stated deviations.
    estimated : bool
        Whether these are not stated, and what was read tells them: `tells_actuators`.
    state : DriveState
        From where the actuators came, and the tension of what they drive, (K, n) each.
    cells : Cells or None
        What load cells read, where tensions are unknown.
    columns : ndarray of int (P, m)
        The parameter that each number of a row is, of each part: rows of one session and one set.
    part_of : tuple of ndarray of int
        Of each row of each set.
    machine_columns : ndarray of int (S, g)
        The parameters of the geometry of each machine: one, or one a session.
    machine_of_pose, command_of_pose : ndarray of int (K,)
        Which of them each pose is of, and which poses are at the same actuators.
    """

    sets: tuple[Measurements, ...]
    rows: IntArray
    set_of: IntArray
    count: IntArray
    pose_of: tuple[IntArray, ...]
    other_of: tuple[IntArray | None, ...]
    actuators: FloatArray
    actuator_sigma: FloatArray | None
    estimated: bool
    state: DriveState
    cells: Cells | None
    columns: IntArray
    part_of: tuple[IntArray, ...]
    machine_columns: IntArray
    machine_of_pose: IntArray
    command_of_pose: IntArray

    @property
    def poses_of_machine(self) -> tuple[IntArray, ...]:
        """The poses of each machine."""
        machines = range(len(self.machine_columns))
        return tuple(np.flatnonzero(self.machine_of_pose == s) for s in machines)

    def with_parameters(
        self, datasets: Sequence[FitData], parameters: Parameters
    ) -> PoseTable | None:
        """The table of the same rows by other parameters; None where its poses are others.

        That is where machines of sessions differ that did not, or the reverse.
        """
        columns, part_of = parameters.columns_of(datasets)
        machine_columns, machine_of = _machines(columns[:, : len(parameters.places)], part_of)
        pairs = zip(machine_of, self.pose_of, strict=True)
        if len(machine_columns) != len(self.machine_columns) or not all(
            np.array_equal(of_row, self.machine_of_pose[pose]) for of_row, pose in pairs
        ):
            return None
        return replace(self, columns=columns, part_of=part_of, machine_columns=machine_columns)


def pose_table(datasets: Sequence[FitData], parameters: Parameters) -> PoseTable:
    """Find the distinct poses of the rows.

    Machines of different sessions are not at the same pose at the same actuators.
    """
    robot = parameters.robot
    columns, part_of = parameters.columns_of(datasets)
    sets = tuple(data.measured for data in datasets)
    double = [i for i, m in enumerate(sets) if m.other is not None]
    rows = np.concatenate([data.rows for data in datasets])
    sources = [*sets, *(sets[i] for i in double)]
    _require_loads(robot, sets)
    cells = cells_of(robot, sources)
    known = _commands(sets, sources, cells)
    commands = np.hstack([*known.values()])
    machine_columns, machine_of = _machines(columns[:, : len(parameters.places)], part_of)
    machine = np.concatenate([*machine_of, *(machine_of[i] for i in double)])
    several = len(machine_columns) > 1
    read = [np.isfinite(m.values).reshape(len(m), -1).sum(axis=1) for m in sets]
    commands = np.column_stack([commands, _again(sets, read, commands)])
    key = np.column_stack([commands, machine]) if several else commands
    distinct, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    width = commands.shape[1]
    ends = np.cumsum([part.shape[1] for part in known.values()])
    parts = np.split(distinct[:, : width - 1], ends[:-1], axis=1)
    of_pose = dict(zip(known, map(np.ascontiguousarray, parts), strict=True))
    tension, of_cells = of_pose.get("tension"), None
    if cells is not None:
        of_cells = Cells(_blank(of_pose["tension"]), of_pose.get("tension sigma"))
        of_rows = np.concatenate([rows, *(datasets[i].rows for i in double)])
        check_cells(robot, of_cells, of_rows[first])
        tension = filled_tension(of_cells.read)
    command_of_pose: IntArray = np.arange(len(distinct))
    if several:
        command_of_pose = np.unique(distinct[:, :width], axis=0, return_inverse=True)[1].reshape(-1)
    count = [len(m) for m in sets]
    edges = np.cumsum([0, *count, *(count[i] for i in double)])
    place = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
    there = iter(place[len(count) :])
    return PoseTable(
        sets=sets,
        rows=rows,
        set_of=held_once(np.repeat(np.arange(len(sets)), count)),
        count=held_once(np.concatenate(read)),
        pose_of=tuple(place[: len(count)]),
        other_of=tuple(None if m.other is None else next(there) for m in sets),
        actuators=of_pose["actuators"],
        actuator_sigma=of_pose.get("sigma"),
        estimated=tells_actuators(sets),
        state=DriveState(of_pose.get("approach"), tension, of_pose.get("load")),
        cells=of_cells,
        columns=columns,
        part_of=part_of,
        machine_columns=machine_columns,
        machine_of_pose=held_once(machine[first]),
        command_of_pose=command_of_pose,
    )


def tells_actuators(sets: Sequence[Measurements]) -> bool:
    """Return whether what was read tells how well actuators were, which nobody has stated.

    Pictures of many corners are read better than machines move to the same pose.
    """
    telling = [m for m in sets if m.instrument.tells_actuators]
    if not telling or any(m.actuator_sigma is not None for m in sets):
        return False
    read = sum(int(np.isfinite(m.values).all(axis=1).sum()) for m in telling)
    poses = len(np.unique(np.concatenate([m.actuators for m in telling]), axis=0))
    return read >= _ENOUGH * poses


def _again(
    sets: Sequence[Measurements], read: Sequence[IntArray], commands: FloatArray
) -> IntArray:
    """Count equal rows (C,) without a reading that came before: equal rows are read again.

    Rows of one set after another. A set all rows of which are in another one is a copy, which
    counts with that one; second places, which come last, do not count.
    """
    again = np.zeros(len(commands), dtype=np.intp)
    silent = np.flatnonzero(np.concatenate(read) == 0)
    if not len(silent):
        return again
    target = np.concatenate([repeats.targets(m) for m in sets])[silent]
    place = np.unique(commands[silent], axis=0, return_inverse=True)[1].reshape(-1)
    key = numbered(place, target)
    set_of = np.repeat(np.arange(len(sets)), [len(m) for m in sets])[silent]
    seen = [np.zeros(0, dtype=np.intp)]
    for i in range(len(sets)):
        own = np.flatnonzero(set_of == i)
        copied = len(own) > CHANCE and any(np.isin(key[own], other).all() for other in seen)
        before = seen[0] if copied else np.concatenate(seen)
        again[silent[own]] = _times(key[own], before)
        seen += [] if copied else [key[own]]
    return again


def _times(key: IntArray, before: IntArray) -> IntArray:
    """Count earlier keys that equal each key (N,), among those `before` and among these."""
    whole = np.concatenate([before, key])
    order = np.argsort(whole, kind="stable")
    first = np.flatnonzero(np.diff(whole[order], prepend=-1))
    times = np.empty_like(whole)
    times[order] = np.arange(len(whole)) - np.repeat(first, np.diff(first, append=len(whole)))
    return times[len(before) :]


def _require_loads(robot: Calibratable, sets: Sequence[Measurements]) -> None:
    """Refuse sets with and without loads where those without would carry the stated payload."""
    stated = [m.load is not None for m in sets]
    payload = "payload.mass" in robot.geometry.names
    if payload and any(stated) and not all(stated):
        file = sets[stated.index(False)].file
        raise ArgumentError(
            f"measurements: {file or f'set {stated.index(False) + 1}'} states no load, others do,"
            f" and the file of {robot.name} states a payload: state the load of all sets"
        )


def _machines(
    columns: IntArray, part_of: Sequence[IntArray]
) -> tuple[IntArray, tuple[IntArray, ...]]:
    """Different machines: columns (S, g) of their numbers, and which each row of each set has."""
    place: dict[tuple[int, ...], int] = {}
    of_part = np.array([place.setdefault(tuple(own), len(place)) for own in columns.tolist()])
    different = np.array(list(place), dtype=np.intp).reshape(len(place), columns.shape[1])
    return different, tuple(of_part[part] for part in part_of)


def _commands(
    sets: Sequence[Measurements], sources: Sequence[Measurements], cells: Cells | None
) -> dict[str, FloatArray]:
    """Return what distinguishes the poses of rows, (N, n) each; second places come last."""
    noises = [m.actuator_sigma for m in sources if m.actuator_sigma is not None]
    states = [m.drive_state for m in sets]
    states += [m.other_drive_state for m in sets if m.other is not None]
    approach, tension, load = (
        _of_all(each, [len(m) for m in sources]) for each in zip(*states, strict=True)
    )
    actuators = np.concatenate(
        [*(m.actuators for m in sets), *(m.other for m in sets if m.other is not None)]
    )
    given = {
        "actuators": actuators,
        "picture": _pictures(sets, sources, actuators),
        "sigma": np.concatenate(noises) if noises else None,
        "approach": approach,
        "tension": tension if cells is None else _blank(cells.read),
        "tension sigma": None if cells is None else cells.sigma,
        "load": load,
    }
    return {name: part for name, part in given.items() if part is not None}


def _pictures(
    sets: Sequence[Measurements], sources: Sequence[Measurements], actuators: FloatArray
) -> FloatArray | None:
    """Number of the picture of each row (N, 1): no two of a camera are at one pose.

    Wherever actuators read. Where each camera took one picture at the same actuators, these are of
    one pose, whatever they are called. None where no set of pictures says which rows are of one.
    """
    if not any(m.instrument.tells_actuators and m.group is not None for m in sets):
        return None
    numbers = [np.full(len(m), -1) if m.group is None else m.group for m in sources]
    place = np.unique(actuators, axis=0, return_inverse=True)[1].reshape(-1)
    several = np.zeros(int(place.max()) + 1, dtype=bool)
    ends = np.cumsum([len(m) for m in sources])[:-1]
    for own, number in zip(np.split(place, ends), numbers, strict=True):
        taken = np.unique(np.column_stack([own, number]), axis=0)[:, 0]
        several |= np.bincount(taken, minlength=len(several)) > 1
    picture = np.where(several[place], np.concatenate(numbers), -1)
    return picture.astype(np.float64)[:, None]


def _blank(tension: FloatArray) -> FloatArray:
    """Tensions that were not read as infinite in place of NaN, or back: equal to one another."""
    there = np.isfinite(tension)
    return np.where(there, tension, np.where(np.isnan(tension), np.inf, np.nan))


def _of_all(parts: Sequence[FloatArray | None], rows: Sequence[int]) -> FloatArray | None:
    """The rows of all sets; 0 where a set states nothing, None where none states anything."""
    widths = [part.shape[1] for part in parts if part is not None]
    if not widths:
        return None
    pairs = zip(parts, rows, strict=True)
    return np.concatenate([np.zeros((n, widths[0])) if part is None else part for part, n in pairs])
