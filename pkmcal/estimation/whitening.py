"""The whitening of readings: each in units of its standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, held_once, lots
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings import orientation

_TOGETHER = 16384  # rows that are whitened at once by matrices


@dataclass(frozen=True, eq=False)
class Whitening:
    """Whitening: it takes the readings of each set to units of their standard deviation.

    The `noise` (G,) of its methods multiplies the stated deviations of each group of components;
    groups beyond those of the sets have none here.

    Attributes
    ----------
    white : tuple of ndarray
        Factors (N, k) or matrices (N, k, k) of each set that make the noise one; of sets whose
        sigma is not stated, of 1 mm.
    read : tuple of ndarray of bool (N, k)
        Which numbers of each set were read.
    deviations : tuple of ndarray (k,)
        Relative deviations of the components of each set; 1 unless they were told apart.
    groups : tuple of ndarray of int (k,)
        The group of each component of each set: the set, or its lengths and angles by themselves.
    set_of_group : ndarray of int
        The set of each group.
    """

    white: tuple[FloatArray, ...]
    read: tuple[BoolArray, ...]
    deviations: tuple[FloatArray, ...]
    groups: tuple[IntArray, ...]
    set_of_group: IntArray

    @classmethod
    def of(cls, sets: Sequence[Measurements], length: float) -> Whitening:
        """Whitening by the sigma of the sets, on a machine of this length in mm."""
        every = np.arange(len(sets))
        return cls(
            tuple(held_once(_whitening(m, length)) for m in sets),
            tuple(np.isfinite(m.values).reshape(len(m), -1) for m in sets),
            tuple(np.ones(len(m.components)) for m in sets),
            tuple(np.full(len(m.components), i) for i, m in enumerate(sets)),
            every,
        )

    def by_set(self) -> Whitening:
        """Put all components of a set into one group."""
        groups = tuple(np.full(len(each), i) for i, each in enumerate(self.groups))
        return replace(self, groups=groups, set_of_group=np.arange(len(groups)))

    def by_family(self, sets: Sequence[Measurements]) -> Whitening:
        """Put lengths and angles of each set into groups of their own."""
        groups, of_set = list[IntArray](), list[int]()
        for i, m in enumerate(sets):
            groups.append(np.empty(len(m.components), dtype=np.intp))
            for family in m.instrument.families:
                groups[-1][list(family.columns)] = len(of_set)
                of_set.append(i)
        return replace(self, groups=tuple(groups), set_of_group=np.array(of_set, dtype=np.intp))

    def unstated(self, sets: Sequence[Measurements]) -> BoolArray:
        """Return whether readings of each group have no stated deviation."""
        found = np.zeros(len(self.set_of_group), dtype=bool)
        for m, read, groups in zip(sets, self.read, self.groups, strict=True):
            if m.sigma is None:
                found[groups[read.any(axis=0)]] = True
        return found

    def of_equations(self, groups: Sequence[IntArray]) -> IntArray:
        """Return numbers of the components (k,) of each set for each reading (M,)."""
        whole = [np.tile(own, len(read)) for own, read in zip(groups, self.read, strict=True)]
        found: IntArray = np.concatenate(whole)[self.present]
        return found

    @cached_property
    def present(self) -> BoolArray:
        """Mark, row by row, which numbers of all sets were read."""
        return np.concatenate([read.reshape(-1) for read in self.read])

    @cached_property
    def complete(self) -> bool:
        """True if all numbers were read."""
        return bool(self.present.all())

    @cached_property
    def any_read(self) -> bool:
        """True if any number was read at all."""
        return bool(self.present.any())

    def reweighted(self, deviations: Sequence[FloatArray]) -> Whitening:
        """Give the components (k,) of each set other relative deviations."""
        white = [held_once(each / by) for each, by in zip(self.white, deviations, strict=True)]
        return replace(self, white=tuple(white), deviations=tuple(deviations))

    def whitened(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """Parts (N, k, ...) of all sets in units of their deviation, stacked: (M, ...).

        Without the numbers that were not read.
        """
        return self.whiten([np.array(part) for part in parts], noise)

    def whiten(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """Whiten in place, as `whitened` does in new memory: a Jacobian is large."""
        for i, part in enumerate(parts):
            for rows in lots(len(part), _TOGETHER):
                self._whiten(part[rows], i, rows, noise)
        flat = [part.reshape(-1, *part.shape[2:]) for part in parts]
        whole = flat[0] if len(flat) == 1 else np.concatenate(flat)
        return whole if self.complete else whole[self.present]

    def whiten_rows(self, part: FloatArray, i: int, rows: slice, noise: FloatArray) -> FloatArray:
        """Whiten a part (b, k, ...) of some rows of set `i` in its memory, and stack it."""
        self._whiten(part, i, rows, noise)
        return self.stacked(part, i, rows)

    def whiten_alone(self, part: FloatArray, i: int) -> FloatArray:
        """Whiten all numbers (N, k, ...) of set `i` as they are stated, in their memory."""
        self._as_stated(part, i, slice(None))
        return part

    def stacked(self, part: FloatArray, i: int, rows: slice) -> FloatArray:
        """The numbers that were read of a part (b, k, ...) of some rows of set `i`, stacked."""
        flat = part.reshape(-1, *part.shape[2:])
        if self.complete:
            return flat
        stacked: FloatArray = flat[self.read[i][rows].reshape(-1)]
        return stacked

    def _whiten(self, part: FloatArray, i: int, rows: slice, noise: FloatArray) -> None:
        self._as_stated(part, i, rows)
        of_components = noise[self.groups[i]]
        part /= of_components.reshape(-1, *(1,) * (part.ndim - 2))

    def _as_stated(self, part: FloatArray, i: int, rows: slice) -> None:
        white = self.white[i][rows]
        if not self.complete:
            np.nan_to_num(part, copy=False, nan=0.0)
        if white.ndim == 3:
            part[:] = np.einsum("nij,nj...->ni...", white, part)
        else:
            part *= white.reshape(*white.shape, *(1,) * (part.ndim - 2))

    def unwhiten(self, whitened: FloatArray, noise: FloatArray) -> list[FloatArray]:
        """Invert `whitened` for vectors (M,): parts (N, k) of all sets, mm and rad.

        0 where nothing was read.
        """
        rest = np.zeros(len(self.present))
        rest[self.present] = whitened
        parts: list[FloatArray] = []
        for white, groups in zip(self.white, self.groups, strict=True):
            rows, k = white.shape[:2]
            own, rest = np.split(rest, [rows * k])
            part = noise[groups] * own.reshape(rows, -1)
            if white.ndim == 3:
                solved = np.linalg.solve(white, part[:, :, None])[:, :, 0]
                parts.append(np.asarray(solved, dtype=np.float64))
            else:
                parts.append(part / white)
        return parts

    def variances(self, noise: FloatArray) -> FloatArray:
        """Variances (M,) of the readings as they are weighted, mm² and rad²."""
        parts = []
        for white, groups in zip(self.white, self.groups, strict=True):
            each = np.linalg.inv(white) ** 2 if white.ndim == 3 else white**-2.0
            each = each.sum(axis=2) if each.ndim == 3 else each
            parts.append((noise[groups] ** 2 * each).ravel())
        variances: FloatArray = np.concatenate(parts)[self.present]
        return variances


def _whitening(measured: Measurements, length: float) -> FloatArray:
    """Factors (N, k) or matrices (N, k, k) that make the noise one; 1 mm where it is not known."""
    sigma = measured.sigma
    if sigma is None:
        mm = measured.instrument.mm(measured, length)
        return np.broadcast_to(mm, (len(measured), len(measured.components)))
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
    """Return whether standard deviations (N, k) are the same about every axis."""
    return sigma.ndim == 2 and bool((sigma[:, first + 1 :] == sigma[:, first : first + 1]).all())
