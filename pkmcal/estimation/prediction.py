"""Predicted readings of instruments at given poses, and their derivatives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, chained, held_once, lots
from pkmcal.effects.effect import EffectOfRows
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_table import PoseTable, pose_table
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import NONE, by_parameters
from pkmcal.estimation.shapes import effect_of_rows, require_derivatives, require_moved
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings import orientation
from pkmcal.readings.predicted import (
    At,
    Predicted,
    joined,
    predicted_by,
    require_predicted,
)

_BATCH = 1024  # rows whose derivatives by the parameters are made at once, as many as caches hold
_LOT = 16 * _BATCH  # rows that are predicted at once: derivatives take ten times what was read
EVERY = slice(None)

RowsOfSets = dict[int, dict[int, IntArray]]  # by the first parameter and the set
Part = tuple[int, slice, FloatArray]  # a set, rows of it, and their derivative (b, k, n)


class Some(NamedTuple):
    """Rows of a set, from the `first` on: their readings, and these by the geometry directly."""

    first: int
    predicted: Predicted
    direct: FloatArray | None

    def of(self, rows: slice) -> Some:
        """The same of some of them, by their places in the set."""
        mine = slice(rows.start - self.first, rows.stop - self.first)
        direct = None if self.direct is None else self.direct[mine]
        return Some(rows.start, self.predicted.some(mine), direct)


@dataclass(frozen=True, eq=False)
class Prediction:
    """The predicted readings of instruments at given poses, and their derivatives.

    Attributes
    ----------
    datasets : tuple of FitData
        The rows of each set as they were given; values that are fitted are those of `table`.
    table : PoseTable
        The rows and their poses.
    parameters : Parameters
        The parameter vector.
    given : tuple of mapping of str to ndarray (N, w)
        What is given of each set, by the name that `Reading.predict` has for it.
    numbers, columns : tuple of mapping of str to ndarray of int (N, w)
        Of what is estimated, which number of a row each is, and which parameter; `NONE` where the
        number is held.
    effects : tuple of tuple of EffectOfRows
        Those of each set.
    """

    datasets: tuple[FitData, ...]
    table: PoseTable
    parameters: Parameters
    given: tuple[Mapping[str, FloatArray], ...]
    numbers: tuple[Mapping[str, IntArray], ...]
    columns: tuple[Mapping[str, IntArray], ...]
    effects: tuple[tuple[EffectOfRows, ...], ...]

    @classmethod
    def of(
        cls,
        datasets: Sequence[FitData],
        parameters: Parameters,
        table: PoseTable | None = None,
    ) -> Prediction:
        """Make the prediction of the rows to be fitted or held out; `table` is theirs, if known.

        Raises
        ------
        ValueError
            An effect that has an argument of the name of another.
        """
        table = pose_table(datasets, parameters) if table is None else table
        depend = [list(data.dependences()) for data in datasets]
        for own in depend:
            for name, several in Counter(each.argument for each in own).items():
                if several > 1:
                    raise ArgumentError(f"effects: several arguments are called {name!r}")
        numbers = [
            {each.argument: parameters.numbers_of(each) for each in own if each.estimated}
            for own in depend
        ]
        return cls(
            datasets=tuple(datasets),
            table=table,
            parameters=parameters,
            given=tuple({each.argument: held_once(each.given) for each in own} for own in depend),
            numbers=tuple(numbers),
            columns=tuple(
                {name: _columns(table.columns, part, own) for name, own in mine.items()}
                for mine, part in zip(numbers, table.part_of, strict=True)
            ),
            effects=tuple(
                tuple(effect_of_rows(effect, data.measured) for effect in data.effects)
                for data in datasets
            ),
        )

    @cached_property
    def frames(self) -> RowsOfSets:
        """Rows of each set that are in each frame, by its first parameter."""
        found: RowsOfSets = {}
        for i, (data, part) in enumerate(zip(self.datasets, self.table.part_of, strict=True)):
            if data.frame is not None:
                number = self.parameters.nuisance[data.frame]
                _collect(found, i, self.table.columns[part, number])
        return found

    @cached_property
    def tools(self) -> RowsOfSets:
        """Rows of each set that have each tool, by its first parameter."""
        found: RowsOfSets = {}
        for i, columns in enumerate(self.columns):
            if "tool" in columns:
                _collect(found, i, columns["tool"][:, 0])
        return found

    @property
    def guess(self) -> RowStates:
        """Return the start of a search for the poses: home, or the poses that were read."""
        table = self.table
        guess = np.tile(self.parameters.robot.home, (len(table.actuators), 1))
        for i, (measured, place) in enumerate(zip(table.sets, table.pose_of, strict=True)):
            elsewhere = self.datasets[i].framed or "tool" in self.columns[i]
            if measured.instrument.is_place and not elsewhere:
                known = np.isfinite(measured.values)
                ever = np.flatnonzero(known.any(axis=0))  # not across a plane, say
                read = np.flatnonzero(known[:, ever].all(axis=1))
                values = measured.values[np.ix_(read, ever)]
                if 5 in ever:  # angles are read together
                    values[:, -3:] = orientation.shortest(values[:, -3:])
                guess[np.ix_(place[read], ever)] = values
        return RowStates(guess, table.actuators, np.zeros(len(guess), dtype=np.int32))

    def refuse_free_poses(self) -> None:
        """Refuse what needs exact actuators, where poses have unknowns.

        Those are effects, and readings of joints and between poses.
        """
        effects = [effect.name for data in self.datasets for effect in data.effects]
        if effects:
            names = ", ".join(dict.fromkeys(effects))
            raise ArgumentError(
                f"{names}: needs poses that follow from the actuators: no actuator_sigma, and"
                " no surplus actuators; found others"
            )
        for m in self.table.sets:
            if not m.instrument.follows_pose(self.parameters.robot):
                raise ArgumentError(
                    f"measurements: readings of kind {m.kind!r} need poses that follow from the"
                    " actuators: no actuator_sigma, and no surplus actuators"
                )

    def arguments_of(self, i: int, theta: FloatArray) -> dict[str, FloatArray]:
        """Return what readings of set `i` depend on beside the pose, (N, w) each, for `predict`."""
        found = dict(self.given[i])
        for name, columns in self.columns[i].items():
            found[name] = np.where(columns == NONE, found[name], theta[columns])
        if "tool" in self.columns[i]:
            first, tool = np.unique(self.columns[i]["tool"][:, 0], return_inverse=True)
            origins = [self.parameters.origin[column] for column in first.tolist()]
            found["tool_origin"] = np.array(origins)[tool.reshape(-1)]
        return found

    def at(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Predict the readings of each set at poses (K, 6), with their derivatives."""
        return tuple(self.of_set(i, pose, theta) for i in range(len(self.table.sets)))

    def of_set(self, i: int, pose: FloatArray, theta: FloatArray) -> Predicted:
        """Predict the readings of a set at poses (K, 6), with their derivatives."""
        return self._predicted(i, EVERY, pose, theta, self.arguments_of(i, theta))

    def _predicted(
        self,
        i: int,
        rows: slice,
        pose: FloatArray,
        theta: FloatArray,
        numbers: Mapping[str, FloatArray],
    ) -> Predicted:
        """Predict some rows of a set; `numbers` are `arguments_of` all of them."""
        m, count = self.table.sets[i], len(self.table.pose_of[i][rows])
        if not m.instrument.components:
            return Predicted(np.empty((count, 0)), np.empty((count, 0, 6)))
        parts = [
            (predicted_by(m.instrument, at, own), place)
            for at, own, place in self.in_frames(i, pose, theta, rows, numbers)
        ]
        alone = joined(*map(list, zip(*parts, strict=True)))
        require_predicted(m.instrument, count, alone)
        moved = self._moved(i, rows, alone, pose, theta, numbers)
        estimated = {name: columns[rows] for name, columns in self.numbers[i].items()}
        require_derivatives(m.instrument, moved, estimated)
        return moved

    def lots_of(
        self, i: int, evaluation: Evaluation, most: int = _LOT
    ) -> Iterator[tuple[slice, Predicted]]:
        """Predict the readings of a set at an evaluation, lot by lot: rows, and these."""
        numbers = self._arguments(i, evaluation)
        for rows in lots(len(self.table.pose_of[i]), most):
            yield rows, self._of_some(i, rows, evaluation, numbers)

    def seen(
        self, pose: FloatArray, theta: FloatArray
    ) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """Return what is predicted of the rows (N, k) of each set, and measured less that."""
        values = []
        for i, m in enumerate(self.table.sets):
            numbers, found = self.arguments_of(i, theta), np.empty((len(m), len(m.components)))
            for rows in lots(len(m), _LOT):
                found[rows] = self._predicted(i, rows, pose, theta, numbers).values
            values.append(found)
        pairs = zip(self.table.sets, values, strict=True)
        return tuple(values), tuple(m.instrument.difference(m.values, each) for m, each in pairs)

    def of_rows(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Return the predicted values of the rows (N, k) of each set."""
        return tuple(each.values for each in predicted)

    def residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Measured less predicted of the rows of each set."""
        return tuple(self.residual(i, each) for i, each in enumerate(predicted))

    def residual(self, i: int, predicted: Predicted) -> FloatArray:
        """Measured less predicted (N, k) of a set."""
        measured = self.table.sets[i]
        return measured.instrument.difference(measured.values, predicted.values)

    def misfits_of(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Return the misfits of the equations of each set, not whitened: the residuals."""
        return self.residuals(predicted)

    def misfits(self, evaluation: Evaluation) -> tuple[FloatArray, ...]:
        """Return `misfits_of` at an evaluation."""
        return evaluation.residuals

    def rows_in_frames(self, i: int) -> list[IntArray]:
        """Rows of a set in each frame; all of them where it has none."""
        found = [of_sets[i] for of_sets in self.frames.values() if i in of_sets]
        return found or [np.arange(len(self.table.pose_of[i]))]

    def in_frames(
        self,
        i: int,
        pose: FloatArray,
        theta: FloatArray,
        rows: slice = EVERY,
        numbers: Mapping[str, FloatArray] | None = None,
    ) -> Iterator[tuple[At, dict[str, FloatArray], IntArray]]:
        """Iterate over the frames of a set: place, arguments of `predict`, rows of each.

        Of some of its rows, which count from the first of these; `numbers` are `arguments_of` the
        set, where they are known.
        """
        data, at = self.datasets[i], self._place(i, rows, pose, theta)
        given = self.arguments_of(i, theta) if numbers is None else numbers
        of_effects = {
            each.argument for effect in data.effects for each in effect.dependences(data.measured)
        }
        mine = {name: each[rows] for name, each in given.items() if name not in of_effects}
        first_row, last_row, _ = rows.indices(len(self.table.pose_of[i]))
        frames = [
            (first, of_sets[i][slice(*np.searchsorted(of_sets[i], [first_row, last_row]))])
            for first, of_sets in self.frames.items()
            if i in of_sets
        ]
        if not frames:
            yield at, mine, np.arange(len(at.pose))
        for first, in_set in frames:
            some = in_set - first_row
            if not len(some) and len(at.pose):
                continue
            every = len(some) == len(at.pose)
            numbers_here = mine if every else {name: each[some] for name, each in mine.items()}
            frame, origin = theta[first : first + 6], self.parameters.origin[first]
            place = at.pose if every else at.pose[some]
            yield replace(at, pose=place, frame=frame, origin=origin), numbers_here, some

    def _moved(
        self,
        i: int,
        some: slice,
        predicted: Predicted,
        pose: FloatArray,
        theta: FloatArray,
        numbers: Mapping[str, FloatArray],
    ) -> Predicted:
        """Predict some readings of set `i` where effects have moved the platform."""
        effects = self.effects[i]
        if not effects:
            return predicted
        table, first = self.table, some.start or 0
        places = [(table.pose_of[i], predicted.by_twist)]
        if predicted.by_other is not None and (other := table.other_of[i]) is not None:
            places.append((other, predicted.by_other))
        by, change = dict(predicted.by), np.zeros(predicted.values.shape)
        for effect in effects:
            for machine, here in self._machines_of_lots(i, some, theta):
                rows = here + first
                for place, by_twist in places:
                    at = place[rows]
                    found = effect.moved(machine, pose[at], table.actuators[at], rows, numbers)
                    require_moved(effect, len(rows), found)
                    change[here] += np.einsum("nki,ni->nk", by_twist[here], found.twist)
                    for name, rates in found.by.items():
                        by.setdefault(name, np.zeros((*change.shape, rates.shape[2])))
                        by[name][here] += by_twist[here] @ rates
                if found.growth is not None and "target" in numbers and "target" in predicted.by:
                    shift = numbers["target"][rows] * found.growth[:, None]
                    by_target = predicted.by["target"][here]
                    change[here] += np.einsum("nki,ni->nk", by_target, shift)
                    by_growth = by_target @ numbers["target"][rows][:, :, None]
                    for name, rates in found.growth_by.items():
                        by[name][here] += by_growth * rates[:, None, :]
        values = table.sets[i].instrument.corrected(predicted.values, change)
        return replace(predicted, values=values, by=by)

    def _place(self, i: int, rows: slice, pose: FloatArray, theta: FloatArray) -> At:
        """Return the machine's place in some rows of set `i`."""
        measured, place = self.table.sets[i], self.table.pose_of[i][rows]
        other, axis = self.table.other_of[i], self.datasets[i].axis
        return At(
            pose[place],
            None if other is None else pose[other[rows]],
            axis=None if axis is None else axis[rows],
            machines=lambda: self.machines_of(i, theta, rows),
            measured=measured if len(place) == len(measured) else measured.select(rows),
        )

    def machines_of(
        self, i: int, theta: FloatArray, some: slice = EVERY
    ) -> Iterator[tuple[Calibratable, IntArray]]:
        """The machines of some rows of set `i`, one or one a session, and the rows of each."""
        table, p = self.table, self.parameters
        machine_of_row = table.machine_of_pose[table.pose_of[i][some]]
        for machine in np.unique(machine_of_row):
            values = p.values_at(theta, table.machine_columns[machine])
            yield p.robot.with_values(values), np.flatnonzero(machine_of_row == machine)

    def _machines_of_lots(
        self, i: int, some: slice, theta: FloatArray
    ) -> Iterator[tuple[Calibratable, IntArray]]:
        """`machines_of` with lots of the rows of each: effects then hold little of them."""
        for machine, rows in self.machines_of(i, theta, some):
            for lot in lots(len(rows)):
                yield machine, rows[lot]

    # derivatives by the parameters ----------------------------------------------------------------

    def predicted(self, evaluation: Evaluation) -> tuple[Predicted, ...]:
        """Predict the readings at an evaluation, which may know them."""
        known = self._known(evaluation)
        return self.at(evaluation.pose, evaluation.theta) if known is None else known

    def values(self, evaluation: Evaluation) -> tuple[FloatArray, ...]:
        """Return what is predicted of the rows (N, k) of each set at an evaluation."""
        known = self._known(evaluation)
        if known is not None:
            return self.of_rows(known)
        return self.seen(evaluation.pose, evaluation.theta)[0]

    def _of_some(
        self, i: int, rows: slice, evaluation: Evaluation, numbers: Mapping[str, FloatArray]
    ) -> Predicted:
        """Predict some rows of a set at an evaluation; `numbers` are `arguments_of` all of them."""
        known = self._known(evaluation)
        if known is not None:
            return known[i].some(rows)
        return self._predicted(i, rows, evaluation.pose, evaluation.theta, numbers)

    def _arguments(self, i: int, evaluation: Evaluation) -> dict[str, FloatArray]:
        """Return what `_of_some` needs: `arguments_of` a set, unless its readings are known."""
        return {} if self._known(evaluation) else self.arguments_of(i, evaluation.theta)

    def _known(self, evaluation: Evaluation) -> tuple[Predicted, ...] | None:
        """Return what the evaluation knows of the predicted readings."""
        owner, known = evaluation.cache.get("predicted", (None, ()))
        return known if owner is self else None

    def derivatives(self, evaluation: Evaluation) -> Iterator[tuple[slice, list[Part]]]:
        """Derivatives of the predicted values by the parameters, batch by batch.

        A batch is rows through all sets, and for each set that has some of these its rows and their
        derivative (b, k, n). There is one batch where poses have unknowns.

        Where there are few rows the evaluation has them for the next who asks.
        """
        owner, known = evaluation.cache.pop("derivatives", (None, []))
        if owner is self:
            yield slice(0, len(self.table.rows)), known
            return
        count, place = len(self.table.rows), np.full(len(evaluation.pose), NONE)
        numbers = [self._arguments(i, evaluation) for i in range(len(self.table.sets))]
        at_once = bool(evaluation.machines.unknowns)
        for lot in lots(count, count if at_once else _LOT):
            seen = {
                i: Some(
                    rows.start,
                    self._of_some(i, rows, evaluation, numbers[i]),
                    self.by_geometry(i, evaluation, rows),
                )
                for i, rows in self._in_sets(lot)
            }
            last = min(lot.stop, count)
            for batch in lots(last, count if at_once else _BATCH, lot.start):
                found = self._of_batch(batch, seen, evaluation, place)
                if count <= _BATCH:
                    again = [(i, rows, part.copy()) for i, rows, part in found]
                    evaluation.cache["derivatives"] = self, again
                yield batch, found

    def _of_batch(
        self, batch: slice, seen: Mapping[int, Some], evaluation: Evaluation, place: IntArray
    ) -> list[Part]:
        """Derivatives of a batch of rows through all sets, of the rows `seen`; `place` is NONE."""
        table, machines, misfits = self.table, evaluation.machines, self.misfits(evaluation)
        some = [(i, rows, seen[i].of(rows)) for i, rows in self._in_sets(batch)]
        wide = table.columns.shape[1]
        parts = [np.zeros((*each.predicted.values.shape, wide)) for _, _, each in some]
        for poses, twists in machines.twists_by_numbers(
            evaluation.states, self.parameters.places, self._poses_of(some)
        ):
            place[poses] = np.arange(len(poses))
            for (i, rows, each), part in zip(some, parts, strict=True):
                known, other = each.predicted, table.other_of[i]
                _add_motion(part, known.by_twist, twists, place[table.pose_of[i][rows]])
                if known.by_other is not None and other is not None:
                    _add_motion(part, known.by_other, twists, place[other[rows]])
            place[poses] = NONE
        found = list[Part]()
        for (i, rows, each), part in zip(some, parts, strict=True):
            self._add_direct(part, i, rows, each)
            by = by_parameters(part, table.columns, table.part_of[i][rows], len(self.parameters))
            found.append((i, rows, table.sets[i].instrument.by_difference(by, misfits[i][rows])))
        return found

    def by_geometry(self, i: int, evaluation: Evaluation, rows: slice = EVERY) -> FloatArray | None:
        """Derivative (N, k, g) of rows of a set to the geometry at held poses; None: it is 0."""
        at = self._place(i, rows, evaluation.pose, evaluation.theta)
        return self.table.sets[i].instrument.by_geometry(at, self.parameters.places)

    def jacobian(self, evaluation: Evaluation) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n).

        With the opposite sign that of the residuals.
        """
        n = len(self.parameters)
        found = [np.empty((*each.shape, n)) for each in self.misfits(evaluation)]
        for _, parts in self.derivatives(evaluation):
            for i, rows, part in parts:
                found[i][rows] = part
        return found

    def _add_direct(self, part: FloatArray, i: int, rows: slice, seen: Some) -> None:
        """Add how readings follow numbers beside the pose to their derivatives (b, k, m)."""
        places, named = self.parameters.places, self.datasets[i].frame
        if seen.direct is not None:
            part[:, :, : len(places)] += seen.direct
        if seen.predicted.by_frame is not None and named is not None:
            frame = self.parameters.nuisance[named]
            part[:, :, frame : frame + 6] = seen.predicted.by_frame
        for name, numbers in self.numbers[i].items():
            own = numbers[rows]
            row, slot = np.nonzero(own != NONE)
            part[row, :, own[row, slot]] += seen.predicted.by[name][row, :, slot]

    def _in_sets(self, batch: slice) -> Iterator[tuple[int, slice]]:
        """Rows of each set that has some of these, which count through all sets."""
        first = 0
        for i, place in enumerate(self.table.pose_of):
            last = first + len(place)
            if batch.start < last and first < batch.stop:
                yield i, slice(max(batch.start - first, 0), min(batch.stop, last) - first)
            first = last

    def _poses_of(self, some: Sequence[tuple[int, slice, Some]]) -> IntArray:
        """Distinct poses of rows of sets: in the order of the rows, unless some have one."""
        table = self.table
        if sum(rows.stop - rows.start for _, rows, _ in some) == len(table.rows):
            return np.arange(len(table.actuators))
        pairs = [((table.pose_of[i], table.other_of[i]), rows) for i, rows, _ in some]
        ends = [end[rows] for both, rows in pairs for end in both if end is not None]
        whole = np.concatenate(ends)
        count, last = np.arange(len(whole)), np.empty(len(table.actuators), dtype=np.intp)
        last[whole] = count
        return whole if np.array_equal(last[whole], count) else np.unique(whole)


def _columns(columns: IntArray, part: IntArray, numbers: IntArray) -> IntArray:
    """The parameters (N, w) of numbers of rows (N, w), by those (P, m) of the part (N,) of each."""
    return np.where(numbers == NONE, NONE, columns[part[:, None], numbers])


def _collect(found: RowsOfSets, i: int, first: IntArray) -> None:
    """Add the rows of set `i` whose first parameters are these (N,)."""
    for each in np.unique(first).tolist():
        found.setdefault(each, {})[i] = np.flatnonzero(first == each)


def _add_motion(
    part: FloatArray, by_twist: FloatArray, twists: FloatArray, place: IntArray
) -> None:
    """Add how readings follow the twists (b, 6, g) to their derivatives (N, k, m), g ≤ m.

    `by_twist` is (N, k, 6), `place` (N,) which of the twists moves each row; `NONE`: none of them.
    """
    into = part[:, :, : twists.shape[2]]
    moved = np.flatnonzero(place != NONE)
    if len(moved) == len(place):
        into += chained(by_twist, twists, place)
    else:
        into[moved] += chained(by_twist[moved], twists, place[moved])
