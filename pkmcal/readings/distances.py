"""Distances: from a fixed point, from the zero of a run, between two places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import instruments
from pkmcal.readings.points import ORIGIN
from pkmcal.readings.reading import At, Components, Predicted, Reading
from pkmcal.readings.unknowns import Dependence, Found, Start, always, point

DISTANCE: Components = (("distance", "mm"),)
ZERO = np.zeros(1)


@dataclass(frozen=True)
class Distance(Reading):
    """From a fixed point of the base to a point of the platform."""

    name: str = "distance"
    components: Components = DISTANCE
    point: Any = "base"

    def predict(
        self,
        at: At,
        target: FloatArray = ORIGIN,
        anchor: FloatArray = ORIGIN,
        zero: FloatArray = ZERO,
        **_: FloatArray,
    ) -> Predicted:
        return distances(at.pose, target, anchor, zero)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        yield point(data.measured, "target", "attachment", data.unknown_attachment)
        yield point(data.measured, "anchor", "anchor", data.unknown_target)

    def simulated(self, m: Any, truth: Any) -> dict[str, FloatArray]:
        return {"target": m.attachments, "anchor": m.targets}


@dataclass(frozen=True)
class RelativeDistance(Distance):
    """The same less the zero of its run."""

    name: str = "relative-distance"
    nouns: Any = ("relative distance", "relative distances")
    starts_by_pose = True

    def dependences(self, data: Any) -> Iterator[Dependence]:
        yield from super().dependences(data)
        runs = data.measured.run.tolist()
        yield always("zero", "run", (("zero", "mm"),), runs, data.starts)

    def starts(self, machine: Any, sets: Sequence[tuple[Any, FloatArray]], found: Found) -> None:
        off: dict[str, list[FloatArray]] = {}
        for data, pose in sets:
            m = data.measured
            here = instruments.distances(pose, m.attachments, m.targets)[0] - m.values
            for name in np.unique(m.run).tolist():
                off.setdefault(name, []).append(here[m.run == name])
        for name, parts in off.items():
            found["run", name] = Start((0,), np.nan_to_num([_mean(np.concatenate(parts))]))


@dataclass(frozen=True)
class Between(Reading):
    """Between where a point of the platform is at two places."""

    name: str = "between"
    components: Components = DISTANCE
    point: Any = "platform"
    nouns: Any = ("distance between two places", "distances between two places")

    def predict(self, at: At, target: FloatArray = ORIGIN, **_: FloatArray) -> Predicted:
        assert at.other is not None
        return between(at.pose, at.other, target)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        yield point(data.measured, "target", "target", data.unknown_target)

    def simulated(self, m: Any, truth: Any) -> dict[str, FloatArray]:
        return {"target": m.targets}


def distances(
    pose: FloatArray, target: FloatArray, anchor: FloatArray, zero: FloatArray
) -> Predicted:
    distance, *derivatives = instruments.distances(pose, target, anchor, zero)
    no_direction(distance + zero.reshape(-1), derivatives)
    by_twist, by_target, by_anchor = (by[:, None, :] for by in derivatives)
    by_zero = np.full((len(pose), 1, 1), -1.0)
    by = {"target": by_target, "anchor": by_anchor, "zero": by_zero}
    return Predicted(distance[:, None], by_twist, by)


def between(pose: FloatArray, other: FloatArray, target: FloatArray) -> Predicted:
    distance, *derivatives = instruments.between(pose, other, target)
    no_direction(distance, derivatives)
    by_twist, by_other, by_target = (by[:, None, :] for by in derivatives)
    return Predicted(distance[:, None], by_twist, {"target": by_target}, by_other=by_other)


def no_direction(distance: FloatArray, derivatives: list[FloatArray]) -> None:
    """Derivatives of a distance of 0, which has no direction, are 0."""
    for by in derivatives:
        by[distance == 0] = 0.0


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else 0.0
