"""How the readings of a calibration follow its parameters, lot by lot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.readings import Readings
from pkmcal.estimation.session_machines import SessionClosures
from pkmcal.estimation.sessions import NONE
from pkmcal.readings.reading import Predicted

_LOT = 1024  # rows whose derivatives by the parameters are made at once, as many as caches hold


class Derivatives(Readings):
    """Derivatives of what is predicted, by the parameters: through the poses and beside them.

    Attributes
    ----------
    closures : SessionClosures
        How poses follow from the actuators.
    """

    closures: SessionClosures

    def seen(self, evaluation: Evaluation) -> tuple[Predicted, ...]:
        """Readings of each set at an evaluation, with derivatives; of few rows the last is kept."""
        whose, seen = evaluation.kept.get("seen", (None, ()))
        if whose is not None and whose() is self:
            known: tuple[Predicted, ...] = seen
            return known
        return self.predicted(evaluation.pose, evaluation.theta)

    def jacobian(self, evaluation: Evaluation) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n).

        With the opposite sign that of the residuals.
        """
        n = len(self.parameters)
        found = [np.empty((*each.shape, n)) for each in evaluation.residuals]
        for _, parts in self.derivatives(evaluation):
            for i, rows, part in parts:
                found[i][rows] = part
        return found

    def derivatives(
        self, evaluation: Evaluation
    ) -> Iterator[tuple[slice, list[tuple[int, slice, FloatArray]]]]:
        """`jacobian` in lots: rows through all sets, and set, rows of it and derivative (b, k, n).

        One lot where poses have unknowns.
        """
        p, numbers = self.parameters, self.spread.columns.shape[1]
        every = self.seen(evaluation)
        direct = [
            self.by_numbers(i, evaluation.pose, evaluation.theta) for i in range(len(self.sets))
        ]
        place = np.full(len(evaluation.pose), NONE)
        for lot in lots(len(self.rows), len(self.rows) if self.closures.unknowns else _LOT):
            some = list(self._in_sets(lot))
            parts = [np.zeros((*every[i].values[rows].shape, numbers)) for i, rows in some]
            for poses, twists in self.closures.twists_by_numbers(
                evaluation.machines, evaluation.states, p.places, self._poses_of(some)
            ):
                place[poses] = np.arange(len(poses))
                for (i, rows), part in zip(some, parts, strict=True):
                    seen, there = every[i], self.other_of[i]
                    _add_motion(part, seen.by_twist[rows], twists, place[self.pose_of[i][rows]])
                    if seen.by_other is not None and there is not None:
                        _add_motion(part, seen.by_other[rows], twists, place[there[rows]])
                place[poses] = NONE
            found = []
            for (i, rows), part in zip(some, parts, strict=True):
                seen, along = every[i], direct[i]
                if along is not None:
                    part[:, :, : len(p.places)] += along[rows]
                if seen.by_frame is not None and p.frame is not None:
                    part[:, :, p.frame : p.frame + 6] = seen.by_frame[rows]
                for name, columns in self._numbers[i].items():
                    mine = columns[rows]
                    row, slot = np.nonzero(mine != NONE)
                    part[row, :, mine[row, slot]] += seen.by[name][rows][row, :, slot]
                wide = self.spread.of_rows(part, i, rows)
                residual = evaluation.residuals[i][rows]
                read = self.sets[i].instrument
                found.append((i, rows, read.by_difference(wide, residual)))
            yield lot, found

    def _in_sets(self, lot: slice) -> Iterator[tuple[int, slice]]:
        """Rows of each set that has some of these, which count through all sets."""
        first = 0
        for i, measured in enumerate(self.sets):
            last = first + len(measured)
            if lot.start < last and first < lot.stop:
                yield i, slice(max(lot.start - first, 0), min(lot.stop, last) - first)
            first = last

    def _poses_of(self, some: Sequence[tuple[int, slice]]) -> IntArray:
        """Distinct poses of rows of sets, in order."""
        if sum(rows.stop - rows.start for _, rows in some) == len(self.rows):
            return np.arange(len(self.actuators))
        pairs = [((self.pose_of[i], self.other_of[i]), rows) for i, rows in some]
        ends = [end[rows] for both, rows in pairs for end in both if end is not None]
        return np.unique(np.concatenate(ends))


def _add_motion(
    part: FloatArray, by_twist: FloatArray, twists: FloatArray, place: IntArray
) -> None:
    """Add how readings follow the twists (b, 6, g) to their derivatives (N, k, m), g ≤ m.

    `by_twist` is (N, k, 6), `place` (N,) which of the twists moves each row; `NONE`: none of them.
    """
    moved = np.flatnonzero(place != NONE)
    part[moved, :, : twists.shape[2]] += by_twist[moved] @ twists[place[moved]]
