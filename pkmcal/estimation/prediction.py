"""Predicted readings of instruments at given poses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, held_once, lots
from pkmcal.effects.effect import EffectOfRows
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_table import PoseTable, pose_table
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.sessions import NONE
from pkmcal.estimation.shapes import effect_of_rows, moved_by, require_derivatives
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings import orientation
from pkmcal.readings.dependences import yielded
from pkmcal.readings.predicted import At, Predicted, joined, require_predicted
from pkmcal.readings.unknowns import ORIGIN

LOT = 16384  # rows that are predicted at once: derivatives take ten times what was read
EVERY = slice(None)

RowsOfSets = dict[int, dict[int, IntArray]]  # by the first parameter and the set


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
    points : tuple of tuple of str
        The arguments of each set that are points of the platform.
    carried : tuple of str
        The argument of each set that is the pose of what the platform carries; "" where none is.
    effects : tuple of tuple of EffectOfRows
        Those of each set.
    """

    datasets: tuple[FitData, ...]
    table: PoseTable
    parameters: Parameters
    given: tuple[Mapping[str, FloatArray], ...]
    numbers: tuple[Mapping[str, IntArray], ...]
    columns: tuple[Mapping[str, IntArray], ...]
    points: tuple[tuple[str, ...], ...]
    carried: tuple[str, ...]
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
            if sum(each.nature.pose for each in own) > 1:
                raise ArgumentError("kind: a reading can depend on one pose of what is carried")
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
            points=tuple(
                tuple(each.argument for each in own if each.nature.point_of == "platform")
                for own in depend
            ),
            carried=tuple(
                next((each.argument for each in own if each.nature.pose), "") for own in depend
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
    def carried_things(self) -> RowsOfSets:
        """Rows of each set that have each thing on the platform, by its first parameter."""
        found: RowsOfSets = {}
        for i in range(len(self.columns)):
            if (columns := self.carried_columns(i)) is not None:
                _collect(found, i, columns[:, 0])
        return found

    def carried_columns(self, i: int) -> IntArray | None:
        """Parameters (N, 6) of the pose of what the platform carries in rows of set `i`, if any."""
        return self.columns[i].get(self.carried[i])

    @property
    def guess(self) -> RowStates:
        """Return the start of a search for the poses: home, or the poses that were read."""
        table = self.table
        guess = np.tile(self.parameters.robot.home, (len(table.actuators), 1))
        for i, (measured, place) in enumerate(zip(table.sets, table.pose_of, strict=True)):
            elsewhere = self.datasets[i].framed or self.carried_columns(i) is not None
            if measured.instrument.is_place and not elsewhere:
                known = np.isfinite(measured.values)
                ever = np.flatnonzero(known.any(axis=0))  # not across a plane, say
                read = np.flatnonzero(known[:, ever].all(axis=1))
                values = measured.values[np.ix_(read, ever)]
                if 5 in ever:  # angles are read together
                    values[:, -3:] = orientation.shortest(values[:, -3:])
                guess[np.ix_(place[read], ever)] = values
        return RowStates(guess, table.actuators, np.zeros(len(guess), dtype=np.int32))

    def arguments_of(self, i: int, theta: FloatArray) -> dict[str, FloatArray]:
        """Return what readings of set `i` depend on beside the pose, (N, w) each, for `predict`."""
        found = dict(self.given[i])
        for name, columns in self.columns[i].items():
            found[name] = np.where(columns == NONE, found[name], theta[columns])
        if (carried := self.carried_columns(i)) is not None:
            first, thing = np.unique(carried[:, 0], return_inverse=True)
            origins = [self.parameters.origin[column] for column in first.tolist()]
            found[f"{self.carried[i]}{ORIGIN}"] = np.array(origins)[thing.reshape(-1)]
        return {name: _kept(each) for name, each in found.items()}

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
        alone = self.unmoved(i, pose, theta, rows, numbers)
        if not self.table.sets[i].instrument.components:
            return alone
        moved = self._moved(i, rows, alone, pose, theta, numbers)
        require_derivatives(self.datasets[i], moved, self.numbers[i])
        return moved

    def unmoved(
        self,
        i: int,
        pose: FloatArray,
        theta: FloatArray,
        rows: slice = EVERY,
        numbers: Mapping[str, FloatArray] | None = None,
    ) -> Predicted:
        """Predict some rows of a set at poses (K, 6) as if no effect moved the machine."""
        reading, count = self.table.sets[i].instrument, len(self.table.pose_of[i][rows])
        if not reading.components:
            return Predicted(np.empty((count, 0)), np.empty((count, 0, 6)))
        parts, places = list[Predicted](), list[IntArray]()
        for at, own, place in self.in_frames(i, pose, theta, rows, numbers):
            found = reading.predict(at, **own)
            require_predicted(reading, len(place), found, at.frame is not None)
            parts.append(found)
            places.append(place)
        return joined(parts, places)

    def lots_of(
        self, i: int, evaluation: Evaluation, most: int = LOT
    ) -> Iterator[tuple[slice, Predicted]]:
        """Predict the readings of a set at an evaluation, lot by lot: rows, and these."""
        numbers = self.arguments_at(i, evaluation)
        for rows in lots(len(self.table.pose_of[i]), most):
            yield rows, self.some_at(i, rows, evaluation, numbers)

    def seen(
        self, pose: FloatArray, theta: FloatArray
    ) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """Return what is predicted of the rows (N, k) of each set, and measured less that."""
        values = []
        for i, m in enumerate(self.table.sets):
            numbers, found = self.arguments_of(i, theta), np.empty((len(m), len(m.components)))
            for rows in lots(len(m), LOT):
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
            each.argument for effect in data.effects for each in yielded(effect, data.measured)
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
                    found = moved_by(effect, machine, pose[at], table.actuators[at], rows, numbers)
                    change[here] += np.einsum("nki,ni->nk", by_twist[here], found.twist)
                    for name, rates in found.by.items():
                        by.setdefault(name, np.zeros((*change.shape, rates.shape[2])))
                        by[name][here] += by_twist[here] @ rates
                for point in self.points[i] if found.growth is not None else ():
                    if point not in predicted.by:
                        continue
                    assert found.growth is not None
                    shift = numbers[point][rows] * found.growth[:, None]
                    by_point = predicted.by[point][here]
                    change[here] += np.einsum("nki,ni->nk", by_point, shift)
                    by_growth = by_point @ numbers[point][rows][:, :, None]
                    for name, rates in found.growth_by.items():
                        by.setdefault(name, np.zeros((*change.shape, rates.shape[1])))
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

    # at an evaluation -----------------------------------------------------------------------------

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

    def some_at(
        self, i: int, rows: slice, evaluation: Evaluation, numbers: Mapping[str, FloatArray]
    ) -> Predicted:
        """Predict some rows of a set at an evaluation; `numbers` are `arguments_of` all of them."""
        known = self._known(evaluation)
        if known is not None:
            return known[i].some(rows)
        return self._predicted(i, rows, evaluation.pose, evaluation.theta, numbers)

    def arguments_at(self, i: int, evaluation: Evaluation) -> dict[str, FloatArray]:
        """Return what `some_at` needs: `arguments_of` a set, unless its readings are known."""
        return {} if self._known(evaluation) else self.arguments_of(i, evaluation.theta)

    def _known(self, evaluation: Evaluation) -> tuple[Predicted, ...] | None:
        """Return what the evaluation knows of the predicted readings."""
        owner, known = evaluation.cache.get("predicted", (None, ()))
        return known if owner is self else None

    def by_geometry(self, i: int, evaluation: Evaluation, rows: slice = EVERY) -> FloatArray | None:
        """Derivative (N, k, g) of rows of a set to the geometry at held poses; None: it is 0."""
        at = self._place(i, rows, evaluation.pose, evaluation.theta)
        return self.table.sets[i].instrument.by_geometry(at, self.parameters.places)


def _kept(numbers: FloatArray) -> FloatArray:
    """A view of numbers that nobody can write: all machines, readings and effects have them."""
    found: FloatArray = numbers.view()
    found.setflags(write=False)
    return found


def _columns(columns: IntArray, part: IntArray, numbers: IntArray) -> IntArray:
    """The parameters (N, w) of numbers of rows (N, w), by those (P, m) of the part (N,) of each."""
    return np.where(numbers == NONE, NONE, columns[part[:, None], numbers])


def _collect(found: RowsOfSets, i: int, first: IntArray) -> None:
    """Add the rows of set `i` whose first parameters are these (N,)."""
    for each in np.unique(first).tolist():
        found.setdefault(each, {})[i] = np.flatnonzero(first == each)
