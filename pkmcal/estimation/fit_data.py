"""What readings depend on beside the pose: points, zeros, artefacts; given, or found along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pkmcal.arrays import BoolArray, IntArray
from pkmcal.effects.expansion import MachineExpansion
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.unknowns import PLACE, Dependence, Numbers, Start, points_of

__all__ = ["PLACE", "Dependence", "FitData", "Numbers", "Start", "points_of"]


@dataclass(frozen=True, eq=False)
class FitData:
    """Rows of one set of measurements, to be fitted or held out.

    Attributes
    ----------
    measured : Measurements
        These rows alone.
    rows : ndarray of int (N,)
        Their numbers in what the user gave, counted through all sets.
    unknown_frame, unknown_target, unknown_attachment : bool
        Which of them `identify` was asked to find along.
    set_name : str
        Of the set, where it has a frame or points of its own.
    starts : mapping of (str, str) to Start
        Of all that is always found along, by role and name.
    expansion : MachineExpansion or None
        How the machine grows with its temperature.
    """

    measured: Measurements
    rows: IntArray
    unknown_frame: bool
    unknown_target: bool
    unknown_attachment: bool = False
    set_name: str = ""
    starts: Mapping[tuple[str, str], Start] = field(default_factory=dict)
    expansion: MachineExpansion | None = None
    others: tuple[Any, ...] = ()

    def select(self, chosen: IntArray | BoolArray) -> FitData:
        """Some of the rows."""
        return replace(self, measured=self.measured.select(chosen), rows=self.rows[chosen])

    @property
    def framed(self) -> bool:
        """Whether these readings depend on the unknown frame."""
        return self.unknown_frame and self.measured.instrument.framed

    @property
    def along(self) -> IntArray | None:
        """Of touched lines and planes, which axis of its own each row's has, (N,)."""
        touched = self.measured.touched
        if touched is None:
            return None
        return np.array([self.starts["touch", name].along for name in touched.tolist()])

    def dependences(self) -> Iterator[Dependence]:
        """What the readings depend on beside the pose and the frame."""
        yield from self.measured.instrument.dependences(self)
        for effect in self.effects:
            yield from effect.dependences(self.measured)

    @property
    def effects(self) -> tuple[Any, ...]:
        """All that moves the machine off its geometry's pose."""
        return (() if self.expansion is None else (self.expansion,)) + self.others
