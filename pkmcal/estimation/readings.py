"""The readings of a calibration: what instruments should show at given poses, whitened."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.sessions import NONE
from pkmcal.estimation.tensioned_poses import Cells, cells_of, check_cells
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.drive_state import DriveState
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tension import filled_tension
from pkmcal.readings import orientation
from pkmcal.readings.reading import At, Predicted, joined

_TOGETHER = 16384  # rows that are whitened at once by matrices
ROUNDING = 2e-15  # of the largest value: what is left of a solved pose


class Readings:
    """What was read of all sets of measurements, pose by pose, beside what is predicted there.

    Parameters
    ----------
    datasets : sequence of FitData
        The rows; those with the same actuators, and the same noise of these, are one pose.
    parameters : Parameters
        The parameter vector.

    Attributes
    ----------
    sets : tuple of Measurements
        The rows of each set.
    rows : ndarray of int (N,)
        Their numbers in what the user gave.
    actuators : ndarray (K, n)
        Distinct rows of what the actuators read.
    actuator_sigma : ndarray (K, n) or None
        Its stated deviations.
    state : DriveState
        From where the actuators came, and the tension of what they drive, (K, n) each.
    cells : Cells or None
        What load cells read, where tensions are unknown.
    pose_of : list of ndarray of int
        Which pose each row of each set is at.
    other_of : list of ndarray of int or None
        At which other pose it ends, of distances between two.
    spread : Spread
        Which parameters hold in each row.
    machine_columns : ndarray of int (S, g)
        The parameters of the geometry of each machine: one, or one a session.
    machine_of_pose, command_of_pose : ndarray of int (K,)
        Which of them each pose is of, and which poses are at the same actuators.
    set_of : ndarray of int (N,)
        Which set each row is of.
    count : ndarray of int (N,)
        How many numbers were read in each row.
    any_read : bool
        Whether any number was read at all.
    present : ndarray of bool
        Which of all numbers of all sets were read, row by row.
    arcs : tuple of float
        What takes the misfit of each set to mm: where angles alone were read, the machine's length.
    deviations : tuple of ndarray (k,)
        Relative deviations of the components of each set; 1 unless they were told apart.
    """

    def __init__(self, datasets: Sequence[FitData], parameters: Parameters) -> None:
        self.sets = tuple(data.measured for data in datasets)
        self.rows = np.concatenate([data.rows for data in datasets])
        self.parameters = parameters
        self.spread = parameters.spread(datasets)
        self._framed = [data.framed for data in datasets]
        self._frames = [self._frames_of(i) for i in range(len(datasets))]
        depend = [list(data.dependences()) for data in datasets]
        self._given = [{each.argument: each.given for each in mine} for mine in depend]
        self._numbers = [  # that are found along, by what `predict` calls them
            {each.argument: parameters.numbers_of(each) for each in mine if each.sought}
            for mine in depend
        ]
        self._columns = [  # the parameters that these are
            {
                name: np.where(
                    numbers == NONE,
                    NONE,
                    np.take_along_axis(self.spread.columns[part], numbers, axis=1),
                )
                for name, numbers in of_set.items()
            }
            for of_set, part in zip(self._numbers, self.spread.part_of, strict=True)
        ]
        self._along = [data.along for data in datasets]
        self._of_effects = [
            [each.argument for e in data.effects for each in e.dependences(data.measured)]
            for data in datasets
        ]
        self._effects = [[e.of_rows(data.measured) for e in data.effects] for data in datasets]
        # several targets or repeats at the same actuators are one pose
        double = [i for i, m in enumerate(self.sets) if m.other is not None]
        actuators = np.concatenate([
            *(m.actuators for m in self.sets),
            *(m.other for m in self.sets if m.other is not None),
        ])  # fmt: skip
        sources = [*self.sets, *(self.sets[i] for i in double)]
        noises = [m.actuator_sigma for m in sources if m.actuator_sigma is not None]
        approach, tension = (
            _of_all(each, [m.actuators for m in sources])
            for each in zip(*(m.drive_state for m in sources), strict=True)
        )
        cells = cells_of(parameters.robot, sources)
        given = {
            "actuators": actuators,
            "sigma": np.concatenate(noises) if noises else None,
            "approach": approach,
            "tension": tension if cells is None else _blank(cells.read),
            "tension sigma": None if cells is None else cells.sigma,
        }
        known = {name: part for name, part in given.items() if part is not None}
        commands = np.hstack([*known.values()])
        self.machine_columns, machine_of = self.spread.machines(len(parameters.places))
        machine = np.concatenate([*machine_of, *(machine_of[i] for i in double)])
        # machines of different sessions are not at the same pose at the same actuators
        several = len(self.machine_columns) > 1
        key = np.column_stack([commands, machine]) if several else commands
        distinct, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
        width = commands.shape[1]
        parts = np.split(distinct[:, :width], len(known), axis=1)
        of_pose = dict(zip(known, map(np.ascontiguousarray, parts), strict=True))
        self.actuators = of_pose["actuators"]
        self.actuator_sigma = of_pose.get("sigma")
        self.state = DriveState(of_pose.get("approach"), of_pose.get("tension"))
        self.cells: Cells | None = None
        if cells is not None:
            self.cells = Cells(_blank(of_pose["tension"]), of_pose.get("tension sigma"))
            of_rows = np.concatenate([self.rows, *(datasets[i].rows for i in double)])
            check_cells(parameters.robot, self.cells, of_rows[first])
            self.state = DriveState(of_pose.get("approach"), filled_tension(self.cells.read))
        self.machine_of_pose: IntArray = machine[first]
        self.command_of_pose: IntArray = (
            np.unique(distinct[:, :width], axis=0, return_inverse=True)[1].reshape(-1)
            if several
            else np.arange(len(distinct))
        )
        count = [len(m) for m in self.sets]
        edges = np.cumsum([0, *count, *(count[i] for i in double)])
        place = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
        self.pose_of, there = place[: len(count)], iter(place[len(count) :])
        self.other_of = [None if m.other is None else next(there) for m in self.sets]
        self._nothing = [  # where actuators alone were read
            None if m.components else Predicted(np.empty((len(m), 0)), np.empty((len(m), 0, 6)))
            for m in self.sets
        ]
        self.deviations = tuple(np.ones(len(m.components)) for m in self.sets)
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self.present: BoolArray = np.concatenate([
            np.isfinite(m.values).reshape(-1) for m in self.sets
        ])  # fmt: skip
        self.arcs = tuple(m.instrument.arc(m, parameters.robot.length) for m in self.sets)
        self._whole, self.any_read = bool(self.present.all()), bool(self.present.any())
        self.set_of = np.repeat(np.arange(len(self.sets)), count)
        self.count = np.concatenate([
            np.isfinite(m.values).reshape(len(m), -1).sum(axis=1) for m in self.sets
        ])  # fmt: skip

    def _frames_of(self, i: int) -> list[tuple[int, IntArray]]:
        """The first parameter of each frame of a set, and the rows that have it."""
        number = self.parameters.frame
        if number is None or not self._framed[i]:
            return []
        first = self.spread.columns[self.spread.part_of[i], number]
        return [(int(each), np.flatnonzero(first == each)) for each in np.unique(first)]

    @property
    def frames(self) -> dict[int, dict[int, IntArray]]:
        """Rows of each set that have each frame, by its first parameter."""
        found: dict[int, dict[int, IntArray]] = {}
        for i, frames in enumerate(self._frames):
            for first, rows in frames:
                found.setdefault(first, {})[i] = rows
        return found

    @property
    def tools(self) -> dict[int, dict[int, IntArray]]:
        """Rows of each set that have each tool, by its first parameter."""
        found: dict[int, dict[int, IntArray]] = {}
        for i, columns in enumerate(self._columns):
            if "tool" in columns:
                first = columns["tool"][:, 0]
                for each in np.unique(first).tolist():
                    found.setdefault(each, {})[i] = np.flatnonzero(first == each)
        return found

    def columns_of(self, i: int, name: str) -> IntArray | None:
        """Parameters (N, w) of what rows of set `i` depend on; `NONE` where a number is held.

        None where all of it is given. `name` is what `predict` calls it.
        """
        return self._columns[i].get(name)

    def arguments_of(self, i: int, theta: FloatArray) -> dict[str, FloatArray]:
        """What readings of set `i` depend on beside the pose, (N, w) each, for `predict`."""
        found = dict(self._given[i])
        for name, columns in self._columns[i].items():
            found[name] = np.where(columns == NONE, found[name], theta[columns])
        if "tool" in self._columns[i]:
            first = self._columns[i]["tool"][:, 0].tolist()
            found["tool_origin"] = np.array([self.parameters.origin[column] for column in first])
        return found

    def predicted(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Readings of each set at poses (K, 6)."""
        return tuple(
            nothing or self._grown(i, self._predicted_of(i, pose, theta), pose, theta)
            for i, nothing in enumerate(self._nothing)
        )

    def _grown(self, i: int, seen: Predicted, pose: FloatArray, theta: FloatArray) -> Predicted:
        """What is read of set `i` where the machine has grown with its temperature."""
        if not self._effects[i]:
            return seen
        places = [(self.pose_of[i], seen.by_twist)]
        if seen.by_other is not None and (there := self.other_of[i]) is not None:
            places.append((there, seen.by_other))
        numbers, by = self.arguments_of(i, theta), dict(seen.by)
        moved = np.zeros(seen.values.shape)
        for effect in self._effects[i]:
            for machine, rows in self._machines(i, theta):
                for place, by_twist in places:
                    at = place[rows]
                    found = effect.moved(machine, pose[at], self.actuators[at], rows, numbers)
                    moved[rows] += np.einsum("nki,ni->nk", by_twist[rows], found.twist)
                    for name, rates in found.by.items():
                        by.setdefault(name, np.zeros((*moved.shape, rates.shape[2])))
                        by[name][rows] += by_twist[rows] @ rates
            grown, target = effect.growth_of_targets(), numbers.get("target")
            if grown is not None and target is not None and "target" in seen.by:
                moved += np.einsum("nki,ni->nk", seen.by["target"], target * grown[:, None])
        values = self.sets[i].instrument.corrected(seen.values, moved)
        return replace(seen, values=values, by=by)

    def _predicted_of(self, i: int, pose: FloatArray, theta: FloatArray) -> Predicted:
        places, at = self.arguments_of(i, theta), self._seen_at(i, pose, theta)
        reading = self.sets[i].instrument
        for name in self._of_effects[i]:
            del places[name]
        if not self._frames[i]:
            return reading.predict(at, **places)
        parts = [
            reading.predict(
                replace(
                    at,
                    pose=at.pose[rows],
                    frame=theta[first : first + 6],
                    origin=self.parameters.origin[first],
                ),
                **{name: place[rows] for name, place in places.items()},
            )
            for first, rows in self._frames[i]
        ]
        return joined(parts, [rows for _, rows in self._frames[i]])

    def _seen_at(self, i: int, pose: FloatArray, theta: FloatArray) -> At:
        """Where the machine is in the rows of set `i`."""
        measured, there = self.sets[i], self.other_of[i]
        return At(
            pose[self.pose_of[i]],
            None if there is None else pose[there],
            along=self._along[i],
            machines=lambda: self._machines(i, theta),
            measured=measured,
        )

    def by_numbers(self, i: int, pose: FloatArray, theta: FloatArray) -> FloatArray | None:
        """How readings of set `i` follow the geometry not by the pose alone, (N, k, g)."""
        reading = self.sets[i].instrument
        return reading.by_geometry(self._seen_at(i, pose, theta), self.parameters.places)

    def _machines(self, i: int, theta: FloatArray) -> Iterator[tuple[Calibratable, IntArray]]:
        """The machines of set `i`, one or one a session, and the rows of each."""
        machine_of_row = self.machine_of_pose[self.pose_of[i]]
        for machine in np.unique(machine_of_row):
            values = self.parameters.values_at(theta, self.machine_columns[machine])
            rows = np.flatnonzero(machine_of_row == machine)
            yield self.parameters.robot.with_values(values), rows

    def residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Measured less predicted of each set."""
        return tuple(
            measured.instrument.difference(measured.values, seen.values)
            for measured, seen in zip(self.sets, predicted, strict=True)
        )

    def misfit(self, pose: FloatArray, theta: FloatArray) -> FloatArray:
        """How far off the worst reading at each pose (K, 6) is, mm (K,); inf without a pose.

        Angles count as their arc. NaN where nothing was read.
        """
        worst = np.full(len(pose), np.nan)
        residuals = self.residuals(self.predicted(pose, theta))
        for measured, place, residual in zip(self.sets, self.pose_of, residuals, strict=True):
            arcs = measured.instrument.mm(measured, self.parameters.robot.length)
            known = np.where(np.isfinite(measured.values.reshape(residual.shape)), residual, 0.0)
            off = np.linalg.norm(known * arcs, axis=1)
            off = np.where(np.isfinite(off), off, np.inf)
            read = np.isfinite(measured.values.reshape(residual.shape)).any(axis=1)
            np.fmax.at(worst, place[read], off[read])
        return worst

    def whitened(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """Parts (N, k, ...) of all sets in units of their standard deviation, stacked: (M, ...).

        `noise` (G,) multiplies what `Measurements.sigma` says. What was not read is left out.
        """
        return self.whiten([np.array(part) for part in parts], noise)

    def whiten(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """The same as `whitened`, in the place of the parts: a Jacobian is large."""
        for i, part in enumerate(parts):
            for rows in lots(len(part), _TOGETHER):
                self._whiten_rows(part[rows], i, rows, noise)
        flat = [part.reshape(-1, *part.shape[2:]) for part in parts]
        whole = flat[0] if len(flat) == 1 else np.concatenate(flat)
        return whole if self._whole else whole[self.present]

    def whiten_rows(self, part: FloatArray, i: int, rows: slice, noise: FloatArray) -> FloatArray:
        """The same of some rows of set `i` alone."""
        self._whiten_rows(part, i, rows, noise)
        return self.read(part, i, rows)

    def read(self, part: FloatArray, i: int, rows: slice) -> FloatArray:
        """What was read of a part (b, k, ...), which is of some rows of set `i`, stacked."""
        flat = part.reshape(-1, *part.shape[2:])
        if self._whole:
            return flat
        read: FloatArray = flat[np.isfinite(self.sets[i].values[rows]).reshape(-1)]
        return read

    def _whiten_rows(self, part: FloatArray, i: int, rows: slice, noise: FloatArray) -> None:
        white = self._whiten[i][rows]
        if not self._whole:
            np.nan_to_num(part, copy=False, nan=0.0)
        if white.ndim == 3:
            part[:] = np.einsum("nij,nj...->ni...", white, part)
        else:
            part *= white.reshape(*white.shape, *(1,) * (part.ndim - 2))
        part /= noise[i]

    def unwhiten(self, whitened: FloatArray, noise: FloatArray) -> list[FloatArray]:
        """Invert `whitened` for vectors (M,): parts (N, k) of all sets, mm and rad.

        0 where nothing was read.
        """
        rest = np.zeros(len(self.present))
        rest[self.present] = whitened
        parts = []
        for measured, white, factor in zip(self.sets, self._whiten, noise, strict=True):
            mine, rest = np.split(rest, [len(measured) * white.shape[1]])
            part = factor * mine.reshape(len(measured), -1)
            if white.ndim == 3:
                parts.append(np.linalg.solve(white, part[:, :, None])[:, :, 0])
            else:
                parts.append(part / white)
        return parts

    def variances(self, noise: FloatArray) -> FloatArray:
        """Variances (M,) of the readings as they are weighted, mm² and rad²."""
        parts = []
        for white, factor in zip(self._whiten, noise, strict=False):
            each = np.linalg.inv(white) ** 2 if white.ndim == 3 else white**-2.0
            parts.append(factor**2 * (each.sum(axis=2) if each.ndim == 3 else each).ravel())
        variances: FloatArray = np.concatenate(parts)[self.present]
        return variances

    def rounding(self, noise: FloatArray) -> float:
        """Length of the whitened rounding errors of what is predicted."""
        parts = [_rounded(m, self.parameters.robot.length) for m in self.sets]
        return float(np.linalg.norm(self.whitened(parts, noise)))


def _blank(tension: FloatArray) -> FloatArray:
    """Tensions that were not read as infinite in place of NaN, or back: equal to one another."""
    there = np.isfinite(tension)
    return np.where(there, tension, np.where(np.isnan(tension), np.inf, np.nan))


def _rounded(measured: Measurements, length: float) -> FloatArray:
    """Rounding errors (N, k) of what is predicted, mm and rad."""
    values = measured.values.reshape(len(measured), -1)
    lengths = np.array([unit == "mm" for unit in measured.units], dtype=bool)
    size = np.max(np.nan_to_num(np.abs(values[:, lengths])), initial=0.0) + length
    return np.broadcast_to(ROUNDING * size / measured.instrument.mm(measured, length), values.shape)


def of_read(measured: Measurements, residual: FloatArray) -> FloatArray:
    """Residuals (N, k) of what was read, 0 beside it; NaN in rows where nothing was."""
    read = np.isfinite(measured.values.reshape(residual.shape))
    if not residual.shape[1]:
        return np.full((len(residual), 1), np.nan)
    if read.all():
        return residual
    known = np.where(read, residual, 0.0)
    known[~read.any(axis=1)] = np.nan
    return known


def _whitening(measured: Measurements, length: float) -> FloatArray:
    """Factors (N, k) or matrices (N, k, k) that make the noise one; 1 mm where it is not known."""
    sigma = measured.sigma
    if sigma is None:
        return np.tile(measured.instrument.mm(measured, length), (len(measured), 1))
    first = measured.instrument.turning
    if first is not None and not _same_turnings(sigma, first):
        sigma = orientation.covariance(sigma, np.nan_to_num(measured.values[:, first:]))
    if sigma.ndim == 2:
        return 1.0 / sigma
    missing = np.isnan(measured.values)
    if missing.any():  # what was read has its marginal covariance
        apart = missing[:, :, None] | missing[:, None, :]
        sigma = np.where(apart, np.eye(sigma.shape[1]), sigma)
    return np.linalg.inv(np.linalg.cholesky(sigma))


def _same_turnings(sigma: FloatArray, first: int) -> bool:
    """Whether standard deviations (N, k) are the same about every axis."""
    return sigma.ndim == 2 and bool((sigma[:, first + 1 :] == sigma[:, first : first + 1]).all())


def _of_all(
    parts: Sequence[FloatArray | None], actuators: Sequence[FloatArray]
) -> FloatArray | None:
    """The rows of all sets; 0 where a set says nothing, None where none says anything."""
    if all(part is None for part in parts):
        return None
    pairs = zip(parts, actuators, strict=True)
    return np.concatenate([np.zeros(q.shape) if part is None else part for part, q in pairs])
