"""The scale of an instrument: all lengths that it reads are 1 + s times what they are.

A tracker reads too long or too short by parts per million, by the air's temperature or its own
calibration. What it reads of a point is then moved by s times the place of that point; of a
distance by s times the distance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.effects.effect import Moved
from pkmcal.geometry.stated_uncertainty import SCALE
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading
from pkmcal.readings.unknowns import Dependence, Numbers

_TYPICAL = 1e-3  # of a length: what moves a reading as much as 1 mm does at a distance of 1 m


@dataclass(frozen=True)
class InstrumentScale:
    """The scale error of an instrument for lengths, found with the geometry as ``scale``."""

    name: ClassVar[str] = SCALE

    def dependences(self, measured: Measurements) -> Iterator[Dependence]:
        """Return the scale, one number common to all rows."""
        count = len(measured)
        number = Numbers(
            (SCALE,), ("1",), np.zeros(1, dtype=np.intp), np.zeros(1), np.array([_TYPICAL])
        )
        given, every = np.zeros((count, 1)), np.zeros(count, dtype=np.intp)
        yield Dependence(SCALE, SCALE, given, {"": number}, every)

    def of_rows(self, measured: Measurements) -> ScaledRows:
        """The effect in rows of one kind.

        Rows that all read the same were touched, whether they say so or not: the machine was driven
        until the instrument read it, and its scale moves none of them.
        """
        touched = measured.instrument.by_contact or not np.ptp(measured.values, axis=0).any()
        reads = "mm" in measured.units and not touched
        return ScaledRows(reads, measured.instrument)


@dataclass(frozen=True)
class ScaledRows:
    """Readings of one set as functions of the scale.

    Attributes
    ----------
    reads : bool
        Whether they are lengths that an instrument reads.
    reading : Reading
        Their kind.
    """

    reads: bool
    reading: Reading

    def moved(
        self,
        machine: Any,
        pose: FloatArray,
        actuators: FloatArray,
        rows: IntArray,
        numbers: Mapping[str, FloatArray],
    ) -> Moved:
        """Compute the motion of the platform at poses (N, 6) that would give the same readings."""
        scale = numbers[SCALE][rows, 0]
        between = self.reading.reach(pose, {name: each[rows] for name, each in numbers.items()})
        place = pose[:, :3] if between is None else between
        by = np.concatenate([np.zeros_like(place), place * self.reads], axis=1)
        moved = Moved(by * scale[:, None], {SCALE: by[:, :, None]})
        if between is not None or not self.reads:
            return moved
        return moved._replace(growth=scale, growth_by={SCALE: np.ones((len(rows), 1))})
