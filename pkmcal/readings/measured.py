"""The interface that readings ask of their rows: `Measurements`, sets of a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from pkmcal.arrays import FloatArray, Int64Array, TextArray
from pkmcal.kinematics.drive_state import DriveState


class Measured(Protocol):
    """Rows of measurements; `Measurements` describes each attribute."""

    def __len__(self) -> int:
        """Number of rows."""

    @property
    def actuators(self) -> FloatArray:
        """Actuator coordinates (N, n)."""

    @property
    def values(self) -> FloatArray:
        """Readings, (N, k) or (N,)."""

    @property
    def instrument(self) -> Any:
        """The reading."""

    @property
    def target(self) -> FloatArray | None:
        """Targets as given."""

    @property
    def targets(self) -> FloatArray:
        """The target of every row (N, 3)."""

    @property
    def target_index(self) -> Int64Array | None:
        """Target of each row, of several."""

    @property
    def target_names(self) -> tuple[str, ...] | None:
        """Names of the targets."""

    @property
    def group(self) -> Int64Array | None:
        """Group of rows that repeat one pose, or one picture."""

    @property
    def pose_name(self) -> TextArray | None:
        """The name of the pose of each row, or of its picture."""

    @property
    def drive_state(self) -> DriveState:
        """Return actuators' approaches, and tensions of what they drive."""

    def of_points(self, place: FloatArray | None) -> FloatArray:
        """A point of every row (N, 3), of one, one a row or one for each target."""


class InFit(Protocol):
    """Rows of a calibration; `FitData` describes each attribute."""

    @property
    def measured(self) -> Any:
        """The rows."""

    @property
    def unknown_frame(self) -> bool:
        """True if the instrument's frame is estimated."""

    @property
    def unknown_target(self) -> bool:
        """True if targets are estimated."""

    @property
    def unknown_attachment(self) -> bool:
        """True if attachments are estimated."""

    @property
    def starts(self) -> Mapping[tuple[str, str], Any]:
        """Start of the search for unknowns without a present value."""
