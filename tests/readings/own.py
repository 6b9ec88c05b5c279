"""Two readings that are no part of the package, as a user would write them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal.readings import At, Dependence, Position, Predicted, Reading, Start, always, point

ORIGIN = np.zeros(3)
ZERO = np.zeros(1)
POSITION = Position()


@dataclass(frozen=True, eq=False)
class Loop(Reading):
    """Length of a string from one fixed point over the target to another, less a named zero."""

    loop: Sequence[str] | None = None

    name = "loop"
    components = (("length", "mm"),)
    point = "platform"
    labels = ("loop",)
    starts_by_pose = True
    ends = np.array([[-700.0, 100.0, 0.0], [800.0, -300.0, 50.0]])

    def predict(self, at: At, target: Any = ORIGIN, zero: Any = ZERO, **numbers: Any) -> Predicted:
        """By the position of the target, as `Position` predicts it."""
        seen = POSITION.predict(at, target=target)
        away = seen.values[:, None, :] - self.ends
        lengths = np.linalg.norm(away, axis=2)
        pull = (away / lengths[:, :, None]).sum(axis=1)[:, None, :]
        by = {"target": pull @ seen.by["target"], "zero": np.full((len(pull), 1, 1), -1.0)}
        zeros = np.broadcast_to(zero, (len(pull), 1))
        return Predicted(lengths.sum(axis=1)[:, None] - zeros, pull @ seen.by_twist, by)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        """The target, and the zero of each loop."""
        yield point(data.measured, "target", "target", data.unknown_target)
        names = list(data.measured.instrument.loop)
        yield always("zero", "loop", (("zero", "mm"),), names, data.starts)

    def starts(self, machine: Any, sets: Any, found: Any) -> None:
        """Zeros by the nominal machine."""
        for data, pose in sets:
            m = data.measured
            off = self.predict(At(pose), target=m.targets).values[:, 0] - m.values
            for name in np.unique(m.instrument.loop).tolist():
                mine = off[m.instrument.loop == name]
                found["loop", name] = Start((0,), np.array([np.nanmean(mine)]))

    def arguments(self, m: Any) -> dict[str, Any]:
        """The target as stated; zeros are 0."""
        return {"target": m.targets}


@dataclass(frozen=True, eq=False)
class Spot(Reading):
    """Where a beam along z from the target meets a screen, in pixels of unknown origin."""

    pitch: float = 0.05  # mm a pixel

    name = "spot"
    components = (("u", "px"), ("v", "px"))
    point = "platform"
    nouns = ("spot", "spots")

    def predict(
        self, at: At, target: Any = ORIGIN, centre: Any = (0.0, 0.0), **numbers: Any
    ) -> Predicted:
        """x and y of the target in pixels."""
        seen = POSITION.predict(at, target=target)
        across = np.array([[1.0, 0, 0], [0, 1.0, 0]]) / self.pitch
        values = seen.values @ across.T - centre
        by = {
            "target": across @ seen.by["target"],
            "centre": np.tile(-np.eye(2), (len(values), 1, 1)),
        }
        return Predicted(values, across @ seen.by_twist, by)

    def dependences(self, data: Any) -> Iterator[Dependence]:
        """The target, and the screen's centre."""
        yield point(data.measured, "target", "target", data.unknown_target)
        numbers = (("u", "px"), ("v", "px"))
        scale = [1.0 / self.pitch] * 2
        names = [""] * len(data.measured)
        yield always("centre", "screen", numbers, names, data.starts, scale)

    def starts(self, machine: Any, sets: Any, found: Any) -> None:
        """The search begins at 0."""
        found["screen", ""] = Start((0, 1), np.zeros(2))

    def arguments(self, m: Any) -> dict[str, Any]:
        """The target as stated."""
        return {"target": m.targets}

    def mm(self, m: Any, length: float) -> np.ndarray:
        """Of a pixel."""
        return np.full(2, self.pitch)
