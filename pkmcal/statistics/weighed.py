"""A linear fit solved again with other weights, and columns beside its design that follow them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Columns

# Equations (n, m) of clusters with equally many, and matrices (n, m, m) that they are multiplied by
Halves = tuple[IntArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Weighed:
    """A fit whose equations were multiplied, by a number each or by a matrix for each cluster.

    Attributes
    ----------
    fit : LinearFit
        The fit with these weights.
    deviations : ndarray (M,) or None
        By which equations were divided.
    halves : tuple of Halves
        By which those of clusters were multiplied.
    """

    fit: LinearFit
    deviations: FloatArray | None = None
    halves: tuple[Halves, ...] = ()

    def weigh(self, matrix: FloatArray) -> FloatArray:
        """Multiply columns (M, d) of the fit before as its equations were."""
        if self.deviations is not None:
            found: FloatArray = matrix / self.deviations[:, None]
            return found
        return multiplied(matrix, self.halves)

    def unweigh(self, values: FloatArray) -> FloatArray:
        """Values (M,) of equations in units of the fit before: the inverse of `weigh`."""
        if self.deviations is not None:
            whole: FloatArray = values * self.deviations
            return whole
        found = values.copy() if self.halves else values
        for rows, half in self.halves:
            found[rows] = np.linalg.solve(half, values[rows][:, :, None])[:, :, 0]
        return found

    def columns(self, columns: Columns) -> Columns:
        """Columns of the fit before, as `weigh` makes them."""
        if self.deviations is None and not self.halves:
            return columns

        def made() -> Iterator[tuple[slice, FloatArray]]:
            if self.deviations is not None:
                for rows, some in columns():
                    yield rows, some / self.deviations[rows, None]
                return
            parts = [some for _, some in columns()]
            if parts:
                yield slice(0, len(self.fit.residual)), self.weigh(np.concatenate(parts))

        return made


def multiplied(matrix: FloatArray, halves: tuple[Halves, ...]) -> FloatArray:
    """Multiply rows (M, d) of clusters by their matrices."""
    found = matrix.copy() if halves else matrix
    for rows, half in halves:
        found[rows] = half @ matrix[rows]
    return found
