"""Distances: from a fixed point, from the zero of a run, between two places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, TextArray
from pkmcal.core import instruments, screws
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn, numbered
from pkmcal.readings import rows
from pkmcal.readings.components import Components
from pkmcal.readings.dependences import always, point
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.points import ORIGIN
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading, Sets, Solve
from pkmcal.readings.unknowns import Dependence, Found, Start

DISTANCE: Components = (("distance", "mm"),)
ZERO = np.zeros(1)
_WAY = "to.approach"  # columns of files: from where actuators came to the second place


@dataclass(frozen=True, eq=False)
class Distance(Reading):
    """Distance from a fixed point of the base, the rows' target, to a point of the platform.

    Attributes
    ----------
    attachment : (3,), (N, 3) or (k, 3) array, optional
        The point in the platform frame, mm, from which distances are measured: of a wire, a ball
        bar, a leg. One for all rows, one per row, or with `target_index` one for each target.
        None: the platform's origin.
    """

    attachment: ArrayLike | None = None

    name = "distance"
    components = DISTANCE
    point = "base"
    unknown_with_target = ("anchor",)
    unknown_with_attachment = ("attachment",)
    own_points = ("attachment",)

    def predict(
        self,
        at: At,
        target: FloatArray = ORIGIN,
        anchor: FloatArray = ORIGIN,
        zero: FloatArray = ZERO,
        **numbers: FloatArray,
    ) -> Predicted:
        """Distance of `target` (N, 3) of the platform from `anchor` (N, 3) of the base, mm.

        Less `zero` (N, 1), mm.
        """
        return distances(at.pose, target, anchor, zero)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return both ends of the distance."""
        yield point(data.measured, "target", "attachment", data.unknown_attachment)
        yield point(data.measured, "anchor", "anchor", data.unknown_target)

    def reach(self, pose: FloatArray, numbers: Mapping[str, FloatArray]) -> FloatArray:
        """From the point of the base to that of the platform."""
        turned = screws.frames(pose)[:, :3, :3] @ numbers["target"][:, :, None]
        away: FloatArray = pose[:, :3] + turned[:, :, 0] - numbers["anchor"]
        return away

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """Return both ends as stated."""
        return {"target": self._attachments(m), "anchor": m.targets}

    def _attachments(self, m: Measured) -> FloatArray:
        return m.of_points(None if self.attachment is None else np.asarray(self.attachment))

    def found_in(self, table: Table) -> list[str]:
        """A column of distances, without second places and runs."""
        plain = "run" not in table.columns and not any(n.startswith("to.") for n in table.columns)
        return ["distance"] if "distance" in table.columns and plain else []


@dataclass(frozen=True, eq=False)
class RelativeDistance(Distance):
    """A distance less the zero of its run, which is not known.

    Attributes
    ----------
    run : (N,) sequence of str
        In which run each was read, by a name. A run has one zero; a simulated one starts at 0.
    """

    run: Sequence[str] | TextArray | None = None

    name = "relative-distance"
    nouns = ("relative distance", "relative distances")
    starts_by_pose = True
    planned = False
    labels = ("run",)
    anew = "run"

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return both ends, and the zero of each run."""
        yield from super().dependences(data)
        yield always("zero", "run", (("zero", "mm"),), np.asarray(self.run).tolist(), data.starts)

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """The mean zero with which the nominal machine reads the distances of a run."""
        off: dict[str, list[FloatArray]] = {}
        for data, pose in sets:
            m = data.measured
            run, ends = m.instrument.run, m.instrument.arguments(m)
            here = instruments.distances(pose, ends["target"], ends["anchor"])[0] - m.values
            for name in np.unique(run).tolist():
                off.setdefault(name, []).append(here[run == name])
        for name, parts in off.items():
            found["run", name] = Start((0,), np.nan_to_num([_mean(np.concatenate(parts))]))

    def simulated(self, m: Measured, solve: Solve) -> FloatArray:
        """Simulate distances from the first row of each run on."""
        exact = super().simulated(m, solve)
        _, first, of_row = np.unique(np.asarray(self.run), return_index=True, return_inverse=True)
        exact -= exact[first][of_row.reshape(-1)]
        return exact

    def found_in(self, table: Table) -> list[str]:
        """A column of distances beside one of runs."""
        there = "distance" in table.columns and "run" in table.columns
        second = any(name.startswith("to.") for name in table.columns)
        return ["distance"] if there and not second else []

    def names(self, table: Table) -> set[str]:
        """Distances and, beside them, runs."""
        return {"distance"} | ({"run"} if "distance" in table.columns else set())


@dataclass(frozen=True, eq=False)
class Between(Reading):
    """Between where a point of the platform is at two places.

    Attributes
    ----------
    other : (N, n) array
        The actuators at the second place, mm or rad.
    approach : scalar, (n,) or (N, n) array, optional
        From where each actuator came to the second place, for drives with backlash: 1 where its
        reading had grown, -1 where it had fallen, 0 where that is not known. None: the machine was
        driven there from the first place.
    """

    other: ArrayLike | None = None
    approach: ArrayLike | None = None

    name = "between"
    components = DISTANCE
    point = "platform"
    nouns = ("distance between two places", "distances between two places")
    planned = False
    per_row = ("other", "approach")

    def follows_pose(self, machine: Any) -> bool:
        """Return False: a distance between places follows from two poses."""
        return False

    def predict(self, at: At, target: FloatArray = ORIGIN, **numbers: FloatArray) -> Predicted:
        """Distance of the two places of `target` (N, 3) of the platform, mm."""
        assert at.other is not None
        distance, *derivatives = instruments.between(at.pose, at.other, target)
        no_direction(distance, derivatives)
        by_twist, by_other, by_target = (by[:, None, :] for by in derivatives)
        return Predicted(distance[:, None], by_twist, {"target": by_target}, by_other=by_other)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return what distances depend on beside the machine: their targets."""
        yield point(data.measured, "target", "target", data.unknown_target)

    def simulated(self, m: Measured, solve: Solve) -> FloatArray:
        """Simulate distances between the poses of both rows of actuators."""
        there = At(solve(m.actuators, "q").pose, solve(np.asarray(self.other), "other").pose)
        return self.predict(there, target=m.targets).values

    def of_rows(
        self, values: Any, actuators: FloatArray, targets: int | None
    ) -> tuple[Between, ArrayLike | None]:
        """Actuators at the second place, as many as at the first."""
        if self.other is None:
            raise ArgumentError(
                "other: a distance between two places needs the actuators at the second"
            )
        other = rows.numbers("other", self.other)
        other = np.atleast_2d(other) if len(actuators) == 1 else other
        if other.shape != actuators.shape:
            raise ArgumentError(
                f"other must have shape {actuators.shape}, as actuators; found {other.shape}"
            )
        fields = {"other": other}
        if self.approach is not None:
            fields["approach"] = rows.signs("approach", self.approach, actuators.shape)
        return self.with_fields(fields), values

    def approached(self, actuators: FloatArray, first: FloatArray | None) -> FloatArray | None:
        """Approach as stated, or from the first place."""
        if self.approach is not None:
            return np.asarray(self.approach, dtype=np.float64)
        if first is None:
            return None
        moved = np.sign(np.asarray(self.other) - actuators)
        return np.where(moved == 0.0, first, moved)

    def found_in(self, table: Table) -> list[str]:
        """A column of distances beside actuators of a second place."""
        second = any(name.startswith("to.") for name in table.columns)
        return ["distance"] if "distance" in table.columns and second else []

    def names(self, table: Table) -> set[str]:
        """Distances, and ``to.q1`` …, ``to.approach.q1`` … for the actuators that are there."""
        names = [name for name in table.columns if name[:1] == "q"]
        ways = [_WAY, *(f"{_WAY}.{name}" for name in names)]
        return {"distance", *(f"to.{name}" for name in names), *ways}

    def read(self, table: Table, units: Sequence[str]) -> Between:
        """The actuators at the second place, in the units of those at the first; steps, too."""
        names = [f"q{i + 1}" for i in range(len(units))]
        table.require([f"to.{name}" for name in names])
        columns = []
        for name, unit in zip(names, units, strict=True):
            second = f"to.{name}"
            values, quantity = table.numbers(second, unit, "count", expected=unit)
            _, of_first = table.numbers(name, unit, "count", expected=unit)
            counts = [table.columns[each].unit for each in (name, second)]
            if quantity != of_first or (quantity == "count" and counts[0] != counts[1]):
                raise table.header_error(f"columns {name!r} and {second!r} have unlike units")
            columns.append(values)
        ways = [f"{_WAY}.{name}" for name in names]
        of_all = [_WAY] * len(names) if _WAY in table.columns else ways
        approach = None
        if any(way in table.columns for way in of_all):
            table.require(of_all)
            approach = np.stack([table.integers(way) for way in of_all], axis=1)
        return replace(self, other=np.stack(columns, axis=1), approach=approach)

    def columns(self, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """The actuators at the second place."""
        yield from numbered("to", units, np.asarray(self.other))
        if self.approach is not None:
            yield from numbered(_WAY, "", np.asarray(self.approach).astype(np.int64))


def distances(
    pose: FloatArray, target: FloatArray, anchor: FloatArray, zero: FloatArray
) -> Predicted:
    """Distances of points of the platform from points of the base, less a zero."""
    distance, *derivatives = instruments.distances(pose, target, anchor, zero)
    no_direction(distance + zero.reshape(-1), derivatives)
    by_twist, by_target, by_anchor = (by[:, None, :] for by in derivatives)
    by_zero = np.full((len(pose), 1, 1), -1.0)
    by = {"target": by_target, "anchor": by_anchor, "zero": by_zero}
    return Predicted(distance[:, None], by_twist, by)


def no_direction(distance: FloatArray, derivatives: list[FloatArray]) -> None:
    """Set derivatives of a distance of 0, which has no direction, to 0."""
    for by in derivatives:
        by[distance == 0] = 0.0


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else 0.0
