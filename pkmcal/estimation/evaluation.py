"""The equations of a calibration at one parameter vector: poses, predictions, residuals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines
from pkmcal.kinematics.calibratable import Calibratable


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations evaluated at one parameter vector.

    Attributes
    ----------
    theta : ndarray (n,)
        The parameters, mm and rad.
    machines : Machines
        With their geometry.
    pose : ndarray (K, 6)
        Where the machine is at each distinct row of actuators; NaN where it cannot be.
    actuators : ndarray (K, n)
        Where the actuators are there; what they read unless their noise is stated.
    status : ndarray of int (K,)
        Of the forward kinematics.
    predicted : tuple of ndarray (N, k)
        What the instruments show there, of each set of measurements.
    residuals : tuple of ndarray (N, k)
        Measured less predicted of each set, mm and rad.
    tension : ndarray (K, n) or None
        Of what the actuators drive, N, where it is unknown and has been found.
    begun : RowStates
        Where the search for the poses began.
    kept : dict
        What was computed here and may be asked for again; it goes when this goes.
    """

    theta: FloatArray
    machines: Machines
    pose: FloatArray
    actuators: FloatArray
    status: Int32Array
    predicted: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    tension: FloatArray | None = None
    begun: RowStates | None = None
    kept: dict[str, Any] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "kept": {}}

    @property
    def onward(self) -> RowStates:
        """Where a search for the poses begins from here; of a row without one, where this did."""
        assert self.begun is not None
        return self.states.chosen(self.status == 0, self.begun)

    @property
    def ok(self) -> bool:
        """Whether the forward kinematics solved every row."""
        return not self.status.any()

    @property
    def robot(self) -> Calibratable:
        """The machine; that of the last session where some of its numbers are of sessions."""
        return self.machines.robots[-1]

    @property
    def states(self) -> RowStates:
        """Where the machine is at each distinct row of actuators."""
        return RowStates(self.pose, self.actuators, self.status, self.tension)
