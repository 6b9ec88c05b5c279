"""Closures: nothing is read but the actuators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.csv_table import Table
from pkmcal.readings.measured import Measured
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading


@dataclass(frozen=True, eq=False)
class Closure(Reading):
    """Nothing is read: the actuators alone, on machines with more of them than needed."""

    name = "closure"

    def predict(self, at: At, **numbers: FloatArray) -> Predicted:
        """Predict nothing, (N, 0): nothing is read beside the actuators."""
        return Predicted(np.empty((len(at.pose), 0)), np.empty((len(at.pose), 0, 6)))

    def found_in(self, table: Table) -> list[str]:
        """Nothing, for it has no columns: a table without another reading holds closures."""
        return []

    def title(self, m: Measured) -> str:
        """Return a title: how many rows there are."""
        return f"{len(m)} row{'' if len(m) == 1 else 's'} of actuators alone"
