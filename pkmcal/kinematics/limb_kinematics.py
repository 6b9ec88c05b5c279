"""The interface of the kinematics of limbs, which the module of each kind of them answers."""

from __future__ import annotations

from typing import Protocol

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.kinematics import Kinematics
from pkmcal.kinematics.limits import Feasibility


class LimbKinematics(Protocol):
    """The limbs of a machine at its own poses (N, 6)."""

    def limits(self, robot: Kinematics, own: FloatArray, q: FloatArray | None) -> Feasibility:
        """Compare limbs with their limits, by actuators (N, n) or by those that the poses ask."""

    def transmission(
        self, robot: Kinematics, own: FloatArray, q: FloatArray, by_q: FloatArray
    ) -> FloatArray:
        """Return the least share of an actuator's motion that reaches closures `by_q`, (N,)."""

    def lines(self, robot: Kinematics, own: FloatArray, q: FloatArray) -> list[FloatArray]:
        """Return the joints of each limb from the base to the platform, each (N, joints, 3)."""
