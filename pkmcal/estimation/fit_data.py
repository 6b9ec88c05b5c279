"""Dependences of readings beside the pose: points, zeros, artefacts; fixed or estimated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from pkmcal.arrays import BoolArray, IntArray
from pkmcal.effects.effect import Effect
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.unknowns import PLACE, Dependence, Numbers, Start, points_of, yielded

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
        """Return the data of some of the rows."""
        return replace(self, measured=self.measured.select(chosen), rows=self.rows[chosen])

    @property
    def framed(self) -> bool:
        """True if these readings depend on the unknown frame."""
        instrument = self.measured.instrument
        return bool(instrument.framed and (self.unknown_frame or not instrument.placed))

    @property
    def frame(self) -> tuple[str, str] | None:
        """Role and name of the unknown frame that these readings are in; None: of none."""
        return (FRAME, self.measured.instrument.frame_name) if self.framed else None

    @property
    def axis(self) -> IntArray | None:
        """The artefact's own axis in each row, (N,), of touched lines and planes."""
        touched = getattr(self.measured.instrument, "touched", None)
        if touched is None:
            return None
        return np.array([self.starts["touch", name].axis for name in touched.tolist()])

    def dependences(self) -> Iterator[Dependence]:
        """Return the dependences of the readings beside pose and frame.

        Raises
        ------
        ValueError
            A dependence that does not have one entry for each row.
        """
        instrument = self.measured.instrument
        own = yielded(instrument, instrument.dependences(self))
        of_effects = (yielded(each, each.dependences(self.measured)) for each in self.effects)
        for each in (*own, *chain.from_iterable(of_effects)):
            if not len(each.index) == len(each.given) == len(self.measured):
                raise ArgumentError(
                    f"{each.argument}: the dependence on it has {len(each.index)} names and"
                    f" {len(each.given)} given numbers; it needs one of each for each of"
                    f" {len(self.measured)} rows"
                )
            yield each
