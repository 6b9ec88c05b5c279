"""The readings of a calibration: what instruments should show at given poses, whitened."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, mm_per_unit
from pkmcal.calibration.parameters import POINTS, FitData, Parameters, places_of
from pkmcal.calibration.sessions import NONE
from pkmcal.measurements import orientation
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import Predicted, difference, joined, predict

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
    approach : ndarray (K, n) or None
        From where the actuators came.
    pose_of : list of ndarray of int
        Which pose each row of each set is at.
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
    present : ndarray of bool
        Which of all numbers of all sets were read, row by row.
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
        self._numbers = [  # of the points that are sought, by what `predict` calls them
            {
                name: parameters.numbers_of(role, data.measured)
                for name, role in POINTS[data.measured.kind].items()
                if role in data.sought
            }
            for data in datasets
        ]
        self._columns = [  # the parameters that these are
            {
                name: np.take_along_axis(self.spread.columns[part], numbers, axis=1)
                for name, numbers in of_set.items()
            }
            for of_set, part in zip(self._numbers, self.spread.part_of, strict=True)
        ]
        self._known = [
            {
                name: places_of(role, m)  # of points that are held
                if name in columns
                else (m.attachments if role == "attachment" else m.targets)
                for name, role in POINTS[m.kind].items()
            }
            for m, columns in zip(self.sets, self._columns, strict=True)
        ]
        # several targets or repeats at the same actuators are one pose
        actuators = np.concatenate([m.actuators for m in self.sets])
        noises = [m.actuator_sigma for m in self.sets]
        stated = [sigma for sigma in noises if sigma is not None]
        commands = np.hstack([actuators, np.concatenate(stated)]) if stated else actuators
        directions = [m.approach for m in self.sets]
        if any(each is not None for each in directions):  # backlash is between their poses
            known = [np.zeros(m.actuators.shape) if m.approach is None else m.approach
                     for m in self.sets]  # fmt: skip
            commands = np.hstack([commands, np.concatenate(known)])
        self.machine_columns, machine_of = self.spread.machines(len(parameters.places))
        machine = np.concatenate(machine_of)
        # machines of different sessions are not at the same pose at the same actuators
        several = len(self.machine_columns) > 1
        key = np.column_stack([commands, machine]) if several else commands
        distinct, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
        n, width = actuators.shape[1], commands.shape[1]
        self.actuators = np.ascontiguousarray(distinct[:, :n])
        self.actuator_sigma = np.ascontiguousarray(distinct[:, n : 2 * n]) if stated else None
        own = n * (1 + bool(stated))
        self.approach = np.ascontiguousarray(distinct[:, own:width]) if width > own else None
        self.machine_of_pose: IntArray = machine[first]
        self.command_of_pose: IntArray = (
            np.unique(distinct[:, :width], axis=0, return_inverse=True)[1].reshape(-1)
            if several
            else np.arange(len(distinct))
        )
        edges = np.cumsum([0, *map(len, self.sets)])
        self.pose_of = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
        self.deviations = tuple(np.ones(len(m.components)) for m in self.sets)
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self.present: BoolArray = np.concatenate([
            np.isfinite(m.values).reshape(-1) for m in self.sets
        ])  # fmt: skip
        self._whole = bool(self.present.all())
        self.set_of = np.repeat(np.arange(len(self.sets)), np.diff(edges))
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

    def columns_of(self, i: int, name: str) -> IntArray | None:
        """Parameters (N, 3) of a point of each row of set `i`; `NONE` where it is held.

        None where it is known.
        `name` is what `predict` calls it.
        """
        return self._columns[i].get(name)

    def points_of(self, i: int, name: str, theta: FloatArray) -> FloatArray:
        """Where that point is (N, 3), mm."""
        known, columns = self._known[i][name], self._columns[i].get(name)
        return known if columns is None else np.where(columns == NONE, known, theta[columns])

    def predicted(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Readings of each set at poses (K, 6)."""
        return tuple(self._predicted_of(i, pose, theta) for i in range(len(self.sets)))

    def _predicted_of(self, i: int, pose: FloatArray, theta: FloatArray) -> Predicted:
        places = {name: self.points_of(i, name, theta) for name in self._known[i]}
        kind, mine = self.sets[i].kind, pose[self.pose_of[i]]
        if not self._frames[i]:
            return predict(kind, mine, **places)
        parts = [
            predict(
                kind,
                mine[rows],
                frame=theta[first : first + 6],
                origin=self.parameters.origin[first],
                **{name: place[rows] for name, place in places.items()},
            )
            for first, rows in self._frames[i]
        ]
        return joined(parts, [rows for _, rows in self._frames[i]])

    def residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Measured less predicted of each set."""
        return tuple(
            difference(measured.kind, measured.values, seen.values)
            for measured, seen in zip(self.sets, predicted, strict=True)
        )

    def misfit(self, pose: FloatArray, theta: FloatArray) -> FloatArray:
        """How far off the worst reading at each pose (K, 6) is, mm (K,); inf without a pose.

        Angles count as their arc. NaN where nothing was read.
        """
        worst = np.full(len(pose), np.nan)
        residuals = self.residuals(self.predicted(pose, theta))
        for measured, place, residual in zip(self.sets, self.pose_of, residuals, strict=True):
            arcs = mm_per_unit(measured.units, self.parameters.robot.length)
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
        stacked = []
        for part, white, factor in zip(parts, self._whiten, noise[: len(parts)], strict=True):
            if not self._whole:
                part = np.nan_to_num(part, nan=0.0)
            if white.ndim == 3:
                scaled = np.einsum("nij,nj...->ni...", white, part)
            else:
                scaled = white.reshape(*white.shape, *(1,) * (part.ndim - 2)) * part
            stacked.append((scaled / factor).reshape(-1, *part.shape[2:]))
        whole = np.concatenate(stacked)
        return whole if self._whole else whole[self.present]

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


def _rounded(measured: Measurements, length: float) -> FloatArray:
    """Rounding errors (N, k) of what is predicted, mm and rad."""
    values = measured.values.reshape(len(measured), -1)
    lengths = np.array([unit == "mm" for unit in measured.units], dtype=bool)
    size = np.max(np.nan_to_num(np.abs(values[:, lengths])), initial=0.0) + length
    return np.broadcast_to(ROUNDING * size / mm_per_unit(measured.units, length), values.shape)


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
        return np.tile(mm_per_unit(measured.units, length), (len(measured), 1))
    if measured.kind == "pose" and not _same_turnings(sigma):
        sigma = orientation.covariance(sigma, np.nan_to_num(measured.values[:, 3:]))
    if sigma.ndim == 2:
        return 1.0 / sigma
    missing = np.isnan(measured.values)
    if missing.any():  # what was read has its marginal covariance
        apart = missing[:, :, None] | missing[:, None, :]
        sigma = np.where(apart, np.eye(sigma.shape[1]), sigma)
    return np.linalg.inv(np.linalg.cholesky(sigma))


def _same_turnings(sigma: FloatArray) -> bool:
    """Whether standard deviations (N, 6) are the same about every axis."""
    return sigma.ndim == 2 and bool((sigma[:, 4:] == sigma[:, 3:4]).all())
