"""What readings depend on beside the pose: points, zeros, artefacts; given, or estimated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import BoolArray, IntArray
from pkmcal.effects.effect import Effect
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.unknowns import PLACE, Dependence, Numbers, Start, points_of

FRAME = "frame"  # the role of frames

__all__ = ["FRAME", "PLACE", "Dependence", "FitData", "Numbers", "Start", "points_of"]


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
        Which of them `identify` was asked to estimate.
    set_name : str
        Of the set, where it has a frame or points of its own.
    starts : mapping of (str, str) to Start
        Where the search begins for all that is never known before, by role and name.
    effects : tuple of Effect
        What moves the machine off the pose that geometry alone gives.
    """

    measured: Measurements
    rows: IntArray
    unknown_frame: bool
    unknown_target: bool
    unknown_attachment: bool = False
    set_name: str = ""
    starts: Mapping[tuple[str, str], Start] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def select(self, chosen: IntArray | BoolArray) -> FitData:
        """Some of the rows."""
        return replace(self, measured=self.measured.select(chosen), rows=self.rows[chosen])

    @property
    def framed(self) -> bool:
        """Whether these readings depend on the unknown frame."""
        instrument = self.measured.instrument
        return bool(instrument.framed and (self.unknown_frame or not instrument.placed))

    @property
    def frame(self) -> tuple[str, str] | None:
        """Role and name of the unknown frame that these readings are in; None: of none."""
        return (FRAME, self.measured.instrument.frame_name) if self.framed else None

    @property
    def axis(self) -> IntArray | None:
        """Of touched lines and planes, which axis of its own each row's has, (N,)."""
        touched = self.measured.touched
        if touched is None:
            return None
        return np.array([self.starts["touch", name].axis for name in touched.tolist()])

    def dependences(self) -> Iterator[Dependence]:
        """What the readings depend on beside the pose and the frame."""
        yield from self.measured.instrument.dependences(self)
        for effect in self.effects:
            yield from effect.dependences(self.measured)
