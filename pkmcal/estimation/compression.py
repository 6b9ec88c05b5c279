"""Many rows of few unknowns: readings of a lot, a picture say, as the triangle of their equations.

Rows of a lot follow the machine through one motion of 6 numbers (`Reading.shared`), and perhaps f
numbers that they depend on by themselves. Their whitened derivatives by these, with what they are
off beside them, are Z, of many rows and w = 6 + f + 1 columns. With Z = Q R the w rows of R have
the squares and products of all columns: every step of least squares, rank and covariance are those
of all rows. Equations across Q, which are left aside, are 0 whatever the parameters are; they count
among the degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.elimination import PoseEquations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.prediction import EVERY, Prediction
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import NONE
from pkmcal.estimation.whitening import Whitening
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.predicted import MOTION, Lots, Predicted, Shared
from pkmcal.statistics.linear_fit import numbered

_PAYS = 2  # times as many numbers as a triangle has rows, from which on it is worth making


@dataclass(frozen=True, eq=False)
class Triangles(Predicted):
    """Readings of L lots: `values` (L, w) are what the rows of their triangles are off, less 0.

    Attributes
    ----------
    of_rows, residual : ndarray (N, k)
        What is predicted of the rows themselves, and measured less that.
    """

    of_rows: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    residual: FloatArray = field(default_factory=lambda: np.empty((0, 0)))


@dataclass(frozen=True, eq=False)
class RowsInLots:
    """The lots that the rows of a set are compressed in.

    Attributes
    ----------
    parts : tuple of (ndarray of int, Lots)
        Rows of the set in each frame, and their lots.
    first : ndarray of int (L,)
        The first row of each lot, part by part.
    own : mapping of str to ndarray of int
        Numbers that are estimated of arguments that rows depend on by themselves.
    equations : PoseEquations
        The numbers that were read in each lot.
    count : ndarray of int (L,)
        How many these are.
    """

    parts: tuple[tuple[IntArray, Lots], ...]
    first: IntArray
    own: Mapping[str, IntArray]
    equations: PoseEquations
    count: IntArray

    @classmethod
    def of(
        cls, prediction: Prediction, whitening: Whitening, i: int, alike: IntArray
    ) -> RowsInLots | None:
        """Find the lots of set `i` among rows that are `alike` (N,); None where they stay as many.

        Rows of a lot are at one pose and depend on the same parameters.
        """
        measured, table = prediction.table.sets[i], prediction.table
        if measured.instrument.turning is not None or prediction.effects[i]:
            return None
        if len(np.unique(whitening.groups[i])) > 1:  # numbers of a lot have one noise
            return None
        keys = [alike, table.pose_of[i], table.part_of[i]]
        keys += [each.T[0] - NONE for each in prediction.columns[i].values()]
        lot = numbered(*keys)
        columns = prediction.columns[i]
        own = {
            name: np.flatnonzero((columns[name] != NONE).any(axis=0))
            for name in measured.instrument.by_rows
            if name in columns
        }
        width = MOTION + sum(map(len, own.values())) + 1
        read = whitening.read[i]
        if read.sum() < _PAYS * width * (int(lot.max()) + 1):
            return None
        parts, first, place = list[tuple[IntArray, Lots]](), list[IntArray](), np.empty_like(lot)
        before = 0
        for rows in prediction.rows_in_frames(i):
            _, at, of = np.unique(lot[rows], return_index=True, return_inverse=True)
            parts.append((rows, Lots(of.reshape(-1), at)))
            place[rows] = before + of.reshape(-1)
            first.append(rows[at])
            before += len(at)
        of_number = np.repeat(place, read.shape[1])[read.ravel()]
        order = np.flatnonzero(read.ravel())[np.argsort(of_number, kind="stable")]
        count = np.bincount(of_number, minlength=before)
        equations = PoseEquations(order, count, width)
        return cls(tuple(parts), np.concatenate(first), own, equations, count)

    def triangles(
        self, i: int, shared: Sequence[Shared], measured: Measurements, whitening: Whitening
    ) -> Triangles:
        """Make the triangles of set `i`, by the readings of its parts."""
        width, (rows, k) = self.equations.unknowns, whitening.read[i].shape
        values, columns = np.empty((rows, k)), np.empty((rows, k, width))
        for (mine, _), part in zip(self.parts, shared, strict=True):
            at = slice(None) if len(mine) == rows else mine
            values[at] = part.values
            columns[at, :, :MOTION] = part.by_motion
            for name, place in self._places.items():
                columns[at, :, place] = part.own[name][:, :, self.own[name]]
        residual = measured.instrument.difference(measured.values, values)
        columns[:, :, -1] = residual
        white = whitening.whiten_alone(columns, i)
        factor = self.equations.triangle(white.reshape(-1, width))
        lots = np.cumsum([len(of.first) for _, of in self.parts])[:-1]

        def following(motions: Sequence[FloatArray]) -> FloatArray:
            several = zip(np.split(factor, lots), motions, strict=True)
            return np.concatenate([mine[:, :, :MOTION] @ motion for mine, motion in several])

        by = {name: following([part.by[name] for part in shared]) for name in shared[0].by}
        for name, slots in self.own.items():
            by[name] = np.zeros((len(factor), width, shared[0].own[name].shape[2]))
            by[name][:, :, slots] = factor[:, :, self._places[name]]
        framed = [part.by_frame for part in shared if part.by_frame is not None]
        return Triangles(
            -factor[:, :, -1],
            following([part.by_twist for part in shared]),
            by,
            following(framed) if framed else None,
            of_rows=values,
            residual=residual,
        )

    @cached_property
    def _places(self) -> dict[str, slice]:
        """Columns of the arguments that rows depend on by themselves."""
        found, place = dict[str, slice](), MOTION
        for name, slots in self.own.items():
            found[name] = slice(place, place + len(slots))
            place += len(slots)
        return found


@dataclass(frozen=True, eq=False)
class CompressedPrediction(Prediction):
    """Predicted readings, lots of rows as triangles.

    A lot stands for its rows: where there is one number for each row, it has one, that of the
    first.

    Attributes
    ----------
    whole : Prediction
        Of all rows.
    whitening : Whitening
        Of all rows.
    lots : tuple of RowsInLots or None
        Of each set; None where its rows stay as they are.
    """

    whole: Prediction
    whitening: Whitening
    lots: tuple[RowsInLots | None, ...]

    @property
    def guess(self) -> RowStates:
        """Poses at which a search for the poses begins."""
        return self.whole.guess

    def of_set(self, i: int, pose: FloatArray, theta: FloatArray) -> Predicted:
        """Predict the readings of a set at poses (K, 6), with their derivatives."""
        own, measured = self.lots[i], self.table.sets[i]
        if own is None:
            return self.whole.of_set(i, pose, theta)
        places = self.whole.in_frames(i, pose, theta)
        shared = [
            measured.instrument.shared(at, lots, **numbers)
            for (at, numbers, _), (_, lots) in zip(places, own.parts, strict=True)
        ]
        return own.triangles(i, shared, measured, self.whitening)

    def seen(
        self, pose: FloatArray, theta: FloatArray
    ) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """Return what is predicted of the rows (N, k) of each set, and measured less that."""
        found = self.at(pose, theta)
        return self.of_rows(found), self.residuals(found)

    def of_rows(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Return the predicted values of the rows (N, k) of each set."""
        return tuple(
            each.of_rows if isinstance(each, Triangles) else each.values for each in predicted
        )

    def residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Return measured less predicted of the rows of each set."""
        return tuple(
            each.residual if isinstance(each, Triangles) else self.whole.residual(i, each)
            for i, each in enumerate(predicted)
        )

    def misfits_of(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Return the misfits of the equations of each set, not whitened: of lots, triangles."""
        return tuple(
            -each.values if isinstance(each, Triangles) else self.whole.residual(i, each)
            for i, each in enumerate(predicted)
        )

    def misfits(self, evaluation: Evaluation) -> tuple[FloatArray, ...]:
        """Return `misfits_of` at an evaluation."""
        return self.misfits_of(self.predicted(evaluation))

    def _known(self, evaluation: Evaluation) -> tuple[Predicted, ...]:
        """The predicted readings at an evaluation, which keeps them."""
        known = super()._known(evaluation)
        if known is None:
            known = self.at(evaluation.pose, evaluation.theta)
            evaluation.cache["predicted"] = self, known
        return known

    def by_geometry(self, i: int, evaluation: Evaluation, rows: slice = EVERY) -> FloatArray | None:
        """Derivative to numbers of the geometry at held poses; of lots there is none."""
        return None if self.lots[i] is not None else super().by_geometry(i, evaluation, rows)


def compressed(
    prediction: Prediction, whitening: Whitening
) -> tuple[CompressedPrediction, Whitening, IntArray] | None:
    """Compress prediction and whitening; None where nothing can be.

    The third result is how many numbers that were read each row, or lot, stands for beyond its own.
    """
    table = prediction.table
    alike = [m.instrument.lots(m) for m in table.sets]
    found = tuple(
        None if own is None else RowsInLots.of(prediction, whitening, i, own)
        for i, own in enumerate(alike)
    )
    if not any(found):
        return None
    chosen = [
        np.arange(len(m)) if own is None else own.first
        for m, own in zip(table.sets, found, strict=True)
    ]
    ends = np.cumsum([0, *map(len, table.sets)])
    rows = np.concatenate([mine + end for mine, end in zip(chosen, ends[:-1], strict=True)])
    counts = np.split(table.count, ends[1:-1])
    width = [0 if own is None else own.equations.unknowns for own in found]
    own_counts = [
        count if own is None else np.full(len(own.first), wide)
        for count, own, wide in zip(counts, found, width, strict=True)
    ]
    beyond = [
        np.zeros(len(mine), dtype=np.intp) if own is None else own.count - wide
        for mine, own, wide in zip(chosen, found, width, strict=True)
    ]
    numbers = [
        {name: each[mine] for name, each in of_set.items()}
        for of_set, mine in zip(prediction.numbers, chosen, strict=True)
    ]
    columns = [
        {name: each[mine] for name, each in of_set.items()}
        for of_set, mine in zip(prediction.columns, chosen, strict=True)
    ]
    fewer = replace(
        table,
        rows=table.rows[rows],
        set_of=table.set_of[rows],
        count=np.concatenate(own_counts),
        pose_of=tuple(each[mine] for each, mine in zip(table.pose_of, chosen, strict=True)),
        other_of=tuple(
            None if each is None else each[mine]
            for each, mine in zip(table.other_of, chosen, strict=True)
        ),
        part_of=tuple(each[mine] for each, mine in zip(table.part_of, chosen, strict=True)),
    )
    ones = [np.ones((len(mine), wide)) for mine, wide in zip(chosen, width, strict=True)]
    known = {each.name: getattr(prediction, each.name) for each in fields(Prediction)}
    known |= {"table": fewer, "numbers": tuple(numbers), "columns": tuple(columns)}
    several = zip(found, whitening.white, whitening.read, ones, strict=True)
    parts = [(w, r) if own is None else (one, one > 0.0) for own, w, r, one in several]
    return (
        CompressedPrediction(**known, whole=prediction, whitening=whitening, lots=found),
        replace(
            whitening,
            white=tuple(w for w, _ in parts),
            read=tuple(r for _, r in parts),
            groups=tuple(
                group if own is None else np.full(wide, group[0])
                for group, own, wide in zip(whitening.groups, found, width, strict=True)
            ),
        ),
        np.concatenate(beyond),
    )
