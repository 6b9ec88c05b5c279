"""Nothing but the actuators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.readings.reading import At, Predicted, Reading


@dataclass(frozen=True)
class Closure(Reading):
    """Nothing is read: the actuators alone, on machines with more of them than needed."""

    name: str = "closure"

    def predict(self, at: At, **_: FloatArray) -> Predicted:
        return Predicted(np.empty((len(at.pose), 0)), np.empty((len(at.pose), 0, 6)))
