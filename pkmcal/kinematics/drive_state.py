"""State of drives beside their readings: how the actuators came there, and their load."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.geometry.carried import Load

M = TypeVar("M")


class DriveState(NamedTuple):
    """The state of each actuator, and of the platform, at N rows; None where it is unknown.

    Attributes
    ----------
    approach : ndarray (N, n) or None
        +1 where its reading had grown, -1 where it had fallen, 0 where that is not known.
    tension : ndarray (N, n) or None
        Of what it drives, N.
    load : ndarray (N, 10) or None
        What the platform carries, as `pkmcal.geometry.carried.Load.rows` has it. A machine of which
        nothing yields does not follow it.
    """

    approach: FloatArray | None = None
    tension: FloatArray | None = None
    load: FloatArray | None = None

    def at(self, rows: IntArray | np.intp) -> DriveState:
        """Return the state of some rows, or of one."""
        return DriveState(*(None if each is None else each[rows] for each in self))

    def of(self, machine: M) -> M:
        """The machine in this state; one without drives, as a user may make, follows none."""
        found: Any = machine
        if self.approach is not None:
            found = found.approaching(self.approach)
        if self.tension is not None:
            found = found.tensioned(self.tension)
        if self.load is not None and found.yields:
            found = found.under(Load.of_rows(self.load))
        return cast(M, found)
