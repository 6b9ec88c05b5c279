"""The readings of a calibration: what instruments should show at given poses, whitened."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, mm_per_unit
from pkmcal.calibration.fit_data import FitData
from pkmcal.calibration.parameters import Parameters
from pkmcal.measurements import orientation
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import Predicted, difference, predict

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
    pose_of : list of ndarray of int
        Which pose each row of each set is at.
    other_of : list of ndarray of int or None
        At which other pose it ends, of distances between two.
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
        self._framed = [data.framed for data in datasets]
        depend = [list(data.dependences()) for data in datasets]
        self._given = [{each.argument: each.given for each in mine} for mine in depend]
        self._columns = [  # of the numbers that are found along
            {each.argument: parameters.columns_of(each) for each in mine if each.sought}
            for mine in depend
        ]
        self._along = [data.along for data in datasets]
        # several targets or repeats at the same actuators are one pose
        seconds = [m for m in self.sets if m.other is not None]
        actuators = np.concatenate([
            *(m.actuators for m in self.sets),
            *(m.other for m in seconds if m.other is not None),
        ])  # fmt: skip
        noises = [m.actuator_sigma for m in (*self.sets, *seconds)]
        stated = [sigma for sigma in noises if sigma is not None]
        key = np.hstack([actuators, np.concatenate(stated)]) if stated else actuators
        distinct, inverse = np.unique(key, axis=0, return_inverse=True)
        n = actuators.shape[1]
        self.actuators = np.ascontiguousarray(distinct[:, :n])
        self.actuator_sigma = np.ascontiguousarray(distinct[:, n:]) if stated else None
        edges = np.cumsum([0, *map(len, self.sets), *map(len, seconds)])
        place = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
        self.pose_of, there = place[: len(self.sets)], iter(place[len(self.sets) :])
        self.other_of = [None if m.other is None else next(there) for m in self.sets]
        self.deviations = tuple(np.ones(len(m.components)) for m in self.sets)
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self.present: BoolArray = np.concatenate([
            np.isfinite(m.values).reshape(-1) for m in self.sets
        ])  # fmt: skip
        self._whole = bool(self.present.all())
        self.set_of = np.repeat(np.arange(len(self.sets)), [len(m) for m in self.sets])
        self.count = np.concatenate([
            np.isfinite(m.values).reshape(len(m), -1).sum(axis=1) for m in self.sets
        ])  # fmt: skip

    def predicted(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Readings of each set at poses (K, 6)."""
        frame = self.parameters.frame_at(theta)
        return tuple(
            predict(
                measured.kind,
                pose[self.pose_of[i]],
                frame=frame if self._framed[i] else None,
                origin=self.parameters.origin,
                artefact=measured.artefact,
                along=self._along[i],
                other=None if (other := self.other_of[i]) is None else pose[other],
                **self._arguments(i, theta),
            )
            for i, measured in enumerate(self.sets)
        )

    def _arguments(self, i: int, theta: FloatArray) -> dict[str, FloatArray]:
        """What the readings of set `i` depend on beside the pose, (N, w) each."""
        found = dict(self._given[i])
        for name, columns in self._columns[i].items():
            found[name] = np.where(columns < 0, found[name], theta[columns])
        return found

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
