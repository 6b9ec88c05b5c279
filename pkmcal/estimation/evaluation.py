"""The equations of a calibration at one parameter vector: poses, predictions, residuals."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TypedDict

from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_search import System
from pkmcal.estimation.row_states import RowStates
from pkmcal.estimation.session_machines import Machines
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.predicted import Predicted
from pkmcal.result import ReadOnly


class Cache(TypedDict, total=False):
    """A cache of results at an evaluation, each made by its function.

    "system" is of some noise (G,), too; "following" (K, u, n) is how unknowns of the poses follow
    the parameters; "derivatives" are those of rows of sets, once.
    """

    predicted: tuple[object, tuple[Predicted, ...]]
    system: tuple[object, FloatArray, System]
    following: tuple[object, FloatArray]
    derivatives: tuple[object, list[tuple[int, slice, FloatArray]]]


@dataclass(frozen=True, eq=False)
class Evaluation(ReadOnly):
    """The equations evaluated at one parameter vector.

    Attributes
    ----------
    theta : ndarray (n,)
        The parameters, mm and rad.
    parameters : Parameters
        What they mean: `Equations.start` counts those of frames and tools from where these lie.
    machines : Machines
        With their geometry.
    states : RowStates
        Where the machine is at each distinct row of actuators; NaN where it cannot be.
    residuals : tuple of ndarray (N, k)
        Measured less predicted of each set, mm and rad.
    begun : RowStates
        Where the search for the poses began.
    cache : Cache
        It dies with the evaluation and is not pickled.
    """

    theta: FloatArray
    parameters: Parameters
    machines: Machines
    states: RowStates
    residuals: tuple[FloatArray, ...]
    begun: RowStates
    cache: Cache = field(default_factory=Cache, repr=False)

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "cache": Cache()}

    @property
    def pose(self) -> FloatArray:
        """Poses of the machine (K, 6)."""
        return self.states.pose

    @property
    def actuators(self) -> FloatArray:
        """Coordinates of the actuators (K, n): their readings, unless their noise is stated."""
        return self.states.actuators

    @property
    def status(self) -> Int32Array:
        """Status of the forward kinematics (K,)."""
        return self.states.status

    @property
    def onward(self) -> RowStates:
        """Start of a search for the poses from here; of failed rows, the start of this search."""
        return self.states if self.ok else self.states.chosen(self.status == 0, self.begun)

    @cached_property
    def ok(self) -> bool:
        """True if the forward kinematics solved every row."""
        return not self.status.any()

    @property
    def robot(self) -> Calibratable:
        """The machine, as it is in the last session where numbers differ by session."""
        return self.machines.robots[-1]
